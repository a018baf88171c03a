"""Linear response of many gaps and their edges, which lasts while edges move little; compiled.

An edge follows its own opening: C_e = C_c at each. Between given edges and in a given potential of
the others every gap is solved by itself, with the motions of its two edges eliminated (static
condensation): about these edges, its reference, it responds to potentials g and a mean stress p by

    q = q0 + p q1 - R g,        n = n0 + p n1 + M g,

its charges and the motions of its edges. The tree (``cluster_tree``) solves for all gaps and all
edges together. While edges move little from their reference, the response stays; where they move
further, that of their gap and of the runs that hold it is renewed. So a state next to a known one
costs what differs, and one step of Newton's iteration of all edges one pass.

A moving edge leaves a singular opening (``weight_function``) and, in translation of the whole gap
through the potential of the others, the edge's own term.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_interaction import end_charges
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw, critical_opening, raise_orders
from adhesis.solver.sharp.field.assembly import assemble_some, fill_gaps
from adhesis.solver.sharp.field.cluster_tree import (
    Charges,
    Tree,
    TreeFactor,
    build_tree,
    charge_run,
    downward_pass,
    empty_factor,
    factor_run,
    replace_run,
    whole_tree,
)
from adhesis.solver.sharp.field.hierarchical_solver import (
    gap_potentials,
    invert_block,
    solve_many,
)
from adhesis.solver.sharp.field.separate_gaps import interpolate_potential
from adhesis.solver.sharp.field.solution import Equations, FieldModel, LoadingDevice, Nodes
from adhesis.solver.sharp.gap.conformal_map import (
    LEFT,
    LEFT_PATCH,
    RIGHT,
    convergence_rate,
    in_order,
    map_gaps,
)
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers, choose_orders
from adhesis.solver.sharp.tolerances import (
    FURTHER_ORDERS,
    REFERENCE_BALANCE,
    REFERENCE_FAR,
    REFERENCE_MOST_FAR,
    REFERENCE_PATCH,
    REFERENCE_SCALE,
    REFERENCE_SHARE,
    SOFT_RATE,
)

Flags = NDArray[np.bool_]


class LinearResponse(NamedTuple):
    """Linear response of all gaps, each about edges of its own; its arrays are changed in place.

    Attributes
    ----------
    nodes : Nodes
        Between the reference edges.
    equations : Equations
        Diagonal blocks, with S and S'.
    inverse : array
        Inverse blocks, flat.
    tree : Tree
    factor : TreeFactor
    charges : Charges
        Without potentials and p, and by a unit of p (two rows).
    held : bool array, shape (L,)
        Gaps whose edges are held.
    about, about_pressure : array, shape (N,) and (L,)
        Potentials and p of the references.
    scaled_opening : array, shape (N,)
        f there.
    residual, balancing : array, shape (2L,)
        C_e - C_c in the reference, and the motion that would balance its gap by itself.
    motion : array, shape (2L, 2)
        Motions of its edges without potentials and p, and by a unit of p.
    motion_by_potential : array, shape (N, 2)
        Motion of both edges of a gap by the potential at each of its nodes.
    potential : array, shape (2, nodes of all runs)
        Of the last solution, without p and by a unit of p.
    mean : array, shape (2,)
        Its mean opening, times 2π, likewise.
    softness : array, shape (L,)
        Rate dn/dd of each gap's edges, or their neighbours', over that from which on gaps are soft.
    """

    nodes: Nodes
    equations: Equations
    inverse: Array
    tree: Tree
    factor: TreeFactor
    charges: Charges
    held: Flags
    about: Array
    about_pressure: Array
    scaled_opening: Array
    residual: Array
    balancing: Array
    motion: Array
    motion_by_potential: Array
    potential: Array
    mean: Array
    softness: Array


class ResponseSolution(NamedTuple):
    """All edges as the linear response has them at a prescribed quantity d.

    Attributes
    ----------
    motion, rate : array, shape (2L,)
        Outward motion n from the reference, and dn/dd along the branch.
    pressure, separation : float
        p and q0 s.
    slope : float
        dY/dd along the branch: Y is p, under a load q0 s.
    stable : bool
        Whether the edges are stable.
    """

    motion: Array
    rate: Array
    pressure: float
    separation: float
    slope: float
    stable: bool


@compiled
def no_motion(gaps: int) -> ResponseSolution:
    """Make a solution in which no edge moves."""
    none = np.zeros(2 * gaps)
    return ResponseSolution(none, none, np.nan, np.nan, np.nan, False)


@compiled
def _allocate(nodes: Nodes, equations: Equations, tree: Tree, factor: TreeFactor) -> LinearResponse:
    """Allocate a response; its fields that are not given are zero."""
    count, n = nodes.orders.shape[0], nodes.theta.shape[0]
    size = tree.node_start[tree.rank.shape[0]]
    return LinearResponse(
        nodes=nodes,
        equations=equations,
        inverse=np.zeros(tree.response_start[count]),
        tree=tree,
        factor=factor,
        charges=Charges(np.zeros((2, size)), np.zeros((2, size))),
        held=np.zeros(count, dtype=np.bool_),
        about=np.zeros(n),
        about_pressure=np.zeros(count),
        scaled_opening=np.zeros(n),
        residual=np.zeros(2 * count),
        balancing=np.zeros(2 * count),
        motion=np.zeros((2 * count, 2)),
        motion_by_potential=np.zeros((n, 2)),
        potential=np.zeros((2, size)),
        mean=np.zeros(2),
        softness=np.ones(count),
    )


@compiled_for_both
def respond(
    gaps: Array, prescribed: float, orders: Integers, law: EdgeLaw, model: FieldModel
) -> tuple[LinearResponse, bool]:
    """Solve the field of these gaps, and linearise about it; returns whether there is a field."""
    state, system = solve_many(gaps, prescribed, orders, 2, model)
    nodes = state.nodes
    count, n = gaps.shape[0], state.nodes.theta.shape[0]
    out = _allocate(nodes, state.equations, system.tree, system.factor)
    if not np.isfinite(state.pressure):
        return out, False
    out.inverse[:] = system.inverse
    out.about[:] = gap_potentials(state, system.weights)
    out.about_pressure[:] = state.pressure
    out.scaled_opening[:] = state.scaled_opening
    out.potential[0, :n] = out.about
    for i in range(n):
        out.mean[0] += nodes.weight[i] * state.scaled_opening[i]
    out.mean[1] = -state.mean.unit_mean
    out.mean[0] -= state.pressure * out.mean[1]
    changed = np.ones(count, dtype=np.bool_)
    for k in range(count):
        _linearise_gap(out, k, law, model)
    _factor_runs(out, changed)
    return out, True


@compiled
def _known_gaps(known: LinearResponse, table: Array, law: EdgeLaw, model: FieldModel) -> Integers:
    """Find the gaps of a response that serve for these of a table, one for each; -1 for none."""
    rows, counts = known.nodes.table, model.rules.counts
    found = np.full(table.shape[0], -1)
    j = 0
    for k in range(table.shape[0]):
        while j < rows.shape[0] - 1 and not rows[j, RIGHT] > table[k, LEFT]:
            j += 1
        order = known.nodes.orders[j]
        wanted = model.digits / convergence_rate(table[k])
        if counts[order] < wanted and order < counts.shape[0] - 1:
            continue
        changed, _ = _has_departed(rows[j], table[k], 1.0, law)
        if not changed:
            found[k] = j
    return found


@compiled_for_both
def respond_again(
    known: LinearResponse,
    gaps: Array,
    prescribed: float,
    least: Integers,
    law: EdgeLaw,
    model: FieldModel,
) -> tuple[LinearResponse, bool]:
    """Set up the response of gaps of which most are those of another; as :func:`respond`."""
    table = map_gaps(gaps)
    orders = raise_orders(choose_orders(table, model.digits, model.rules.counts), least)
    source = _known_gaps(known, table, law, model)
    fresh = source < 0
    if not in_order(table) or fresh.sum() > REFERENCE_MOST_FAR * fresh.shape[0]:
        return respond(gaps, prescribed, orders, law, model)
    for k in range(source.shape[0]):
        if source[k] < 0:  # where something moves it goes on
            most = model.rules.counts.shape[0] - 1
            orders[k] = min(orders[k] + FURTHER_ORDERS, most)
        else:
            table[k] = known.nodes.table[source[k]]
            orders[k] = known.nodes.orders[source[k]]
    nodes, equations = assemble_some(table, orders, source, known.nodes, known.equations, model)
    offset, n = nodes.offset, nodes.theta.shape[0]
    stretch = np.empty(n)
    for k in range(orders.shape[0]):
        start = model.rules.vector_start[orders[k]] - offset[k]
        for i in range(offset[k], offset[k + 1]):
            stretch[i] = nodes.weight[i] / model.rules.weights[start + i]
    tree = build_tree(table, offset, nodes.theta, stretch, model.digits, True)
    out = _allocate(nodes, equations, tree, empty_factor(tree))
    out.held[:] = fresh
    for k in range(orders.shape[0]):
        own = slice(offset[k], offset[k + 1])
        square = slice(tree.response_start[k], tree.response_start[k + 1])
        if fresh[k]:
            block = equations.matrix[own, : offset[k + 1] - offset[k]]
            if not invert_block(block, out.inverse[square]):
                return out, False
            _linearise_gap(out, k, law, model)
        else:
            _copy_gap(known, source[k], out, k)
    _factor_runs(out, np.ones(orders.shape[0], dtype=np.bool_))
    pressure = solve_response(out, prescribed, model.device).pressure
    if not np.isfinite(pressure):
        return out, False
    for k in range(fresh.shape[0]):
        if fresh[k]:
            _linearise_here(out, k, pressure, law, model)
    _factor_runs(out, fresh)
    return out, True


@compiled
def _copy_gap(known: LinearResponse, j: int, out: LinearResponse, k: int) -> None:
    """Copy the response of a gap by itself."""
    theirs = slice(known.nodes.offset[j], known.nodes.offset[j + 1])
    own = slice(out.nodes.offset[k], out.nodes.offset[k + 1])
    square = slice(known.tree.response_start[j], known.tree.response_start[j + 1])
    here = slice(out.tree.response_start[k], out.tree.response_start[k + 1])
    out.inverse[here] = known.inverse[square]
    out.factor.response[here] = known.factor.response[square]
    out.factor.negative[k] = known.factor.negative[j]
    out.charges.isolated[:, own] = known.charges.isolated[:, theirs]
    out.held[k] = known.held[j]
    out.about[own] = known.about[theirs]
    out.about_pressure[k] = known.about_pressure[j]
    out.scaled_opening[own] = known.scaled_opening[theirs]
    for side in range(2):
        out.residual[2 * k + side] = known.residual[2 * j + side]
        out.balancing[2 * k + side] = known.balancing[2 * j + side]
        out.motion[2 * k + side] = known.motion[2 * j + side]
    out.motion_by_potential[own] = known.motion_by_potential[theirs]


@compiled
def _factor_runs(response: LinearResponse, changed: Flags) -> None:
    """Compute the responses and charges of all runs that hold gaps that have changed."""
    tree, count = response.tree, changed.shape[0]
    renewed = np.zeros(tree.rank.shape[0], dtype=np.bool_)
    renewed[:count] = changed
    work = np.empty((2, tree.rank.max()))
    for run in range(count, renewed.shape[0]):
        if renewed[tree.children[run, 0]] or renewed[tree.children[run, 1]]:
            renewed[run] = True
            factor_run(tree, response.factor, run)
            charge_run(tree, response.factor, run, response.charges, work)


@compiled
def _linearise_here(
    response: LinearResponse, k: int, pressure: float, law: EdgeLaw, model: FieldModel
) -> None:
    """Take a gap's potential in the last solution as its reference, and let its edges follow."""
    offset, potential = response.nodes.offset, response.potential
    response.held[k] = False
    response.about_pressure[k] = pressure
    for i in range(offset[k], offset[k + 1]):
        response.about[i] = potential[0, i] + pressure * potential[1, i]
    _linearise_gap(response, k, law, model)


