"""Descent of many gaps in windows: where edges run, the rest responding linearly; compiled.

In a jump a few edges run at a time. The gaps around them are a window whose edges descend as those
of few gaps do (:mod:`adhesis.solver.sharp.descent`); all other gaps are what the window feels of
them (:mod:`adhesis.solver.sharp.outside`), their edges following by their tangent. After some
steps, or when the window has come to rest, the others are put where their tangent leads, everything
is solved anew, and the next window is chosen: around the edge that is furthest from its balance or,
once all are near it, that Newton's step moves most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.compiled import compiled
from adhesis.solver.profile import Array
from adhesis.solver.sharp.balance import Law, at_least, imbalance, moved_gaps, narrowest
from adhesis.solver.sharp.coordinate import LEFT, RIGHT, map_gaps
from adhesis.solver.sharp.descent import LOST, NARROW, RESTING, UNFINISHED, descend, limits
from adhesis.solver.sharp.far import Gaps, solve_many
from adhesis.solver.sharp.field import solve
from adhesis.solver.sharp.outside import Outside, reach
from adhesis.solver.sharp.rules import Kinds, Rules, choose_kinds
from adhesis.solver.sharp.solution import Solution
from adhesis.solver.sharp.source import Panels, measure_at, with_outside
from adhesis.solver.sharp.tree import Response, Tree, collect, distribute, plant, respond
from adhesis.solver.sharp.yielding import Yielding, newton_step, yielding_gaps

_HALF_WIDTH = 4  # gaps of a window on each side of the edge that leads
_WIDEST = 48
_STEPS = 60  # steps in a window before everything is solved anew
_LOUD = 0.02  # imbalance, of C_c, above which the furthest edge leads
_CALM = 0.2  # an edge outside follows its tangent if that moves it by less, in longest steps
_NEWTON_STEPS = 12  # steps of all edges in a row


@compiled
def _leading_gap(residual: Array, step: Array, law: Law) -> int:
    """Gap of the edge around which a window is put."""
    if np.abs(residual).max() > _LOUD * law.critical:
        return int(np.argmax(np.abs(residual))) // 2
    return int(np.argmax(np.abs(step))) // 2


@compiled
def rolled(rows: Array, first: int) -> Array:
    """Rows from ``first`` on, angles in the columns 0 and 1 rising beyond the period."""
    out = np.empty(rows.shape)
    count = rows.shape[0]
    for i in range(count):
        out[i] = rows[(first + i) % count]
        if first + i >= count:
            out[i, 0] += 2 * np.pi
            out[i, 1] += 2 * np.pi
    return out


@compiled
def descend_many(
    gaps: Array,
    prescribed: float,
    most: int,
    least: Kinds,
    equal_speeds: bool,
    law: Law,
    rules: Rules,
    panels: Panels,
) -> tuple[Array, int, int, int, Kinds]:
    """As :func:`adhesis.solver.sharp.descent.descend`, for many gaps."""
    fields = 0
    tangents = 0
    count = gaps.shape[0]
    half = _HALF_WIDTH
    newton = 0
    kinds = least
    while fields < most:
        table = map_gaps(gaps)
        kinds = at_least(choose_kinds(table, law.digits, rules.counts), kinds)
        of, parts = solve_many(gaps, prescribed, law.hold, kinds, law.digits, 2, rules, panels)
        fields += 1
        tangents += 1
        if not np.isfinite(of.pressure):
            return gaps, LOST, fields, tangents, kinds
        residual, drift = imbalance(of, law, panels)
        edges = yielding_gaps(of, parts, residual, drift, rules)
        step, _, _, stable, _ = newton_step(of, parts, edges, law.hold)
        size = np.abs(step).max()
        if stable and size < law.near:
            return moved_gaps(gaps, step), RESTING, fields, tangents, kinds
        limit = limits(table, law.longest)
        if stable and newton < _NEWTON_STEPS and np.all(np.abs(step) <= limit):
            newton += 1
            gaps = moved_gaps(gaps, step)
            continue
        newton = 0
        width = min(2 * half + 1, count - 2)
        first = (_leading_gap(residual, step, law) - width // 2) % count
        calm = _CALM * law.longest
        about = About(of, parts.w, parts.blocks, parts.inverse, edges)
        window, outside, outer = open_window(about, first, width, calm, law, rules, panels)
        window_kinds = np.zeros(width + 1, dtype=np.int64)
        for i in range(width):
            window_kinds[i] = kinds[(first + i) % count]
        moved, ended, moved_kinds = window, LOST, window_kinds
        followed = np.empty(0)
        soft = outer.response.negative == 0
        while ended == LOST:
            if not soft:  # with all edges outside held
                window, outside, outer = open_window(about, first, width, 0.0, law, rules, panels)
            moved, ended, some, more, moved_kinds, _, _, _ = descend(
                window, prescribed, min(_STEPS, most - fields), window_kinds, equal_speeds, law,
                rules, with_outside(panels, outside), np.empty((0, window.size)), False,
            )  # fmt: skip
            fields += some
            tangents += more
            if ended != LOST:
                followed = following(
                    moved, prescribed, moved_kinds, outer, about, limit, law, rules,
                    with_outside(panels, outside),
                )  # fmt: skip
                if not np.all(np.isfinite(followed)):  # where the window came to has no field
                    ended = LOST
            if ended == LOST and not soft:
                return gaps, LOST, fields, tangents, kinds
            soft = False
        progress = np.abs(moved[:width] - window[:width]).max()
        result = np.empty(gaps.shape)
        for i in range(count):
            k = (first + i) % count
            turn = 2 * np.pi if first + i >= count else 0.0
            for side in range(2):
                if i < width:
                    result[k, side] = moved[i, side] - turn
                else:
                    sign = 1 - 2 * side
                    result[k, side] = gaps[k, side] + sign * followed[2 * (i - width) + side]
            if i < width:
                kinds[k] = max(kinds[k], moved_kinds[i])
        gaps = result
        if ended == NARROW or narrowest(gaps) < law.smallest:
            return gaps, NARROW, fields, tangents, kinds
        if progress > law.near:
            half = _HALF_WIDTH
        elif 2 * half + 1 >= count - 2 or half >= _WIDEST:
            return gaps, RESTING, fields, tangents, kinds
        else:
            half = min(2 * half, _WIDEST)
    return gaps, UNFINISHED, fields, tangents, kinds


class About(NamedTuple):
    """A solved state about which windows are opened.

    Attributes
    ----------
    of : Solution
    w, blocks, inverse : array
        As in :class:`adhesis.solver.sharp.far.Gaps`.
    edges : Yielding
        How its edges follow.
    """

    of: Solution
    w: Array
    blocks: Array
    inverse: Array
    edges: Yielding


@compiled
def at_rest(of: Solution, parts: Gaps, edges: Yielding) -> About:
    """State whose edges are in equilibrium, but for what is left of an iteration.

    ``edges`` may be those of a state very near.
    """
    edges.alone[:, 0] = 0.0
    edges.motion[:, 0] = 0.0
    return About(of, parts.w, parts.blocks, parts.inverse, edges)


class Outer(NamedTuple):
    """The gaps outside a window.

    Attributes
    ----------
    order : int array
        Which they are.
    soft : bool array
        Whether their edges follow.
    offset : int array
        First node of each.
    tree : Tree
    response : Response
    alone : array, shape (nodes, 2)
        Charges of each without potentials and p, and by a unit of p.
    potential : array
        Potentials at the nodes in the state about which their response is linear.
    """

    order: Kinds
    soft: NDArray[np.bool_]
    offset: Kinds
    tree: Tree
    response: Response
    alone: Array
    potential: Array


@compiled
def open_window(
    about: About,
    first: int,
    width: int,
    calm: float,
    law: Law,
    rules: Rules,
    panels: Panels,
) -> tuple[Array, Outside, Outer]:
    """Window of ``width`` gaps from ``first`` on: its gaps and the outside, and what lies there.

    Edges outside follow if that moves them by less than ``calm``.
    """
    of, edges = about.of, about.edges
    count = of.kinds.shape[0]
    order = np.arange(first + width, first + count) % count
    soft = np.zeros(order.shape[0], dtype=np.bool_)
    for i in range(order.shape[0]):
        k = order[i]
        still = abs(edges.motion[2 * k, 0]) < calm and abs(edges.motion[2 * k + 1, 0]) < calm
        soft[i] = still and edges.negative[k] == 0
    turned = rolled(of.table, first)
    table = turned[width:].copy()
    tree, own, alone, potential, offset = _outer_gaps(about, order, soft, table, law, rules)
    response = respond(tree, own, np.zeros(order.shape[0], dtype=np.int64))
    window = np.empty((width + 1, 2))
    window[:width] = turned[:width, :2]
    window[width, 0] = table[0, LEFT]
    window[width, 1] = table[-1, RIGHT]
    outside = _outside_of(tree, response, alone, window[width], law, panels)
    return window, outside, Outer(order, soft, offset, tree, response, alone, potential)


@compiled
def known_about(
    gaps: Array, prescribed: float, kinds: Kinds, law: Law, rules: Rules, panels: Panels
) -> About:
    """What windows on these gaps, which are in equilibrium, are opened with."""
    of, parts = solve_many(gaps, prescribed, law.hold, kinds, law.digits, 2, rules, panels)
    residual, drift = imbalance(of, law, panels)
    return at_rest(of, parts, yielding_gaps(of, parts, residual, drift, rules))


@compiled
def _outer_gaps(
    about: About,
    order: Kinds,
    soft: Array,
    table: Array,
    law: Law,
    rules: Rules,
) -> tuple[Tree, Array, Array, Array, Kinds]:
    """Tree of the gaps ``order``, their responses and charges, potentials at them, and offsets.

    The charges, shape (nodes, 2), are those without potentials and p, and by a unit of p; gaps that
    are ``soft`` follow with their edges.
    """
    of, soft_own, soft_alone = about.of, about.edges.own, about.edges.alone
    count = order.shape[0]
    offset = np.zeros(count + 1, dtype=np.int64)
    squares = 0
    start = np.zeros(of.kinds.shape[0] + 1, dtype=np.int64)
    for k in range(of.kinds.shape[0]):
        start[k + 1] = start[k] + rules.counts[of.kinds[k]] ** 2
    for i in range(count):
        m = rules.counts[of.kinds[order[i]]]
        offset[i + 1] = offset[i] + m
        squares += m * m
    n = offset[count]
    own = np.empty(squares)
    alone = np.empty((n, 2))
    potential = np.empty(n)
    theta = np.empty(n)
    stretch = np.empty(n)
    at = 0
    for i in range(count):
        k = order[i]
        base = of.offset[k]
        m = offset[i + 1] - offset[i]
        turn = table[i, LEFT] - of.table[k, LEFT]
        for j in range(m):
            place = offset[i] + j
            theta[place] = of.theta[base + j] + turn
            stretch[place] = of.weight[base + j] / about.w[base + j]
            # A f + w g + S~ + p X = 0
            total = of.rhs[base + j, 0] + of.pressure * of.rhs[base + j, 1]
            for other in range(m):
                total += about.blocks[base + j, other] * of.f[base + other]
            potential[place] = -total / about.w[base + j]
        for j in range(m):
            place = offset[i] + j
            by_mean = 0.0
            for other in range(m):
                inverse = about.inverse[start[k] + j * m + other]
                by_mean -= about.w[base + j] * inverse * of.rhs[base + other, 1]
                if soft[i]:
                    own[at + j * m + other] = soft_own[start[k] + j * m + other]
                else:
                    own[at + j * m + other] = about.w[base + j] * inverse * about.w[base + other]
            alone[place, 1] = soft_alone[base + j, 1] if soft[i] else by_mean
            alone[place, 0] = about.w[base + j] * of.f[base + j] - of.pressure * alone[place, 1]
            if soft[i]:
                alone[place, 0] += soft_alone[base + j, 0]
            for other in range(m):
                alone[place, 0] += own[at + j * m + other] * potential[offset[i] + other]
        at += m * m
    return plant(table, offset, theta, stretch, law.digits, False), own, alone, potential, offset


@compiled
def _outside_of(
    tree: Tree, response: Response, alone: Array, ends: Array, law: Law, panels: Panels
) -> Outside:
    """What a window feels of the gaps of a tree; ``ends`` are those of their run."""
    run = tree.rank.shape[0] - 1
    r = tree.rank[run]
    last = slice(tree.at[run], tree.at[run + 1])
    charge = collect(tree, response, alone)
    whole = charge[last].copy()
    whole[:, 1] *= -1.0
    distribute(tree, response, charge, np.zeros((r, 2)))
    mean = np.zeros(2)
    for i in range(alone.shape[0]):
        mean[0] += tree.stretch[i] * charge[i, 0]
        mean[1] -= tree.stretch[i] * charge[i, 1]
    opening = np.empty(2)
    for side in range(2):
        measure, _ = measure_at(ends[side], panels)
        opening[side] = law.critical * np.sqrt(measure)
    own = response.own[tree.square[run] : tree.square[run + 1]].copy().reshape(r, r)
    return Outside(
        tree.theta[last].copy(), tree.stretch[last].copy(), own, whole, mean, opening
    )  # fmt: skip


@compiled
def following(
    window: Array,
    prescribed: float,
    kinds: Kinds,
    outer: Outer,
    about: About,
    limit: Array,
    law: Law,
    rules: Rules,
    panels: Panels,
) -> Array:
    """Outward motion of the edges outside, for the window's gaps as they are now."""
    of, edges = about.of, about.edges
    out = np.zeros(2 * outer.order.shape[0])
    now = solve(window, prescribed, law.hold, kinds, 1, rules, panels)
    rows, _ = reach(now.theta, now.weight, panels.outside)
    potential = np.zeros((rows.shape[1], 1))
    for i in range(rows.shape[0]):
        for a in range(rows.shape[1]):
            potential[a, 0] -= rows[i, a] * now.f[i]
    total = outer.alone[:, :1] + now.pressure * outer.alone[:, 1:]
    charge = collect(outer.tree, outer.response, total)
    felt = distribute(outer.tree, outer.response, charge, potential)
    for i in range(outer.order.shape[0]):
        if not outer.soft[i]:
            continue
        base = of.offset[outer.order[i]]
        for side in range(2):
            e = 2 * outer.order[i] + side
            step = edges.motion[e, 0] + (now.pressure - of.pressure) * edges.motion[e, 1]
            for j in range(outer.offset[i + 1] - outer.offset[i]):
                place = outer.offset[i] + j
                change = felt[place, 0] - outer.potential[place]
                step += edges.follows[base + j, side] * change
            if abs(step) <= limit[e]:
                out[2 * i + side] = step
            else:
                out[2 * i + side] = np.sign(step) * limit[e]
    return out
