"""Leave a saddle of the energy, compiled: along the softest modes, one edge leading."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.edge_forces import FlowProblem, slope_along
from adhesis.solver.sharp.equilibrium.griffith import move_edges
from adhesis.solver.sharp.field.cholesky import is_definite
from adhesis.solver.sharp.gap.conformal_map import LEFT, map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import EQUAL_AMPLITUDES, EQUAL_GAINS, EQUAL_MODES


class QuadraticModel(NamedTuple):
    """Quadratic model of the energy about the present edges, and the bounds of a step.

    Attributes
    ----------
    values : array, shape (2L,)
        Eigenvalues of the Hessian, rising; for equal speeds the scale factors of ``matrix``.
    matrix : array, shape (2L, 2L)
        Eigenvectors of the Hessian; for equal speeds the scaled tangent.
    limit : array, shape (2L,)
        Longest step of every edge.
    """

    values: Array
    matrix: Array
    limit: Array


@compiled
def step_off_saddle(
    step: Array,
    model: QuadraticModel,
    gaps: Array,
    prescribed: float,
    orders: Integers,
    equal_speeds: bool,
    problem: FlowProblem,
) -> tuple[Array, int]:
    """Choose the step from edges without force: off a saddle, or ``step`` where they are stable.

    Both directions are tried by linear kinetics. The one on which energy falls more is taken,
    of equal ones the outward one. Where energy rises on both, half the step is tried: just beyond a
    pitchfork the minima beside the saddle are near. Also returns the number of fields.
    """
    if equal_speeds:
        if is_definite(model.matrix):
            return step, 0
        return softest_step(model.matrix, model.values, model.limit), 0
    if not model.values[0] < 0:
        return step, 0
    order = positions(map_gaps(gaps), problem.law.origin)
    way = leaving_step(model.values, model.matrix, model.limit, order)
    tried = 0
    while np.abs(way).max() >= problem.law.rest_step:
        onwards = slope_along(move_edges(gaps, way), way, prescribed, orders, problem)
        backwards = slope_along(move_edges(gaps, -way), -way, prescribed, orders, problem)
        tried += 2
        if max(onwards, backwards) > 0:
            return (way if onwards >= backwards * (1 - EQUAL_GAINS) else -way), tried
        way = 0.5 * way
    return step, tried


@compiled
def positions(table: Array, origin: float) -> Array:
    """Measure the distance of every edge to the right of ``origin``, in [0, 2π)."""
    out = np.empty(2 * table.shape[0])
    for k in range(table.shape[0]):
        for side in range(2):
            out[2 * k + side] = (table[k, LEFT + side] - origin) % (2 * np.pi)
    return out


@compiled
def softest_step(matrix: Array, scale: Array, limit: Array) -> Array:
    """Step along the softest mode of a scaled tangent, its first large edge outwards."""
    mode = np.linalg.eigh(matrix)[1][:, 0] / scale
    size = np.abs(mode)
    lead = np.flatnonzero(size > EQUAL_AMPLITUDES * size.max())[0]
    step: Array = mode * (limit.min() / mode[lead])
    for e in range(step.shape[0]):
        step[e] = min(max(step[e], -limit[e]), limit[e])
    return step


@compiled
def leaving_step(values: Array, vectors: Array, limit: Array, order: Array) -> Array:
    """Step off a saddle, along its softest modes, up to the limit of an edge.

    One edge leads, outwards; it is the one that moves most freely in these modes, of equal ones the
    first in ``order`` (positions). Where symmetry makes several modes equally soft, the step is the
    leading edge's projection on all of them: which of equivalent edges leads does not matter.
    """
    n = limit.shape[0]
    level = min(values[0] + EQUAL_MODES * np.abs(values).max(), 0.0)
    freedom = np.zeros(n)
    for i in range(n):
        if values[i] <= level:
            for e in range(n):
                freedom[e] += vectors[e, i] ** 2
    most = freedom.max()
    lead = -1
    for e in range(n):
        if freedom[e] > EQUAL_AMPLITUDES * most and (lead < 0 or order[e] < order[lead]):
            lead = e
    step = np.zeros(n)
    for i in range(n):
        if values[i] <= level:
            for e in range(n):
                step[e] += vectors[e, i] * vectors[lead, i]
    worst = 0.0
    for e in range(n):
        worst = max(worst, abs(step[e]) / limit[e])
    return step / worst
