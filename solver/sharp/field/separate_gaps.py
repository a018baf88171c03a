"""Solve every gap by itself, between given edges and in a known potential of the others."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.field.assembly import assemble_blocks
from adhesis.solver.sharp.field.cholesky import factor_rows, solve_column
from adhesis.solver.sharp.field.solution import (
    FieldModel,
    MeanResponse,
    Solution,
    edge_openings,
    subtract_end_terms,
)
from adhesis.solver.sharp.gap.conformal_map import LEFT, RIGHT, eta_at, map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers


@compiled
def interpolate_potential(
    gap: Array, eta: Array, w: Array, potential: Array, theta: float
) -> float:
    """Interpolate a potential g at θ from G = g dθ/dη at the nodes η of a gap.

    Beyond an end of the gap it is the potential at that end.
    """
    x, _, slope = eta_at(gap, min(max(theta, gap[LEFT]), gap[RIGHT]))
    above = 0.0
    below = 0.0
    sign = 1.0
    for i in range(eta.shape[0]):
        apart = x - eta[i]
        if apart == 0:
            above, below = potential[i], 1.0
            break
        share = sign * w[i] / apart
        above += share * potential[i]
        below += share
        sign = -sign
    value: float = slope * above / below
    return value


@compiled_for_both
def solve_separately(
    edges: Array,
    table: Array,
    orders: Integers,
    potential: Array,
    pressure: float,
    prescribed: float,
    model: FieldModel,
) -> Solution:
    """Solve every gap between ``edges``, shape (L, 2), in the potential of the others.

    The potential is given as G = g dθ/dη at the nodes of nearby gaps, with rows in ``table``. The
    pressure is corrected for the errors of the potentials, so that d has the prescribed value to
    rounding. Responses of all gaps together (``solved`` and ``mean``) are left out.
    """
    rules = model.rules
    nodes, equations = assemble_blocks(map_gaps(edges), orders, 1, model)
    load, offset, n = equations.load, nodes.offset, nodes.theta.shape[0]
    f = np.empty((n, 1))
    by_pressure = np.empty(n)
    for k in range(orders.shape[0]):
        first, m = offset[k], offset[k + 1] - offset[k]
        own = slice(first, first + m)
        start = rules.vector_start[orders[k]]
        eta, w = rules.eta[start : start + m], rules.weights[start : start + m]
        factor = equations.matrix[own, :m].copy()
        if not factor_rows(factor, 0.0):
            pressure = np.nan
        column = np.empty(m)
        unit = load[own, 1].copy()
        solve_column(factor, unit)
        by_pressure[own] = unit
        for i in range(m):
            there = interpolate_potential(table[k], eta, w, potential[own], nodes.theta[first + i])
            total = load[first + i, 0] + pressure * load[first + i, 1]
            column[i] = -total - nodes.weight[first + i] * there
        solve_column(factor, column)
        for i in range(m):
            f[first + i, 0] = column[i]
    mean = 0.0  # mean opening times 2π
    unit_mean = 0.0  # its decrease per unit of p
    for i in range(n):
        mean += nodes.weight[i] * f[i, 0]
        unit_mean += nodes.weight[i] * by_pressure[i]
    # weight·mean - 2π compliance·p = 2π d
    weight, compliance = model.device.separation_weight, model.device.compliance
    more = weight * mean - 2 * np.pi * (prescribed + compliance * pressure)
    more /= weight * unit_mean + 2 * np.pi * compliance
    pressure += more
    for i in range(n):
        f[i, 0] -= more * by_pressure[i]
    separation = prescribed
    if compliance != 0:
        separation = (mean - more * unit_mean) / (2 * np.pi)
    opening = edge_openings(f, nodes, rules)[:, 0].copy()
    subtract_end_terms(opening, nodes.slope, equations.end_terms, 0)
    return Solution(
        nodes=nodes,
        equations=equations,
        solved=np.empty((0, 0)),
        mean=MeanResponse(model.device.separation_weight, np.nan, np.nan),
        separation=separation,
        pressure=pressure,
        scaled_opening=f[:, 0].copy(),
        opening=opening,
    )
