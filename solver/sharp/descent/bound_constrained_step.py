"""One step of a descent in the edges: who runs, and how the others follow."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.cholesky import factor_rows, solve_column

_SWEEPS = 200


@compiled
def _sweep(matrix: Array, load: Array, bound: Array, y: Array) -> None:
    """Minimise ½ yᵀMy - loadᵀy in |y| ≤ bound, one edge after the other, in place."""
    for _ in range(_SWEEPS):
        largest = 0.0
        for e in range(y.shape[0]):
            pull = load[e]
            for f in range(y.shape[0]):
                if f != e:
                    pull -= matrix[e, f] * y[f]
            if matrix[e, e] * bound[e] > abs(pull):
                value = pull / matrix[e, e]
            else:
                value = np.sign(pull) * bound[e]
            largest = max(largest, abs(value - y[e]) / bound[e])
            y[e] = value
        if largest < 1e-12:
            break


@compiled
def running_step(matrix: Array, d: Array, pull: Array, limit: Array) -> Array:
    """Step of every edge: a minimum of the energy's quadratic model in the box of the limits.

    ``matrix`` is the symmetric tangent, ``d`` its scale factors, ``pull`` C_c - C. The edges at
    their limit run, the others follow by Newton's step around them. Edges become runners where
    Newton's step would move them beyond their limit, and, while the matrix of the others is not
    positive definite, the one that its softest mode moves most. A runner that the model pulls back
    is set free again; if it is pulled back once more, every edge in turn is put where the model is
    lowest, until none moves.
    """
    n = pull.shape[0]
    y = np.zeros(n)  # the step times d
    bound = limit * d
    load = pull * d
    runs = np.zeros(n, dtype=np.bool_)
    returned = np.zeros(n, dtype=np.bool_)
    for _ in range(4 * n + 4):
        free = np.flatnonzero(~runs)
        count = free.shape[0]
        if count > 0:
            block = np.empty((count, count))
            right = np.empty(count)
            for i in range(count):
                right[i] = load[free[i]]
                for j in range(n):
                    if runs[j]:
                        right[i] -= matrix[free[i], j] * y[j]
                for j in range(count):
                    block[i, j] = matrix[free[i], free[j]]
            factor = block.copy()
            newton = right.copy()
            if factor_rows(factor, 1e-9):
                solve_column(factor, newton)
            else:
                values, vectors = np.linalg.eigh(block)
                floor = 1e-9 * np.abs(values).max()
                if values[0] <= floor:
                    # The softest mode runs downhill; its largest edge leads. A pull without any
                    # share in that mode is a symmetric one: it keeps its symmetry.
                    downhill = vectors[:, 0] @ right
                    if abs(downhill) > 1e-6 * np.sqrt(right @ right):
                        mode = vectors[:, 0]
                        lead = np.argmax(np.abs(mode) / d[free])
                        edge = free[lead]
                        sign = np.sign(mode[lead]) * np.sign(downhill)
                        if abs(load[edge]) > 0.5 * np.abs(right).max():
                            sign = np.sign(load[edge])
                        runs[edge] = True
                        y[edge] = sign * bound[edge]
                        continue
                values = np.maximum(np.abs(values), floor)
                newton = vectors @ ((vectors.T @ right) / values)
            inside = True
            for i in range(count):
                edge = free[i]
                y[edge] = newton[i]
                if not abs(newton[i]) <= bound[edge]:
                    runs[edge] = True
                    y[edge] = np.sign(newton[i]) * bound[edge]
                    inside = False
            if not inside:
                for i in range(count):
                    if not runs[free[i]]:
                        y[free[i]] = 0.0
                continue
        # Is every runner pushed against its limit?
        worst = 0.0
        back = -1
        for e in range(n):
            if runs[e]:
                push = load[e]
                for f in range(n):
                    push -= matrix[e, f] * y[f]
                if -push * y[e] > worst * bound[e]:
                    worst = -push * y[e] / bound[e]
                    back = e
        if back < 0:
            break
        if returned[back]:
            _sweep(matrix, load, bound, y)
            break
        returned[back] = True
        runs[back] = False
        y[back] = 0.0
    return y / d


@compiled
def off_saddle(matrix: Array, d: Array, limit: Array) -> Array:
    """Step along the softest mode, its first large edge outwards: the way off a saddle."""
    mode = np.linalg.eigh(matrix)[1][:, 0] / d
    size = np.abs(mode)
    lead = np.flatnonzero(size > 0.99 * size.max())[0]
    step: Array = mode * (limit.min() / mode[lead])
    for e in range(step.shape[0]):
        step[e] = min(max(step[e], -limit[e]), limit[e])
    return step
