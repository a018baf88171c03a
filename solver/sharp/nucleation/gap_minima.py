"""Find local minima of the openings, compiled: by parabolas on the fine nodes or the series."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.opening_series import count_sine_nodes, open_gap, sum_modes
from adhesis.solver.sharp.field.solution import Nodes
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers
from adhesis.solver.sharp.gap.sine_transform import tabulate_circle
from adhesis.solver.sharp.tolerances import (
    MINIMUM_DOUBT,
    MINIMUM_IS_LOW,
    MINIMUM_REFINEMENTS,
    NO_CURVATURE,
    SHAPE_NODES,
)


@compiled
def local_minima(theta: Array, opening: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Find local minima where θ falls: position, value, half of κ, width, error; θ then rises.

    By the parabola through three nodes, Newton's form; ``width`` is the distance of the outer two,
    ``error`` that of the value, estimated from the cubics through a fourth node on either side.
    """
    x, y = theta, opening
    out = np.empty((5, y.shape[0] // 2 + 1))
    count = 0
    for i in range(y.shape[0] - 2, 0, -1):
        if y[i] <= y[i + 1] and y[i] < y[i - 1]:
            first = (y[i] - y[i + 1]) / (x[i] - x[i + 1])
            second = (y[i - 1] - y[i]) / (x[i - 1] - x[i])
            width = x[i - 1] - x[i + 1]
            half = (second - first) / width
            slope = first + half * (x[i] - x[i + 1])
            cubic = 0.0
            for j in (i - 2, i + 2):
                if 0 <= j < y.shape[0]:
                    beside = i - 1 if j < i else i + 1
                    far = i + 1 if j < i else i - 1
                    outer = (y[j] - y[beside]) / (x[j] - x[beside])
                    inner = second if j < i else first
                    other = (outer - inner) / (x[j] - x[i])
                    cubic = max(cubic, abs((other - half) / (x[j] - x[far])))
            out[0, count] = x[i] - slope / (2 * half)
            out[1, count] = y[i] - slope * slope / (4 * half)
            out[2, count] = half
            out[3, count] = width
            out[4, count] = 0.05 * cubic * width**3
            count += 1
    return out[0, :count], out[1, :count], out[2, :count], out[3, :count], out[4, :count]


@compiled
def _refine_minimum(
    gap: Array, modes: Array, at: float, width: float
) -> tuple[float, float, float]:
    """Locate a minimum by narrowing parabolas: position, opening and half the curvature."""
    half = 0.0
    low = np.inf
    x = np.empty(3)
    for _ in range(MINIMUM_REFINEMENTS):
        width /= 8
        x[0], x[1], x[2] = at - width, at, at + width
        y = sum_modes(gap, x, modes)
        half = (y[2] - 2 * y[1] + y[0]) / (2 * width**2)
        slope = (y[2] - y[0]) / (2 * width)
        if not half > 0:
            return at, y[1], max(half, NO_CURVATURE)
        step = min(max(-slope / (2 * half), -4 * width), 4 * width)
        at += step
        low = y[1] + slope * step + half * step**2
    return at, low, half


@compiled
def minima_of_gaps(
    indices: Integers,
    nodes: Nodes,
    f: Array,
    rules: GaussRules,
    top: int,
    panels: Panels,
) -> tuple[Array, Array, Array, Integers]:
    """Find the minima of some gaps of a field: position, value, κ, and the gap of each.

    ``top`` and ``panels`` are those of the source; ``indices`` of the gaps rise.
    """
    out = np.empty((3, 64))
    where = np.empty(64, dtype=np.int64)
    found = 0
    last = 0
    circle = tabulate_circle(4)
    for k in indices:
        fewest = rules.counts[nodes.orders[k]]
        count = count_sine_nodes(nodes.table[k], fewest, top, SHAPE_NODES)
        if count != last:
            circle = tabulate_circle(count + 1)
            last = count
        theta, _, opening, modes = open_gap(nodes, k, f, circle, rules, panels)
        at, low, half, width, error = local_minima(theta, opening)
        while found + at.shape[0] > where.shape[0]:
            wider = np.empty((3, 2 * where.shape[0]))
            wider[:, :found] = out[:, :found]
            longer = np.empty(2 * where.shape[0], dtype=np.int64)
            longer[:found] = where[:found]
            out, where = wider, longer
        for j in range(at.shape[0]):
            if low[j] < max(MINIMUM_IS_LOW * half[j] * width[j] ** 2, MINIMUM_DOUBT * error[j]):
                at[j], low[j], half[j] = _refine_minimum(
                    nodes.table[k], modes, at[j], 0.5 * width[j]
                )
            out[0, found] = at[j]
            out[1, found] = low[j]
            out[2, found] = 2 * half[j]
            where[found] = k
            found += 1
    return out[0, :found].copy(), out[1, :found].copy(), out[2, :found].copy(), where[:found].copy()
