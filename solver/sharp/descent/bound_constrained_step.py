"""Step with equal speeds, compiled: a minimum of the energy's quadratic model within bounds.

It is an active-set method: edges at their bound form the active set, the others take Newton's step
around them. ½ yᵀMy - bᵀy is minimised in |y_e| ≤ the bound of edge e; where M is indefinite that
minimum need not be the only one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.cholesky import factor_rows, solve_column
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import (
    BOUND_SWEEPS,
    BOUND_SWEEPS_CHANGE,
    LEADING_FORCE,
    LEAST_PIVOT,
    SYMMETRIC_FORCE,
)

Flags = NDArray[np.bool_]


@compiled
def bound_constrained_step(matrix: Array, scale: Array, force: Array, limit: Array) -> Array:
    """Find the step of every edge: a minimum of the energy's quadratic model within the limits.

    ``matrix`` is the symmetric tangent, ``scale`` its scale factors, ``force`` C_c - C. An edge
    becomes active where Newton's step would move it beyond its limit, and, while the matrix of the
    others is not positive definite, the one that its softest mode moves most. An active edge that
    the model pulls back is set free again; if it is pulled back once more, every edge in turn is
    put where the model is lowest, until none moves.
    """
    n = force.shape[0]
    y = np.zeros(n)  # the step times the scale factors
    bound = limit * scale
    load = force * scale
    active = np.zeros(n, dtype=np.bool_)
    returned = np.zeros(n, dtype=np.bool_)
    for _ in range(4 * n + 4):
        free = np.flatnonzero(~active)
        if free.shape[0] > 0:
            block, right = _reduced_system(matrix, load, active, y, free)
            newton, edge, sign = _free_step(block, right, load, scale, free)
            if edge >= 0:
                active[edge] = True
                y[edge] = sign * bound[edge]
                continue
            if not _put_free(newton, bound, active, y, free):
                continue
        back = _most_pulled_back(matrix, load, bound, active, y)
        if back < 0:
            break
        if returned[back]:
            _sweep(matrix, load, bound, y)
            break
        returned[back] = True
        active[back] = False
        y[back] = 0.0
    return y / scale


@compiled
def _reduced_system(
    matrix: Array, load: Array, active: Flags, y: Array, free: Integers
) -> tuple[Array, Array]:
    """Reduce matrix and load to the free edges, the active ones standing at their bounds."""
    count = free.shape[0]
    block = np.empty((count, count))
    right = np.empty(count)
    for i in range(count):
        right[i] = load[free[i]]
        for j in range(load.shape[0]):
            if active[j]:
                right[i] -= matrix[free[i], j] * y[j]
        for j in range(count):
            block[i, j] = matrix[free[i], free[j]]
    return block, right


@compiled
def _free_step(
    block: Array, right: Array, load: Array, scale: Array, free: Integers
) -> tuple[Array, int, float]:
    """Find Newton's step of the free edges, or the edge that becomes active, and its direction.

    The edge is -1 where the step holds.
    """
    factor = block.copy()
    newton = right.copy()
    if factor_rows(factor, LEAST_PIVOT):
        solve_column(factor, newton)
        return newton, -1, 0.0
    values, vectors = np.linalg.eigh(block)
    least = LEAST_PIVOT * np.abs(values).max()
    if values[0] <= least:
        # The softest mode goes downhill; its largest edge leads. A force without any share in that
        # mode is a symmetric one: it keeps its symmetry.
        downhill = vectors[:, 0] @ right
        if abs(downhill) > SYMMETRIC_FORCE * np.sqrt(right @ right):
            mode = vectors[:, 0]
            lead = np.argmax(np.abs(mode) / scale[free])
            edge = free[lead]
            sign = np.sign(mode[lead]) * np.sign(downhill)
            if abs(load[edge]) > LEADING_FORCE * np.abs(right).max():
                sign = np.sign(load[edge])
            return newton, edge, sign
    values = np.maximum(np.abs(values), least)
    return vectors @ ((vectors.T @ right) / values), -1, 0.0


@compiled
def _put_free(newton: Array, bound: Array, active: Flags, y: Array, free: Integers) -> bool:
    """Move the free edges; False where some became active, and the others begin again."""
    inside = True
    for i in range(free.shape[0]):
        edge = free[i]
        y[edge] = newton[i]
        if not abs(newton[i]) <= bound[edge]:
            active[edge] = True
            y[edge] = np.sign(newton[i]) * bound[edge]
            inside = False
    if not inside:
        for i in range(free.shape[0]):
            if not active[free[i]]:
                y[free[i]] = 0.0
    return inside


@compiled
def _most_pulled_back(matrix: Array, load: Array, bound: Array, active: Flags, y: Array) -> int:
    """Find the active edge that the model pulls back most; -1 if none is."""
    worst = 0.0
    back = -1
    for e in range(load.shape[0]):
        if active[e]:
            force = load[e]
            for f in range(load.shape[0]):
                force -= matrix[e, f] * y[f]
            if -force * y[e] > worst * bound[e]:
                worst = -force * y[e] / bound[e]
                back = e
    return back


@compiled
def _sweep(matrix: Array, load: Array, bound: Array, y: Array) -> None:
    """Minimise the model within the bounds by one edge after the other, in place."""
    for _ in range(BOUND_SWEEPS):
        largest = 0.0
        for e in range(y.shape[0]):
            force = load[e]
            for f in range(y.shape[0]):
                if f != e:
                    force -= matrix[e, f] * y[f]
            if matrix[e, e] * bound[e] > abs(force):
                value = force / matrix[e, e]
            else:
                value = np.sign(force) * bound[e]
            largest = max(largest, abs(value - y[e]) / bound[e])
            y[e] = value
        if largest < BOUND_SWEEPS_CHANGE:
            break
