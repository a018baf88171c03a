"""Response of one gap and its two edges to the potential of the others; compiled.

A moving edge leaves a singular opening (``weight_function``). The edge's own term follows from the
translation of the whole gap through its own loads and the potential of the others.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.equilibrium.edge_interaction import end_charges
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import critical_opening
from adhesis.solver.sharp.equilibrium.linear_response import LinearResponse
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.conformal_map import LEFT
from adhesis.solver.sharp.gap.quadrature import GaussRules


@compiled
def linearise_gap(out: LinearResponse, k: int, law: EdgeLaw, model: FieldModel) -> None:
    """Compute the response of a gap about its reference."""
    m = out.nodes.offset[k + 1] - out.nodes.offset[k]
    space = np.empty((18, m))  # functions that make no arrays are faster
    loads, solved, singular, by_potential = space[:5], space[5:10], space[10:12], space[12:14]
    _load_gap(out, k, loads, singular, space[14:], model)
    square = slice(out.tree.response_start[k], out.tree.response_start[k + 1])
    inverse = out.inverse[square].reshape(m, m)
    _apply(inverse, loads, solved)
    out.scaled_opening[out.nodes.offset[k] : out.nodes.offset[k + 1]] = solved[0]
    ends = np.empty((2, 10))
    opening, strength = ends[:, :5], ends[:, 5]
    _open_edges(out, k, solved, opening, by_potential, strength, model)
    _move_gap(out, k, opening, by_potential, strength, ends[:, 6:], law, model)
    _charge_gap(out, k, solved, singular, strength, space[14:16], model.rules)


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
def _open_edges(
    out: LinearResponse,
    k: int,
    solved: Array,
    opening: Array,
    by_potential: Array,
    strength: Array,
    model: FieldModel,
) -> None:
    """Compute C at both edges of a gap by its loads and by potentials, and their ``strength``."""
    nodes, rules = out.nodes, model.rules
    m = solved.shape[1]
    start = rules.vector_start[nodes.orders[k]]
    square = slice(out.tree.response_start[k], out.tree.response_start[k + 1])
    inverse, end_terms = out.inverse[square].reshape(m, m), out.equations.end_terms
    for side in range(2):
        scale = np.sqrt(2 * nodes.slope[k, side])
        for c in range(5):
            total = 0.0
            for i in range(m):
                total += rules.end_values[side, start + i] * solved[c, i]
            opening[side, c] = scale * total
        opening[side, 0] -= scale * end_terms[k, side, 0]
        opening[side, 2] -= scale * end_terms[k, side, 1]
        strength[side] = -opening[side, 0] * np.sqrt(nodes.slope[k, side] / 8)
        follows = by_potential[side]
        follows[:] = 0.0
        for i in range(m):
            value, row = scale * rules.end_values[side, start + i], inverse[i]
            for j in range(m):
                follows[j] += value * row[j]
        for j in range(m):
            follows[j] *= rules.weights[start + j]


@compiled
def _move_gap(
    out: LinearResponse,
    k: int,
    opening: Array,
    by_potential: Array,
    strength: Array,
    space: Array,
    law: EdgeLaw,
    model: FieldModel,
) -> None:
    """Compute how the edges of a gap follow potentials and p, from their tangent."""
    nodes = out.nodes
    own = slice(nodes.offset[k], nodes.offset[k + 1])
    potential, pressure = out.about[own], out.about_pressure[k]
    residual = out.residual[2 * k : 2 * k + 2]
    # ∂(C_e - C_c)/∂n_f in the potential of the others, and its inverse
    tangent, compliance = space[:, :2], space[:, 2:]
    for side in range(2):
        place = nodes.table[k, LEFT + side]
        critical, drift = critical_opening(place, law, model.panels)
        residual[side] = opening[side, 0] - critical
        far = opening[side, 4 - side] + np.sqrt(nodes.slope[k, side] / 2)
        tangent[side, 1 - side] = far * strength[1 - side]
        # the sum over both edges is the motion of the gap
        sign = 1 - 2 * side
        tangent[side, side] = sign * (opening[side, 2] - drift) + tangent[side, 1 - side]
    out.factor.negative[k] = _invert_tangent(tangent, compliance)
    if out.held[k]:
        compliance[:] = 0.0
        out.factor.negative[k] = 0
    motion, follows = out.motion[2 * k : 2 * k + 2], out.motion_by_potential[own]
    for side in range(2):
        a, b = compliance[side, 0], compliance[side, 1]
        out.isolated_correction[2 * k + side] = -(a * residual[0] + b * residual[1])
        motion[side, 1] = a * opening[0, 1] + b * opening[1, 1]
        motion[side, 0] = out.isolated_correction[2 * k + side] - motion[side, 1] * pressure
        for j in range(potential.shape[0]):
            follows[j, side] = a * by_potential[0, j] + b * by_potential[1, j]
            motion[side, 0] -= follows[j, side] * potential[j]


@compiled
def _invert_tangent(tangent: Array, inverse: Array) -> int:
    """Invert a 2×2 matrix, and count its negative eigenvalues."""
    det = tangent[0, 0] * tangent[1, 1] - tangent[0, 1] * tangent[1, 0]
    inverse[0, 0] = tangent[1, 1] / det
    inverse[1, 1] = tangent[0, 0] / det
    inverse[0, 1] = -tangent[0, 1] / det
    inverse[1, 0] = -tangent[1, 0] / det
    if det < 0:
        return 1
    return 2 if tangent[0, 0] + tangent[1, 1] < 0 else 0


@compiled_sums
def _charge_gap(
    out: LinearResponse,
    k: int,
    solved: Array,
    singular: Array,
    strength: Array,
    moving: Array,
    rules: GaussRules,
) -> None:
    """Compute the charges of a gap, and their response, from its edges' motions."""
    first, m = out.nodes.offset[k], solved.shape[1]
    own = slice(first, first + m)
    potential, pressure = out.about[own], out.about_pressure[k]
    start = rules.vector_start[out.nodes.orders[k]]
    w = rules.weights[start : start + m]
    square = slice(out.tree.response_start[k], out.tree.response_start[k + 1])
    inverse, response = out.inverse[square], out.factor.response[square]
    charge, motion, follows = out.charges.isolated, out.motion, out.motion_by_potential[own]
    for i in range(m):
        charge[1, first + i] = -w[i] * solved[1, i]
        charge[0, first + i] = w[i] * solved[0, i]
        for side in range(2):
            part = strength[side] * (w[i] * solved[3 + side, i] + singular[side, i])
            moving[side, i] = part
            charge[1, first + i] += part * motion[2 * k + side, 1]
            charge[0, first + i] += part * out.isolated_correction[2 * k + side]
        charge[0, first + i] -= pressure * charge[1, first + i]
    left, right = moving[0], moving[1]
    stretch = out.tree.stretch[own]
    for i in range(m):
        row, solved_row = response[i * m : (i + 1) * m], inverse[i * m : (i + 1) * m]
        total = 0.0
        mean = 0.0
        for j in range(m):
            value = w[i] * solved_row[j] * w[j]
            value -= 0.5 * (left[i] * follows[j, 0] + left[j] * follows[i, 0])
            value -= 0.5 * (right[i] * follows[j, 1] + right[j] * follows[i, 1])
            row[j] = value
        for j in range(m):
            total += row[j] * potential[j]
            mean += row[j] * stretch[j]
        charge[0, first + i] += total
        out.mean_by_potential[first + i] = mean
