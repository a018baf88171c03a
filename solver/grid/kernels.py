"""Compiled inner loops of the method ``grid``.

Threaded linear algebra sums in an order that depends on the number of threads; these sums depend on
the input alone.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_finite_sums


@compiled_finite_sums
def dot(a: Array, b: Array) -> float:
    """Return the sum of a_i b_i."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled_finite_sums
def update_direction(direction: Array, inside: Array, correction: Array, factor: float) -> None:
    """Set the next search direction: the correction on Ω plus ``factor`` times the last one."""
    for i in range(direction.size):
        direction[i] = inside[i] * correction[i] + factor * direction[i]


@compiled_finite_sums
def advance(
    stress: Array,
    displacement: Array,
    residual: Array,
    direction: Array,
    response: Array,
    inside: Array,
    step: float,
) -> float:
    """Take ``step`` along the direction; return the largest absolute residual on Ω."""
    largest = 0.0
    for i in range(stress.size):
        stress[i] += step * direction[i]
        displacement[i] += step * response[i]
        residual[i] -= step * response[i] * inside[i]
        largest = max(largest, abs(residual[i]))
    return largest


@compiled
def inverse_form(matrix: Array, vector: Array) -> float:
    """Return bᵀA⁻¹b for a symmetric positive definite A (Cholesky); overwrites its lower half."""
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
