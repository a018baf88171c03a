"""Window of few gaps among many: its exterior responds linearly about a known state; compiled.

The gaps outside are runs of the tree of gaps (``linear_response``), each with its response: a tree
of these runs gives that of all of them to the window, an ``Exterior`` (``field/exterior``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import critical_opening
from adhesis.solver.sharp.equilibrium.linear_response import (
    Flags,
    LinearResponse,
    motion_in,
    motion_to,
)
from adhesis.solver.sharp.equilibrium.renewal import renew_held
from adhesis.solver.sharp.field.cluster_tree import Tree, build_tree, run_span
from adhesis.solver.sharp.field.dense_solver import solve
from adhesis.solver.sharp.field.exterior import Exterior, exterior_kernel
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.field.tree_factor import (
    Charges,
    TreeFactor,
    downward_pass,
    factor_tree,
    upward_pass,
    whole_tree,
)
from adhesis.solver.sharp.gap.conformal_map import LEFT, RIGHT
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Integers


class OutsideRuns(NamedTuple):
    """Runs of gaps that together are the outside of a window.

    Attributes
    ----------
    runs : int array
        Which they are in the tree of all gaps.
    gaps : int array
        The gaps of all of them.
    edges : array, shape (L, 2)
        All gaps when the window was opened.
    tree : Tree
        Of these runs.
    factor : TreeFactor
    charges : Charges
        Without potentials and p, and by a unit of p.
    """

    runs: Integers
    gaps: Integers
    edges: Array
    tree: Tree
    factor: TreeFactor
    charges: Charges


@compiled_for_both
def open_window(
    response: LinearResponse,
    gaps: Array,
    first: int,
    width: int,
    longest_motion: float,
    law: EdgeLaw,
    model: FieldModel,
) -> tuple[Array, Exterior, OutsideRuns]:
    """Open a window of ``width`` gaps from ``first`` on: its gaps, the exterior and its runs.

    The last of the window's gaps stands for the exterior; angles rise beyond the period where the
    window goes on at its beginning. Edges outside follow if they are stable by themselves, and are
    out of balance by less than ``longest_motion``.
    """
    count = gaps.shape[0]
    outside: Integers = np.arange(first + width, first + count) % count
    held = response.held.copy()
    for k in outside:
        correction = np.abs(response.isolated_correction[2 * k : 2 * k + 2])
        near = correction[0] < longest_motion and correction[1] < longest_motion
        held[k] = not near or response.factor.negative[k] != 0
    renew_held(response, held, law, model)
    window = np.empty((width + 1, 2))
    for i in range(width):
        turn = 2 * np.pi if first + i >= count else 0.0
        window[i] = gaps[(first + i) % count] + turn
    runs, turns = _cover(response.tree, first, width)
    found = _solve_runs(response, gaps, outside, runs, turns, model)
    rows = found.tree.rows
    window[width, 0] = rows[0, LEFT]
    window[width, 1] = rows[runs.shape[0] - 1, RIGHT]
    return window, _reduce_exterior(found, window[width], law, model.panels), found


@compiled
def _cover(tree: Tree, first: int, width: int) -> tuple[Integers, Array]:
    """Find the largest runs outside a window, in order, and by how much they lie beyond it."""
    count = (tree.rank.shape[0] + 1) // 2
    parent = np.full(tree.rank.shape[0], -1)
    for run in range(count, tree.rank.shape[0]):
        parent[tree.children[run, 0]] = run
        parent[tree.children[run, 1]] = run
    runs = np.empty(count, dtype=np.int64)
    turns = np.empty(count)
    made = 0
    k, end = first + width, first + count
    while k < end:
        turn = 0
        if k >= count:
            turn = count
        last = min(end, count + turn) - turn  # first gap beyond, or the end of the period
        run = k - turn
        while parent[run] >= 0:
            above = parent[run]
            if tree.gap_range[above, 0] != k - turn or tree.gap_range[above, 1] >= last:
                break
            run = above
        runs[made] = run
        turns[made] = 2 * np.pi if turn > 0 else 0.0
        made += 1
        k = tree.gap_range[run, 1] + 1 + turn
    return runs[:made].copy(), turns[:made].copy()


@compiled
def _solve_runs(
    response: LinearResponse,
    edges: Array,
    outside: Integers,
    runs: Integers,
    turns: Array,
    model: FieldModel,
) -> OutsideRuns:
    """Factor the tree of runs outside a window, and compute their charges."""
    tree, factor, isolated = response.tree, response.factor, response.charges.isolated
    count = runs.shape[0]
    offset = np.zeros(count + 1, dtype=np.int64)
    squares = 0
    for i in range(count):
        r = tree.rank[runs[i]]
        offset[i + 1] = offset[i] + r
        squares += r * r
    table = np.empty((count, tree.rows.shape[1]))
    theta = np.empty(offset[count])
    stretch = np.empty(offset[count])
    charge = np.empty((offset[count], 2))
    squared = np.empty(squares)
    negative = np.empty(count, dtype=np.int64)
    at = 0
    for i in range(count):
        run, r = runs[i], tree.rank[runs[i]]
        table[i] = tree.rows[run]
        table[i, LEFT] += turns[i]
        table[i, RIGHT] += turns[i]
        negative[i] = factor.negative[run]
        for j in range(r):
            node = tree.node_start[run] + j
            theta[offset[i] + j] = tree.theta[node] + turns[i]
            stretch[offset[i] + j] = tree.stretch[node]
            charge[offset[i] + j, 0] = isolated[0, node]
            charge[offset[i] + j, 1] = isolated[1, node]
        start = tree.response_start[run]
        squared[at : at + r * r] = factor.response[start : start + r * r]
        at += r * r
    own = build_tree(table, offset, theta, stretch, model.digits, False)
    own_factor = factor_tree(own, squared, negative)
    charges = upward_pass(own, own_factor, charge)
    return OutsideRuns(runs, outside, edges, own, own_factor, charges)


@compiled
def _reduce_exterior(outside: OutsideRuns, ends: Array, law: EdgeLaw, panels: Panels) -> Exterior:
    """Reduce the runs outside a window to the charges of one; ``ends`` are those of that."""
    tree, factor = outside.tree, outside.factor
    run = tree.rank.shape[0] - 1
    r = tree.rank[run]
    last = slice(tree.node_start[run], tree.node_start[run + 1])
    charge = np.empty((r, 2))
    charge[:, 0] = outside.charges.isolated[0, last]
    charge[:, 1] = -outside.charges.isolated[1, last]
    potential = np.zeros(outside.charges.potential_of_sibling.shape)
    downward_pass(tree, factor, whole_tree(tree), outside.charges, potential)
    mean = np.zeros(2)
    for leaf in range(outside.runs.shape[0]):
        own, size = run_span(tree.node_start, leaf), tree.rank[leaf]
        stretch = tree.stretch[own]
        response = factor.response[run_span(tree.response_start, leaf)].reshape(size, size)
        by_potential = response @ stretch
        for column in range(2):
            charge_of_leaf, there = outside.charges.isolated[column], potential[column]
            mean[column] += charge_of_leaf[own] @ stretch - there[own] @ by_potential
    mean[1] = -mean[1]
    opening = np.empty(2)
    for side in range(2):
        opening[side], _ = critical_opening(ends[side], law, panels)
    square = slice(tree.response_start[run], tree.response_start[run + 1])
    return Exterior(
        theta=tree.theta[last].copy(),
        stretch=tree.stretch[last].copy(),
        response=factor.response[square].copy().reshape(r, r),
        charge=charge,
        mean=mean,
        opening=opening,
    )


@compiled_for_both
def extend_window(
    window: Array,
    prescribed: float,
    orders: Integers,
    exterior: Exterior,
    outside: OutsideRuns,
    response: LinearResponse,
    limit: Array,
    model: FieldModel,
) -> Array:
    """Compute the outward motion of the edges outside, for the window's gaps as they are now.

    It is 0 for edges of the window, and is limited.
    """
    now = solve(window, prescribed, orders, 1, model, exterior)
    kernel, _ = exterior_kernel(now.nodes.theta, now.nodes.weight, exterior)
    own = outside.tree
    potential = np.zeros(outside.charges.potential_of_sibling.shape)
    whole = own.node_start[own.rank.shape[0] - 1]
    for i in range(kernel.shape[0]):
        for a in range(kernel.shape[1]):
            potential[0, whole + a] -= kernel[i, a] * now.scaled_opening[i]
    downward_pass(own, outside.factor, whole_tree(own), outside.charges, potential)
    tree = response.tree
    inside = np.zeros(response.potential.shape)
    below = np.zeros(tree.rank.shape[0], dtype=np.bool_)
    for i in range(outside.runs.shape[0]):
        run = outside.runs[i]
        below[run] = True
        inside[:, run_span(tree.node_start, run)] = potential[:, run_span(own.node_start, i)]
    downward_pass(tree, response.factor, below, response.charges, inside)
    wanted: Flags = np.zeros(outside.edges.shape[0], dtype=np.bool_)
    wanted[outside.gaps] = True
    motion = motion_in(response, inside, wanted)
    before = motion_to(response, outside.edges)
    out = np.zeros(motion.shape[0])
    for k in outside.gaps:
        if response.held[k]:
            continue
        for e in range(2 * k, 2 * k + 2):
            step = motion[e, 0] + now.pressure * motion[e, 1] - before[e]
            out[e] = step if abs(step) <= limit[e] else np.sign(step) * limit[e]
    return out
