"""Solve the interaction of many gaps on their tree (``cluster_tree``) directly.

With R the response of a run, q = q° - R g, a pair of neighbours 1, 2 obeys

    g1 = E1 g - K12 q2,      g2 = E2 g - K21 q1,      q = E1ᵀ q1 + E2ᵀ q2:

its potential g and the charges of both halves give g1 = c1 + D1 g and g2 = c2 + D2 g. Going up the
tree gives R, c and D of every run, going down the potentials at every gap. The work grows as the
number of gaps. The responses are symmetric, and the number of negative eigenvalues, that is
stability, is counted on the way up.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.field.cluster_tree import Tree, run_halves, run_span
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import WEAK_INTERACTION


class TreeFactor(NamedTuple):
    """Factor of a tree, flat (see :class:`Tree` for the offsets).

    Attributes
    ----------
    response : array
        R of every run.
    pair_inverse : array
        (1 - K12 R2 K21 R1)⁻¹ of every pair.
    inner_potential : array
        D of both halves of every pair: their potentials by a potential outside.
    negative : int array, shape (runs,)
        Number of negative eigenvalues of every run; the whole is the last one.
    nearest : array, shape (runs,)
        Distance of each gap's 2×2, or of the pair of a run's halves, from singular: 1 without
        interaction.
    """

    response: Array
    pair_inverse: Array
    inner_potential: Array
    negative: Integers
    nearest: Array


class Charges(NamedTuple):
    """Charges of all runs, one row a column of loads, shape (columns, nodes of all runs).

    Attributes
    ----------
    isolated : array
        q°, without potentials from outside the run.
    potential_of_sibling : array
        c, the potential of the other half of the run's parent, without any from outside that.
    """

    isolated: Array
    potential_of_sibling: Array


@compiled_sums
def eliminate(a: Array, x: Array) -> None:
    """Solve a y = x for the columns of x, both overwritten."""
    n = a.shape[0]
    columns = x.shape[1]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            for j in range(columns):
                x[k, j], x[best, j] = x[best, j], x[k, j]
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


@compiled_sums
def count_negative(h: Array, r: Array) -> tuple[int, float]:
    """Count the negative eigenvalues of [[h, 1], [1, r]], h and r symmetric and overwritten.

    By pivots of two rows, one of each half: where h r is small they are far from singular. Returns
    also the least of their determinants, without sign: about the least of those of 1 - h r.
    """
    n = h.shape[0]
    x, columns = np.eye(n), np.empty((2, n))
    of_h, of_r = columns[0], columns[1]
    negative, least = 0, 1.0
    for k in range(n):
        _take_pivot(h, r, x, k)
        a, b, c = h[k, k], x[k, k], r[k, k]
        det = a * c - b * b
        least = min(least, abs(det))
        if det < 0:
            negative += 1
        elif a + c < 0:
            negative += 2
        for i in range(k + 1, n):
            of_h[i], of_r[i] = x[i, k], x[k, i]
        for i in range(k + 1, n):
            own, cross = h[i, k], of_h[i]
            first, second = (c * own - b * cross) / det, (a * cross - b * own) / det
            own, cross = r[i, k], of_r[i]
            third, fourth = (c * cross - b * own) / det, (a * own - b * cross) / det
            for j in range(k + 1, n):
                x[i, j] -= first * of_r[j] + second * r[k, j]
            for j in range(k + 1, n):
                h[i, j] -= first * h[k, j] + second * of_h[j]
            for j in range(k + 1, n):
                r[i, j] -= third * of_r[j] + fourth * r[k, j]
    return negative, least


@compiled
def _take_pivot(h: Array, r: Array, x: Array, k: int) -> None:
    """Bring the pivot with the largest determinant to row and column ``k``."""
    best, largest = k, 0.0
    for i in range(k, h.shape[0]):
        det = abs(h[i, i] * r[i, i] - x[i, i] * x[i, i])
        if det > largest:
            best, largest = i, det
    if best == k:
        return
    for a in (h, r, x):
        for j in range(h.shape[0]):
            a[k, j], a[best, j] = a[best, j], a[k, j]
        for i in range(h.shape[0]):
            a[i, k], a[i, best] = a[i, best], a[i, k]


@compiled
def empty_factor(tree: Tree) -> TreeFactor:
    """Allocate the factor of a tree."""
    runs = tree.rank.shape[0]
    return TreeFactor(
        response=np.empty(tree.response_start[runs]),
        pair_inverse=np.empty(tree.pair_start[runs]),
        inner_potential=np.empty(tree.interpolation_start[runs]),
        negative=np.zeros(runs, dtype=np.int64),
        nearest=np.ones(runs),
    )


@compiled
def factor_tree(tree: Tree, gap_response: Array, gap_negative: Integers) -> TreeFactor:
    """Compute the responses of all runs from those of the gaps (flat, one after the other).

    ``gap_negative`` are the gaps' numbers of negative eigenvalues.
    """
    runs = tree.rank.shape[0]
    count = (runs + 1) // 2
    factor = empty_factor(tree)
    factor.response[: tree.response_start[count]] = gap_response
    factor.negative[:count] = gap_negative
    for run in range(count, runs):
        factor_run(tree, factor, run)
    return factor


@compiled
def factor_run(tree: Tree, factor: TreeFactor, run: int) -> None:
    """Compute the response of a run from those of its halves.

    With H = K12 R2 K21 a pair of halves has n - count [[H, 1], [1, R1]] negative eigenvalues more
    than its halves, n that of nodes of the first half: Haynsworth's formula, applied twice. These
    are none where the eigenvalues of H R1, real if one of both is definite, are below one.
    """
    responses, negative = factor.response, factor.negative
    one, two, n, m = run_halves(tree, run)
    r = tree.rank[run]
    first = responses[run_span(tree.response_start, one)].reshape(n, n)
    second = responses[run_span(tree.response_start, two)].reshape(m, m)
    kernel = tree.kernel[run_span(tree.kernel_start, run)].reshape(n, m)
    inverse = factor.pair_inverse[run_span(tree.pair_start, run)].reshape(n, n)
    # (1 - H R1)⁻¹, H = K12 R2 K21
    half = np.dot(kernel, second)
    reflected = np.dot(half, kernel.T)
    matrix = np.dot(reflected, first)
    squares = _trace_of_square(matrix)
    for i in range(n):
        for j in range(n):
            inverse[i, j] = 0.0
            matrix[i, j] = -matrix[i, j]
        inverse[i, i] = 1.0
        matrix[i, i] += 1.0
    eliminate(matrix, inverse)
    negative[run], factor.nearest[run] = negative[one] + negative[two], 1.0
    if squares > WEAK_INTERACTION or (negative[one] > 0 and negative[two] > 0):
        counted, factor.nearest[run] = count_negative(reflected, first.copy())
        negative[run] += n - counted
    if r == 0:
        return
    interpolation = tree.interpolation[run_span(tree.interpolation_start, run)].reshape(n + m, r)
    inward = factor.inner_potential[run_span(tree.interpolation_start, run)].reshape(n + m, r)
    charges = np.empty((n + m, r))  # by the potential, with the other sign
    # D1 = (1 - H R1)⁻¹ (E1 + K12 R2 E2), D2 = E2 + K21 R1 D1
    drive = np.dot(half, interpolation[n:])
    _add(interpolation[:n], drive)
    np.dot(inverse, drive, inward[:n])
    np.dot(first, inward[:n], charges[:n])
    np.dot(kernel.T, charges[:n], inward[n:])
    _add(interpolation[n:], inward[n:])
    np.dot(second, inward[n:], charges[n:])
    response = responses[run_span(tree.response_start, run)].reshape(r, r)
    np.dot(interpolation.T, charges, response)
    for i in range(r):
        for j in range(i):
            mean = 0.5 * (response[i, j] + response[j, i])
            response[i, j] = mean
            response[j, i] = mean


@compiled_sums
def _trace_of_square(a: Array) -> float:
    """Add up the squares of the eigenvalues of a matrix."""
    total = 0.0
    for i in range(a.shape[0]):
        for j in range(i):
            total += 2 * a[i, j] * a[j, i]
        total += a[i, i] * a[i, i]
    return total


@compiled
def _add(a: Array, out: Array) -> None:
    """Add a to ``out``."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            out[i, j] += a[i, j]


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
    """Compute the charges of a run from those of its halves, and the halves' potentials."""
    one, two, n, m = run_halves(tree, run)
    first = factor.response[run_span(tree.response_start, one)]
    second = factor.response[run_span(tree.response_start, two)]
    kernel = tree.kernel[run_span(tree.kernel_start, run)]
    inverse = factor.pair_inverse[run_span(tree.pair_start, run)]
    up = tree.interpolation[run_span(tree.interpolation_start, run)]
    split = n * tree.rank[run]
    q1, g, q2 = work[0, :n], work[1, :n], work[2, :m]
    for column in range(charges.potential_of_sibling.shape[0]):
        isolated, mutual = charges.isolated[column], charges.potential_of_sibling[column]
        g1 = mutual[run_span(tree.node_start, one)]
        g2 = mutual[run_span(tree.node_start, two)]
        q1[:] = isolated[run_span(tree.node_start, one)]
        q2[:] = isolated[run_span(tree.node_start, two)]
        # g1 = -(1 - H R1)⁻¹ K12 (q2° + R2 K21 q1°);  g2 = -K21 q1
        g2[:] = 0.0
        _add_transposed(kernel, q1, g2)
        _add_apply(second, g2, q2)
        g[:] = 0.0
        _add_apply(kernel, q2, g)
        g1[:] = 0.0
        _add_apply(inverse, g, g1)  # still with the other sign
        _add_apply(first, g1, q1)
        q2[:] = isolated[run_span(tree.node_start, two)]
        g2[:] = 0.0
        _add_transposed(kernel, q1, g2)
        _add_apply(second, g2, q2)
        for i in range(n):
            g1[i] = -g1[i]
        for i in range(m):
            g2[i] = -g2[i]
        q = isolated[run_span(tree.node_start, run)]
        q[:] = 0.0
        _add_transposed(up[:split], q1, q)
        _add_transposed(up[split:], q2, q)


