"""Compiled inner loops of the method ``grid``.

Threaded linear algebra sums in an order that depends on the number of threads; these sums depend on
the input alone.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from solver.profile import Array

# Sums may be reordered at compile time (vector registers), never at run time.
_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": {"reassoc", "nnan", "nsz", "contract"}}
_VECTOR = numba.types.Array(numba.float64, 1, "C")
_MATRIX = numba.types.Array(numba.float64, 2, "C")


@numba.njit(numba.float64(_VECTOR, _VECTOR), **_OPTIONS)
def dot(a: Array, b: Array) -> float:
    """Sum of a_i b_i."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@numba.njit(numba.void(_VECTOR, _VECTOR, _VECTOR, numba.float64), **_OPTIONS)
def turn(direction: Array, inside: Array, correction: Array, factor: float) -> None:
    """Next search direction: the correction on Ω plus ``factor`` times the last direction."""
    for i in range(direction.size):
        direction[i] = inside[i] * correction[i] + factor * direction[i]


@numba.njit(
    numba.float64(_VECTOR, _VECTOR, _VECTOR, _VECTOR, _VECTOR, _VECTOR, numba.float64), **_OPTIONS
)
def advance(
    stress: Array,
    displacement: Array,
    residual: Array,
    direction: Array,
    response: Array,
    inside: Array,
    step: float,
) -> float:
    """Go ``step`` along the direction; return the largest absolute residual on Ω."""
    largest = 0.0
    for i in range(stress.size):
        stress[i] += step * direction[i]
        displacement[i] += step * response[i]
        residual[i] -= step * response[i] * inside[i]
        largest = max(largest, abs(residual[i]))
    return largest


@numba.njit(numba.float64(_MATRIX, _VECTOR), nogil=True)
def inverse_form(matrix: Array, vector: Array) -> float:
    """bᵀ A⁻¹ b of a symmetric positive definite A by Cholesky; A's lower half is destroyed."""
    n = vector.size
    total = 0.0
    y = np.empty(n)
    for i in range(n):
        for j in range(i):
            entry = matrix[i, j]
            for k in range(j):
                entry -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = entry / matrix[j, j]
        pivot = matrix[i, i]
        rest = vector[i]
        for k in range(i):
            pivot -= matrix[i, k] * matrix[i, k]
            rest -= matrix[i, k] * y[k]
        matrix[i, i] = np.sqrt(pivot)
        y[i] = rest / matrix[i, i]
        total += y[i] * y[i]
    return total