@compiled
def _near_potential(out: LinearResponse, k: int, own: Array, slope: Array) -> None:
    """Compute the potential g of both neighbours at the nodes of a gap, and its derivative by θ.

    They change it most sharply: without them the derivative of the interpolated potential is
    exacter by an order of magnitude.
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
                half = sine[node] * cosine[j] - cosine[node] * sine[j]
                value = charge / (half * half)
                own[i] -= value
                slope[i] += value * (cosine[node] * cosine[j] + sine[node] * sine[j]) / half


@compiled
def _by_eta(eta: Array, w: Array, potential: Array, i: int) -> float:
    """Compute the derivative by η of a potential g at node i of a gap."""
    total = 0.0
    sign = 1.0 if i % 2 == 0 else -1.0
    for j in range(eta.shape[0]):
        if j != i:
            share = (1.0 if j % 2 == 0 else -1.0) * sign * w[j] / w[i]
            total += share * (potential[j] - potential[i]) / (eta[i] - eta[j])
    return total


@compiled
def _linearise_gap(out: LinearResponse, k: int, law: EdgeLaw, model: FieldModel) -> None:
    """Compute the response of a gap about its reference."""
    m = out.nodes.offset[k + 1] - out.nodes.offset[k]
    space = np.empty((18, m))  # functions that make no arrays are faster
    loads, solved, singular, by_potential = space[:5], space[5:10], space[10:12], space[12:14]
    _load_gap(out, k, loads, singular, space[14:], model)
    square = slice(out.tree.response_start[k], out.tree.response_start[k + 1])
    inverse = out.inverse[square].reshape(m, m)
    for c in range(5):
        for i in range(m):
            total = 0.0
            for j in range(m):
                total += inverse[i, j] * loads[c, j]
            solved[c, i] = total
    out.scaled_opening[out.nodes.offset[k] : out.nodes.offset[k + 1]] = solved[0]
    ends = np.empty((2, 10))
    opening, strength = ends[:, :5], ends[:, 5]
    _open_edges(out, k, solved, opening, by_potential, strength, model)
    _move_gap(out, k, opening, by_potential, strength, ends[:, 6:], law, model)
    _charge_gap(out, k, solved, singular, strength, space[14:16], model.rules)


@compiled
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


@compiled
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
        for j in range(m):
            total = 0.0
            for i in range(m):
                total += rules.end_values[side, start + i] * inverse[i, j]
            by_potential[side, j] = scale * total * rules.weights[start + j]


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
    tangent, compliance = (
        space[:, :2],
        space[:, 2:],
    )  # ∂(C_e - C_c)/∂n_f in the potential of the others
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
        out.balancing[2 * k + side] = -(a * residual[0] + b * residual[1])
        motion[side, 1] = a * opening[0, 1] + b * opening[1, 1]
        motion[side, 0] = out.balancing[2 * k + side] - motion[side, 1] * pressure
        for j in range(potential.shape[0]):
            follows[j, side] = a * by_potential[0, j] + b * by_potential[1, j]
            motion[side, 0] -= follows[j, side] * potential[j]


@compiled
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
            charge[0, first + i] += part * out.balancing[2 * k + side]
        charge[0, first + i] -= pressure * charge[1, first + i]
    for i in range(m):
        for j in range(m):
            value = w[i] * inverse[i * m + j] * w[j]
            for side in range(2):
                value -= 0.5 * moving[side, i] * follows[j, side]
                value -= 0.5 * moving[side, j] * follows[i, side]
            response[i * m + j] = value
            charge[0, first + i] += value * potential[j]


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


@compiled_for_both
def solve_response(
    response: LinearResponse, prescribed: float, device: LoadingDevice
) -> ResponseSolution:
    """Solve for all edges, with d prescribed."""
    tree, nodes = response.tree, response.nodes
    count, n = nodes.orders.shape[0], nodes.theta.shape[0]
    charge, potential = response.charges.coupled.copy(), response.potential
    downward_pass(tree, response.factor, whole_tree(tree), charge, potential)
    mean = response.mean
    mean[:] = 0.0
    for column in range(2):
        for i in range(n):
            mean[column] += tree.stretch[i] * charge[column, i]
    motion = motion_in(response, potential, np.ones(count, dtype=np.bool_))
    # weight·mean - 2π compliance·p = 2π d
    weight = device.separation_weight
    by_pressure = weight * mean[1] - 2 * np.pi * device.compliance
    pressure = pressure_at(response, prescribed, device)
    rate = 2 * np.pi / by_pressure  # dp/dd
    separation = prescribed
    if device.compliance != 0:
        separation = (mean[0] + pressure * mean[1]) / (2 * np.pi)
    negative = response.factor.negative[-1]
    rates = motion[:, 1] * rate
    _note_softness(response.softness, rates)
    return ResponseSolution(
        motion=motion[:, 0] + pressure * motion[:, 1],
        rate=rates,
        pressure=pressure,
        separation=separation,
        slope=rate if weight != 0 else rate * mean[1] / (2 * np.pi),
        stable=(negative == 0 and by_pressure < 0) or (negative == 1 and by_pressure > 0),
    )


@compiled
def _note_softness(softness: Array, rate: Array) -> None:
    """Compute how soft each gap is by its largest rate, or its neighbours'."""
    count = softness.shape[0]
    mean = np.abs(rate).mean()
    for k in range(count):
        largest = 0.0
        for beside in range(-1, 2):
            j = (k + beside) % count
            largest = max(largest, abs(rate[2 * j]), abs(rate[2 * j + 1]))
        softness[k] = max(largest / (SOFT_RATE * mean), 1.0)


