"""Binary tree of neighbouring gaps: the charges through which each run acts on the others.

In its own coordinate η (``conformal_map``) a gap acts on the others through charges q_i = w_i f_i
at its nodes; the others' potentials g_i = (dθ/dη) g(θ_i) there are

    g_i = -Σ_j K_ij q_j,      K_ij = (dθ/dη)_i (dθ/dη)_j / (4π sin²((θ_i - θ_j)/2)).

A run of neighbouring gaps is an interval between two patches, just as a gap is one: in *its*
coordinate all that lies outside is again on the line Im η = π/(2α), however narrow the patches at
its ends. So it acts on the outside like a few charges at the Chebyshev nodes of η, their number
growing with the logarithm of run over patch. The tree holds their places, the kernel K between both
halves of a run, and the interpolation E from its nodes to theirs; ``tree_factor`` solves on it.
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
    children, span : int array, shape (runs, 2)
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
    span: Integers
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
    """Return where a flat array holds what belongs to a run."""
    return slice(start[run], start[run + 1])


@compiled
def run_halves(tree: Tree, run: int) -> tuple[int, int, int, int]:
    """Return both halves of a run, and how many charges they have."""
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
    """Return how many charges a run needs."""
    wanted = int(np.ceil((digits + CHARGE_MARGIN) / convergence_rate(row)))
    return min(max(wanted, FEWEST_CHARGES), MOST_CHARGES)


@compiled
def _pair_runs(
    table: Array, rank: Integers, digits: float, closed: bool
) -> tuple[Integers, Integers, Array]:
    """Pair neighbouring runs, level by level: children, span and row of each; fills in ``rank``."""
    gaps, runs = table.shape[0], rank.shape[0]
    children = np.full((runs, 2), -1)
    span = np.empty((runs, 2), dtype=np.int64)
    rows = np.empty((runs, table.shape[1]))
    for k in range(gaps):
        span[k] = k
        rows[k] = table[k]
    level = np.arange(gaps)
    made = gaps
    while level.shape[0] > 1:
        above = np.empty((level.shape[0] + 1) // 2, dtype=np.int64)
        for i in range(level.shape[0] // 2):
            children[made, 0] = level[2 * i]
            children[made, 1] = level[2 * i + 1]
            span[made, 0] = span[level[2 * i], 0]
            span[made, 1] = span[level[2 * i + 1], 1]
            if made < runs - 1 or not closed:
                rows[made] = _interval(table, span[made, 0], span[made, 1])
                rank[made] = _wanted_rank(rows[made], digits)
            above[i] = made
            made += 1
        if level.shape[0] % 2 == 1:
            above[-1] = level[-1]
        level = above
    return children, span, rows


@compiled
def build_tree(
    table: Array, offset: Integers, theta: Array, stretch: Array, digits: float, closed: bool
) -> Tree:
    """Build the tree over the gaps of ``table``, whose nodes are ``theta`` with dθ/dη ``stretch``.

    ``closed`` if they are all gaps of the period, so that there is nothing outside; else they must
    leave space for at least one more.
    """
    gaps = table.shape[0]
    runs = 2 * gaps - 1
    rank = np.zeros(runs, dtype=np.int64)
    for k in range(gaps):
        rank[k] = offset[k + 1] - offset[k]
    children, span, rows = _pair_runs(table, rank, digits, closed)
    at = np.zeros(runs + 1, dtype=np.int64)
    square = np.zeros(runs + 1, dtype=np.int64)
    inner = np.zeros(runs + 1, dtype=np.int64)
    mixed = np.zeros(runs + 1, dtype=np.int64)
    lift = np.zeros(runs + 1, dtype=np.int64)
    for run in range(runs):
        r = rank[run]
        at[run + 1] = at[run] + r
        square[run + 1] = square[run] + r * r
        one = 0
        two = 0
        if run >= gaps:
            one = rank[children[run, 0]]
            two = rank[children[run, 1]]
        inner[run + 1] = inner[run] + one * one
        mixed[run + 1] = mixed[run] + one * two
        lift[run + 1] = lift[run] + (one + two) * r
    places = np.empty(at[runs])
    stretches = np.empty(at[runs])
    places[: theta.shape[0]] = theta
    stretches[: theta.shape[0]] = stretch
    tree = Tree(
        children, span, rows, rank, at, square, inner, mixed, lift, places, stretches,
        np.empty(mixed[runs]), np.empty(lift[runs]),
    )  # fmt: skip
    for run in range(gaps, runs):
        _place_charges(tree, run)
    return tree


@compiled
def _place_charges(tree: Tree, run: int) -> None:
    """Place the charges of a run, and compute its interpolation and kernel."""
    at, r, row = tree.node_start, tree.rank[run], tree.rows[run]
    places, stretches = tree.theta, tree.stretch
    for i in range(r):
        t = np.pi * (r - i - 0.5) / r
        places[at[run] + i], stretches[at[run] + i] = theta_at(row, np.cos(t))
    begin = tree.interpolation_start[run]
    for half in range(2):
        child = tree.children[run, half]
        own = slice(at[child], at[child + 1])
        end = begin + tree.rank[child] * r
        _interpolate(row, places[own], stretches[own], r, tree.interpolation[begin:end])
        begin = end
    own = slice(at[tree.children[run, 0]], at[tree.children[run, 0] + 1])
    other = slice(at[tree.children[run, 1]], at[tree.children[run, 1] + 1])
    kernel = tree.kernel[run_span(tree.kernel_start, run)]
    _kernel(places[own], stretches[own], places[other], stretches[other], kernel)


@compiled
def replace_run(tree: Tree, run: int, table: Array, digits: float) -> bool:
    """Place the charges of a run anew; returns whether it has enough.

    One less than it needs is enough: the margin covers it.
    """
    if tree.rank[run] > 0:
        tree.rows[run] = _interval(table, tree.span[run, 0], tree.span[run, 1])
        if _wanted_rank(tree.rows[run], digits) > tree.rank[run] + 1:
            return False
    _place_charges(tree, run)
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


@compiled
def _interpolate(row: Array, theta: Array, stretch: Array, rank: int, out: Array) -> None:
    """Interpolate potentials from the nodes of an interval to places inside it, flat."""
    node = np.empty(rank)
    share = np.empty(rank)
    for a in range(rank):
        t = np.pi * (rank - a - 0.5) / rank
        node[a] = np.cos(t)
        share[a] = np.sin(t) if a % 2 == 0 else -np.sin(t)
    for b in range(theta.shape[0]):
        x, _, slope = eta_at(row, theta[b])
        scale = stretch[b] * slope
        total = 0.0
        hit = -1
        line = out[b * rank : (b + 1) * rank]
        for a in range(rank):
            if x == node[a]:
                hit = a
            line[a] = share[a] / (x - node[a])
            total += line[a]
        if hit >= 0:
            line[:] = 0.0
            line[hit] = scale
        else:
            for a in range(rank):
                line[a] *= scale / total
