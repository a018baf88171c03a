"""Compute the moments of the full-contact stress over a gap.

The field of a gap needs, in its coordinate η (``conformal_map``; its ends are η = ∓1),

    s_n  = (2/π) ∫ S U_n(η) sqrt(1 - η²) dθ,        n = 0 … M-1   (second-kind Chebyshev moments)
    s^±  = (1/π) ∫ S sqrt((1 ± η)/(1 ∓ η)) dθ = Σ_n (±1)^n s_n    (the load of each end)

A gap is tiled with panels (``full_contact_stress``) no longer than their distance from its ends;
the cost of a moment grows with log(gap/λ_min), not with the number of wave numbers. The two end
pieces, with their square-root weight, are integrated with S interpolated on the finest panels.
"""

from __future__ import annotations

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
    eta_from,
    log_ratio,
    one_minus_plus,
    place_nodes,
    pole_distances,
)
from adhesis.solver.sharp.gap.full_contact_stress import Panels, interpolate, short_gap_rule
from adhesis.solver.sharp.tolerances import PANEL_PHASE, SHORT_GAP_PANELS

_LARGEST = 0.36  # z up to which artanh z is a short series
_SAFE = 2.0  # modes·length/distance of a panel up to which it surely spans less

# Nodes of a gap's moments: rows 1 - η, 1 + η, ∫S dθ and ∫S' dθ of each.
_MINUS, _PLUS, _STRESS, _SLOPE = 0, 1, 2, 3


@compiled
def _artanh_over(y: float) -> float:
    """Compute artanh z/z, y = z², where |z| is hardly above 1/3."""
    series = 1 / 15 + y * (1 / 17 + y * (1 / 19 + y * (1 / 21 + y / 23)))
    series = 1 / 7 + y * (1 / 9 + y * (1 / 11 + y * (1 / 13 + y * series)))
    return 1 + y * (1 / 3 + y * (1 / 5 + y * series))


@compiled
def _most_end_nodes(left: float, right: float, panels: Panels) -> int:
    """Bound the number of nodes of both end pieces, beside patches of these widths."""
    cells = 2
    for patch in (left, right):
        length = patch
        while length < 2 * panels.width:
            length *= 2
            cells += 1
    most: int = cells * max(panels.x.shape[0], panels.end_x.shape[0])
    return most


@compiled_sums
def _end_piece(
    gap: Array, side: int, length: float, panels: Panels, nodes: Array, count: int
) -> int:
    """Place nodes from the end of a gap inwards, in cells graded to the patch beyond that end.

    ``nodes`` must have space for them; returns their number so far.
    """
    near, far = pole_distances(gap, side)
    scale = 1 / gap[ALPHA]
    nearer = nodes[_PLUS - side]
    farther = nodes[_MINUS + side]
    stress = nodes[_STRESS]
    x, w, end_x, end_w = panels.x, panels.w, panels.end_x, panels.end_w
    begin = 0.0
    stop = min(length, near)
    while begin < length:
        first = begin == 0.0
        rule = end_x.shape[0] if first else x.shape[0]
        # distances from the end, and from where the logarithm of the map is known
        if first:
            # the square root at the end becomes smooth in y
            known, known_distance = 0.0, 0.0
            for i in range(rule):
                y = end_x[i]
                farther[count + i] = y * y * stop
                stress[count + i] = 2 * y * end_w[i] * stop
        else:
            known, half = 0.5 * (begin + stop), 0.5 * (stop - begin)
            known_distance = 0.5 * scale * log_ratio(known, near, far)
            for i in range(rule):
                farther[count + i] = known + half * x[i]
                stress[count + i] = half * w[i]
        a = near + known
        b = far - known
        d = stop - known
        if d * (a + b) < _LARGEST * (2 * a * b + d * (b - a)):
            for i in range(count, count + rule):
                d = farther[i] - known
                z = d * (a + b) / (2 * a * b + d * (b - a))
                nearer[i] = known_distance + scale * z * _artanh_over(z * z)
        else:
            for i in range(count, count + rule):
                nearer[i] = 0.5 * scale * log_ratio(farther[i], near, far)
        _weigh_by_source(gap, side, panels, nodes, count, count + rule)
        for i in range(count, count + rule):
            farther[i] = 2 - nearer[i]
        count += rule
        begin = stop
        stop = min(2 * begin, length)
        if length - stop < 0.25 * begin:
            stop = length
    return count


