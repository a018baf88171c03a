"""The field of many gaps: equation (1) of ``dense_solver`` on a tree of gaps.

The same equation as the dense solver's, with the same nodes; the interaction of the gaps is that of
``cluster_tree``. The work grows as the number of gaps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.assembly import one_gap
from adhesis.solver.sharp.field.cholesky import factor_rows, solve_factored
from adhesis.solver.sharp.field.cluster_tree import (
    Response,
    Tree,
    collect,
    distribute,
    plant,
    respond,
)
from adhesis.solver.sharp.field.solution import (
    Hold,
    PlainSolution,
    Solution,
    balanced,
    openings_at,
    plain,
)
from adhesis.solver.sharp.gap.conformal_map import in_order, map_gaps
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules


@compiled
def gap_blocks(
    table: Array, kinds: Kinds, offset: Kinds, fields: int, rules: Rules, panels: Panels
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """θ and X of the nodes, dη/dθ at the ends, diagonal blocks, loads (S~, X, S~'), higher modes.

    The block of gap k is ``blocks[offset[k] : offset[k + 1], :m]``, m its number of nodes.
    """
    gaps = table.shape[0]
    n = offset[gaps]
    widest = 0
    for k in range(gaps):
        widest = max(widest, rules.counts[kinds[k]])
    theta = np.empty(n)
    weight = np.empty(n)
    slope = np.empty((gaps, 2))
    rhs = np.empty((n, fields + 1))
    beyond = np.empty((gaps, 2, fields))
    blocks = np.zeros((n, widest))
    for k in range(gaps):
        own = slice(offset[k], offset[k + 1])
        one_gap(
            table[k], kinds[k], rules, panels, theta[own], weight[own], slope[k], rhs[own],
            beyond[k], blocks[own, : offset[k + 1] - offset[k]],
        )  # fmt: skip
    return theta, weight, slope, blocks, rhs, beyond


@compiled
def invert_gaps(
    kinds: Kinds, offset: Kinds, rules: Rules, blocks: Array
) -> tuple[Array, Array, bool]:
    """Inverses A⁻¹ of the diagonal blocks and w A⁻¹ w, flat; False if there is none."""
    size = 0
    for k in range(kinds.shape[0]):
        size += rules.counts[kinds[k]] ** 2
    inverse = np.empty(size)
    own = np.empty(size)
    at = 0
    for k in range(kinds.shape[0]):
        m = rules.counts[kinds[k]]
        start = rules.start[kinds[k]]
        factor = blocks[offset[k] : offset[k + 1], :m].copy()
        if not factor_rows(factor, 0.0):
            return inverse, own, False
        unit = np.zeros((m, m))
        for i in range(m):
            unit[i, i] = 1.0
        solve_factored(factor, unit)
        for i in range(m):
            for j in range(m):
                value = 0.5 * (unit[i, j] + unit[j, i])
                inverse[at + i * m + j] = value
                own[at + i * m + j] = rules.w[start + i] * value * rules.w[start + j]
        at += m * m
    return inverse, own, True


@compiled
def weights_of(kinds: Kinds, offset: Kinds, rules: Rules) -> Array:
    """Quadrature weights w of all nodes."""
    w = np.empty(offset[kinds.shape[0]])
    for k in range(kinds.shape[0]):
        start = rules.start[kinds[k]]
        for i in range(offset[k + 1] - offset[k]):
            w[offset[k] + i] = rules.w[start + i]
    return w


@compiled
def by_gaps(kinds: Kinds, offset: Kinds, rules: Rules, inverse: Array, x: Array) -> Array:
    """Inverse diagonal blocks times the columns of x."""
    out = np.zeros(x.shape)
    at = 0
    for k in range(kinds.shape[0]):
        m = rules.counts[kinds[k]]
        for i in range(m):
            for j in range(m):
                value = inverse[at + i * m + j]
                for c in range(x.shape[1]):
                    out[offset[k] + i, c] += value * x[offset[k] + j, c]
        at += m * m
    return out


class Gaps(NamedTuple):
    """What a step of all edges needs of a field of many gaps, beyond its :class:`Solution`.

    Attributes
    ----------
    blocks : array, shape (N, widest)
        Diagonal blocks of (1).
    inverse : array
        Their inverses, flat.
    w : array, shape (N,)
        Quadrature weights.
    tree : Tree
    response : Response
        That of the gaps with their edges held.
    """

    blocks: Array
    inverse: Array
    w: Array
    tree: Tree
    response: Response


@compiled
def solve_many(
    gaps: Array,
    prescribed: float,
    hold: Hold,
    kinds: Kinds,
    digits: float,
    fields: int,
    rules: Rules,
    panels: Panels,
) -> tuple[Solution, Gaps]:
    """Solve the field of many gaps; ``matrix`` and ``factor`` are empty.

    Otherwise as ``dense_solver.solve``.

    Of S' there is the load alone, no solution.

    ``digits`` is -ln of the wanted accuracy of the interaction.
    """
    table = map_gaps(gaps)
    count = table.shape[0]
    offset = np.zeros(count + 1, dtype=np.int64)
    for k in range(count):
        offset[k + 1] = offset[k] + rules.counts[kinds[k]]
    sound = in_order(table)
    if not sound:  # any edges with a field: what comes of them is marked as none
        table = map_gaps(np.arange(2.0 * count).reshape(count, 2) * (np.pi / count))
    theta, weight, slope, blocks, rhs, beyond = gap_blocks(
        table, kinds, offset, fields, rules, panels
    )
    inverse, own, definite = invert_gaps(kinds, offset, rules, blocks)
    w = weights_of(kinds, offset, rules)
    tree = plant(table, offset, theta, weight / w, digits, True)
    response = respond(tree, own, np.zeros(count, dtype=np.int64))
    of_gaps = Gaps(blocks, inverse, w, tree, response)
    solved = spread(of_gaps, kinds, offset, rules, rhs[:, :2].copy(), np.zeros((rhs.shape[0], 2)))
    load_mean = 0.0
    unit_mean = 0.0
    for i in range(theta.shape[0]):
        load_mean += weight[i] * solved[i, 0]
        unit_mean += weight[i] * solved[i, 1]
    resistance, pressure, separation = balanced(load_mean, unit_mean, prescribed, hold)
    if not (sound and definite):
        pressure = np.nan
    f, opening = openings_at(pressure, solved, slope, beyond, kinds, offset, rules)
    empty = np.empty((0, 0))
    solution = Solution(
        table, kinds, offset, theta, weight, slope, empty, empty, rhs, solved, beyond,
        hold.share, unit_mean, resistance, separation, pressure, f, opening, empty, np.empty(0),
        0.0,
    )  # fmt: skip
    return solution, of_gaps


@compiled
def spread(
    of: Gaps, kinds: Kinds, offset: Kinds, rules: Rules, load: Array, charge: Array
) -> Array:
    """(B + G)⁻¹ of loads and of the potentials of further charges, which each gap has, as columns.

    What a gap's own further charges do to it is part of its load.
    """
    alone = by_gaps(kinds, offset, rules, of.inverse, load)
    w = of.w.reshape(-1, 1)
    charges = collect(of.tree, of.response, alone * w + charge)
    potential = distribute(of.tree, of.response, charges, np.zeros((0, load.shape[1])))
    return alone - by_gaps(kinds, offset, rules, of.inverse, potential * w)


@compiled
def solve_many_plain(
    gaps: Array,
    prescribed: float,
    hold: Hold,
    kinds: Kinds,
    digits: float,
    fields: int,
    rules: Rules,
    panels: Panels,
) -> PlainSolution:
    """As :func:`solve_many`, for calls from Python."""
    return plain(solve_many(gaps, prescribed, hold, kinds, digits, fields, rules, panels)[0])
