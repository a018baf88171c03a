"""Response of one gap and its two edges to the potential of the others; compiled.

A moving edge leaves a singular opening (``weight_function``). The edge's own term follows from the
translation of the whole gap through its own loads and the potential of the others.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw, critical_opening
from adhesis.solver.sharp.equilibrium.linear_response import LinearResponse, imbalance_of
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.field.weight_function import end_charges
from adhesis.solver.sharp.gap.conformal_map import LEFT
from adhesis.solver.sharp.gap.quadrature import GaussRules


@compiled
def linearise_gap(out: LinearResponse, k: int, law: EdgeLaw, model: FieldModel) -> None:
    """Compute the response of a gap about its reference."""
    m = out.nodes.offset[k + 1] - out.nodes.offset[k]
    space = np.empty((16, m))  # functions that make no arrays are faster
    loads, solved, singular = space[:5], space[5:10], space[10:12]
    _load_gap(out, k, loads, singular, space[12:], model)
    square = slice(out.tree.response_start[k], out.tree.response_start[k + 1])
    inverse = out.inverse[square].reshape(m, m)
    _apply(inverse, loads, solved)
    out.scaled_opening[out.nodes.offset[k] : out.nodes.offset[k + 1]] = solved[0]
    ends = np.empty((2, 6))
    _open_edges(out, k, solved, ends, model)
    _differentiate_edges(out, k, ends, law, model)
    _charge_edges(out, k, solved, singular, ends[:, 5], model.rules)
    condense_gap(out, k, law.pinning, model.rules)


@compiled_sums
def _apply(inverse: Array, loads: Array, solved: Array) -> None:
    """Multiply every row of ``loads`` by a symmetric matrix."""
    for c in range(loads.shape[0]):
        out = solved[c]
        out[:] = 0.0
        for i in range(loads.shape[1]):
            value, row = loads[c, i], inverse[i]
            for j in range(loads.shape[1]):
                out[j] += value * row[j]


@compiled_sums
def _load_gap(
    out: LinearResponse, k: int, loads: Array, singular: Array, space: Array, model: FieldModel
) -> None:
    """Load a gap by its field, by p, by its motion to the right, and by both ends' openings.

    These leave ``singular`` charges.
    """
    nodes, rules = out.nodes, model.rules
    first, m = nodes.offset[k], loads.shape[1]
    own = slice(first, first + m)
    potential, pressure = out.about[own], out.about_pressure[k]
    start = rules.vector_start[nodes.orders[k]]
    eta, w = rules.eta[start : start + m], rules.weights[start : start + m]
    load, block = out.equations.load[own], out.equations.matrix[own, :m]
    near, smooth = space[:2], space[2]
    _near_potential(out, k, near[0], near[1])
    for i in range(m):
        smooth[i] = potential[i] * w[i] / nodes.weight[first + i] - near[0, i]
    for i in range(m):
        x = nodes.weight[first + i]
        loads[0, i] = -(load[i, 0] + pressure * load[i, 1] + w[i] * potential[i])
        loads[1, i] = load[i, 1]
        loads[2, i] = -(load[i, 2] + x * near[1, i] + w[i] * _by_eta(eta, w, smooth, i))
    for side in range(2):
        end_charges(nodes, block, 2 * k + side, rules, space[3], loads[3 + side], singular[side])


@compiled_sums
def _near_potential(out: LinearResponse, k: int, own: Array, slope: Array) -> None:
    """Compute the potential g of both neighbours at the nodes of a gap, and its derivative by θ.

    They change it most sharply. Without them the derivative of the interpolated potential is more
    accurate, for uneven gaps by an order of magnitude.
    """
    nodes, opening = out.nodes, out.scaled_opening
    offset, sine, cosine = nodes.offset, nodes.sine, nodes.cosine
    count = nodes.orders.shape[0]
    own[:] = 0.0
    slope[:] = 0.0
    for side in range(min(2, count - 1)):
        other = (k - 1 + 2 * side) % count
        for j in range(offset[other], offset[other + 1]):
            charge = nodes.weight[j] * opening[j] / (4 * np.pi)
            for i in range(own.shape[0]):
                node = offset[k] + i
                pole = 1 / (sine[node] * cosine[j] - cosine[node] * sine[j])
                value = charge * pole * pole
                own[i] -= value
                slope[i] += value * (cosine[node] * cosine[j] + sine[node] * sine[j]) * pole


@compiled_sums
def _by_eta(eta: Array, w: Array, potential: Array, i: int) -> float:
    """Compute the derivative by η of a potential g at node i of a gap."""
    total = 0.0
    sign = 1.0 if i % 2 == 0 else -1.0
    for j in range(eta.shape[0]):
        if j != i:
            share = (1.0 if j % 2 == 0 else -1.0) * sign * w[j] / w[i]
            total += share * (potential[j] - potential[i]) / (eta[i] - eta[j])
    return total


@compiled_sums
def _open_edges(out: LinearResponse, k: int, solved: Array, ends: Array, model: FieldModel) -> None:
    """Compute C at both edges of a gap by its loads and by potentials, and the edges' strength.

    ``ends`` has a row for each edge: C by each load, and the strength of its singular opening.
    """
    nodes, rules = out.nodes, model.rules
    first, m = nodes.offset[k], solved.shape[1]
    start = rules.vector_start[nodes.orders[k]]
    square = slice(out.tree.response_start[k], out.tree.response_start[k + 1])
    inverse, end_terms = out.inverse[square].reshape(m, m), out.equations.end_terms
    by_potential = out.opening_by_potential
    for side in range(2):
        scale = np.sqrt(2 * nodes.slope[k, side])
        for c in range(5):
            total = 0.0
            for i in range(m):
                total += rules.end_values[side, start + i] * solved[c, i]
            ends[side, c] = scale * total
        ends[side, 0] -= scale * end_terms[k, side, 0]
        ends[side, 2] -= scale * end_terms[k, side, 1]
        ends[side, 5] = -ends[side, 0] * np.sqrt(nodes.slope[k, side] / 8)
        for j in range(m):
            by_potential[first + j, side] = 0.0
        for i in range(m):
            value, row = scale * rules.end_values[side, start + i], inverse[i]
            for j in range(m):
                by_potential[first + j, side] += value * row[j]
        for j in range(m):
            by_potential[first + j, side] *= rules.weights[start + j]


@compiled
def _differentiate_edges(
    out: LinearResponse, k: int, ends: Array, law: EdgeLaw, model: FieldModel
) -> None:
    """Compute ∂(C_e - C_c)/∂n_f between both edges of a gap in the potential of the others."""
    nodes = out.nodes
    for side in range(2):
        e = 2 * k + side
        critical, drift = critical_opening(nodes.table[k, LEFT + side], law, model.panels)
        out.opening[e], out.opening_by_pressure[e] = ends[side, 0], ends[side, 1]
        out.residual[e] = ends[side, 0] - critical
        far = ends[side, 4 - side] + np.sqrt(nodes.slope[k, side] / 2)
        out.tangent[e, 1 - side] = far * ends[1 - side, 5]
        # the sum over both edges is the motion of the gap
        sign = 1 - 2 * side
        out.drift[e] = sign * drift
        out.tangent[e, side] = sign * (ends[side, 2] - drift) + out.tangent[e, 1 - side]


@compiled_sums
def _charge_edges(
    out: LinearResponse, k: int, solved: Array, singular: Array, strength: Array, rules: GaussRules
) -> None:
    """Compute the charges of a gap at held edges, by a unit of p, and by each edge's motion."""
    first, m = out.nodes.offset[k], solved.shape[1]
    start = rules.vector_start[out.nodes.orders[k]]
    w = rules.weights[start : start + m]
    for i in range(m):
        out.held_charge[first + i, 0] = w[i] * solved[0, i]
        out.held_charge[first + i, 1] = -w[i] * solved[1, i]
        for side in range(2):
            part = strength[side] * (w[i] * solved[3 + side, i] + singular[side, i])
            out.charge_by_edge[first + i, side] = part