@compiled
def pressure_at(response: LinearResponse, prescribed: float, device: LoadingDevice) -> float:
    """Compute p with d prescribed, by the mean openings of the last solution."""
    weight, mean = device.separation_weight, response.mean
    by_pressure = weight * mean[1] - 2 * np.pi * device.compliance
    pressure: float = (2 * np.pi * prescribed - weight * mean[0]) / by_pressure
    return pressure


@compiled
def motion_in(response: LinearResponse, potential: Array, wanted: Flags) -> Array:
    """Compute the motions of some gaps' edges, shape (2L, 2): in potentials, and by a unit of p.

    The potentials have one row, or a second for those by a unit of p.
    """
    offset, follows = response.nodes.offset, response.motion_by_potential
    motion = response.motion.copy()
    for k in range(wanted.shape[0]):
        if wanted[k]:
            for i in range(offset[k], offset[k + 1]):
                for column in range(potential.shape[0]):
                    g = potential[column, i]
                    motion[2 * k, column] += follows[i, 0] * g
                    motion[2 * k + 1, column] += follows[i, 1] * g
    return motion


@compiled
def moved_gaps(response: LinearResponse, motion: Array) -> Array:
    """Return the gaps whose edges have moved so far outwards from their references."""
    table = response.nodes.table
    out = np.empty((table.shape[0], 2))
    for k in range(out.shape[0]):
        out[k, 0] = table[k, LEFT] + motion[2 * k]
        out[k, 1] = table[k, RIGHT] - motion[2 * k + 1]
    return out


