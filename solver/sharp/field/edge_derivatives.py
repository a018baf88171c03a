"""Derivatives of the field of ``dense_solver`` with respect to the edges.

The derivative with respect to an edge is the homogeneous solution with an opening ∝ 1/sqrt(r) there
(Bueckner's and Rice's weight function); the diagonal follows from translation invariance: moving
all edges together is moving the profile, whose source is S_full'.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both, compiled_sums
from adhesis.solver.sharp.field.assembly import mapped, periodic
from adhesis.solver.sharp.field.cholesky import solve_factored, wide
from adhesis.solver.sharp.field.exterior import Outside, reach
from adhesis.solver.sharp.field.solution import Solution, edge_openings
from adhesis.solver.sharp.gap.conformal_map import ALPHA, LEFT
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules


@compiled_for_both
def derivatives(of: Solution, rules: Rules) -> tuple[Array, Array]:
    """∂C_e/∂θ_f, shape (2L, 2L), and ∂Y/∂θ_f, shape (2L,), of a solution with S and S'.

    Y is p, under a load q0 s.
    """
    edges = 2 * of.slope.shape[0]
    load, area = _singular_loads(of, rules)
    windowed = of.felt_area.shape[0] > 0
    if windowed:
        load[:, :edges] += of.felt_load
        area += of.felt_area
    solve_factored(of.factor, load)
    p = area
    for i in range(load.shape[0]):
        for e in range(edges):
            p[e] += of.rhs[i, 1] * load[i, e]
    if of.share == 0:
        p /= 2 * np.pi  # of the separation; the pressure stays
    else:
        p /= of.resistance
        for i in range(load.shape[0]):
            for e in range(edges):
                load[i, e] -= of.solved[i, 1] * p[e]
    openings = edge_openings(load, of.slope, of.kinds, of.offset, rules.start, rules.ends)
    by_edge = openings[:, :edges].copy()
    # Translation: all edges together against the profile.
    drift = 0.0
    for i in range(load.shape[0]):
        drift -= of.rhs[i, 1] * of.solved[i, 2]
    drift += of.felt_shift
    drift = of.share * drift / of.resistance
    moving = np.empty((load.shape[0], 1))
    for i in range(load.shape[0]):
        moving[i, 0] = -of.solved[i, 2] - drift * of.solved[i, 1]
    moved = edge_openings(moving, of.slope, of.kinds, of.offset, rules.start, rules.ends)
    for e in range(edges):
        slope = of.slope[e // 2, e % 2]
        far = of.slope[e // 2, 1 - e % 2]
        by_edge[e ^ 1, e] += 0.5 * np.sqrt(2 * far)  # the singular opening's far end
        strength = (2 * (e % 2) - 1) * of.opening[e] * np.sqrt(slope / 8)
        p[e] *= strength
        for other in range(edges):
            by_edge[other, e] *= strength
    for e in range(edges):
        total = 0.0
        for other in range(edges):
            if other != e:
                total += by_edge[e, other]
        slope = of.slope[e // 2, e % 2]
        by_edge[e, e] = moved[e, 0] - np.sqrt(2 * slope) * of.beyond[e // 2, e % 2, 1] - total
    if windowed:
        # the ends of the outside stay
        typical = 0.0
        for e in range(edges - 2):
            typical = max(typical, abs(by_edge[e, e]))
        by_edge[edges - 2 :] = 0.0
        by_edge[:, edges - 2 :] = 0.0
        by_edge[edges - 2, edges - 2] = typical
        by_edge[edges - 1, edges - 1] = -typical
        p[edges - 2 :] = 0.0
    return by_edge, p


@compiled
def _singular_loads(of: Solution, rules: Rules) -> tuple[Array, Array]:
    """Right-hand sides of the regular part of the solution singular at each edge, and its area.

    There are more columns than edges, for ``cholesky``; those are
    zero.

    The opening sqrt((1∓η)/(1±η)) of the own gap has the density 1/(1±η) at the nodes and, as the
    rule is exact for polynomials only, a further weight π/(M+1) at the edge itself.
    """
    table, slope, kinds, offset = of.table, of.slope, of.kinds, of.offset
    theta, weight, matrix = of.theta, of.weight, of.matrix
    counts, start, square = rules.counts, rules.start, rules.square
    eta, b, w = rules.eta, rules.b, rules.w
    n = theta.shape[0]
    gaps = table.shape[0]
    load = np.zeros((n, wide(2 * gaps)))
    area = np.empty(2 * gaps)
    sine = np.sin(0.5 * theta)
    cosine = np.cos(0.5 * theta)
    for k in range(gaps):
        if offset[k] == offset[k + 1]:
            load[:, 2 * k : 2 * k + 2] = 0.0
            area[2 * k : 2 * k + 2] = 0.0
            continue
        m = counts[kinds[k]]
        base = offset[k]
        point = np.pi / (m + 1)
        low = np.empty(m)  # 1/(1 + η) and 1/(1 - η)
        high = np.empty(m)
        area[2 * k] = point / slope[k, 0]
        area[2 * k + 1] = point / slope[k, 1]
        for j in range(m):
            x = eta[start[kinds[k]] + j]
            low[j] = 1 / (1 + x)
            high[j] = 1 / (1 - x)
            area[2 * k] += weight[base + j] * low[j]
            area[2 * k + 1] += weight[base + j] * high[j]
        edge_sine = np.sin(0.5 * table[k, LEFT : LEFT + 2])
        edge_cosine = np.cos(0.5 * table[k, LEFT : LEFT + 2])
        crack = b[square[kinds[k]] : square[kinds[k]] + m * m].reshape(m, m)
        for side in range(2):
            edge = table[k, LEFT + side]
            strength = point / slope[k, side]
            density = low if side == 0 else high
            column = np.empty(n)
            _singular_load(
                matrix[base : base + m], density, sine, cosine, weight, edge_sine[side],
                edge_cosine[side], strength, column,
            )  # fmt: skip
            for i in range(m):  # its own gap
                total = 0.0
                for j in range(m):
                    total -= (matrix[base + i, base + j] - crack[i, j]) * density[j]
                place = start[kinds[k]] + i
                bent = w[place] * point * mapped(table[k, ALPHA], eta[place] - (2 * side - 1))
                images = weight[base + i] * strength * periodic(theta[base + i] - edge)
                column[base + i] = total + (bent + images) / (4 * np.pi)
            load[:, 2 * k + side] = column
    return load, area


@compiled_sums
def _singular_load(
    rows: Array,
    density: Array,
    sine: Array,
    cosine: Array,
    weight: Array,
    edge_sine: float,
    edge_cosine: float,
    strength: float,
    out: Array,
) -> None:
    """Into ``out``: load on other gaps of a density of a gap's ``rows`` and a weight at its end."""
    scale = strength / (4 * np.pi)
    for i in range(out.shape[0]):
        half = sine[i] * edge_cosine - cosine[i] * edge_sine
        out[i] = scale * weight[i] / (half * half)
    for j in range(density.shape[0]):
        row = rows[j]
        value = density[j]
        for i in range(out.shape[0]):
            out[i] -= value * row[i]


@compiled
def felt_from_outside(
    table: Array,
    slope: Array,
    kinds: Kinds,
    offset: Kinds,
    rules: Rules,
    rows: Array,
    drawn: Array,
    outside: Outside,
) -> tuple[Array, Array]:
    """What the outside adds to loads and areas of the singular openings of a window."""
    load = np.zeros((rows.shape[0], 2 * table.shape[0]))
    area = np.zeros(2 * table.shape[0])
    for k in range(table.shape[0] - 1):
        point = np.pi / (rules.counts[kinds[k]] + 1)
        edge_rows, _ = reach(table[k, LEFT : LEFT + 2], point / slope[k], outside)
        for side in range(2):
            e = 2 * k + side
            for a in range(rows.shape[1]):
                area[e] += edge_rows[side, a] * outside.charge[a, 1]
                for i in range(rows.shape[0]):
                    load[i, e] += drawn[i, a] * edge_rows[side, a]
            for j in range(offset[k], offset[k + 1]):
                x = rules.eta[rules.start[kinds[k]] + j - offset[k]]
                density = 1 / (1 + x) if side == 0 else 1 / (1 - x)
                for a in range(rows.shape[1]):
                    area[e] += density * rows[j, a] * outside.charge[a, 1]
    return load, area
