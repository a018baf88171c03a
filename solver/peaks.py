"""Find local maxima of a periodic row of values that stand out from their surroundings."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array

LEAST_PROMINENCE = 0.01
"""Least prominence of a maximum, over its height; smaller ones may be errors of the values."""


def highest_peaks(values: Array, most: int, least: float = 0.0) -> list[int]:
    """Return the indices of the highest maxima above ``least``, the highest first.

    The height of a maximum is that of the parabola through it and its neighbours: where values have
    large and steep minima a maximum can lie well above all values. The prominence of a maximum is
    its height above the higher one of the two minima between which it is the largest value; it is
    no maximum unless its neighbours have values. The values are periodic, NaN where there is none.
    At most ``most`` are returned; ``least`` is not negative.
    """
    nothing = np.flatnonzero(np.isnan(values))
    start = int(nothing[0]) if nothing.size else 0
    row = np.concatenate([values[start:], values[:start], values[start : start + 1]])
    here, before, after = row[1:-1], row[:-2], row[2:]
    tops = 1 + np.flatnonzero((here > before) & (here >= after))
    left, right = row[tops] - row[tops - 1], row[tops] - row[tops + 1]
    height = row[tops] + (left - right) ** 2 / (8 * (left + right))
    tops, height = tops[height > least], height[height > least]
    found: list[int] = []
    order = np.argsort(-height, kind="stable")
    for top, high in zip(tops[order].tolist(), height[order].tolist(), strict=True):
        sides = row[:top][::-1], row[top + 1 :]
        base = max(_least_before_higher(side, row[top]) for side in sides)
        if high - base >= LEAST_PROMINENCE * high:
            found.append((start + top) % len(values))
            if len(found) == most:
                break
    return found


def parabola_vertex(before: float, here: float, after: float) -> tuple[float, float]:
    """Find the maximum of the parabola through three equally spaced values.

    Returns its distance from the middle one, in spacings, and its height; without a maximum 0 and
    the middle value.
    """
    bend = before - 2 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(shift), float(here - 0.25 * (before - after) * shift)


def _least_before_higher(values: Array, height: float) -> float:
    """Return the least value before the first that exceeds ``height`` or is NaN."""
    ends = ~(values <= height)
    stop = int(ends.argmax()) if ends.any() else len(values)
    return float(values[:stop].min(initial=height))
