"""Newton's step of all edges of many gaps at once, and their stability, on the tree of gaps.

An edge follows its own opening: C_e = C_c at each. So a gap whose edges may move responds to the
potentials of the others like one with held edges, only more compliantly; with the motions n of its
two edges eliminated, its charges are again q = q° - R g, and the tree
(``cluster_tree``) solves for all gaps and all edges together. The
singular opening that a moving edge leaves is that of
``dense_solver``: regular part, charges and, from translation
invariance, the edge's own term.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.assembly import mapped, periodic
from adhesis.solver.sharp.field.cluster_tree import collect, distribute, respond
from adhesis.solver.sharp.field.hierarchical_solver import Gaps, by_gaps, solve_many, spread
from adhesis.solver.sharp.field.solution import Hold, Solution, edge_openings
from adhesis.solver.sharp.gap.conformal_map import ALPHA, LEFT
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules


class Yielding(NamedTuple):
    """Gaps whose edges keep their balance.

    Attributes
    ----------
    own : array
        Response of every gap, flat.
    negative : int array, shape (L,)
        Negative eigenvalues of each.
    alone : array, shape (N, 2)
        Charges of each gap by itself, by the imbalance of its edges and by a unit of p.
    motion : array, shape (2L, 2)
        The motions of its edges then.
    follows : array, shape (N, 2)
        Motion of both edges of a gap by the potential at each of its nodes.
    """

    own: Array
    negative: Kinds
    alone: Array
    motion: Array
    follows: Array


class Change(NamedTuple):
    """What a step of all edges changes for every gap, to first order.

    Attributes
    ----------
    potential : array, shape (N,)
        Of the other gaps at its nodes, which stay where they are.
    pressure : float
    """

    potential: Array
    pressure: float


@compiled
def singular_gap(of: Solution, gap: int, block: Array, rules: Rules) -> tuple[Array, Array, Array]:
    """Own load, charges and area of the openings sqrt((1∓η)/(1±η)) at both ends of a gap."""
    kind = of.kinds[gap]
    m = rules.counts[kind]
    start = rules.start[kind]
    base = of.offset[gap]
    square = rules.square[kind]
    point = np.pi / (m + 1)
    load = np.zeros((m, 2))
    charge = np.empty((m, 2))
    area = np.empty(2)
    for side in range(2):
        end = 2 * side - 1
        edge = of.table[gap, LEFT + side]
        area[side] = point / of.slope[gap, side]
        for j in range(m):
            density = 1 / (1 - end * rules.eta[start + j])
            charge[j, side] = rules.w[start + j] * density + point * rules.ends[side, start + j]
            area[side] += of.weight[base + j] * density
            for i in range(m):
                load[i, side] -= (block[i, j] - rules.b[square + i * m + j]) * density
        for i in range(m):
            near = (
                rules.w[start + i]
                * point
                * mapped(of.table[gap, ALPHA], rules.eta[start + i] - end)
            )
            far = of.weight[base + i] * point / of.slope[gap, side]
            load[i, side] += (near + far * periodic(of.theta[base + i] - edge)) / (4 * np.pi)
    return load, charge, area


@compiled
def yielding_gaps(
    of: Solution, gaps: Gaps, residual: Array, drift: Array, rules: Rules
) -> Yielding:
    """Gaps that keep C_e = C_c from a solution with S and S', imbalance ``residual``.

    ``drift`` is the derivative of C_c by θ.
    """
    count = of.slope.shape[0]
    n = of.theta.shape[0]
    load = np.empty((n, 2))
    charge = np.empty((n, 2))
    strength = np.empty(2 * count)  # of the singular opening for a motion outwards
    together = np.empty((n, 1))  # moving the profile less moving all edges, both to the right
    together_charge = np.empty((n, 1))
    area = 0.0
    for k in range(count):
        own = slice(of.offset[k], of.offset[k + 1])
        m = of.offset[k + 1] - of.offset[k]
        load[own], charge[own], areas = singular_gap(of, k, gaps.blocks[own, :m], rules)
        for side in range(2):
            strength[2 * k + side] = -of.opening[2 * k + side] * np.sqrt(of.slope[k, side] / 8)
        left = strength[2 * k]
        right = -strength[2 * k + 1]
        area += areas[0] * left + areas[1] * right
        for i in range(of.offset[k], of.offset[k + 1]):
            together[i, 0] = -of.rhs[i, 2] - load[i, 0] * left - load[i, 1] * right
            together_charge[i, 0] = -charge[i, 0] * left - charge[i, 1] * right
    regular = spread(gaps, of.kinds, of.offset, rules, together, together_charge)
    p = -area
    for i in range(n):
        p += of.weight[i] * regular[i, 0]
    p *= of.share / of.resistance
    for i in range(n):
        regular[i, 0] -= p * of.solved[i, 1]
    shift = edge_openings(regular, of.slope, of.kinds, of.offset, rules.start, rules.ends)

    bare = by_gaps(of.kinds, of.offset, rules, gaps.inverse, load)
    by_mean = by_gaps(of.kinds, of.offset, rules, gaps.inverse, of.rhs[:, 1:2])
    bare_edges = edge_openings(bare, of.slope, of.kinds, of.offset, rules.start, rules.ends)
    mean_edges = edge_openings(by_mean, of.slope, of.kinds, of.offset, rules.start, rules.ends)
    own_response = np.empty(gaps.inverse.shape[0])
    negative = np.zeros(count, dtype=np.int64)
    alone = np.empty((n, 2))
    motion = np.empty((2 * count, 2))
    follows = np.empty((n, 2))
    at = 0
    for k in range(count):
        base = of.offset[k]
        m = of.offset[k + 1] - base
        start = rules.start[of.kinds[k]]
        tangent = np.empty((2, 2))
        for side in range(2):
            e = 2 * k + side
            end = np.sqrt(of.slope[k, side] / 2)
            for other in range(2):
                tangent[side, other] = bare_edges[e, other] * strength[2 * k + other]
            tangent[side, 1 - side] += end * strength[2 * k + 1 - side]
            sign = 1 - 2 * side
            # the singular opening of the other end, for a motion of both to the right
            own_term = shift[e, 0] + sign * end * strength[2 * k + 1 - side]
            own_term -= np.sqrt(2 * of.slope[k, side]) * of.beyond[k, side, 1]
            tangent[side, side] += sign * (own_term - drift[e])
        det = tangent[0, 0] * tangent[1, 1] - tangent[0, 1] * tangent[1, 0]
        if det < 0:
            negative[k] = 1
        elif tangent[0, 0] + tangent[1, 1] < 0:
            negative[k] = 2
        inverse = np.empty((2, 2))
        inverse[0, 0] = tangent[1, 1] / det
        inverse[1, 1] = tangent[0, 0] / det
        inverse[0, 1] = -tangent[0, 1] / det
        inverse[1, 0] = -tangent[1, 0] / det
        # opening of both ends by the potential at each node
        reach = np.empty((2, m))
        for side in range(2):
            scale = np.sqrt(2 * of.slope[k, side])
            for j in range(m):
                total = 0.0
                for i in range(m):
                    total += rules.ends[side, start + i] * gaps.inverse[at + i * m + j]
                reach[side, j] = scale * total * rules.w[start + j]
        ends = slice(2 * k, 2 * k + 2)
        drive = np.empty((2, 2))
        drive[:, 0] = -residual[ends]
        drive[:, 1] = mean_edges[ends, 0]
        for side in range(2):
            a, b = inverse[side, 0], inverse[side, 1]
            for column in range(2):
                motion[2 * k + side, column] = a * drive[0, column] + b * drive[1, column]
            for j in range(m):
                follows[base + j, side] = a * reach[0, j] + b * reach[1, j]
        moving = np.empty((m, 2))  # charges by the motion of each end
        for i in range(m):
            w = rules.w[start + i]
            for side in range(2):
                regular_part = w * bare[base + i, side]
                moving[i, side] = strength[2 * k + side] * (regular_part + charge[base + i, side])
            alone[base + i, 0] = 0.0
            alone[base + i, 1] = -w * by_mean[base + i, 0]
            for column in range(2):
                for side in range(2):
                    alone[base + i, column] += moving[i, side] * motion[2 * k + side, column]
        for i in range(m):
            for j in range(m):
                value = gaps.w[base + i] * gaps.inverse[at + i * m + j] * gaps.w[base + j]
                for side in range(2):
                    value -= 0.5 * moving[i, side] * follows[base + j, side]
                    value -= 0.5 * moving[j, side] * follows[base + i, side]
                own_response[at + i * m + j] = value
        at += m * m
    return Yielding(own_response, negative, alone, motion, follows)


@compiled
def newton_many(
    of: Solution, gaps: Gaps, residual: Array, drift: Array, hold: Hold, rules: Rules
) -> tuple[Array, Array, float, bool]:
    """Newton's step n of every edge towards C_e = C_c, with d prescribed.

    Returns the step, the rate dn/dd and the slope dY/dd along the branch (Y is p, under a load
    q0 s), and whether the edges are stable.
    """
    parts = yielding_gaps(of, gaps, residual, drift, rules)
    step, rate, slope, stable, _ = newton_step(of, gaps, parts, hold)
    return step, rate, slope, stable


@compiled
def newton_step(
    of: Solution, gaps: Gaps, parts: Yielding, hold: Hold
) -> tuple[Array, Array, float, bool, Change]:
    """As :func:`newton_many`, from the gaps' parts; and what the step changes for every gap."""
    response = respond(gaps.tree, parts.own, parts.negative)
    charge = collect(gaps.tree, response, parts.alone)
    potential = distribute(gaps.tree, response, charge, np.zeros((0, 2)))
    count = of.slope.shape[0]
    motion = parts.motion.copy()
    mean = np.zeros(2)  # of the opening, times 2π
    for k in range(count):
        for i in range(of.offset[k], of.offset[k + 1]):
            stretch = of.weight[i] / gaps.w[i]
            for column in range(2):
                mean[column] += stretch * charge[i, column]
                for side in range(2):
                    motion[2 * k + side, column] += parts.follows[i, side] * potential[i, column]
    # share·mean - 2π give·p = 2π d
    yields = hold.share * mean[1] - 2 * np.pi * hold.give
    rate = 2 * np.pi / yields  # dp/dd
    stable = (response.negative == 0 and yields < 0) or (response.negative == 1 and yields > 0)
    pressure = -hold.share * mean[0] / yields
    step = motion[:, 0] + motion[:, 1] * pressure
    slope = rate if hold.share != 0 else rate * mean[1] / (2 * np.pi)
    change = Change(potential[:, 0] + pressure * potential[:, 1], pressure)
    return step, motion[:, 1] * rate, slope, stable, change