@compiled
def motion_to(response: LinearResponse, gaps: Array) -> Array:
    """Compute the motion of all edges outwards from their references to these."""
    table = response.nodes.table
    motion = np.empty(gaps.size)
    for k in range(gaps.shape[0]):
        motion[2 * k] = gaps[k, 0] - table[k, LEFT]
        motion[2 * k + 1] = table[k, RIGHT] - gaps[k, 1]
    return motion


@compiled
def _has_departed(known: Array, row: Array, softness: float, law: EdgeLaw) -> tuple[bool, bool]:
    """Return whether a gap, by its row of the table, has departed from its reference, and far.

    The response is wrong to second order, in which the motion squared over the gap or the patch
    beside it may be the error of the field; the less the softer the gap is: next to a fold.
    """
    length = known[RIGHT] - known[LEFT]
    changed, far = False, False
    for side in range(2):
        moved = abs(row[LEFT + side] - known[LEFT + side])
        before, patch = known[LEFT_PATCH + side], row[LEFT_PATCH + side]
        least = min(length, before)
        # not written as > : references that are no numbers are no references
        scale = min(least, REFERENCE_SCALE * law.longest_step)
        allowed = min(np.sqrt(law.field_error * scale) / softness**2, REFERENCE_SHARE * least)
        if not moved <= max(law.newton_tolerance, allowed):
            changed = True
        if not moved <= REFERENCE_FAR * least:
            far = True
        if not abs(patch - before) <= REFERENCE_PATCH * min(before, patch):
            changed = True
    return changed, far


