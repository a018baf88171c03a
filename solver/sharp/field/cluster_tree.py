"""Interaction of many gaps on a binary tree of neighbours, solved directly.

In its own coordinate η (``conformal_map``) a gap acts on the others through charges q_i = w_i f_i
at its nodes; the others' potentials g_i = (dθ/dη) g(θ_i) there are

    g_i = -Σ_j K_ij q_j,      K_ij = (dθ/dη)_i (dθ/dη)_j / (4π sin²((θ_i - θ_j)/2)).

A run of neighbouring gaps is an interval between two patches, just as a gap is one: in *its*
coordinate all that lies outside is again on the line Im η = π/(2α), however narrow the patches at
its ends. So it acts on the outside like a few charges at the Chebyshev nodes of η, their number
growing with the logarithm of run over patch. With R the response of a run, q = q° - R g, a
pair of neighbours 1, 2 obeys

    q1 = q1° - R1 (E1 g - K12 q2),      q2 = q2° - R2 (E2 g - K21 q1),

E the interpolation from the nodes of the pair to those of its halves, and the pair's charges are
q = E1ᵀ q1 + E2ᵀ q2. Going up the tree gives the response of every run, going down the potentials
at every gap. The work grows as the number of gaps. The responses are symmetric, and the number of
negative eigenvalues, that is stability, is counted on the way up.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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


class TreeFactor(NamedTuple):
    """Factor of a tree, flat (see :class:`Tree` for the offsets).

    Attributes
    ----------
    response : array
        R of every run.
    pair : array
        W = (R1⁻¹ - K12 R2 K21)⁻¹ of every pair.
    charge : array
        Charges of both halves of a pair by the potentials at its nodes.
    negative : int array, shape (runs,)
        Number of negative eigenvalues of every run; the whole is the last one.
    """

    response: Array
    pair: Array
    charge: Array
    negative: Integers


class Charges(NamedTuple):
    """Charges of all runs, one row a column of loads, shape (columns, nodes of all runs).

    Attributes
    ----------
    isolated : array
        Without potentials from outside the run.
    coupled : array
        Without potentials from outside the run's parent.
    """

    isolated: Array
    coupled: Array


@compiled
def _span(start: Integers, run: int) -> slice:
    """Return where a flat array holds what belongs to a run."""
    return slice(start[run], start[run + 1])


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
    kernel = tree.kernel[_span(tree.kernel_start, run)]
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


@compiled_sums
def _eliminate(a: Array, x: Array) -> bool:
    """Solve a y = x for the columns of x, both overwritten; returns whether det a is negative."""
    n = a.shape[0]
    columns = x.shape[1]
    negative = False
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            negative = not negative
            for j in range(k, n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            for j in range(columns):
                x[k, j], x[best, j] = x[best, j], x[k, j]
        if a[k, k] < 0:
            negative = not negative
        pivot = 1 / a[k, k]
        for i in range(k + 1, n):
            factor = a[i, k] * pivot
            for j in range(k + 1, n):
                a[i, j] -= factor * a[k, j]
            for j in range(columns):
                x[i, j] -= factor * x[k, j]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            factor = a[k, i]
            for j in range(columns):
                x[k, j] -= factor * x[i, j]
        pivot = 1 / a[k, k]
        for j in range(columns):
            x[k, j] *= pivot
    return negative


@compiled
def empty_factor(tree: Tree) -> TreeFactor:
    """Make space for the factor of a tree."""
    runs = tree.rank.shape[0]
    return TreeFactor(
        response=np.empty(tree.response_start[runs]),
        pair=np.empty(tree.pair_start[runs]),
        charge=np.empty(tree.interpolation_start[runs]),
        negative=np.zeros(runs, dtype=np.int64),
    )


@compiled
def factor_tree(tree: Tree, gap_response: Array, gap_negative: Integers) -> TreeFactor:
    """Compute the responses of all runs from those of the gaps (flat, one after the other).

    ``gap_negative`` are the gaps' numbers of negative eigenvalues.
    """
    runs = tree.rank.shape[0]
    gaps = (runs + 1) // 2
    factor = empty_factor(tree)
    factor.response[: tree.response_start[gaps]] = gap_response
    factor.negative[:gaps] = gap_negative
    for run in range(gaps, runs):
        factor_run(tree, factor, run)
    return factor


@compiled
def factor_run(tree: Tree, factor: TreeFactor, run: int) -> None:
    """Compute the response of a run from those of its halves.

    A whole has no fewer negative eigenvalues than each of its halves; the sign of a pair's
    determinant gives whether their number is even. Two that appear together in one pair go unseen:
    two places whose forces are equal to rounding.
    """
    responses, negative = factor.response, factor.negative
    one = tree.children[run, 0]
    two = tree.children[run, 1]
    n = tree.rank[one]
    m = tree.rank[two]
    r = tree.rank[run]
    first = responses[_span(tree.response_start, one)].reshape(n, n)
    second = responses[_span(tree.response_start, two)].reshape(m, m)
    kernel = tree.kernel[_span(tree.kernel_start, run)].reshape(n, m)
    w = factor.pair[_span(tree.pair_start, run)].reshape(n, n)
    # W = (R1⁻¹ - H)⁻¹ = (1 - R1 H)⁻¹ R1, H = K12 R2 K21
    half = np.dot(kernel, second)
    reflected = np.dot(half, kernel.T)
    matrix = np.dot(first, reflected)
    for i in range(n):
        for j in range(n):
            w[i, j] = first[i, j]
            matrix[i, j] = -matrix[i, j]
        matrix[i, i] += 1.0
    odd = _eliminate(matrix, w)
    count = max(negative[one], negative[two])
    if (negative[one] + negative[two] + count + (1 if odd else 0)) % 2 == 1:
        count += 1
    negative[run] = count
    if r == 0:
        return
    interpolation = tree.interpolation[_span(tree.interpolation_start, run)].reshape(n + m, r)
    charges = factor.charge[_span(tree.interpolation_start, run)].reshape(n + m, r)
    # q1 = W (E1 + K12 R2 E2), q2 = R2 (E2 + K21 q1)
    drive = np.dot(half, interpolation[n:])
    for i in range(n):
        for j in range(r):
            drive[i, j] += interpolation[i, j]
    np.dot(w, drive, charges[:n])
    more = np.dot(kernel.T, charges[:n])
    for i in range(m):
        for j in range(r):
            more[i, j] += interpolation[n + i, j]
    np.dot(second, more, charges[n:])
    response = responses[_span(tree.response_start, run)].reshape(r, r)
    np.dot(interpolation.T, charges, response)
    for i in range(r):
        for j in range(i):
            mean = 0.5 * (response[i, j] + response[j, i])
            response[i, j] = mean
            response[j, i] = mean


@compiled_sums
def _apply(a: Array, x: Array, out: Array) -> None:
    """Compute a x into ``out``, a flat."""
    n = x.shape[0]
    for i in range(out.shape[0]):
        row = a[i * n : (i + 1) * n]
        total = 0.0
        for k in range(n):
            total += row[k] * x[k]
        out[i] = total


@compiled_sums
def _add_apply(a: Array, x: Array, out: Array) -> None:
    """Add a x to ``out``, a flat."""
    n = x.shape[0]
    for i in range(out.shape[0]):
        row = a[i * n : (i + 1) * n]
        total = 0.0
        for k in range(n):
            total += row[k] * x[k]
        out[i] += total


@compiled_sums
def _add_transposed(a: Array, x: Array, out: Array) -> None:
    """Add aᵀ x to ``out``, a flat."""
    n = out.shape[0]
    for k in range(x.shape[0]):
        value = x[k]
        row = a[k * n : (k + 1) * n]
        for j in range(n):
            out[j] += value * row[j]


@compiled
def charge_run(tree: Tree, factor: TreeFactor, run: int, charges: Charges, work: Array) -> None:
    """Compute the charges of a run from those of its two parts, and couple these."""
    one = tree.children[run, 0]
    two = tree.children[run, 1]
    n = tree.rank[one]
    m = tree.rank[two]
    first = factor.response[_span(tree.response_start, one)]
    second = factor.response[_span(tree.response_start, two)]
    kernel = tree.kernel[_span(tree.kernel_start, run)]
    w = factor.pair[_span(tree.pair_start, run)]
    up = tree.interpolation[_span(tree.interpolation_start, run)]
    split = n * tree.rank[run]
    a = work[0, :n]
    b = work[1, :m]
    isolated, coupled = charges.isolated, charges.coupled
    for column in range(coupled.shape[0]):
        q1 = coupled[column][_span(tree.node_start, one)]
        q2 = coupled[column][_span(tree.node_start, two)]
        q1[:] = isolated[column][_span(tree.node_start, one)]
        q2[:] = isolated[column][_span(tree.node_start, two)]
        # q1 = t + W K12 R2 K21 t, t = q1° + R1 K12 q2°;  q2 = q2° + R2 K21 q1
        _apply(kernel, q2, a)
        _add_apply(first, a, q1)
        b[:] = 0.0
        _add_transposed(kernel, q1, b)
        c = work[0, :m]
        _apply(second, b, c)
        _apply(kernel, c, work[1, :n])
        _add_apply(w, work[1, :n], q1)
        b[:] = 0.0
        _add_transposed(kernel, q1, b)
        _add_apply(second, b, q2)
        q = isolated[column][_span(tree.node_start, run)]
        q[:] = 0.0
        _add_transposed(up[:split], q1, q)
        _add_transposed(up[split:], q2, q)


@compiled
def upward_pass(tree: Tree, factor: TreeFactor, isolated: Array) -> Charges:
    """Compute the charges of all runs.

    ``isolated``, shape (N, columns), are the charges that each gap would have by itself.
    """
    runs = tree.rank.shape[0]
    gaps = (runs + 1) // 2
    size = tree.node_start[runs]
    charges = Charges(np.empty((isolated.shape[1], size)), np.zeros((isolated.shape[1], size)))
    charges.isolated[:, : isolated.shape[0]] = isolated.T
    work = np.empty((2, tree.rank.max()))
    for run in range(gaps, runs):
        charge_run(tree, factor, run, charges, work)
    return charges


@compiled
def _pass_potential(
    tree: Tree, factor: TreeFactor, run: int, charges: Array, potential: Array, work: Array
) -> None:
    """Compute potentials of the two parts of a run from its own, and change their charges."""
    one = tree.children[run, 0]
    two = tree.children[run, 1]
    n = tree.rank[one]
    m = tree.rank[two]
    kernel = tree.kernel[_span(tree.kernel_start, run)]
    up = tree.interpolation[_span(tree.interpolation_start, run)]
    by_potential = factor.charge[_span(tree.interpolation_start, run)]
    split = n * tree.rank[run]
    for column in range(charges.shape[0]):
        q1 = charges[column][_span(tree.node_start, one)]
        q2 = charges[column][_span(tree.node_start, two)]
        g1 = potential[column][_span(tree.node_start, one)]
        g2 = potential[column][_span(tree.node_start, two)]
        g = potential[column][_span(tree.node_start, run)]
        a = work[:n]
        _apply(by_potential[:split], g, a)
        for i in range(n):
            q1[i] -= a[i]
        b = work[:m]
        _apply(by_potential[split:], g, b)
        for i in range(m):
            q2[i] -= b[i]
        _apply(kernel, q2, a)
        _apply(up[:split], g, g1)
        for i in range(n):
            g1[i] -= a[i]
        b[:] = 0.0
        _add_transposed(kernel, q1, b)
        _apply(up[split:], g, g2)
        for i in range(m):
            g2[i] -= b[i]


@compiled
def downward_pass(
    tree: Tree, factor: TreeFactor, below: NDArray[np.bool_], charge: Array, potential: Array
) -> None:
    """Compute the potentials of all runs, and their final charges, in place.

    Both have the shape (columns, nodes of all runs). ``below`` marks the runs at whose nodes the
    potentials are given; those inside them are marked, too, and the others left as they are.
    ``charge`` begins as the coupled charges (:class:`Charges`).
    """
    runs = tree.rank.shape[0]
    gaps = (runs + 1) // 2
    work = np.empty(tree.rank.max())
    for run in range(runs - 1, gaps - 1, -1):
        if below[run]:
            below[tree.children[run, 0]] = True
            below[tree.children[run, 1]] = True
            _pass_potential(tree, factor, run, charge, potential, work)


@compiled
def whole_tree(tree: Tree) -> NDArray[np.bool_]:
    """Mark the whole of a tree, for :func:`downward_pass`."""
    below = np.zeros(tree.rank.shape[0], dtype=np.bool_)
    below[-1] = True
    return below
