"""Many gaps: their interaction on a binary tree of neighbours, solved directly.

In its own coordinate η (``conformal_map``) a gap acts on the others
through charges q_i = w_i f_i at its nodes and feels the potentials g_i = (dθ/dη) g(θ_i) there,

    g_i = -Σ_j K_ij q_j,      K_ij = (dθ/dη)_i (dθ/dη)_j / (4π sin²((θ_i - θ_j)/2)).

A run of neighbouring gaps is an interval between two patches, just as a gap is one: in *its*
coordinate all that lies outside is again on the line Im η = π/(2α), however narrow the patches at
its ends. So what it does to the outside is that of a few charges at the Chebyshev nodes of η, their
number growing with the logarithm of run over patch. With R the response of a run, q = q° - R g, a
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
    convergence,
    one_minus_plus,
    theta_at,
)

Integers = NDArray[np.int64]

_MARGIN = 1.0  # digits (base e) of a run's charges beyond those of the field
_FEWEST = 4  # charges of a run, at least
_MOST = 160


class Tree(NamedTuple):
    """Runs of neighbouring gaps: first the L gaps, then pairs of runs, the last one the whole.

    Attributes
    ----------
    children : int array, shape (runs, 2)
        Both halves of a run; -1 for a gap.
    rank : int array, shape (runs,)
        Number of charges.
    at, square, inner, mixed, lift : int array, shape (runs,)
        Offsets: of its charges, of matrices (rank, rank), of (half 1, half 1), of (half 1, half 2)
        and of (both halves, rank).
    theta, stretch : array
        θ and dθ/dη of all charges.
    kernel : array
        K12 of all pairs, flat.
    lifted : array
        E of all pairs, flat.
    """

    children: Integers
    rank: Integers
    at: Integers
    square: Integers
    inner: Integers
    mixed: Integers
    lift: Integers
    theta: Array
    stretch: Array
    kernel: Array
    lifted: Array


class Response(NamedTuple):
    """Responses of all runs of a tree, flat (see :class:`Tree` for the offsets).

    Attributes
    ----------
    own : array
        R of every run.
    pair : array
        W = (R1⁻¹ - K12 R2 K21)⁻¹ of every pair.
    felt : array
        Charges of both halves of a pair by the potentials at its nodes.
    negative : int
        Number of negative eigenvalues of the whole.
    """

    own: Array
    pair: Array
    felt: Array
    negative: int


@compiled
def _interval(table: Array, first: int, last: int) -> Array:
    """Row of the table of gaps for a run of them."""
    row: Array = table[first].copy()
    length = table[last, RIGHT] - table[first, LEFT]
    row[RIGHT] = table[last, RIGHT]
    row[RIGHT_PATCH] = table[last, RIGHT_PATCH]
    row[ALPHA] = 0.25 * (np.log1p(length / row[LEFT_PATCH]) + np.log1p(length / row[RIGHT_PATCH]))
    return row


@compiled
def plant(
    table: Array, offset: Integers, theta: Array, stretch: Array, digits: float, closed: bool
) -> Tree:
    """Tree over the gaps of ``table``, whose nodes are ``theta`` with dθ/dη ``stretch``.

    ``closed`` if they are all gaps of the period, so that there is nothing outside; else they must
    leave room for at least one more.
    """
    gaps = table.shape[0]
    runs = 2 * gaps - 1
    children = np.full((runs, 2), -1)
    span = np.empty((runs, 2), dtype=np.int64)
    rank = np.zeros(runs, dtype=np.int64)
    rows = np.empty((runs, table.shape[1]))
    for k in range(gaps):
        span[k] = k
        rank[k] = offset[k + 1] - offset[k]
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
                wanted = int(np.ceil((digits + _MARGIN) / convergence(rows[made])))
                rank[made] = min(max(wanted, _FEWEST), _MOST)
            above[i] = made
            made += 1
        if level.shape[0] % 2 == 1:
            above[-1] = level[-1]
        level = above
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
    kernel = np.empty(mixed[runs])
    lifted = np.empty(lift[runs])
    for run in range(gaps, runs):
        for i in range(rank[run]):
            t = np.pi * (rank[run] - i - 0.5) / rank[run]
            places[at[run] + i], stretches[at[run] + i] = theta_at(rows[run], np.cos(t))
        one = children[run, 0]
        two = children[run, 1]
        _kernel(
            places[at[one] : at[one + 1]], stretches[at[one] : at[one + 1]],
            places[at[two] : at[two + 1]], stretches[at[two] : at[two + 1]],
            kernel[mixed[run] : mixed[run + 1]],
        )  # fmt: skip
        _lift(
            rows[run], places[at[one] : at[one + 1]], stretches[at[one] : at[one + 1]], rank[run],
            lifted[lift[run] : lift[run] + rank[one] * rank[run]],
        )  # fmt: skip
        _lift(
            rows[run], places[at[two] : at[two + 1]], stretches[at[two] : at[two + 1]], rank[run],
            lifted[lift[run] + rank[one] * rank[run] : lift[run + 1]],
        )  # fmt: skip
    return Tree(
        children, rank, at, square, inner, mixed, lift, places, stretches, kernel, lifted
    )  # fmt: skip


@compiled_sums
def _kernel(theta: Array, stretch: Array, other: Array, other_stretch: Array, out: Array) -> None:
    """K between two sets of charges, flat."""
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
def _lift(row: Array, theta: Array, stretch: Array, rank: int, out: Array) -> None:
    """Interpolation of potentials from the nodes of an interval to places inside it, flat."""
    middle = 0.5 * (row[LEFT] + row[RIGHT])
    length = row[RIGHT] - row[LEFT]
    node = np.empty(rank)
    share = np.empty(rank)
    for a in range(rank):
        t = np.pi * (rank - a - 0.5) / rank
        node[a] = np.cos(t)
        share[a] = np.sin(t) if a % 2 == 0 else -np.sin(t)
    for b in range(theta.shape[0]):
        side = 0 if theta[b] < middle else 1
        r = theta[b] - row[LEFT] if side == 0 else row[RIGHT] - theta[b]
        own = row[LEFT_PATCH] if side == 0 else row[RIGHT_PATCH]
        far = length + (row[RIGHT_PATCH] if side == 0 else row[LEFT_PATCH])
        minus, plus = one_minus_plus(row, r, side)
        x = plus - 1 if plus < minus else 1 - minus
        scale = stretch[b] * (1 / (own + r) + 1 / (far - r)) / (2 * row[ALPHA])
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
def eliminate(a: Array, x: Array) -> bool:
    """Solve a y = x for the columns of x, both overwritten; whether det a is negative."""
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
def respond(tree: Tree, gaps_own: Array, gaps_negative: Integers) -> Response:
    """Responses of all runs from those of the gaps, ``gaps_own`` (flat, one after the other).

    ``gaps_negative`` are the gaps' numbers of negative eigenvalues. A whole has no fewer than each
    of its halves; a pair's determinant tells whether their number is even. Two that appear
    together in one pair go unseen: pulls of two places that are equal to rounding.
    """
    runs = tree.rank.shape[0]
    gaps = (runs + 1) // 2
    own = np.empty(tree.square[runs])
    own[: tree.square[gaps]] = gaps_own
    negative = np.zeros(runs, dtype=np.int64)
    negative[:gaps] = gaps_negative
    pair = np.empty(tree.inner[runs])
    felt = np.empty(tree.lift[runs])
    for run in range(gaps, runs):
        one = tree.children[run, 0]
        two = tree.children[run, 1]
        n = tree.rank[one]
        m = tree.rank[two]
        r = tree.rank[run]
        first = own[tree.square[one] : tree.square[one + 1]].reshape(n, n)
        second = own[tree.square[two] : tree.square[two + 1]].reshape(m, m)
        kernel = tree.kernel[tree.mixed[run] : tree.mixed[run + 1]].reshape(n, m)
        w = pair[tree.inner[run] : tree.inner[run + 1]].reshape(n, n)
        # W = (R1⁻¹ - H)⁻¹ = (1 - R1 H)⁻¹ R1, H = K12 R2 K21
        half = np.dot(kernel, second)
        felt_back = np.dot(half, kernel.T)
        matrix = np.dot(first, felt_back)
        for i in range(n):
            for j in range(n):
                w[i, j] = first[i, j]
                matrix[i, j] = -matrix[i, j]
            matrix[i, i] += 1.0
        odd = eliminate(matrix, w)
        count = max(negative[one], negative[two])
        if (negative[one] + negative[two] + count + (1 if odd else 0)) % 2 == 1:
            count += 1
        negative[run] = count
        if r == 0:
            continue
        lifted = tree.lifted[tree.lift[run] : tree.lift[run + 1]].reshape(n + m, r)
        charges = felt[tree.lift[run] : tree.lift[run + 1]].reshape(n + m, r)
        # q1 = W (E1 + K12 R2 E2), q2 = R2 (E2 + K21 q1)
        drive = np.dot(half, lifted[n:])
        for i in range(n):
            for j in range(r):
                drive[i, j] += lifted[i, j]
        np.dot(w, drive, charges[:n])
        more = np.dot(kernel.T, charges[:n])
        for i in range(m):
            for j in range(r):
                more[i, j] += lifted[n + i, j]
        np.dot(second, more, charges[n:])
        response = own[tree.square[run] : tree.square[run + 1]].reshape(r, r)
        np.dot(lifted.T, charges, response)
        for i in range(r):
            for j in range(i):
                mean = 0.5 * (response[i, j] + response[j, i])
                response[i, j] = mean
                response[j, i] = mean
    return Response(own, pair, felt, negative[runs - 1])


@compiled_sums
def _apply(a: Array, x: Array, out: Array) -> None:
    """Into ``out``: a x, a flat."""
    n = x.shape[0]
    for i in range(out.shape[0]):
        row = a[i * n : (i + 1) * n]
        total = 0.0
        for k in range(n):
            total += row[k] * x[k]
        out[i] = total


@compiled_sums
def _add_apply(a: Array, x: Array, out: Array) -> None:
    """To ``out``: a x, a flat."""
    n = x.shape[0]
    for i in range(out.shape[0]):
        row = a[i * n : (i + 1) * n]
        total = 0.0
        for k in range(n):
            total += row[k] * x[k]
        out[i] += total


@compiled_sums
def _add_transposed(a: Array, x: Array, out: Array) -> None:
    """To ``out``: aᵀ x, a flat."""
    n = out.shape[0]
    for k in range(x.shape[0]):
        value = x[k]
        row = a[k * n : (k + 1) * n]
        for j in range(n):
            out[j] += value * row[j]


@compiled
def collect(tree: Tree, response: Response, alone: Array) -> Array:
    """Charges of all runs, without potentials from outside a run's parent, columns as ``alone``.

    ``alone``, shape (N, columns), are the charges that each gap would have by itself.
    """
    runs = tree.rank.shape[0]
    gaps = (runs + 1) // 2
    charge = np.zeros((alone.shape[1], tree.at[runs]))
    charge[:, : alone.shape[0]] = alone.T
    room = np.empty((2, tree.rank.max()))
    for run in range(gaps, runs):
        one = tree.children[run, 0]
        two = tree.children[run, 1]
        n = tree.rank[one]
        m = tree.rank[two]
        first = response.own[tree.square[one] : tree.square[one + 1]]
        second = response.own[tree.square[two] : tree.square[two + 1]]
        kernel = tree.kernel[tree.mixed[run] : tree.mixed[run + 1]]
        w = response.pair[tree.inner[run] : tree.inner[run + 1]]
        up = tree.lifted[tree.lift[run] : tree.lift[run + 1]]
        split = n * tree.rank[run]
        a = room[0, :n]
        b = room[1, :m]
        for column in range(charge.shape[0]):
            q1 = charge[column, tree.at[one] : tree.at[one + 1]]
            q2 = charge[column, tree.at[two] : tree.at[two + 1]]
            # q1 = t + W K12 R2 K21 t, t = q1° + R1 K12 q2°;  q2 = q2° + R2 K21 q1
            _apply(kernel, q2, a)
            _add_apply(first, a, q1)
            b[:] = 0.0
            _add_transposed(kernel, q1, b)
            c = room[0, :m]
            _apply(second, b, c)
            _apply(kernel, c, room[1, :n])
            _add_apply(w, room[1, :n], q1)
            b[:] = 0.0
            _add_transposed(kernel, q1, b)
            _add_apply(second, b, q2)
            q = charge[column, tree.at[run] : tree.at[run + 1]]
            _add_transposed(up[:split], q1, q)
            _add_transposed(up[split:], q2, q)
    return np.ascontiguousarray(charge.T)


@compiled
def distribute(tree: Tree, response: Response, charge: Array, outside: Array) -> Array:
    """Potentials at all gaps, shape (N, columns), from charges of :func:`collect`.

    ``outside`` are those at the nodes of the whole, shape (its rank, columns). ``charge`` becomes
    that of the whole tree.
    """
    runs = tree.rank.shape[0]
    gaps = (runs + 1) // 2
    charges = np.ascontiguousarray(charge.T)
    potential = np.zeros(charges.shape)
    potential[:, tree.at[runs - 1] : tree.at[runs]] = outside.T
    room = np.empty(tree.rank.max())
    for run in range(runs - 1, gaps - 1, -1):
        one = tree.children[run, 0]
        two = tree.children[run, 1]
        n = tree.rank[one]
        m = tree.rank[two]
        kernel = tree.kernel[tree.mixed[run] : tree.mixed[run + 1]]
        up = tree.lifted[tree.lift[run] : tree.lift[run + 1]]
        felt = response.felt[tree.lift[run] : tree.lift[run + 1]]
        split = n * tree.rank[run]
        for column in range(charges.shape[0]):
            q1 = charges[column, tree.at[one] : tree.at[one + 1]]
            q2 = charges[column, tree.at[two] : tree.at[two + 1]]
            g1 = potential[column, tree.at[one] : tree.at[one + 1]]
            g2 = potential[column, tree.at[two] : tree.at[two + 1]]
            g = potential[column, tree.at[run] : tree.at[run + 1]]
            a = room[:n]
            _apply(felt[:split], g, a)
            for i in range(n):
                q1[i] -= a[i]
            b = room[:m]
            _apply(felt[split:], g, b)
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
    charge[:] = charges.T
    return np.ascontiguousarray(potential[:, : tree.at[gaps]].T)
