"""The field of many gaps after a last, small correction of their edges; compiled.

Newton's step of all edges (``edge_elimination``) tells what
every gap will feel of the others to first order. With it each gap is solved by itself between its
new edges: what the step leaves behind in the field is of second order in it, as it is in the edges,
and no further solution of all gaps together is needed.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.edge_elimination import Change
from adhesis.solver.sharp.field.hierarchical_solver import Gaps, by_gaps, gap_blocks, invert_gaps
from adhesis.solver.sharp.field.solution import Hold, Solution, edge_openings
from adhesis.solver.sharp.gap.conformal_map import (
    ALPHA,
    LEFT,
    LEFT_PATCH,
    RIGHT,
    RIGHT_PATCH,
    map_gaps,
    one_minus_plus,
)
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Rules


@compiled
def potentials(of: Solution, gaps: Gaps) -> Array:
    """What the other gaps make at every node, times dθ/dη: from the balance of its own gap."""
    out = np.empty(of.theta.shape[0])
    for k in range(of.kinds.shape[0]):
        base = of.offset[k]
        m = of.offset[k + 1] - base
        for i in range(base, base + m):
            # A f + w g + S~ + p X = 0
            total = of.rhs[i, 0] + of.pressure * of.rhs[i, 1]
            for j in range(m):
                total += gaps.blocks[i, j] * of.f[base + j]
            out[i] = -total / gaps.w[i]
    return out


@compiled
def _felt_at(gap: Array, eta: Array, w: Array, felt: Array, theta: float) -> float:
    """A potential g at θ from its values times dθ/dη at the nodes η of a gap."""
    side = 0 if theta < 0.5 * (gap[LEFT] + gap[RIGHT]) else 1
    r = theta - gap[LEFT] if side == 0 else gap[RIGHT] - theta
    own = gap[LEFT_PATCH] if side == 0 else gap[RIGHT_PATCH]
    far = gap[RIGHT] - gap[LEFT] + (gap[RIGHT_PATCH] if side == 0 else gap[LEFT_PATCH])
    minus, plus = one_minus_plus(gap, r, side)
    x = plus - 1 if plus < minus else 1 - minus
    per = (1 / (own + r) + 1 / (far - r)) / (2 * gap[ALPHA])  # dη/dθ
    above = 0.0
    below = 0.0
    sign = 1.0
    for i in range(eta.shape[0]):
        apart = x - eta[i]
        if apart == 0:
            above, below = felt[i], 1.0
            break
        share = sign * w[i] / apart
        above += share * felt[i]
        below += share
        sign = -sign
    value: float = per * above / below
    return value


@compiled
def landed(
    edges: Array,
    prescribed: float,
    hold: Hold,
    of: Solution,
    gaps: Gaps,
    change: Change,
    rules: Rules,
    panels: Panels,
) -> tuple[Solution, Gaps]:
    """Solution between ``edges``, shape (L, 2), a step away from ``of``, which it ``change`` s.

    What tells of other edges and pressures to first order alone (``solved``, ``unit_mean``,
    ``resistance``, the tree and its response) is that of ``of``.
    """
    kinds, offset = of.kinds, of.offset
    table = map_gaps(edges)
    theta, weight, slope, blocks, rhs, beyond = gap_blocks(table, kinds, offset, 1, rules, panels)
    inverse, _, definite = invert_gaps(kinds, offset, rules, blocks)
    felt = potentials(of, gaps)
    for i in range(felt.shape[0]):
        felt[i] += change.potential[i]
    pressure = of.pressure + change.pressure
    load = np.empty((theta.shape[0], 1))
    for k in range(kinds.shape[0]):
        own = slice(offset[k], offset[k + 1])
        start = rules.start[kinds[k]]
        rule = slice(start, start + offset[k + 1] - offset[k])
        for i in range(offset[k], offset[k + 1]):
            there = _felt_at(of.table[k], rules.eta[rule], rules.w[rule], felt[own], theta[i])
            load[i, 0] = -rhs[i, 0] - pressure * rhs[i, 1] - weight[i] * there
    f = by_gaps(kinds, offset, rules, inverse, load)
    mean = 0.0  # of the opening, times 2π, and what it loses by a unit of p
    by_pressure = 0.0
    for i in range(theta.shape[0]):
        mean += weight[i] * f[i, 0]
        by_pressure += weight[i] * of.solved[i, 1]
    # share·mean - 2π give·p = 2π d, to rounding
    more = hold.share * mean - 2 * np.pi * (prescribed + hold.give * pressure)
    more /= hold.share * by_pressure + 2 * np.pi * hold.give
    pressure += more
    for i in range(theta.shape[0]):
        f[i, 0] -= more * of.solved[i, 1]
    separation = prescribed
    if hold.give != 0:
        separation = (mean - more * by_pressure) / (2 * np.pi)
    if not definite:
        pressure = np.nan
    opening = edge_openings(f, slope, kinds, offset, rules.start, rules.ends)[:, 0].copy()
    for k in range(kinds.shape[0]):
        for side in range(2):
            opening[2 * k + side] -= np.sqrt(2 * slope[k, side]) * beyond[k, side, 0]
    solution = Solution(
        table, kinds, offset, theta, weight, slope, of.matrix, of.factor, rhs, of.solved, beyond,
        hold.share, of.unit_mean, of.resistance, separation, pressure, f[:, 0].copy(), opening,
        of.felt_load, of.felt_area, of.felt_shift,
    )  # fmt: skip
    return solution, Gaps(blocks, inverse, gaps.w, gaps.tree, gaps.response)
