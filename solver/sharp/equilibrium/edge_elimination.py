"""Newton's step of all edges of many gaps at once, and their stability, on the tree of gaps.

An edge follows its own opening: C_e = C_c at each. So a gap whose edges may move responds to the
potentials of the others like one with held edges, only more compliantly; with the motions n of its
two edges eliminated (static condensation), its charges are again q = q° - R g, and the tree
(``cluster_tree``) solves for all gaps and all edges together. The singular opening that a moving
edge leaves (``weight_function``) has a regular part, charges and, from translation invariance, the
edge's own term.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.cluster_tree import downward_pass, factor_tree, upward_pass
from adhesis.solver.sharp.field.hierarchical_solver import (
    HierarchicalSystem,
    apply_inverse,
    solve_loads,
    solve_many,
)
from adhesis.solver.sharp.field.solution import (
    FieldModel,
    LoadingDevice,
    Nodes,
    Solution,
    edge_openings,
    subtract_end_terms,
)
from adhesis.solver.sharp.field.weight_function import (
    end_singularity,
    openings_by_edges,
    own_singular_load,
)
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers


class EliminatedEdges(NamedTuple):
    """Gaps whose edges keep their balance.

    Attributes
    ----------
    response : array
        Response of every gap, flat.
    negative : int array, shape (L,)
        Negative eigenvalues of each.
    charge : array, shape (N, 2)
        Charges of each gap by itself, by the imbalance of its edges and by a unit of p.
    motion : array, shape (2L, 2)
        The motions of its edges then.
    motion_by_potential : array, shape (N, 2)
        Motion of both edges of a gap by the potential at each of its nodes.
    """

    response: Array
    negative: Integers
    charge: Array
    motion: Array
    motion_by_potential: Array


class StepChange(NamedTuple):
    """First-order change of the field of every gap by a step of all edges.

    Attributes
    ----------
    potential : array, shape (N,)
        Of the other gaps at its nodes, which stay where they are.
    pressure : float
    """

    potential: Array
    pressure: float


class NewtonStep(NamedTuple):
    """Newton's step of every edge towards C_e = C_c.

    Attributes
    ----------
    step, rate : array, shape (2L,)
        Outward motion n, and dn/dd along the branch.
    slope : float
        dY/dd along the branch: Y is p, under a load q0 s.
    stable : bool
        Whether the edges are stable.
    change : StepChange
    """

    step: Array
    rate: Array
    slope: float
    stable: bool
    change: StepChange


class _MovingEnds(NamedTuple):
    """Singular openings of both edges of every gap, for motions outwards.

    Attributes
    ----------
    strength : array, shape (2L,)
    load, charge : array, shape (N, 2)
        Of the openings sqrt((1∓η)/(1±η)): load on their own gap, and charges.
    together : array, shape (2L,)
        Derivatives of the openings when all edges move to the right and the profile stays.
    """

    strength: Array
    load: Array
    charge: Array
    together: Array


@compiled
def _end_charges(
    nodes: Nodes, matrix: Array, e: int, rules: GaussRules, work: Array, load: Array, charge: Array
) -> float:
    """Compute load on the own gap, charges and area of the singular opening of edge e.

    ``matrix`` are the diagonal blocks, ``work`` has space for the nodes of a gap.
    """
    k, side = e // 2, e % 2
    m = load.shape[0]
    density = work[:m]
    strength, area = end_singularity(nodes, e, rules, density)
    block = matrix[nodes.offset[k] : nodes.offset[k + 1], :m]
    own_singular_load(nodes, e, block, density, strength, rules, load)
    start = rules.vector_start[nodes.orders[k]]
    point = np.pi / (m + 1)
    for j in range(m):
        ends = point * rules.end_values[side, start + j]
        charge[j] = rules.weights[start + j] * density[j] + ends
    return area


@compiled
def _moving_ends(state: Solution, system: HierarchicalSystem, rules: GaussRules) -> _MovingEnds:
    """Compute the singular openings of all edges, and the translation of all together."""
    nodes, matrix = state.nodes, state.equations.matrix
    edges = state.opening.shape[0]
    n = nodes.theta.shape[0]
    work = np.empty(n)
    load = np.empty((n, 2))
    charge = np.empty((n, 2))
    strength = np.empty(edges)
    together = np.empty((n, 1))  # moving the profile less moving all edges, both to the right
    together_charge = np.zeros((n, 1))
    area = 0.0
    for i in range(n):
        together[i, 0] = -state.equations.load[i, 2]
    for e in range(edges):
        k, side = e // 2, e % 2
        own = slice(nodes.offset[k], nodes.offset[k + 1])
        area_of_end = _end_charges(
            nodes, matrix, e, rules, work, load[own, side], charge[own, side]
        )
        strength[e] = -state.opening[e] * np.sqrt(nodes.slope[k, side] / 8)
        to_right = (1 - 2 * side) * strength[e]
        area += area_of_end * to_right
        for i in range(nodes.offset[k], nodes.offset[k + 1]):
            together[i, 0] -= load[i, side] * to_right
            together_charge[i, 0] -= charge[i, side] * to_right
    regular = solve_loads(system, nodes.offset, together, together_charge)
    p = -area
    for i in range(n):
        p += nodes.weight[i] * regular[i, 0]
    p *= state.mean.separation_weight / state.mean.resistance
    for i in range(n):
        regular[i, 0] -= p * state.solved[i, 1]
    shift = edge_openings(regular, nodes, rules)[:, 0].copy()
    subtract_end_terms(shift, nodes.slope, state.equations.end_terms, 1)
    return _MovingEnds(strength, load, charge, shift)


@compiled
def eliminate_edges(
    state: Solution, system: HierarchicalSystem, residual: Array, drift: Array, rules: GaussRules
) -> EliminatedEdges:
    """Eliminate the edges, which keep C_e = C_c, from a solution with S and S'.

    ``residual`` is the imbalance C_e - C_c, ``drift`` the derivative of C_c by θ.
    """
    nodes = state.nodes
    count, n = nodes.orders.shape[0], nodes.theta.shape[0]
    ends = _moving_ends(state, system, rules)
    regular = apply_inverse(nodes.offset, system.inverse, ends.load)
    by_mean = apply_inverse(nodes.offset, system.inverse, state.equations.load[:, 1:2])
    regular_openings = edge_openings(regular, nodes, rules)
    mean_openings = edge_openings(by_mean, nodes, rules)
    out = EliminatedEdges(
        response=np.empty(system.inverse.shape[0]),
        negative=np.zeros(count, dtype=np.int64),
        charge=np.empty((n, 2)),
        motion=np.empty((2 * count, 2)),
        motion_by_potential=np.empty((n, 2)),
    )
    square = 0
    for k in range(count):
        own = slice(nodes.offset[k], nodes.offset[k + 1])
        both = slice(2 * k, 2 * k + 2)
        m = nodes.offset[k + 1] - nodes.offset[k]
        start = rules.vector_start[nodes.orders[k]]
        w = system.weights[own]
        inverse = system.inverse[square : square + m * m].reshape(m, m)
        tangent = _own_tangent(
            ends.strength[both], nodes.slope[k], regular_openings[both], ends.together[both],
            drift[both],
        )  # fmt: skip
        compliance, out.negative[k] = _invert_tangent(tangent)
        # motion of both ends by the imbalance, by p, and by the potential at each node
        opening = np.empty((2, m))
        for side in range(2):
            scale = np.sqrt(2 * nodes.slope[k, side])
            for j in range(m):
                total = 0.0
                for i in range(m):
                    total += rules.end_values[side, start + i] * inverse[i, j]
                opening[side, j] = scale * total * w[j]
        motion, follows = out.motion[both], out.motion_by_potential[own]
        for side in range(2):
            a, b = compliance[side, 0], compliance[side, 1]
            motion[side, 0] = -(a * residual[2 * k] + b * residual[2 * k + 1])
            motion[side, 1] = a * mean_openings[2 * k, 0] + b * mean_openings[2 * k + 1, 0]
            for j in range(m):
                follows[j, side] = a * opening[0, j] + b * opening[1, j]
        moving = np.empty((m, 2))  # charges by the motion of each end
        charge = out.charge[own]
        for i in range(m):
            for side in range(2):
                part = w[i] * regular[nodes.offset[k] + i, side] + ends.charge[own][i, side]
                moving[i, side] = ends.strength[2 * k + side] * part
            charge[i, 0] = 0.0
            charge[i, 1] = -w[i] * by_mean[nodes.offset[k] + i, 0]
            for column in range(2):
                for side in range(2):
                    charge[i, column] += moving[i, side] * motion[side, column]
        _condense(inverse, w, moving, follows, out.response[square : square + m * m])
        square += m * m
    return out


@compiled
def _condense(inverse: Array, w: Array, moving: Array, follows: Array, out: Array) -> None:
    """Condense the response of a gap, flat: with held edges, less that by their motion."""
    m = w.shape[0]
    for i in range(m):
        for j in range(m):
            value = w[i] * inverse[i, j] * w[j]
            for side in range(2):
                value -= 0.5 * moving[i, side] * follows[j, side]
                value -= 0.5 * moving[j, side] * follows[i, side]
            out[i * m + j] = value


@compiled
def _own_tangent(
    strength: Array, slope: Array, regular: Array, together: Array, drift: Array
) -> Array:
    """Compute ∂(C_e - C_c)/∂n_f between both edges of a gap, all other gaps held."""
    tangent = np.empty((2, 2))
    for side in range(2):
        end = np.sqrt(slope[side] / 2)
        for other in range(2):
            tangent[side, other] = regular[side, other] * strength[other]
        tangent[side, 1 - side] += end * strength[1 - side]
        sign = 1 - 2 * side
        # the singular opening of the other end, for a motion of both to the right
        own = together[side] + sign * end * strength[1 - side]
        tangent[side, side] += sign * (own - drift[side])
    return tangent


@compiled
def _invert_tangent(tangent: Array) -> tuple[Array, int]:
    """Invert a 2×2 matrix, and count its negative eigenvalues."""
    det = tangent[0, 0] * tangent[1, 1] - tangent[0, 1] * tangent[1, 0]
    negative = 0
    if det < 0:
        negative = 1
    elif tangent[0, 0] + tangent[1, 1] < 0:
        negative = 2
    inverse = np.empty((2, 2))
    inverse[0, 0] = tangent[1, 1] / det
    inverse[1, 1] = tangent[0, 0] / det
    inverse[0, 1] = -tangent[0, 1] / det
    inverse[1, 0] = -tangent[1, 0] / det
    return inverse, negative


@compiled
def newton_step(
    state: Solution, system: HierarchicalSystem, edges: EliminatedEdges, device: LoadingDevice
) -> NewtonStep:
    """Compute Newton's step of every edge, with d prescribed."""
    factor = factor_tree(system.tree, edges.response, edges.negative)
    charge = upward_pass(system.tree, factor, edges.charge)
    potential = downward_pass(system.tree, factor, charge, np.zeros((0, 2)))
    offset = state.nodes.offset
    motion = edges.motion.copy()
    mean = np.zeros(2)  # of the opening, times 2π
    for k in range(offset.shape[0] - 1):
        for i in range(offset[k], offset[k + 1]):
            stretch = state.nodes.weight[i] / system.weights[i]
            for column in range(2):
                mean[column] += stretch * charge[i, column]
                for side in range(2):
                    follows = edges.motion_by_potential[i, side]
                    motion[2 * k + side, column] += follows * potential[i, column]
    # weight·mean - 2π compliance·p = 2π d
    weight = device.separation_weight
    by_pressure = weight * mean[1] - 2 * np.pi * device.compliance
    rate = 2 * np.pi / by_pressure  # dp/dd
    negative = factor.negative
    stable = (negative == 0 and by_pressure < 0) or (negative == 1 and by_pressure > 0)
    pressure = -weight * mean[0] / by_pressure
    return NewtonStep(
        step=motion[:, 0] + motion[:, 1] * pressure,
        rate=motion[:, 1] * rate,
        slope=rate if weight != 0 else rate * mean[1] / (2 * np.pi),
        stable=stable,
        change=StepChange(potential[:, 0] + pressure * potential[:, 1], pressure),
    )


@compiled
def openings_between_edges(
    gaps: Array, prescribed: float, orders: Integers, wanted: Integers, model: FieldModel
) -> Array:
    """Compute ∂C_e/∂θ_f between the edges ``wanted`` of many gaps; 0 for e = f."""
    state, system = solve_many(gaps, prescribed, orders, 1, model)
    offset, matrix = state.nodes.offset, state.equations.matrix
    n, count = state.nodes.theta.shape[0], wanted.shape[0]
    work = np.empty(n)
    load = np.zeros((n, count))
    charge = np.zeros((n, count))
    area = np.zeros(count)
    for c in range(count):
        k = wanted[c] // 2
        own = slice(offset[k], offset[k + 1])
        area[c] = _end_charges(
            state.nodes, matrix, wanted[c], model.rules, work, load[own, c], charge[own, c]
        )
    regular = solve_loads(system, offset, load, charge)
    by_edge, _ = openings_by_edges(state, wanted, regular, area, model.rules)
    out = by_edge[wanted]
    for c in range(count):
        out[c, c] = 0.0
    return out
