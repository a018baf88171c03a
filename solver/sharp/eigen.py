"""Eigenvalues and vectors of a small symmetric matrix, compiled.

The Hessian of a descent has some tens of rows; there the library's method, divide and conquer,
takes twice as long as this one: reflections to a tridiagonal matrix and implicit QL steps on that
(Wilkinson and Reinsch, *Linear Algebra*, 1971, contributions II/2 and II/4), with all loops along
rows.
"""

from __future__ import annotations

import numpy as np

from solver.compiled import compiled, compiled_sums
from solver.profile import Array

_MOST = 60  # QL steps for one eigenvalue; two are usual


@compiled_sums
def _tridiagonal(a: Array, diagonal: Array, beside: Array, z: Array) -> None:
    """Turn ``a`` = z t zᵀ into the tridiagonal t: ``diagonal``, and ``beside`` it from place 1 on.

    ``a`` is used up.
    """
    n = a.shape[0]
    u = np.zeros((n, n))  # of the reflections 1 - u uᵀ/h
    h = np.zeros(n)
    q = np.empty(n)
    for i in range(n - 1, 0, -1):
        beyond = 0.0
        for k in range(i - 1):
            beyond += a[i, k] * a[i, k]
        first = a[i, i - 1]
        beside[i] = first
        if beyond == 0:
            continue
        norm = np.sqrt(beyond + first * first)
        g = -norm if first > 0 else norm
        beside[i] = g
        h[i] = beyond + first * first - first * g
        for k in range(i):
            u[i, k] = a[i, k]
        u[i, i - 1] = first - g
        share = 0.0
        for j in range(i):
            total = 0.0
            for k in range(i):
                total += a[j, k] * u[i, k]
            q[j] = total / h[i]
            share += u[i, j] * q[j]
        share /= 2 * h[i]
        for j in range(i):
            q[j] -= share * u[i, j]
        for j in range(i):
            left = u[i, j]
            right = q[j]
            for k in range(i):
                a[j, k] -= left * q[k] + right * u[i, k]
    for i in range(n):
        diagonal[i] = a[i, i]
        if h[i] > 0:
            for j in range(i):
                q[j] = 0.0
            for k in range(i):
                left = u[i, k]
                for j in range(i):
                    q[j] += left * z[k, j]
            for k in range(i):
                left = u[i, k] / h[i]
                for j in range(i):
                    z[k, j] -= left * q[j]


@compiled_sums
def _turn(vectors: Array, i: int, c: float, s: float) -> None:
    """Rotate rows i and i + 1."""
    for k in range(vectors.shape[1]):
        low = vectors[i, k]
        high = vectors[i + 1, k]
        vectors[i + 1, k] = s * low + c * high
        vectors[i, k] = c * low - s * high


@compiled
def _diagonal(d: Array, e: Array, vectors: Array) -> bool:
    """QL steps on the tridiagonal matrix of ``d`` and ``e`` (e_i beside d_i and d_{i+1}).

    The ``vectors`` are rows; ``d`` becomes the eigenvalues. False if the steps do not end.
    """
    n = d.shape[0]
    for low in range(n):
        for step in range(_MOST + 1):
            m = low
            while m < n - 1:
                size = abs(d[m]) + abs(d[m + 1])
                if abs(e[m]) + size == size:
                    break
                m += 1
            if m == low:
                break
            if step == _MOST:
                return False
            g = (d[low + 1] - d[low]) / (2 * e[low])
            r = np.sqrt(g * g + 1)
            g = d[m] - d[low] + e[low] / (g + (r if g >= 0 else -r))
            s = c = 1.0
            p = 0.0
            i = m - 1
            while i >= low:
                f = s * e[i]
                b = c * e[i]
                r = np.sqrt(f * f + g * g)
                e[i + 1] = r
                if r == 0:
                    d[i + 1] -= p
                    e[m] = 0.0
                    break
                s = f / r
                c = g / r
                g = d[i + 1] - p
                r = (d[i] - g) * s + 2 * c * b
                p = s * r
                d[i + 1] = g + p
                g = c * r - b
                _turn(vectors, i, c, s)
                i -= 1
            if i < low:
                d[low] -= p
                e[low] = g
                e[m] = 0.0
    return True


@compiled
def symmetric_modes(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues, rising, and vectors (columns) of a symmetric matrix.

    Not numbers where the matrix has entries that are none.
    """
    n = matrix.shape[0]
    d = np.empty(n)
    beside = np.zeros(n)
    z = np.eye(n)
    _tridiagonal(matrix.copy(), d, beside, z)
    e = np.zeros(n)
    e[: n - 1] = beside[1:]
    rows = z.T.copy()
    if not _diagonal(d, e, rows):
        d[:] = np.nan
    order = np.argsort(d)
    vectors = np.empty((n, n))
    values = np.empty(n)
    for i in range(n):
        values[i] = d[order[i]]
        for k in range(n):
            vectors[k, i] = rows[order[i], k]
    return values, vectors
