"""Dense symmetric positive definite systems, compiled: small ones without a call of LAPACK.

A field of a few gaps has some tens of unknowns; there the overhead of library calls and their
copies is what costs. Larger systems are handed to LAPACK and BLAS in blocks.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from solver.compiled import compiled, compiled_sums
from solver.profile import Array

_SMALL = 32  # up to this order the loops here are faster than LAPACK called from compiled code
_BLOCK = 48


@compiled_sums
def factor_rows(a: Array, floor: float) -> bool:
    """Lower Cholesky factor in place, by rows.

    False if a pivot is not positive, or below ``floor`` times the largest diagonal element.
    """
    n = a.shape[0]
    least = 0.0
    for i in range(n):
        least = max(least, floor * a[i, i])
    for i in range(n):
        row = a[i]
        for j in range(i):
            other = a[j]
            total = row[j]
            for k in range(j):
                total -= row[k] * other[k]
            row[j] = total / other[j]
        pivot = row[i]
        for k in range(i):
            pivot -= row[k] * row[k]
        if not pivot > least:
            return False
        row[i] = np.sqrt(pivot)
    return True


@compiled
def cholesky(a: Array) -> tuple[Array, bool]:
    """Lower Cholesky factor of ``a`` and whether there is one.

    Raises
    ------
    LinAlgError
        If there is none and the system is a large one.
    """
    if a.shape[0] > _SMALL:
        lapack: Any = np.linalg.cholesky(a)  # numpy promises some float
        return lapack, True
    factor = a.copy()
    definite = factor_rows(factor, 0.0)
    return factor, definite


@compiled
def is_definite(a: Array) -> bool:
    """Whether a symmetric matrix is positive definite to rounding."""
    return factor_rows(a.copy(), 0.0)


@compiled
def solve_factored(factor: Array, x: Array) -> None:
    """Solve for the columns of ``x``, shape (n, columns), in place, with a Cholesky factor."""
    n = factor.shape[0]
    if x.shape[1] < 4:
        for c in range(x.shape[1]):
            column = x[:, c].copy()
            solve_column(factor, column)
            x[:, c] = column
        return
    if n <= _SMALL:
        _forward(factor, x)
        _backward(factor, x)
        return
    for start in range(0, n, _BLOCK):
        stop = min(start + _BLOCK, n)
        if start > 0:
            x[start:stop] -= np.ascontiguousarray(factor[start:stop, :start]) @ x[:start]
        _forward(factor[start:stop, start:stop], x[start:stop])
    for start in range((n - 1) // _BLOCK * _BLOCK, -1, -_BLOCK):
        stop = min(start + _BLOCK, n)
        if stop < n:
            x[start:stop] -= np.ascontiguousarray(factor[stop:, start:stop].T) @ x[stop:]
        _backward(factor[start:stop, start:stop], x[start:stop])


@compiled_sums
def solve_column(factor: Array, x: Array) -> None:
    """Solve for one right-hand side, in place, with a Cholesky factor."""
    n = factor.shape[0]
    for i in range(n):
        row = factor[i]
        total = x[i]
        for k in range(i):
            total -= row[k] * x[k]
        x[i] = total / row[i]
    for i in range(n - 1, -1, -1):
        row = factor[i]
        value = x[i] / row[i]
        x[i] = value
        for k in range(i):
            x[k] -= value * row[k]


@compiled
def _forward(factor: Array, x: Array) -> None:
    n, columns = x.shape
    for i in range(n):
        for k in range(i):
            value = factor[i, k]
            for c in range(columns):
                x[i, c] -= value * x[k, c]
        pivot = 1 / factor[i, i]
        for c in range(columns):
            x[i, c] *= pivot


@compiled
def _backward(factor: Array, x: Array) -> None:
    n, columns = x.shape
    for i in range(n - 1, -1, -1):
        pivot = 1 / factor[i, i]
        for c in range(columns):
            x[i, c] *= pivot
        for k in range(i):
            value = factor[i, k]
            for c in range(columns):
                x[k, c] -= value * x[i, c]
