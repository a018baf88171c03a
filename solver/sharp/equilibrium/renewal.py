"""Renewal of a linear response of many gaps where edges have moved; compiled.

A response is used while edges stay near their references. A gap whose edge leaves its reference
is linearised anew where it is now, in the potential of the last solution, and the runs of the tree
that hold the gap are computed anew. So a state next to a known one costs the changed gaps and one
pass through the tree.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw, Flags, at_memory, way_from_memory
from adhesis.solver.sharp.equilibrium.gap_response import condense_gap, linearise_gap
from adhesis.solver.sharp.equilibrium.linear_response import (
    LinearResponse,
    imbalance_of,
    motion_to,
    pressure_at,
    solve_response,
)
from adhesis.solver.sharp.field.assembly import fill_gaps
from adhesis.solver.sharp.field.cluster_tree import replace_run
from adhesis.solver.sharp.field.hierarchical_solver import invert_block
from adhesis.solver.sharp.field.separate_gaps import interpolate_potential
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.field.tree_factor import charge_run, factor_run
from adhesis.solver.sharp.gap.conformal_map import (
    LEFT,
    LEFT_PATCH,
    RIGHT,
    convergence_rate,
    map_gaps,
)
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import (
    FEW_REFERENCES,
    REFERENCE_BALANCE,
    REFERENCE_FAR,
    REFERENCE_MOST_FAR,
    REFERENCE_PATCH,
    REFERENCE_SCALE,
    REFERENCE_SHARE,
)


@compiled
def factor_runs(response: LinearResponse, changed: Flags) -> None:
    """Compute the responses and charges of runs that have changed, or hold gaps that have."""
    tree, count = response.tree, response.softness.shape[0]
    renewed = np.zeros(tree.rank.shape[0], dtype=np.bool_)
    renewed[: changed.shape[0]] = changed
    work = np.empty((3, tree.rank.max()))
    for run in range(count, renewed.shape[0]):
        if renewed[run] or renewed[tree.children[run, 0]] or renewed[tree.children[run, 1]]:
            renewed[run] = True
            factor_run(tree, response.factor, run)
            charge_run(tree, response.factor, run, response.charges, work)


@compiled
def linearise_in_current_potential(
    response: LinearResponse, k: int, pressure: float, law: EdgeLaw, model: FieldModel
) -> None:
    """Take a gap's potential in the last solution as its reference, and let its edges follow."""
    offset, potential = response.nodes.offset, response.potential
    response.about_pressure[k] = pressure
    for i in range(offset[k], offset[k + 1]):
        response.about[i] = potential[0, i] + pressure * potential[1, i]
    linearise_gap(response, k, law, model)


@compiled
def is_outdated(known: Array, row: Array, softness: float, law: EdgeLaw) -> tuple[bool, bool]:
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
        if law.critical == 0:
            # an edge acts on the field to second order only, in which all have the same sign
            allowed = law.field_error
        if not moved <= max(law.newton_tolerance, allowed):
            changed = True
        if not moved <= REFERENCE_FAR * least:
            far = True
        if not abs(patch - before) <= REFERENCE_PATCH * min(before, patch):
            changed = True
    return changed, far


@compiled
def outdated_references(
    response: LinearResponse, table: Array, law: EdgeLaw
) -> tuple[Flags, Flags]:
    """Mark the gaps whose references are to be renewed for the edges of a table.

    That is where edges have left them, or were out of balance in them. Returned apart are gaps that
    have moved so far that the potential in the old gap cannot be taken for that in the new one.
    """
    count = table.shape[0]
    changed = np.zeros(count, dtype=np.bool_)
    far = np.zeros(count, dtype=np.bool_)
    for k in range(count):
        known, softness = response.nodes.table[k], response.softness[k]
        changed[k], far[k] = is_outdated(known, table[k], softness, law)
        # in other potentials than those of its reference its edges follow otherwise
        for e in range(2 * k, 2 * k + 2):
            residual, _ = imbalance_of(response, e, law.pinning)
            pinned = law.pinning > 0 and response.held[e]
            if abs(residual) * softness > REFERENCE_BALANCE * law.critical > 0 and not pinned:
                changed[k] = True
    return changed, far


