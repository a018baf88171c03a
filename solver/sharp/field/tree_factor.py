"""Interaction of many gaps on their tree (``cluster_tree``), solved directly.

With R the response of a run, q = q° - R g, a pair of neighbours 1, 2 obeys

    q1 = q1° - R1 (E1 g - K12 q2),      q2 = q2° - R2 (E2 g - K21 q1),

and the pair's charges are q = E1ᵀ q1 + E2ᵀ q2. Going up the tree gives the response of every run,
going down the potentials at every gap. The work grows as the number of gaps. The responses are
symmetric, and the number of negative eigenvalues, that is stability, is counted on the way up.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.field.cluster_tree import Tree, run_halves, run_span
from adhesis.solver.sharp.gap.quadrature import Integers


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
    one, two, n, m = run_halves(tree, run)
    r = tree.rank[run]
    first = responses[run_span(tree.response_start, one)].reshape(n, n)
    second = responses[run_span(tree.response_start, two)].reshape(m, m)
    kernel = tree.kernel[run_span(tree.kernel_start, run)].reshape(n, m)
    w = factor.pair[run_span(tree.pair_start, run)].reshape(n, n)
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
    interpolation = tree.interpolation[run_span(tree.interpolation_start, run)].reshape(n + m, r)
    charges = factor.charge[run_span(tree.interpolation_start, run)].reshape(n + m, r)
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
    response = responses[run_span(tree.response_start, run)].reshape(r, r)
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
    one, two, n, m = run_halves(tree, run)
    first = factor.response[run_span(tree.response_start, one)]
    second = factor.response[run_span(tree.response_start, two)]
    kernel = tree.kernel[run_span(tree.kernel_start, run)]
    w = factor.pair[run_span(tree.pair_start, run)]
    up = tree.interpolation[run_span(tree.interpolation_start, run)]
    split = n * tree.rank[run]
    a = work[0, :n]
    b = work[1, :m]
    isolated, coupled = charges.isolated, charges.coupled
    for column in range(coupled.shape[0]):
        q1 = coupled[column][run_span(tree.node_start, one)]
        q2 = coupled[column][run_span(tree.node_start, two)]
        q1[:] = isolated[column][run_span(tree.node_start, one)]
        q2[:] = isolated[column][run_span(tree.node_start, two)]
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
        q = isolated[column][run_span(tree.node_start, run)]
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
    one, two, n, m = run_halves(tree, run)
    kernel = tree.kernel[run_span(tree.kernel_start, run)]
    up = tree.interpolation[run_span(tree.interpolation_start, run)]
    by_potential = factor.charge[run_span(tree.interpolation_start, run)]
    split = n * tree.rank[run]
    for column in range(charges.shape[0]):
        q1 = charges[column][run_span(tree.node_start, one)]
        q2 = charges[column][run_span(tree.node_start, two)]
        g1 = potential[column][run_span(tree.node_start, one)]
        g2 = potential[column][run_span(tree.node_start, two)]
        g = potential[column][run_span(tree.node_start, run)]
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
