"""Linear responses of many gaps: set up from nothing or from a known one, and renewed; compiled.

A response lasts while edges move little. Where an edge leaves its reference, that of its gap is
moved to where it is now, in the potential of the last solution, and the runs of the tree that hold
the gap are computed anew. So a state next to a known one costs what differs, and one pass.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.gap_response import linearise_gap
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw, raise_orders
from adhesis.solver.sharp.equilibrium.linear_response import (
    Flags,
    LinearResponse,
    allocate_response,
    pressure_at,
    solve_response,
)
from adhesis.solver.sharp.field.assembly import assemble_some, fill_gaps
from adhesis.solver.sharp.field.cluster_tree import (
    empty_tree,
    pair_again,
    place_charges,
    replace_run,
    run_span,
)
from adhesis.solver.sharp.field.hierarchical_solver import (
    gap_potentials,
    invert_block,
    quadrature_weights,
    solve_many,
)
from adhesis.solver.sharp.field.separate_gaps import interpolate_potential
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.field.tree_factor import charge_run, empty_factor, factor_run
from adhesis.solver.sharp.gap.conformal_map import (
    LEFT,
    LEFT_PATCH,
    RIGHT,
    convergence_rate,
    in_order,
    map_gaps,
)
from adhesis.solver.sharp.gap.quadrature import Integers, choose_orders
from adhesis.solver.sharp.tolerances import (
    FURTHER_ORDERS,
    REFERENCE_BALANCE,
    REFERENCE_FAR,
    REFERENCE_MOST_FAR,
    REFERENCE_PATCH,
    REFERENCE_SCALE,
    REFERENCE_SHARE,
)


@compiled_for_both
def respond(
    gaps: Array, prescribed: float, orders: Integers, law: EdgeLaw, model: FieldModel
) -> tuple[LinearResponse, bool]:
    """Solve the field of these gaps, and linearise about it; returns whether there is a field."""
    state, system = solve_many(gaps, prescribed, orders, 2, model)
    nodes = state.nodes
    count, n = gaps.shape[0], state.nodes.theta.shape[0]
    out = allocate_response(nodes, state.equations, system.tree, system.factor)
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
        linearise_gap(out, k, law, model)
    _factor_runs(out, changed)
    return out, True


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
    offset = nodes.offset
    children, same = pair_again(known.tree.children, source)
    rank = np.zeros(same.shape[0], dtype=np.int64)
    for run in range(same.shape[0]):
        if same[run] >= 0:
            rank[run] = known.tree.rank[same[run]]
    tree = empty_tree(table, offset, children, rank, model.digits, True)
    out = allocate_response(nodes, equations, tree, empty_factor(tree))
    out.held[:] = fresh
    tree.theta[: offset[-1]] = nodes.theta
    tree.stretch[: offset[-1]] = nodes.weight / quadrature_weights(nodes, model.rules)
    for run in range(same.shape[0]):
        if same[run] >= 0:
            _copy_run(known, same[run], out, run)
        elif run >= orders.shape[0]:
            place_charges(tree, run)
    for k in range(orders.shape[0]):
        if fresh[k]:
            own = slice(offset[k], offset[k + 1])
            block = equations.matrix[own, : offset[k + 1] - offset[k]]
            if not invert_block(block, out.inverse[run_span(tree.response_start, k)]):
                return out, False
            linearise_gap(out, k, law, model)
        else:
            _copy_gap(known, source[k], out, k)
    _factor_runs(out, same < 0)
    pressure = solve_response(out, prescribed, model.device).pressure
    if not np.isfinite(pressure):
        return out, False
    for k in range(fresh.shape[0]):
        if fresh[k]:
            _linearise_here(out, k, pressure, law, model)
    _factor_runs(out, fresh)
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


@compiled
def _copy(source: Array, theirs: slice, out: Array, own: slice) -> None:
    """Copy a part of an array into one of another."""
    taken, kept = source[theirs], out[own]
    for i in range(taken.shape[0]):
        kept[i] = taken[i]


@compiled
def _copy_run(known: LinearResponse, old: int, out: LinearResponse, new: int) -> None:
    """Copy the charges and the response of a run, and how its halves act on each other."""
    source, tree = known.tree, out.tree
    theirs, own = run_span(source.node_start, old), run_span(tree.node_start, new)
    _copy(source.theta, theirs, tree.theta, own)
    _copy(source.stretch, theirs, tree.stretch, own)
    for column in range(2):
        _copy(known.charges.isolated[column], theirs, out.charges.isolated[column], own)
    theirs, own = run_span(source.response_start, old), run_span(tree.response_start, new)
    _copy(known.factor.response, theirs, out.factor.response, own)
    out.factor.negative[new] = known.factor.negative[old]
    theirs, own = run_span(source.pair_start, old), run_span(tree.pair_start, new)
    _copy(known.factor.pair, theirs, out.factor.pair, own)
    theirs, own = run_span(source.kernel_start, old), run_span(tree.kernel_start, new)
    _copy(source.kernel, theirs, tree.kernel, own)
    theirs = run_span(source.interpolation_start, old)
    own = run_span(tree.interpolation_start, new)
    _copy(source.interpolation, theirs, tree.interpolation, own)
    _copy(known.factor.inward, theirs, out.factor.inward, own)
    for half in range(2):
        if tree.children[new, half] >= 0:
            theirs = run_span(source.node_start, source.children[old, half])
            own = run_span(tree.node_start, tree.children[new, half])
            for column in range(2):
                _copy(known.charges.mutual[column], theirs, out.charges.mutual[column], own)


@compiled
def _copy_gap(known: LinearResponse, j: int, out: LinearResponse, k: int) -> None:
    """Copy how the edges of a gap respond, and its reference."""
    square, here = run_span(known.tree.response_start, j), run_span(out.tree.response_start, k)
    _copy(known.inverse, square, out.inverse, here)
    out.held[k] = known.held[j]
    out.about_pressure[k] = known.about_pressure[j]
    theirs, own = run_span(known.nodes.offset, j), run_span(out.nodes.offset, k)
    _copy(known.about, theirs, out.about, own)
    _copy(known.scaled_opening, theirs, out.scaled_opening, own)
    _copy(known.mean_by_potential, theirs, out.mean_by_potential, own)
    for side in range(2):
        e, f = 2 * j + side, 2 * k + side
        out.residual[f], out.balancing[f] = known.residual[e], known.balancing[e]
        for column in range(2):
            out.motion[f, column] = known.motion[e, column]
    for i in range(own.stop - own.start):
        for side in range(2):
            follows = known.motion_by_potential[theirs.start + i, side]
            out.motion_by_potential[own.start + i, side] = follows


@compiled
def _factor_runs(response: LinearResponse, changed: Flags) -> None:
    """Compute the responses and charges of runs that have changed, or hold gaps that have."""
    tree, count = response.tree, response.held.shape[0]
    renewed = np.zeros(tree.rank.shape[0], dtype=np.bool_)
    renewed[: changed.shape[0]] = changed
    work = np.empty((3, tree.rank.max()))
    for run in range(count, renewed.shape[0]):
        if renewed[run] or renewed[tree.children[run, 0]] or renewed[tree.children[run, 1]]:
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
    linearise_gap(response, k, law, model)


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
    or run needs more nodes than it has, or many gaps are far from their references: then another
    response is to be set up.
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
    renewed = True
    for k in range(changed.shape[0]):
        if changed[k] and renewed:
            renewed = _renew_gap(response, k, before[k], pressure, law, model)
    if not (renewed and _replace_runs(response, changed, model)):
        nodes.table[changed] = np.nan  # they serve for no other response
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
        return False
    linearise_gap(response, k, law, model)
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
def renew_held(response: LinearResponse, held: Flags, law: EdgeLaw, model: FieldModel) -> None:
    """Hold the edges of some gaps, and let those of all others follow."""
    changed = held != response.held
    if not changed.any():
        return
    for k in range(held.shape[0]):
        if changed[k]:
            response.held[k] = held[k]
            linearise_gap(response, k, law, model)
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
