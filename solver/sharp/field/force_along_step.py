"""How the forces on a few edges change along a way of all edges, compiled.

The derivative of one edge's force along a way of all edges needs one column of the tangent only:
the energy's second derivatives are symmetric, and translation invariance gives the diagonal. So it
costs one right-hand side, where the whole tangent costs one for every edge.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.assembly import mapped, periodic
from adhesis.solver.sharp.field.cholesky import solve_column
from adhesis.solver.sharp.field.edge_derivatives import derivatives
from adhesis.solver.sharp.field.solution import Solution, edge_openings
from adhesis.solver.sharp.gap.conformal_map import ALPHA, LEFT
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules

_PLACES = 16  # at which a force is looked at on its way
_ERROR = 1 / 24  # of a cubic, in its twist: of a wave over almost half its length
_MARGIN = 0.02  # of its range: so little of a force may be none


@compiled
def first_fall(departing: float, departing_rate: float, arriving: float, rate: float) -> float:
    """Share of a way after which a force on it has fallen to nothing, or to next to nothing; or 1.

    The force is the cubic with these values and derivatives at both ends.
    """
    bend = 3 * (arriving - departing) - 2 * departing_rate - rate
    twist = 2 * (departing - arriving) + departing_rate + rate
    values = np.empty(_PLACES + 1)
    for i in range(_PLACES + 1):
        t = i / _PLACES
        values[i] = departing + t * (departing_rate + t * (bend + t * twist))
    # The cubic errs by h⁴/384 of the fourth derivative, ``twist`` is h³/6 of the third.
    least = max(_MARGIN * np.abs(values).max(), _ERROR * abs(twist))
    for i in range(1, _PLACES + 1):
        if values[i] < least and values[i] < values[i - 1]:
            return max(i - 1, 1) / _PLACES
    return 1.0


@compiled
def _singular_load(of: Solution, e: int, rules: Rules) -> tuple[Array, float]:
    """Column ``e`` of ``edge_derivatives._singular_loads``, and its area."""
    k = e // 2
    side = e % 2
    kind = of.kinds[k]
    m = rules.counts[kind]
    base = of.offset[k]
    start = rules.start[kind]
    square = rules.square[kind]
    point = np.pi / (m + 1)
    edge = of.table[k, LEFT + side]
    reach = point / of.slope[k, side]
    area = reach
    density = np.empty(m)
    for j in range(m):
        x = rules.eta[start + j]
        density[j] = 1 / (1 + x) if side == 0 else 1 / (1 - x)
        area += of.weight[base + j] * density[j]
    load = np.empty(of.theta.shape[0])
    for i in range(load.shape[0]):
        total = 0.0
        for j in range(m):
            total -= of.matrix[i, base + j] * density[j]
        strength = of.weight[i] * reach
        if base <= i < base + m:
            for j in range(m):
                total += rules.b[square + (i - base) * m + j] * density[j]
            place = start + i - base
            bent = mapped(of.table[k, ALPHA], rules.eta[place] - (2 * side - 1))
            extra = rules.w[place] * point * bent + strength * periodic(of.theta[i] - edge)
        else:
            half = np.sin(0.5 * (of.theta[i] - edge))
            extra = strength / (half * half)
        load[i] = total + extra / (4 * np.pi)
    return load, area


@compiled
def forces_on(of: Solution, wanted: Kinds, rules: Rules, rows: Array, known: Kinds) -> None:
    """C_e ∂C_e/∂n_f of the edges ``wanted``, n outwards, into their ``rows``, one for each edge e.

    Those that are ``known``, which is not zero, are left. The solution must be one with S and S'.
    """
    edges = of.opening.shape[0]
    missing = 0
    for e in wanted:
        missing += 1 if known[e] == 0 else 0
    if missing == 0:
        return
    if of.felt_area.shape[0] > 0:  # of a window, whose outside follows
        tangent, _ = derivatives(of, rules)
        for e in range(edges):
            for f in range(edges):
                rows[e, f] = of.opening[e] * tangent[e, f] * (1 - 2 * (f % 2))
        known[:] = 1
        return
    # translation: all edges together against the profile
    n = of.theta.shape[0]
    drift = 0.0
    for i in range(n):
        drift -= of.rhs[i, 1] * of.solved[i, 2]
    drift = of.share * drift / of.resistance
    column = np.empty((n, 1))
    for i in range(n):
        column[i, 0] = -of.solved[i, 2] - drift * of.solved[i, 1]
    moved = edge_openings(column, of.slope, of.kinds, of.offset, rules.start, rules.ends)
    for e in wanted:
        if known[e] != 0:
            continue
        k = e // 2
        side = e % 2
        outwards = 1 - 2 * side
        load, area = _singular_load(of, e, rules)
        solve_column(of.factor, load)
        if of.share != 0:
            p = area
            for j in range(n):
                p += of.rhs[j, 1] * load[j]
            p /= of.resistance
            for j in range(n):
                load[j] -= of.solved[j, 1] * p
        column[:, 0] = load
        felt = edge_openings(column, of.slope, of.kinds, of.offset, rules.start, rules.ends)
        felt[e ^ 1, 0] += 0.5 * np.sqrt(2 * of.slope[k, 1 - side])
        strength = -outwards * of.opening[e] * np.sqrt(of.slope[k, side] / 8)
        own = moved[e, 0] - np.sqrt(2 * of.slope[k, side]) * of.beyond[k, side, 1]
        alone = of.opening[e] * own * outwards
        for f in range(edges):
            if f != e:
                # C_e ∂C_e/∂n_f = C_f ∂C_f/∂n_e, both n outwards
                by = of.opening[f] * felt[f, 0] * strength * outwards
                rows[e, f] = by
                alone -= by * outwards * (1 - 2 * (f % 2))
        rows[e, e] = alone
        known[e] = 1