@compiled_sums
def condense_gap(out: LinearResponse, k: int, pinning: float, rules: GaussRules) -> None:
    """Eliminate the motions of a gap's edges: its charges and edges by potentials and p.

    Edges that are held stay where they are.
    """
    first, behind = out.nodes.offset[k], out.nodes.offset[k + 1]
    m = behind - first
    compliance, motion = out.compliance[2 * k : 2 * k + 2], out.motion[2 * k : 2 * k + 2]
    tangent, pressure = out.tangent[2 * k : 2 * k + 2], out.about_pressure[k]
    held, here = out.held[2 * k : 2 * k + 2], out.here[2 * k : 2 * k + 2]
    compliance[:] = 0.0
    negative, nearest = 0, 1.0
    residual0, a = imbalance_of(out, 2 * k, pinning)
    residual1, d = imbalance_of(out, 2 * k + 1, pinning)
    b, c = tangent[0, 1], tangent[1, 0]
    if not (held[0] or held[1]):
        det = a * d - b * c
        compliance[0, 0], compliance[0, 1] = d / det, -b / det
        compliance[1, 0], compliance[1, 1] = -c / det, a / det
        negative = 1
        if not det < 0:
            negative = 2 if a + d < 0 else 0
        nearest = abs(det) / (abs(a * d) + abs(b * c))
    else:
        for side in range(2):
            if not held[side]:
                own = a if side == 0 else d
                compliance[side, side] = 1 / own
                negative = 1 if own < 0 else 0
    out.factor.negative[k], out.factor.nearest[k] = negative, nearest
    pull0 = -residual0 - a * here[0] - b * here[1]
    pull1 = -residual1 - c * here[0] - d * here[1]
    by_pressure, by_potential = out.opening_by_pressure, out.opening_by_potential
    potential, follows = out.about[first:behind], out.motion_by_potential[first:behind]
    for side in range(2):
        x, y = compliance[side, 0], compliance[side, 1]
        alone = here[side] + x * pull0 + y * pull1
        out.isolated_correction[2 * k + side] = alone
        motion[side, 1] = x * by_pressure[2 * k] + y * by_pressure[2 * k + 1]
        motion[side, 0] = alone - motion[side, 1] * pressure
        for j in range(m):
            value = x * by_potential[first + j, 0] + y * by_potential[first + j, 1]
            follows[j, side] = value
            motion[side, 0] -= value * potential[j]
    start = rules.vector_start[out.nodes.orders[k]]
    w = rules.weights[start : start + m]
    square = slice(out.tree.response_start[k], out.tree.response_start[k + 1])
    inverse, response = out.inverse[square], out.factor.response[square]
    charge, by_edge = out.charges.isolated, out.charge_by_edge[first:behind]
    stretch = out.tree.stretch[first:behind]
    for i in range(m):
        row, inverse_row = response[i * m : (i + 1) * m], inverse[i * m : (i + 1) * m]
        of_left, of_right = by_edge[i, 0], by_edge[i, 1]
        by_left, by_right, weight = follows[i, 0], follows[i, 1], w[i]
        total = 0.0
        mean = 0.0
        for j in range(m):
            value = weight * inverse_row[j] * w[j]
            value -= 0.5 * (of_left * follows[j, 0] + by_edge[j, 0] * by_left)
            value -= 0.5 * (of_right * follows[j, 1] + by_edge[j, 1] * by_right)
            row[j] = value
        for j in range(m):
            total += row[j] * potential[j]
            mean += row[j] * stretch[j]
        out.mean_by_potential[first + i] = mean
        by_p = out.held_charge[first + i, 1] + of_left * motion[0, 1] + of_right * motion[1, 1]
        alone = of_left * out.isolated_correction[2 * k]
        alone += of_right * out.isolated_correction[2 * k + 1]
        charge[1, first + i] = by_p
        charge[0, first + i] = out.held_charge[first + i, 0] + alone - pressure * by_p + total
