"""One step of a descent in the edges: who runs, and how the others follow."""

from __future__ import annotations

import numpy as np

from solver.compiled import compiled
from solver.sharp_linear import factor_rows, solve_column


@compiled
def running_step(matrix, d, pull, limit):  # type: ignore[no-untyped-def]  # compiled
    """Step of every edge: runners at their limit, the others by Newton's step around them.

    ``matrix`` is the symmetric tangent, ``d`` its scale factors, ``pull`` C_c - C. Edges become
    runners one after the other: those that Newton's step would move beyond their limit, and, while
    the matrix of the others is not positive definite, the one that its softest mode moves most.
    """
    n = pull.shape[0]
    step = np.zeros(n)
    runs = np.zeros(n, dtype=np.bool_)
    scaled = pull * d
    for _ in range(n + 1):
        free = np.flatnonzero(~runs)
        if free.shape[0] == 0:
            break
        block = np.empty((free.shape[0], free.shape[0]))
        right = np.empty(free.shape[0])
        for i in range(free.shape[0]):
            right[i] = scaled[free[i]]
            for j in range(n):
                if runs[j]:
                    right[i] -= matrix[free[i], j] * step[j] * d[j]
            for j in range(free.shape[0]):
                block[i, j] = matrix[free[i], free[j]]
        factor = block.copy()
        if factor_rows(factor, 1e-9):
            newton = right.copy()
            solve_column(factor, newton)
        else:
            values, vectors = np.linalg.eigh(block)
            floor = 1e-9 * np.abs(values).max()
            # The softest mode runs downhill; its largest edge leads. A pull without any share in
            # that mode is a symmetric one: it keeps its symmetry.
            downhill = vectors[:, 0] @ right
            if abs(downhill) > 1e-6 * np.sqrt(right @ right):
                mode = vectors[:, 0] / d[free]
                lead = np.argmax(np.abs(mode))
                edge = free[lead]
                sign = np.sign(mode[lead]) * np.sign(downhill)
                if abs(pull[edge]) * d[edge] > 0.5 * np.abs(right).max():
                    sign = np.sign(pull[edge])
                runs[edge] = True
                step[edge] = sign * limit[edge]
                continue
            values = np.maximum(np.abs(values), floor)
            newton = vectors @ ((vectors.T @ right) / values)
        newton /= d[free]
        done = True
        for i in range(free.shape[0]):
            edge = free[i]
            step[edge] = newton[i]
            if not abs(newton[i]) <= limit[edge]:
                runs[edge] = True
                step[edge] = np.sign(newton[i]) * limit[edge]
                done = False
        if done:
            break
        for i in range(free.shape[0]):
            if not runs[free[i]]:
                step[free[i]] = 0.0
    return step


@compiled
def off_saddle(matrix, d, limit):  # type: ignore[no-untyped-def]  # compiled
    """Step along the softest mode, its first large edge outwards: the way off a saddle."""
    mode = np.linalg.eigh(matrix)[1][:, 0] / d
    size = np.abs(mode)
    lead = np.flatnonzero(size > 0.99 * size.max())[0]
    step = mode * (limit.min() / mode[lead])
    for e in range(step.shape[0]):
        step[e] = min(max(step[e], -limit[e]), limit[e])
    return step
