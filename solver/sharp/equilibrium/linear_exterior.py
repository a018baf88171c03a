"""A window of few gaps among many: its exterior responds linearly about a known state; compiled.

The exterior is solved on the tree of gaps (``cluster_tree``) with its own edges either held or
following by their tangent (``edge_elimination``); what it adds to the equations of the window is
an ``Outside`` (``field/exterior``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.edge_elimination import Yielding, yielding_gaps
from adhesis.solver.sharp.equilibrium.griffith import Law, imbalance
from adhesis.solver.sharp.field.cluster_tree import (
    Response,
    Tree,
    collect,
    distribute,
    plant,
    respond,
)
from adhesis.solver.sharp.field.dense_solver import solve
from adhesis.solver.sharp.field.exterior import Outside, reach
from adhesis.solver.sharp.field.hierarchical_solver import Gaps, solve_many
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.gap.conformal_map import LEFT, RIGHT
from adhesis.solver.sharp.gap.full_contact_stress import Panels, measure_at
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules


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


class About(NamedTuple):
    """A solved state about which windows are opened.

    Attributes
    ----------
    of : Solution
    w, blocks, inverse : array
        As in ``hierarchical_solver.Gaps``.
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