@compiled
def move_references(
    response: LinearResponse,
    gaps: Array,
    held: Flags,
    pressure: float,
    prescribed: float,
    law: EdgeLaw,
    model: FieldModel,
) -> bool:
    """Move the references of gaps to these edges where they have departed from them.

    ``held`` marks the edges that are held from now on. ``pressure`` is p, with which the last
    solution gives the potentials. Returns False where a gap or run needs more nodes than it has,
    or many gaps are far from their references: then another response is to be set up.
    """
    table = map_gaps(gaps)
    nodes, counts = response.nodes, model.rules.counts
    changed, far = outdated_references(response, table, law)
    indices = np.flatnonzero(changed)
    if far.sum() > REFERENCE_MOST_FAR * max(changed.shape[0], FEW_REFERENCES):
        return False
    for gap in indices:
        order = nodes.orders[gap]
        wanted = model.digits / convergence_rate(table[gap])
        if counts[order] < wanted and order < counts.shape[0] - 1:
            return False
    before = nodes.table.copy()
    for gap in indices:
        nodes.table[gap] = table[gap]
    both = held.copy()
    for e in range(held.shape[0]):
        if far[e // 2]:
            both[e] = True
    others = hold_edges(response, gaps, both, law)
    if indices.shape[0] == 0:
        condense_gaps(response, others, law, model)
        return True
    fill_gaps(indices, nodes, response.equations, model)
    renewed = True
    for k in range(changed.shape[0]):
        if changed[k] and renewed:
            renewed = _renew_gap(response, k, before[k], pressure, law, model)
        elif others[k]:
            condense_gap(response, k, law.pinning, model.rules)
            changed[k] = True
    if not (renewed and _replace_runs(response, indices, model)):
        nodes.table[indices] = np.nan  # they serve for no other response
        return False
    factor_runs(response, changed)
    if far.any():
        # their potentials are not those of the old edges: solved with these held
        pressure = solve_response(response, prescribed, law, model.device).pressure
        hold_edges(response, gaps, held, law)
        for k in range(far.shape[0]):
            if far[k]:
                linearise_in_current_potential(response, k, pressure, law, model)
        factor_runs(response, far)
    return True


@compiled
def hold_edges(response: LinearResponse, gaps: Array, held: Flags, law: EdgeLaw) -> Flags:
    """Hold some edges where they are, and no others, and note which of all recede.

    Marks the gaps that are to be condensed.
    """
    motion = motion_to(response, gaps)
    changed = np.zeros(gaps.shape[0], dtype=np.bool_)
    for e in range(held.shape[0]):
        here, recedes = motion[e] if held[e] else 0.0, False
        if law.pinning > 0:
            recedes = way_from_memory(e, gaps[e // 2, e % 2], law) < 0
        if held[e] != response.held[e] or here != response.here[e]:
            changed[e // 2] = True
        if recedes != response.recedes[e]:
            changed[e // 2] = True
        response.held[e], response.here[e], response.recedes[e] = held[e], here, recedes
    return changed


@compiled
def condense_gaps(response: LinearResponse, some: Flags, law: EdgeLaw, model: FieldModel) -> None:
    """Eliminate the edges of some gaps anew, and factor the runs that hold them."""
    for k in range(some.shape[0]):
        if some[k]:
            condense_gap(response, k, law.pinning, model.rules)
    if some.any():
        factor_runs(response, some)


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
def _replace_runs(response: LinearResponse, changed: Integers, model: FieldModel) -> bool:
    """Place the runs anew that hold gaps that have changed.

    Returns whether they have enough charges.
    """
    tree, count = response.tree, response.softness.shape[0]
    renewed = np.zeros(tree.rank.shape[0], dtype=np.bool_)
    renewed[changed] = True
    for run in range(count, renewed.shape[0]):
        if renewed[tree.children[run, 0]] or renewed[tree.children[run, 1]]:
            renewed[run] = True
            if not replace_run(tree, run, response.nodes.table, model.digits):
                return False
    return True


@compiled_for_both
def settle_response(
    response: LinearResponse, gaps: Array, prescribed: float, law: EdgeLaw, model: FieldModel
) -> bool:
    """Renew the response for a known equilibrium; returns False as :func:`move_references` does."""
    held = at_memory(gaps, law)
    pressure = pressure_at(response, prescribed, model.device)
    if not move_references(response, gaps, held, pressure, prescribed, law, model):
        return False
    solve_response(response, prescribed, law, model.device)
    return True