@compiled
def departed(response: LinearResponse, table: Array, law: EdgeLaw) -> tuple[Flags, Flags]:
    """Mark the gaps whose reference is to be renewed for the edges of a table, and far other ones.

    That is where edges have left it, or were out of balance in it.
    """
    count = table.shape[0]
    changed = np.zeros(count, dtype=np.bool_)
    far = np.zeros(count, dtype=np.bool_)
    for k in range(count):
        known, softness = response.nodes.table[k], response.softness[k]
        changed[k], far[k] = _has_departed(known, table[k], softness, law)
        # in other potentials than those of its reference its edges follow otherwise
        for e in range(2 * k, 2 * k + 2):
            if abs(response.residual[e]) * softness > REFERENCE_BALANCE * law.critical > 0:
                changed[k] = True
    return changed, far


@compiled
def _renew_gap(
    response: LinearResponse, k: int, row: Array, pressure: float, law: EdgeLaw, model: FieldModel
) -> bool:
    """Move the reference of a gap, filled in already, with the potential there; ``row`` is the old.

    Returns whether it has a field.
    """
    nodes, tree, rules = response.nodes, response.tree, model.rules
    first, m = nodes.offset[k], nodes.offset[k + 1] - nodes.offset[k]
    start = rules.vector_start[nodes.orders[k]]
    eta, w = rules.eta[start : start + m], rules.weights[start : start + m]
    known = np.empty(m)
    response.about_pressure[k] = pressure
    for i in range(m):
        known[i] = response.potential[0, first + i] + pressure * response.potential[1, first + i]
    for i in range(m):
        stretch = nodes.weight[first + i] / w[i]
        tree.theta[first + i], tree.stretch[first + i] = nodes.theta[first + i], stretch
        there = interpolate_potential(row, eta, w, known, nodes.theta[first + i])
        response.about[first + i] = stretch * there
    tree.rows[k] = nodes.table[k]
    square = slice(tree.response_start[k], tree.response_start[k + 1])
    block = response.equations.matrix[first : first + m, :m]
    if not invert_block(block, response.inverse[square]):
        nodes.table[k] = np.nan  # serves for no other
        return False
    _linearise_gap(response, k, law, model)
    return True


