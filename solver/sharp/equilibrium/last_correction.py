"""Field of many gaps after a last, small correction of their edges; compiled.

Newton's step of all edges (``edge_elimination``) gives the change of the potential at every gap to
first order. With it each gap is solved by itself between its new edges: the error of the field is
of second order in the step, as it is of the edges, and no further solution of all gaps together is
needed.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.edge_elimination import StepChange
from adhesis.solver.sharp.field.assembly import assemble_blocks
from adhesis.solver.sharp.field.hierarchical_solver import (
    HierarchicalSystem,
    apply_inverse,
    gap_potentials,
    invert_blocks,
)
from adhesis.solver.sharp.field.solution import (
    FieldModel,
    Solution,
    edge_openings,
    subtract_end_terms,
)
from adhesis.solver.sharp.gap.conformal_map import eta_at, map_gaps


@compiled
def _interpolate_potential(
    gap: Array, eta: Array, w: Array, potential: Array, theta: float
) -> float:
    """Interpolate a potential g at θ from its values times dθ/dη at the nodes η of a gap."""
    x, _, slope = eta_at(gap, theta)
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


@compiled
def correct_gaps(
    edges: Array,
    prescribed: float,
    state: Solution,
    system: HierarchicalSystem,
    change: StepChange,
    model: FieldModel,
) -> tuple[Solution, HierarchicalSystem]:
    """Solve between ``edges``, shape (L, 2), a step away from ``state``, with its ``change``.

    Responses to other edges and pressures (``solved``, ``mean``, the tree and its factor) are those
    of ``state``, as they count to first order alone.
    """
    rules, device, offset = model.rules, model.device, state.nodes.offset
    nodes, equations = assemble_blocks(map_gaps(edges), state.nodes.orders, 1, model)
    load = equations.load
    inverse, _, definite = invert_blocks(nodes, equations.matrix, rules)
    potential = gap_potentials(state, system.weights)
    for i in range(potential.shape[0]):
        potential[i] += change.potential[i]
    pressure = state.pressure + change.pressure
    own_load = np.empty((load.shape[0], 1))
    for k in range(nodes.orders.shape[0]):
        own = slice(offset[k], offset[k + 1])
        start = rules.vector_start[nodes.orders[k]]
        rule = slice(start, start + offset[k + 1] - offset[k])
        eta, w = rules.eta[rule], rules.weights[rule]
        for i in range(offset[k], offset[k + 1]):
            there = _interpolate_potential(
                state.nodes.table[k], eta, w, potential[own], nodes.theta[i]
            )
            own_load[i, 0] = -load[i, 0] - pressure * load[i, 1] - nodes.weight[i] * there
    f = apply_inverse(offset, inverse, own_load)
    mean = 0.0  # of the opening, times 2π, and what it loses by a unit of p
    by_pressure = 0.0
    for i in range(load.shape[0]):
        mean += nodes.weight[i] * f[i, 0]
        by_pressure += nodes.weight[i] * state.solved[i, 1]
    # weight·mean - 2π compliance·p = 2π d, to rounding
    weight, compliance = device.separation_weight, device.compliance
    more = weight * mean - 2 * np.pi * (prescribed + compliance * pressure)
    more /= weight * by_pressure + 2 * np.pi * compliance
    pressure += more
    for i in range(load.shape[0]):
        f[i, 0] -= more * state.solved[i, 1]
    separation = prescribed
    if compliance != 0:
        separation = (mean - more * by_pressure) / (2 * np.pi)
    if not definite:
        pressure = np.nan
    opening = edge_openings(f, nodes, rules)[:, 0].copy()
    subtract_end_terms(opening, nodes.slope, equations.end_terms, 0)
    solution = Solution(
        nodes=nodes,
        equations=equations,
        factor=state.factor,
        solved=state.solved,
        mean=state.mean,
        separation=separation,
        pressure=pressure,
        scaled_opening=f[:, 0].copy(),
        opening=opening,
        exterior=state.exterior,
    )
    return solution, HierarchicalSystem(inverse, system.weights, system.tree, system.factor)
