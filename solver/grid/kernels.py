"""Compiled inner loops of the method ``grid``.

Threaded linear algebra sums in an order that depends on the number of threads; these sums depend on
the input alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array, Integers
from adhesis.solver.runtime.jit import compiled, compiled_finite_sums


@compiled_finite_sums
def dot(a: Array, b: Array) -> float:
    """Return the sum of a_i b_i."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled_finite_sums
def total(values: Array) -> float:
    """Return the sum of the values."""
    out = 0.0
    for i in range(values.size):
        out += values[i]
    return out


@compiled_finite_sums
def total_inside(values: Array, inside: NDArray[np.bool_]) -> float:
    """Return the sum of the values on Ω."""
    out = 0.0
    for i in range(values.size):
        out += values[i] * inside[i]
    return out


@compiled_finite_sums
def restrict(values: Array, inside: Array) -> bool:
    """Set the values outside Ω to zero, in place; return whether they all were."""
    was = True
    for i in range(values.size):
        if inside[i] == 0 and values[i] != 0:
            values[i] = 0.0
            was = False
    return was


@compiled_finite_sums
def residual_inside(target: Array, displacement: Array, inside: Array, out: Array) -> float:
    """Compute the residual on Ω, zero elsewhere; return the largest absolute one."""
    largest = 0.0
    for i in range(out.size):
        out[i] = (target[i] - displacement[i]) * inside[i]
        largest = max(largest, abs(out[i]))
    return largest


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


@compiled
def patch_ranges(mask: NDArray[np.bool_]) -> tuple[Integers, Integers]:
    """Find first node and number of nodes of every patch of a contact set, shape (patches,) each.

    Sorted by the first node; a patch may extend across the end of the period. A contact set without
    a free node is one patch that starts at node 0.
    """
    n = mask.size
    count = 0
    for i in range(n):
        count += mask[i] and not mask[i - 1]
    if count == 0:
        whole = 1 if mask[0] else 0  # one patch without an end, or none
        return np.zeros(whole, dtype=np.int64), np.full(whole, n)
    first = np.empty(count, dtype=np.int64)
    width = np.zeros(count, dtype=np.int64)
    k = -1
    for i in range(n):
        if mask[i] and not mask[i - 1]:
            k += 1
            first[k] = i
        if mask[i]:
            width[k] += 1  # of the last patch, where the period begins within one
    return first, width


@compiled
def edges_of(
    first: Integers, width: Integers, n: int
) -> tuple[Integers, Integers, Integers, Integers, Integers]:
    """Return side, inner and outer node, width and gap of every edge, as ``edges.Edges``."""
    count = first.size
    out = np.empty((5, 2 * count), dtype=np.int64)
    for k in range(count):
        last = first[k] + width[k] - 1
        following = first[k + 1] if k + 1 < count else first[0] + n
        right = count + k
        out[0, k], out[0, right] = -1, 1
        out[1, k], out[1, right] = first[k], last % n
        out[2, k], out[2, right] = (first[k] - 1) % n, (last + 1) % n
        out[3, k] = out[3, right] = width[k]
        out[4, right] = following - last - 1
        out[4, k + 1 if k + 1 < count else 0] = following - last - 1
    return out[0], out[1], out[2], out[3], out[4]