@compiled
def _replace_runs(response: LinearResponse, changed: Flags, model: FieldModel) -> bool:
    """Place the runs anew that hold gaps that have changed.

    Returns whether they have enough charges.
    """
    tree = response.tree
    renewed = np.zeros(tree.rank.shape[0], dtype=np.bool_)
    renewed[: changed.shape[0]] = changed
    for run in range(changed.shape[0], renewed.shape[0]):
        if renewed[tree.children[run, 0]] or renewed[tree.children[run, 1]]:
            renewed[run] = True
            if not replace_run(tree, run, response.nodes.table, model.digits):
                return False
    return True


@compiled
def move_references(
    response: LinearResponse,
    gaps: Array,
    pressure: float,
    prescribed: float,
    law: EdgeLaw,
    model: FieldModel,
) -> bool:
    """Move the references of gaps to these edges where they have departed from them.

    ``pressure`` is p, with which the last solution gives the potentials. Returns False where a gap
    or run needs more nodes than it has: then all gaps must be solved anew.
    """
    table = map_gaps(gaps)
    nodes, counts = response.nodes, model.rules.counts
    changed, far = departed(response, table, law)
    indices = np.flatnonzero(changed)
    if indices.shape[0] == 0:
        return True
    if far.sum() > REFERENCE_MOST_FAR * changed.shape[0]:
        return False
    for gap in indices:
        order = nodes.orders[gap]
        wanted = model.digits / convergence_rate(table[gap])
        if counts[order] < wanted and order < counts.shape[0] - 1:
            return False
    before = nodes.table.copy()
    for gap in indices:
        nodes.table[gap] = table[gap]
        response.held[gap] = far[gap]
    column = np.zeros(changed.shape[0], dtype=np.int64)
    fill_gaps(indices, nodes, response.equations, column, model)
    for k in range(changed.shape[0]):
        if changed[k] and not _renew_gap(response, k, before[k], pressure, law, model):
            return False
    if not _replace_runs(response, changed, model):
        return False
    _factor_runs(response, changed)
    if far.any():
        # their potentials are not those of the old edges: solved with these held
        pressure = solve_response(response, prescribed, model.device).pressure
        for k in range(far.shape[0]):
            if far[k]:
                _linearise_here(response, k, pressure, law, model)
        _factor_runs(response, far)
    return True


@compiled
def renew_held(response: LinearResponse, held: Flags, law: EdgeLaw, model: FieldModel) -> None:
    """Hold the edges of some gaps, and let those of all others follow."""
    changed = held != response.held
    if not changed.any():
        return
    for k in range(held.shape[0]):
        if changed[k]:
            response.held[k] = held[k]
            _linearise_gap(response, k, law, model)
    _factor_runs(response, changed)


@compiled_for_both
def settle_response(
    response: LinearResponse, gaps: Array, prescribed: float, law: EdgeLaw, model: FieldModel
) -> bool:
    """Renew the response for a known equilibrium; returns False as :func:`move_references` does."""
    renew_held(response, np.zeros(gaps.shape[0], dtype=np.bool_), law, model)
    pressure = pressure_at(response, prescribed, model.device)
    if not move_references(response, gaps, pressure, prescribed, law, model):
        return False
    solve_response(response, prescribed, model.device)
    return True