@compiled
def between_edges(
    gaps: Array,
    prescribed: float,
    hold: Hold,
    kinds: Kinds,
    digits: float,
    wanted: Kinds,
    rules: Rules,
    panels: Panels,
) -> Array:
    """∂C_e/∂θ_f between the edges ``wanted`` of many gaps, all others held; 0 for e = f."""
    of, parts = solve_many(gaps, prescribed, hold, kinds, digits, 1, rules, panels)
    n = of.theta.shape[0]
    count = wanted.shape[0]
    load = np.zeros((n, count))
    charge = np.zeros((n, count))
    p = np.zeros(count)
    for i in range(count):
        k = wanted[i] // 2
        side = wanted[i] % 2
        own = slice(of.offset[k], of.offset[k + 1])
        m = of.offset[k + 1] - of.offset[k]
        loads, charges, areas = singular_gap(of, k, parts.blocks[own, :m], rules)
        load[own, i] = loads[:, side]
        charge[own, i] = charges[:, side]
        p[i] = areas[side]
    column = spread(parts, of.kinds, of.offset, rules, load, charge)
    if of.share != 0:
        for i in range(count):
            for j in range(n):
                p[i] += of.weight[j] * column[j, i]
            for j in range(n):
                column[j, i] -= of.solved[j, 1] * p[i] / of.resistance
    opening = edge_openings(column, of.slope, of.kinds, of.offset, rules.start, rules.ends)
    out = np.zeros((count, count))
    for i in range(count):
        f = wanted[i]
        strength = (2 * (f % 2) - 1) * of.opening[f] * np.sqrt(of.slope[f // 2, f % 2] / 8)
        for j in range(count):
            e = wanted[j]
            if e != f:
                value = opening[e, i]
                if e == f ^ 1:  # the singular opening's far end
                    value += 0.5 * np.sqrt(2 * of.slope[e // 2, e % 2])
                out[j, i] = strength * value
    return out