@compiled
def upward_pass(tree: Tree, factor: TreeFactor, isolated: Array) -> Charges:
    """Compute the charges of all runs.

    ``isolated``, shape (N, columns), are the charges that each gap would have by itself.
    """
    runs = tree.rank.shape[0]
    count = (runs + 1) // 2
    size = tree.node_start[runs]
    charges = Charges(np.empty((isolated.shape[1], size)), np.zeros((isolated.shape[1], size)))
    charges.isolated[:, : isolated.shape[0]] = isolated.T
    work = np.empty((3, tree.rank.max()))
    for run in range(count, runs):
        charge_run(tree, factor, run, charges, work)
    return charges


@compiled
def downward_pass(
    tree: Tree,
    factor: TreeFactor,
    wanted: NDArray[np.bool_],
    charges: Charges,
    potential: Array,
) -> None:
    """Compute the potentials of wanted runs, shape (columns, nodes of all runs), in place.

    The runs that hold a wanted one must be wanted, too. There is no potential outside the whole.
    """
    runs = tree.rank.shape[0]
    count = (runs + 1) // 2
    for run in range(runs - 1, count - 1, -1):
        if not wanted[run]:
            continue
        inward = factor.inner_potential[run_span(tree.interpolation_start, run)]
        at = 0
        for half in range(2):
            child = tree.children[run, half]
            size = tree.rank[child] * tree.rank[run]
            if wanted[child]:
                own = run_span(tree.node_start, child)
                for column in range(potential.shape[0]):
                    potential[column, own] = charges.potential_of_sibling[column, own]
                    outer = potential[column][run_span(tree.node_start, run)]
                    _add_apply(inward[at : at + size], outer, potential[column][own])
            at += size


@compiled
def whole_tree(tree: Tree) -> NDArray[np.bool_]:
    """Mark all runs of a tree, for :func:`downward_pass`."""
    return np.ones(tree.rank.shape[0], dtype=np.bool_)
