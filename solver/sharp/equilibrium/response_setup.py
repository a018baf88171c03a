"""Linear responses of many gaps, set up from nothing or from one of nearly the same; compiled.

Where a patch comes or goes the other gaps keep their responses, and the tree all runs that hold no
change.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.gap_response import linearise_gap
from adhesis.solver.sharp.equilibrium.griffith import raise_orders
from adhesis.solver.sharp.equilibrium.linear_response import (
    LinearResponse,
    allocate_response,
    solve_response,
)
from adhesis.solver.sharp.equilibrium.renewal import (
    factor_runs,
    is_outdated,
    linearise_in_current_potential,
)
from adhesis.solver.sharp.field.assembly import assemble_some
from adhesis.solver.sharp.field.cluster_tree import (
    empty_tree,
    pair_again,
    place_charges,
    run_span,
)
from adhesis.solver.sharp.field.hierarchical_solver import (
    gap_potentials,
    invert_block,
    quadrature_weights,
    solve_many,
)
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.field.tree_factor import empty_factor
from adhesis.solver.sharp.gap.conformal_map import LEFT, RIGHT, convergence_rate, in_order, map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers, choose_orders
from adhesis.solver.sharp.tolerances import FURTHER_CHARGES, FURTHER_ORDERS, REFERENCE_MOST_FAR


@compiled_for_both
def set_up_response(
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
    out.held[:] = law.pinning > 0  # which edges are pinned is not known yet
    for k in range(count):
        linearise_gap(out, k, law, model)
    factor_runs(out, changed)
    return out, True


@compiled_for_both
def update_response(
    known: LinearResponse,
    gaps: Array,
    prescribed: float,
    least: Integers,
    law: EdgeLaw,
    model: FieldModel,
) -> tuple[LinearResponse, bool]:
    """Set up a response as :func:`set_up_response`, of gaps of which most are those of another."""
    table = map_gaps(gaps)
    orders = choose_orders(table, model.digits, model.rules.counts)
    source = _known_gaps(known, table, law, model)
    fresh = source < 0
    if not in_order(table) or fresh.sum() > REFERENCE_MOST_FAR * fresh.shape[0]:
        return set_up_response(gaps, prescribed, raise_orders(orders, least), law, model)
    for k in range(source.shape[0]):
        if source[k] < 0:  # a gap that has changed is likely to change again
            most = model.rules.counts.shape[0] - 1
            orders[k] = min(orders[k] + FURTHER_ORDERS, most)
    orders = raise_orders(orders, least)
    for k in range(source.shape[0]):
        if source[k] >= 0:
            table[k] = known.nodes.table[source[k]]
            orders[k] = known.nodes.orders[source[k]]
    nodes, equations = assemble_some(table, orders, source, known.nodes, known.equations, model)
    offset = nodes.offset
    children, same = pair_again(known.tree.children, source)
    rank = np.zeros(same.shape[0], dtype=np.int64)
    for run in range(same.shape[0]):
        if same[run] >= 0:
            rank[run] = known.tree.rank[same[run]]
    tree = empty_tree(table, offset, children, rank, FURTHER_CHARGES * model.digits, True)
    out = allocate_response(nodes, equations, tree, empty_factor(tree))
    for k in range(fresh.shape[0]):
        out.held[2 * k : 2 * k + 2] = fresh[k]
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
    factor_runs(out, same < 0)
    pressure = solve_response(out, prescribed, law, model.device).pressure
    if not np.isfinite(pressure):
        return out, False
    for k in range(fresh.shape[0]):
        if fresh[k]:
            out.held[2 * k : 2 * k + 2] = law.pinning > 0
            linearise_in_current_potential(out, k, pressure, law, model)
    factor_runs(out, fresh)
    return out, True


@compiled_for_both
def count_unknown(known: LinearResponse, gaps: Array, law: EdgeLaw, model: FieldModel) -> int:
    """Count the gaps that :func:`update_response` would not take over from a response."""
    return int((_known_gaps(known, map_gaps(gaps), law, model) < 0).sum())


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
        changed, _ = is_outdated(rows[j], table[k], 1.0, law)
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
    out.factor.nearest[new] = known.factor.nearest[old]
    theirs, own = run_span(source.pair_start, old), run_span(tree.pair_start, new)
    _copy(known.factor.pair_inverse, theirs, out.factor.pair_inverse, own)
    theirs, own = run_span(source.kernel_start, old), run_span(tree.kernel_start, new)
    _copy(source.kernel, theirs, tree.kernel, own)
    theirs = run_span(source.interpolation_start, old)
    own = run_span(tree.interpolation_start, new)
    _copy(source.interpolation, theirs, tree.interpolation, own)
    _copy(known.factor.inner_potential, theirs, out.factor.inner_potential, own)
    for half in range(2):
        if tree.children[new, half] >= 0:
            theirs = run_span(source.node_start, source.children[old, half])
            own = run_span(tree.node_start, tree.children[new, half])
            for column in range(2):
                _copy(
                    known.charges.potential_of_sibling[column],
                    theirs,
                    out.charges.potential_of_sibling[column],
                    own,
                )


@compiled
def _copy_gap(known: LinearResponse, j: int, out: LinearResponse, k: int) -> None:
    """Copy how the edges of a gap set_up_response, and its reference."""
    square, here = run_span(known.tree.response_start, j), run_span(out.tree.response_start, k)
    _copy(known.inverse, square, out.inverse, here)
    out.about_pressure[k] = known.about_pressure[j]
    theirs, own = run_span(known.nodes.offset, j), run_span(out.nodes.offset, k)
    _copy(known.about, theirs, out.about, own)
    _copy(known.scaled_opening, theirs, out.scaled_opening, own)
    _copy(known.mean_by_potential, theirs, out.mean_by_potential, own)
    _copy_edges(known, j, out, k)
    for node in range(own.stop - own.start):
        i, there = own.start + node, theirs.start + node
        for side in range(2):
            out.motion_by_potential[i, side] = known.motion_by_potential[there, side]
            out.opening_by_potential[i, side] = known.opening_by_potential[there, side]
            out.charge_by_edge[i, side] = known.charge_by_edge[there, side]
            out.held_charge[i, side] = known.held_charge[there, side]


@compiled
def _copy_edges(known: LinearResponse, j: int, out: LinearResponse, k: int) -> None:
    """Copy what is known of both edges of a gap."""
    for side in range(2):
        e, f = 2 * j + side, 2 * k + side
        out.opening[f], out.residual[f] = known.opening[e], known.residual[e]
        out.opening_by_pressure[f] = known.opening_by_pressure[e]
        out.held[f], out.here[f], out.recedes[f] = known.held[e], known.here[e], known.recedes[e]
        out.drift[f] = known.drift[e]
        out.isolated_correction[f] = known.isolated_correction[e]
        for column in range(2):
            out.tangent[f, column] = known.tangent[e, column]
            out.compliance[f, column] = known.compliance[e, column]
            out.motion[f, column] = known.motion[e, column]
