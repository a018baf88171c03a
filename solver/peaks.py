"""Find what stands out in a periodic row: local maxima of values, and patches of contact nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array, Integers

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


def patch_ranges(mask: NDArray[np.bool_]) -> tuple[Integers, Integers]:
    """Find first node and number of nodes of every patch of a contact set, shape (patches,) each.

    Sorted by the first node; a patch may extend across the end of the period. A contact set without
    a free node is one patch that starts at node 0.
    """
    before = np.concatenate([mask[-1:], mask[:-1]])  # as np.roll, ten times as fast
    (first,) = np.nonzero(mask & ~before)
    if first.size == 0:
        whole = 1 if mask.any() else 0  # one patch without an end, or none
        return np.zeros(whole, dtype=np.int64), np.full(whole, mask.size)
    (behind,) = np.nonzero(before & ~mask)  # the node after the end of each patch
    if behind[0] < first[0]:  # the period begins within the last patch
        behind = np.append(behind[1:], behind[0] + mask.size)
    return first, behind - first
