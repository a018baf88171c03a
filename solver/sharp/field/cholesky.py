"""Factor and solve dense symmetric positive definite systems, compiled, without LAPACK.

A field of a few gaps has some tens of unknowns, seldom hundreds; there the overhead of library
calls and their copies dominates. Factors are A = LᵀL with L lower, by rows and from the last
one on: every loop then starts at the beginning of a row, and eight rows are subtracted at once, so
that sums stay in vector registers.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums

BLOCK = 8  # rows that are subtracted at once; numbers of columns that it divides are fastest


@compiled_sums
def factor_rows(a: Array, floor: float) -> bool:
    """Factor a = LᵀL in place of the lower triangle, from the last row on.

    There may be more columns than rows; those further to the right, and the upper triangle, are
    not read, and not kept. False if a pivot is not positive, or below ``floor`` times the largest
    diagonal element.
    """
    n, columns = a.shape
    least = 0.0
    for i in range(n):
        least = max(least, floor * a[i, i])
    last = n
    while last > 0:
        r = max(last - BLOCK, 0)
        for k in range(last - 1, r - 1, -1):
            for i in range(k + 1, last):
                c = a[i, k]
                for j in range(k + 1):
                    a[k, j] -= c * a[i, j]
            pivot = a[k, k]
            if not pivot > least:
                return False
            scale = 1 / np.sqrt(pivot)
            for j in range(k + 1):
                a[k, j] *= scale
        for i in range(r):
            c0, c1, c2, c3 = a[r, i], a[r + 1, i], a[r + 2, i], a[r + 3, i]
            c4, c5, c6, c7 = a[r + 4, i], a[r + 5, i], a[r + 6, i], a[r + 7, i]
            for j in range(min(i - i % BLOCK + BLOCK, columns)):
                a[i, j] -= (
                    c0 * a[r, j]
                    + c1 * a[r + 1, j]
                    + c2 * a[r + 2, j]
                    + c3 * a[r + 3, j]
                    + c4 * a[r + 4, j]
                    + c5 * a[r + 5, j]
                    + c6 * a[r + 6, j]
                    + c7 * a[r + 7, j]
                )
        last = r
    return True


@compiled
def padded(count: int) -> int:
    """Round up to a multiple of ``BLOCK``."""
    return (count + BLOCK - 1) // BLOCK * BLOCK


@compiled
def cholesky(a: Array) -> tuple[Array, bool]:
    """Factor a = LᵀL into columns of a :func:`padded` array; returns whether that is possible."""
    n = a.shape[0]
    factor = np.zeros((n, padded(n)))
    factor[:, :n] = a
    definite = factor_rows(factor, 0.0)
    return factor, definite


@compiled
def is_definite(a: Array) -> bool:
    """Return whether a symmetric matrix is positive definite to rounding."""
    _, definite = cholesky(a)
    return definite


@compiled
def solve_factored(factor: Array, x: Array) -> None:
    """Solve for the columns of ``x``, shape (n, columns), in place, with a factor."""
    if x.shape[1] == 3:
        _solve_three(factor, x)
    elif x.shape[1] < 3:
        for c in range(x.shape[1]):
            column = x[:, c].copy()
            solve_column(factor, column)
            x[:, c] = column
    else:
        _solve_backward(factor, x)
        _solve_forward(factor, x)


@compiled_sums
def solve_column(factor: Array, x: Array) -> None:
    """Solve for one right-hand side, in place, with a factor."""
    n = factor.shape[0]
    for i in range(n - 1, -1, -1):
        value = x[i] / factor[i, i]
        x[i] = value
        for k in range(i):
            x[k] -= value * factor[i, k]
    for i in range(n):
        total = x[i]
        for k in range(i):
            total -= factor[i, k] * x[k]
        x[i] = total / factor[i, i]


@compiled_sums
def _solve_three(factor: Array, x: Array) -> None:
    """Solve as :func:`solve_column` for three columns together."""
    n = factor.shape[0]
    a, b, c = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        a[i], b[i], c[i] = x[i, 0], x[i, 1], x[i, 2]
    for i in range(n - 1, -1, -1):
        scale = 1 / factor[i, i]
        u, v, w = a[i] * scale, b[i] * scale, c[i] * scale
        a[i], b[i], c[i] = u, v, w
        for k in range(i):
            value = factor[i, k]
            a[k] -= u * value
            b[k] -= v * value
            c[k] -= w * value
    for i in range(n):
        u, v, w = a[i], b[i], c[i]
        for k in range(i):
            value = factor[i, k]
            u -= value * a[k]
            v -= value * b[k]
            w -= value * c[k]
        scale = 1 / factor[i, i]
        a[i], b[i], c[i] = u * scale, v * scale, w * scale
    for i in range(n):
        x[i, 0], x[i, 1], x[i, 2] = a[i], b[i], c[i]


@compiled_sums
def _solve_backward(f: Array, x: Array) -> None:
    """Solve Lᵀ y = x, in place."""
    n, columns = x.shape
    last = n
    while last > 0:
        r = max(last - BLOCK, 0)
        for k in range(last - 1, r - 1, -1):
            for i in range(k + 1, last):
                c = f[i, k]
                for j in range(columns):
                    x[k, j] -= c * x[i, j]
            scale = 1 / f[k, k]
            for j in range(columns):
                x[k, j] *= scale
        for i in range(r):
            c0, c1, c2, c3 = f[r, i], f[r + 1, i], f[r + 2, i], f[r + 3, i]
            c4, c5, c6, c7 = f[r + 4, i], f[r + 5, i], f[r + 6, i], f[r + 7, i]
            for j in range(columns):
                x[i, j] -= (
                    c0 * x[r, j]
                    + c1 * x[r + 1, j]
                    + c2 * x[r + 2, j]
                    + c3 * x[r + 3, j]
                    + c4 * x[r + 4, j]
                    + c5 * x[r + 5, j]
                    + c6 * x[r + 6, j]
                    + c7 * x[r + 7, j]
                )
        last = r


@compiled_sums
def _solve_forward(f: Array, x: Array) -> None:
    """Solve L y = x, in place."""
    n, columns = x.shape
    for r in range(0, n, BLOCK):
        stop = min(r + BLOCK, n)
        for k in range(r, stop):
            for i in range(r, k):
                c = f[k, i]
                for j in range(columns):
                    x[k, j] -= c * x[i, j]
            scale = 1 / f[k, k]
            for j in range(columns):
                x[k, j] *= scale
        for i in range(stop, n):
            c0, c1, c2, c3 = f[i, r], f[i, r + 1], f[i, r + 2], f[i, r + 3]
            c4, c5, c6, c7 = f[i, r + 4], f[i, r + 5], f[i, r + 6], f[i, r + 7]
            for j in range(columns):
                x[i, j] -= (
                    c0 * x[r, j]
                    + c1 * x[r + 1, j]
                    + c2 * x[r + 2, j]
                    + c3 * x[r + 3, j]
                    + c4 * x[r + 4, j]
                    + c5 * x[r + 5, j]
                    + c6 * x[r + 6, j]
                    + c7 * x[r + 7, j]
                )
