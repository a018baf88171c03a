"""Build the binary tree of neighbouring gaps, whose runs act on each other through charges.

In its own coordinate η (``conformal_map``) a gap acts on the others through charges q_i = w_i f_i
at its nodes; the others' potentials g_i = (dθ/dη) g(θ_i) there are

    g_i = -Σ_j K_ij q_j,      K_ij = (dθ/dη)_i (dθ/dη)_j / (4π sin²((θ_i - θ_j)/2)).

A run of neighbouring gaps is an interval between two patches, just as a gap is one: in *its*
coordinate all that lies outside is again on the line Im η = π/(2α), however narrow the patches at
its ends. So it acts on the outside like a few charges at the Chebyshev nodes of η, their number
growing with the logarithm of run over patch. The tree holds their positions, the kernel K between
both halves of a run, and the interpolation E from its nodes to theirs; ``tree_factor`` solves on
it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.gap.conformal_map import (
    ALPHA,
    LEFT,
    LEFT_PATCH,
    RIGHT,
    RIGHT_PATCH,
    convergence_rate,
    eta_at,
    theta_at,
)
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import CHARGE_MARGIN, FEWEST_CHARGES, MOST_CHARGES


class Tree(NamedTuple):
    """Runs of neighbouring gaps: first the L gaps, then pairs of runs, the last one the whole.

    Attributes
    ----------
    children, gap_range : int array, shape (runs, 2)
        Both halves of a run, -1 for a gap; and its first and last gap.
    rows : array, shape (runs, 5)
        Its ends and patches, as in the table of gaps; of a whole period none.
    rank : int array, shape (runs,)
        Number of charges.
    node_start, response_start, pair_start, kernel_start, interpolation_start : int array
        Offsets, shape (runs + 1,): of its charges, of matrices (rank, rank), of (half 1, half 1),
        of (half 1, half 2) and of (both halves, rank).
    theta, stretch : array
        θ and dθ/dη of all charges.
    kernel : array
        K12 of all pairs, flat.
    interpolation : array
        E of all pairs, flat.
    """

    children: Integers
    gap_range: Integers
    rows: Array
    rank: Integers
    node_start: Integers
    response_start: Integers
    pair_start: Integers
    kernel_start: Integers
    interpolation_start: Integers
    theta: Array
    stretch: Array
    kernel: Array
    interpolation: Array


@compiled
def run_span(start: Integers, run: int) -> slice:
    """Return the slice of a flat array that belongs to a run."""
    return slice(start[run], start[run + 1])


@compiled
def run_halves(tree: Tree, run: int) -> tuple[int, int, int, int]:
    """Return both halves of a run, and their numbers of charges."""
    one, two = tree.children[run, 0], tree.children[run, 1]
    return one, two, tree.rank[one], tree.rank[two]


@compiled
def _interval(table: Array, first: int, last: int) -> Array:
    """Make the row of the table of gaps for a run of them."""
    row: Array = table[first].copy()
    length = table[last, RIGHT] - table[first, LEFT]
    row[RIGHT] = table[last, RIGHT]
    row[RIGHT_PATCH] = table[last, RIGHT_PATCH]
    row[ALPHA] = 0.25 * (np.log1p(length / row[LEFT_PATCH]) + np.log1p(length / row[RIGHT_PATCH]))
    return row


@compiled
def _wanted_rank(row: Array, digits: float) -> int:
    """Return the number of charges that a run needs."""
    wanted = int(np.ceil((digits + CHARGE_MARGIN) / convergence_rate(row)))
    return min(max(wanted, FEWEST_CHARGES), MOST_CHARGES)


@compiled
def _pair_runs(count: int) -> Integers:
    """Pair neighbouring runs, level by level; returns both halves of each."""
    children = np.full((2 * count - 1, 2), -1)
    level = np.arange(count)
    made = count
    while level.shape[0] > 1:
        above = np.empty((level.shape[0] + 1) // 2, dtype=np.int64)
        for i in range(level.shape[0] // 2):
            children[made] = level[2 * i : 2 * i + 2]
            above[i] = made
            made += 1
        if level.shape[0] % 2 == 1:
            above[-1] = level[-1]
        level = above
    return children


@compiled
def pair_again(known: Integers, source: Integers) -> tuple[Integers, Integers]:
    """Pair the runs of gaps most of which were gaps of a tree with the halves ``known``.

    ``source[k]`` is the index of gap k in that tree, or -1. A gap that is not in the tree replaces
    one that is gone, if there is one between the same neighbours; else it is paired with the gap
    before it. Returns both halves of each run, and its index in the tree, -1 if it has changed.
    """
    count, runs, before = source.shape[0], 2 * source.shape[0] - 1, (known.shape[0] + 1) // 2
    children, same = np.full((runs, 2), -1), np.full(runs, -1)
    same[:count] = source
    image = np.full(known.shape[0], -1)  # of every run of the tree
    made = count
    first = -1  # run of the gaps before all known ones
    free = 0  # index in the tree
    for k in range(count):
        after = k
        while after < count and source[after] < 0:
            after += 1
        end = source[after] if after < count else before
        if source[k] >= 0:
            free = source[k]
        if source[k] >= 0 or free < end:
            image[free] = k
            if first >= 0:
                children[made, 0], children[made, 1] = first, k
                image[free], first = made, -1
                made += 1
            free += 1
        elif free == 0 and first < 0:
            first = k
        else:
            partner = first if free == 0 else image[free - 1]
            children[made, 0], children[made, 1] = partner, k
            if free == 0:
                first = made
            else:
                image[free - 1] = made
            made += 1
    for run in range(before, known.shape[0]):
        one, two = image[known[run, 0]], image[known[run, 1]]
        image[run] = max(one, two)
        if one >= 0 and two >= 0:
            children[made, 0], children[made, 1] = one, two
            if same[one] == known[run, 0] and same[two] == known[run, 1]:
                same[made] = run
            image[run] = made
            made += 1
    return children, same


@compiled
def empty_tree(
    table: Array, offset: Integers, children: Integers, known: Integers, digits: float, closed: bool
) -> Tree:
    """Allocate the tree of the gaps of ``table``, in runs with these halves.

    ``known`` are the numbers of charges of known runs, else 0. ``closed`` if the gaps are all those
    of the period, so that there is nothing outside; else they must leave space for at least one
    more.
    """
    runs, count = children.shape[0], table.shape[0]
    rank = known.copy()
    gap_range = np.empty((runs, 2), dtype=np.int64)
    rows = np.empty((runs, table.shape[1]))
    at = np.zeros(runs + 1, dtype=np.int64)
    square = np.zeros(runs + 1, dtype=np.int64)
    inner = np.zeros(runs + 1, dtype=np.int64)
    mixed = np.zeros(runs + 1, dtype=np.int64)
    lift = np.zeros(runs + 1, dtype=np.int64)
    for run in range(runs):
        one, two = 0, 0
        if run < count:
            gap_range[run] = run
            rows[run] = table[run]
            rank[run] = offset[run + 1] - offset[run]
        else:
            first, last = children[run, 0], children[run, 1]
            one, two = rank[first], rank[last]
            gap_range[run, 0], gap_range[run, 1] = gap_range[first, 0], gap_range[last, 1]
            if run < runs - 1 or not closed:
                rows[run] = _interval(table, gap_range[run, 0], gap_range[run, 1])
                if rank[run] == 0:
                    rank[run] = _wanted_rank(rows[run], digits)
        r = rank[run]
        at[run + 1] = at[run] + r
        square[run + 1] = square[run] + r * r
        inner[run + 1] = inner[run] + one * one
        mixed[run + 1] = mixed[run] + one * two
        lift[run + 1] = lift[run] + (one + two) * r
    return Tree(
        children, gap_range, rows, rank, at, square, inner, mixed, lift, np.empty(at[runs]),
        np.empty(at[runs]), np.empty(mixed[runs]), np.empty(lift[runs]),
    )  # fmt: skip


@compiled
def build_tree(
    table: Array, offset: Integers, theta: Array, stretch: Array, digits: float, closed: bool
) -> Tree:
    """Build the tree over the gaps of ``table``, whose nodes are ``theta`` with dθ/dη ``stretch``.

    ``closed`` as in :func:`empty_tree`.
    """
    count = table.shape[0]
    children = _pair_runs(count)
    none: Integers = np.zeros(children.shape[0], dtype=np.int64)
    tree = empty_tree(table, offset, children, none, digits, closed)
    tree.theta[: theta.shape[0]] = theta
    tree.stretch[: theta.shape[0]] = stretch
    for run in range(count, children.shape[0]):
        place_charges(tree, run)
    return tree


@compiled
def place_charges(tree: Tree, run: int) -> None:
    """Place the charges of a run, and compute its interpolation and kernel."""
    at, r, row = tree.node_start, tree.rank[run], tree.rows[run]
    theta, stretch = tree.theta, tree.stretch
    node, share = np.empty(r), np.empty(r)  # Chebyshev nodes, and their barycentric weights
    for i in range(r):
        t = np.pi * (r - i - 0.5) / r
        node[i] = np.cos(t)
        share[i] = np.sin(t) if i % 2 == 0 else -np.sin(t)
        theta[at[run] + i], stretch[at[run] + i] = theta_at(row, node[i])
    begin = tree.interpolation_start[run]
    for half in range(2):
        child = tree.children[run, half]
        own = slice(at[child], at[child + 1])
        end = begin + tree.rank[child] * r
        _interpolate(row, node, share, theta[own], stretch[own], tree.interpolation[begin:end])
        begin = end
    own = slice(at[tree.children[run, 0]], at[tree.children[run, 0] + 1])
    other = slice(at[tree.children[run, 1]], at[tree.children[run, 1] + 1])
    kernel = tree.kernel[run_span(tree.kernel_start, run)]
    _kernel(theta[own], stretch[own], theta[other], stretch[other], kernel)


@compiled
def replace_run(tree: Tree, run: int, table: Array, digits: float) -> bool:
    """Place the charges of a run anew; returns whether it has enough.

    Accepts one charge fewer than required; CHARGE_MARGIN covers it.
    """
    if tree.rank[run] > 0:
        tree.rows[run] = _interval(table, tree.gap_range[run, 0], tree.gap_range[run, 1])
        if _wanted_rank(tree.rows[run], digits) > tree.rank[run] + 1:
            return False
    place_charges(tree, run)
    return True


@compiled_sums
def _kernel(theta: Array, stretch: Array, other: Array, other_stretch: Array, out: Array) -> None:
    """Compute K between two sets of charges, flat."""
    columns = other.shape[0]
    sine = np.sin(0.5 * other)
    cosine = np.cos(0.5 * other)
    for i in range(theta.shape[0]):
        si = np.sin(0.5 * theta[i])
        ci = np.cos(0.5 * theta[i])
        scale = stretch[i] / (4 * np.pi)
        row = out[i * columns : (i + 1) * columns]
        for j in range(columns):
            half = si * cosine[j] - ci * sine[j]
            row[j] = scale * other_stretch[j] / (half * half)


@compiled_sums
def _interpolate(
    row: Array, node: Array, share: Array, theta: Array, stretch: Array, out: Array
) -> None:
    """Compute the interpolation of potentials from the nodes of an interval to points inside."""
    rank = node.shape[0]
    for b in range(theta.shape[0]):
        x, _, slope = eta_at(row, theta[b])
        scale = stretch[b] * slope
        total = 0.0
        line = out[b * rank : (b + 1) * rank]
        for a in range(rank):
            line[a] = share[a] / (x - node[a])
        for a in range(rank):
            total += line[a]
        if np.isfinite(total):
            for a in range(rank):
                line[a] *= scale / total
        else:  # the point is a node
            for a in range(rank):
                line[a] = scale if x == node[a] else 0.0