@compiled_sums
def _weigh_by_source(
    gap: Array, side: int, panels: Panels, nodes: Array, first: int, behind: int
) -> None:
    """Multiply the weights of nodes by S and S'; in place of 1 ∓ η is their distance from the end.

    Two recurrences run side by side, as each waits for its last term.
    """
    distance = nodes[_MINUS + side]
    origin = (gap[LEFT] if side == 0 else gap[RIGHT]) / panels.width
    per = (1 if side == 0 else -1) / panels.width
    last = panels.finest_count - 1
    stress, slope = panels.stress, panels.slope
    both = nodes.shape[0] > _SLOPE
    for i in range(first, behind, 2):
        position = origin + per * distance[i]
        other_position = origin + per * distance[i + 1]
        k = int(np.floor(position))
        other_k = int(np.floor(other_position))
        x = 2 * (position - k) - 1
        y = 2 * (other_position - other_k) - 1
        k &= last
        other_k &= last
        b1 = b2 = e1 = e2 = 0.0
        if both:
            f1 = f2 = g1 = g2 = 0.0
            for j in range(stress.shape[1] - 1, 0, -1):
                b1, b2 = 2 * x * b1 - b2 + stress[k, j], b1
                e1, e2 = 2 * y * e1 - e2 + stress[other_k, j], e1
                f1, f2 = 2 * x * f1 - f2 + slope[k, j], f1
                g1, g2 = 2 * y * g1 - g2 + slope[other_k, j], g1
            weight, other_weight = nodes[_STRESS, i], nodes[_STRESS, i + 1]
            nodes[_SLOPE, i] = weight * (x * f1 - f2 + slope[k, 0])
            nodes[_SLOPE, i + 1] = other_weight * (y * g1 - g2 + slope[other_k, 0])
        else:
            for j in range(stress.shape[1] - 1, 0, -1):
                b1, b2 = 2 * x * b1 - b2 + stress[k, j], b1
                e1, e2 = 2 * y * e1 - e2 + stress[other_k, j], e1
        nodes[_STRESS, i] *= x * b1 - b2 + stress[k, 0]
        nodes[_STRESS, i + 1] *= y * e1 - e2 + stress[other_k, 0]


@compiled_sums
def _panel_nodes(
    gap: Array,
    tiles: NDArray[np.int64],
    tiled: int,
    panels: Panels,
    nodes: Array,
    count: int,
) -> int:
    """Place the nodes of compressed panels; ``tiles`` holds their first panel, size and row.

    A panel is no longer than its distance from either end, so the logarithm of the map differs at
    its nodes from that at its centre by 2 artanh z with |z| ≤ 1/3: a short series.
    """
    x, weights, width = panels.x, panels.weights, panels.width
    p = x.shape[0]
    length = gap[RIGHT] - gap[LEFT]
    scale = 1 / (2 * gap[ALPHA])
    above = np.empty(tiled * p)
    below = np.empty(tiled * p)
    for tile in range(tiled):
        centre = (tiles[0, tile] + 0.5 * tiles[1, tile]) * width - gap[LEFT]
        half = 0.5 * tiles[1, tile] * width
        side = 0 if centre < length - centre else 1
        near, far = pole_distances(gap, side)
        if side == 1:
            centre, half = length - centre, -half
        a = near + centre
        b = far - centre
        for i in range(p):
            d = half * x[i]
            above[tile * p + i] = d * (a + b)
            below[tile * p + i] = 2 * a * b + d * (b - a)
    # the costly part over all panels at once: the processor's vectors are wider than a panel's loop
    for i in range(tiled * p):
        z = above[i] / below[i]
        above[i] = 2 * z * _artanh_over(z * z) * scale
    for tile in range(tiled):
        centre = (tiles[0, tile] + 0.5 * tiles[1, tile]) * width - gap[LEFT]
        row = tiles[2, tile]
        side = 0 if centre < length - centre else 1
        near, far = pole_distances(gap, side)
        if side == 1:
            centre = length - centre
        distance = log_ratio(centre, near, far) * scale
        nearer = nodes[_PLUS - side]
        farther = nodes[_MINUS + side]
        for i in range(p):
            value = distance + above[tile * p + i]
            nearer[count + i] = value
            farther[count + i] = 2 - value
            nodes[_STRESS, count + i] = weights[0, row, i]
        if nodes.shape[0] > _SLOPE:
            for i in range(p):
                nodes[_SLOPE, count + i] = weights[1, row, i]
        count += p
    return count


@compiled
def _fill_short_gap(gap: Array, panels: Panels, nodes: Array) -> None:
    """Place Gauss-Chebyshev nodes of the first kind in η, which serve s_n and s^± alike."""
    count = nodes.shape[1]
    rule = panels.short if panels.short.shape[1] == count else short_gap_rule(count)
    theta, theta_by_t = np.empty(count), np.empty(count)
    place_nodes(gap, rule[2], rule[3], theta, theta_by_t)
    stress = interpolate(theta, panels.width, panels.stress)
    for i in range(count):
        nodes[_MINUS, i], nodes[_PLUS, i] = rule[0, i], rule[1, i]
        theta_by_t[i] *= np.pi / count
        nodes[_STRESS, i] = theta_by_t[i] * stress[i]
    if nodes.shape[0] > _SLOPE:
        slope = interpolate(theta, panels.width, panels.slope)
        for i in range(count):
            nodes[_SLOPE, i] = theta_by_t[i] * slope[i]


