"""Change of the openings of some edges by the motion of others, all further ones held; compiled."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.field.hierarchical_solver import solve_loads, solve_many
from adhesis.solver.sharp.field.solution import FieldModel, Nodes
from adhesis.solver.sharp.field.weight_function import (
    end_singularity,
    openings_by_edges,
    own_singular_load,
)
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers


@compiled
def end_charges(
    nodes: Nodes, block: Array, e: int, rules: GaussRules, work: Array, load: Array, charge: Array
) -> float:
    """Compute load on the own gap, charges and area of the singular opening of edge e.

    ``block`` is the diagonal block of its gap, ``work`` has space for the nodes of a gap.
    """
    k, side = e // 2, e % 2
    m = load.shape[0]
    density = work[:m]
    strength, area = end_singularity(nodes, e, rules, density)
    own_singular_load(nodes, e, block, density, strength, rules, load)
    start = rules.vector_start[nodes.orders[k]]
    point = np.pi / (m + 1)
    for j in range(m):
        ends = point * rules.end_values[side, start + j]
        charge[j] = rules.weights[start + j] * density[j] + ends
    return area


@compiled_for_both
def openings_between_edges(
    gaps: Array, orders: Integers, wanted: Integers, opening: Array, model: FieldModel
) -> Array:
    """Compute ∂C_e/∂θ_f at fixed p between the edges ``wanted``; 0 for e = f.

    ``opening`` is C at each of these. It may be that of more gaps than are given: the derivatives
    depend on the field by these openings alone.
    """
    state, system = solve_many(gaps, 0.0, orders, 1, model)
    for c in range(wanted.shape[0]):
        state.opening[wanted[c]] = opening[c]
    offset, matrix = state.nodes.offset, state.equations.matrix
    n, count = state.nodes.theta.shape[0], wanted.shape[0]
    work = np.empty(n)
    load = np.zeros((n, count))
    charge = np.zeros((n, count))
    area = np.zeros(count)
    for c in range(count):
        k = wanted[c] // 2
        own = slice(offset[k], offset[k + 1])
        block = matrix[own, : offset[k + 1] - offset[k]]
        area[c] = end_charges(
            state.nodes, block, wanted[c], model.rules, work, load[own, c], charge[own, c]
        )
    regular = solve_loads(system, offset, load, charge)
    by_edge, _ = openings_by_edges(state, wanted, regular, area, model.rules)
    out = by_edge[wanted]
    for c in range(count):
        out[c, c] = 0.0
    return out