@compiled
def _moment_nodes(gap: Array, modes: int, panels: Panels, fields: int) -> tuple[Array, int]:
    """Place the nodes of the moments of one gap; returns their number, too."""
    left = gap[LEFT]
    right = gap[RIGHT]
    width = panels.width
    if right - left <= SHORT_GAP_PANELS * width:
        nodes = np.empty((2 + fields, max(panels.short.shape[1], 2 * modes)))
        _fill_short_gap(gap, panels, nodes)
        return nodes, nodes.shape[1]
    first = int(np.floor(left / width)) + 2  # an end piece is one to two finest panels long
    last = int(np.ceil(right / width)) - 2
    levels = panels.level_start.shape[0]
    tiles = np.empty((3, max(0, last - first)), dtype=np.int64)
    tiled = 0
    panel = first
    while panel < last:
        level = 0
        size = 1
        while level + 1 < levels:
            twice = 2 * size
            if panel & (twice - 1) != 0 or panel + twice > last:
                break
            start = panel * width - left
            stop = right - (panel + twice) * width
            if start < twice * width or stop < twice * width:
                break
            # the highest mode turns by modes·Δη/sqrt(1-η²) over the panel
            if modes * twice * width > _SAFE * min(start, stop):
                a_minus, a_plus = one_minus_plus(gap, start, 0)
                b_minus, b_plus = one_minus_plus(gap, stop, 1)
                nearest = min(a_minus * a_plus, b_minus * b_plus)
                if modes * (b_plus - a_plus) > PANEL_PHASE * np.sqrt(nearest):
                    break
            level += 1
            size = twice
        tiles[0, tiled] = panel
        tiles[1, tiled] = size
        tiles[2, tiled] = panels.level_start[level] + (
            (panel >> level) & ((panels.finest_count >> level) - 1)
        )
        tiled += 1
        panel += size
    most = _most_end_nodes(gap[LEFT_PATCH], gap[RIGHT_PATCH], panels)
    nodes = np.empty((2 + fields, most + tiled * panels.x.shape[0]))
    count = _end_piece(gap, 0, first * width - left, panels, nodes, 0)
    count = _end_piece(gap, 1, right - last * width, panels, nodes, count)
    count = _panel_nodes(gap, tiles, tiled, panels, nodes, count)
    return nodes, count


@compiled_sums
def _sum_moments(nodes: Array, count: int, s: Array, ends: Array) -> None:
    """Sum the moments of the nodes, by the recurrence of sin((n+1)t), cos t = η."""
    fields = s.shape[1]
    twice = np.empty(count)
    current = np.empty(count)
    previous = np.zeros(count)
    low0 = 0.0
    high0 = 0.0
    for i in range(count):
        minus = nodes[_MINUS, i]
        plus = nodes[_PLUS, i]
        current[i] = np.sqrt(minus * plus)
        twice[i] = 2 * eta_from(minus, plus)
    for i in range(count):
        share = nodes[_STRESS, i] / (current[i] * np.pi)
        low0 += share * nodes[_MINUS, i]
        high0 += share * nodes[_PLUS, i]
    ends[0, 0] = low0
    ends[1, 0] = high0
    if fields > 1:
        low1 = 0.0
        high1 = 0.0
        for i in range(count):
            share = nodes[_SLOPE, i] / (current[i] * np.pi)
            low1 += share * nodes[_MINUS, i]
            high1 += share * nodes[_PLUS, i]
        ends[0, 1] = low1
        ends[1, 1] = high1
    for n in range(s.shape[0]):
        total0 = 0.0
        total1 = 0.0
        if fields > 1:
            for i in range(count):
                total0 += nodes[_STRESS, i] * current[i]
                total1 += nodes[_SLOPE, i] * current[i]
        else:
            for i in range(count):
                total0 += nodes[_STRESS, i] * current[i]
        s[n, 0] = total0 * (2 / np.pi)
        if fields > 1:
            s[n, 1] = total1 * (2 / np.pi)
        for i in range(count):
            value = twice[i] * current[i] - previous[i]
            previous[i] = current[i]
            current[i] = value


@compiled
def gap_moments(gap: Array, panels: Panels, s: Array, ends: Array) -> None:
    """Fill ``s``, shape (modes, 2), and ``ends``, (2, 2), with the moments of (S, S') over a gap.

    With ``s`` of shape (modes, 1) those of S alone. ``gap`` is a row of
    ``conformal_map.map_gaps``.
    """
    nodes, count = _moment_nodes(gap, s.shape[0], panels, s.shape[1])
    _sum_moments(nodes, count, s, ends)
