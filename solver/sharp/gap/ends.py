"""Measure gaps, insert patches, and drop those that have closed or vanished.

Gaps are an array of shape (L, 2) of θ = q0 x: left and right ends, ascending.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from adhesis.solver._kernels import CLOSING_SHARE
from adhesis.solver.model.profile import Array


def lengths_of(gaps: Array) -> tuple[Array, Array]:
    """Measure the gaps, and the patches to the right of each, shape (L,)."""
    patch = np.empty(len(gaps))
    patch[:-1] = gaps[1:, 0]
    patch[-1] = gaps[0, 0] + 2 * np.pi
    return gaps[:, 1] - gaps[:, 0], patch - gaps[:, 1]


def positions(gaps: Array, origin: float) -> Array:
    """Measure the distance of every edge to the right of ``origin``, in [0, 2π)."""
    return np.asarray((gaps.ravel() - origin) % (2 * np.pi))


def step_limits(gaps: Array, longest: float) -> Array:
    """Limit the step of each edge: ``longest``, or a share of the gap or patch it may close."""
    length, patch = lengths_of(gaps)
    beside = np.stack([np.roll(patch, 1), patch], axis=1)
    closing = CLOSING_SHARE * np.minimum(length[:, None], beside)
    return np.minimum(longest, closing).ravel()


@cache
def signs_of(count: int) -> Array:
    """Return +1 at left ends of gaps, where contact grows to the right, else -1, read-only."""
    sign = np.tile([1.0, -1.0], count)
    sign.setflags(write=False)
    return sign


def move_edges(gaps: Array, step: Array) -> Array:
    """Move the contact outwards by ``step`` at every edge."""
    return np.asarray(gaps + (signs_of(len(gaps)) * step).reshape(-1, 2))


def with_patches(gaps: Array, centres: Array, widths: Array) -> Array:
    """Insert patches of the given widths into gaps; without gaps, into the open surface.

    Patches that meet, or meet an earlier one, become one: the gap between them closes.
    """
    if len(gaps) == 0:
        order = np.argsort(centres)
        left, right = (centres + widths / 2)[order], (centres - widths / 2)[order]
        return _open(np.stack([left, np.append(right[1:], right[0] + 2 * np.pi)], axis=1))
    order = np.argsort(centres, kind="stable")
    centres, widths = centres[order], widths[order]
    index = np.searchsorted(gaps[:, 0], centres) - 1
    inside = (index >= 0) & (centres < gaps[index, 1])
    seeds = np.stack([centres - widths / 2, centres + widths / 2], axis=1)[inside]
    ends = np.insert(gaps.ravel(), np.repeat(2 * index[inside] + 1, 2), seeds.ravel())
    return _open(np.asarray(ends.reshape(-1, 2)))


def _open(gaps: Array) -> Array:
    """Drop gaps that end where they begin, or before; the last gap never closes."""
    opened = gaps[:, 1] > gaps[:, 0]
    return gaps[opened] if opened.any() else gaps


def union_of(one: Array, other: Array) -> Array:
    """Return the places that lie in a gap of either state; empty if these are all."""
    both = np.concatenate([one, other])
    both = both - 2 * np.pi * np.floor(both[:, :1] / (2 * np.pi))
    both = both[np.argsort(both[:, 0], kind="stable")]
    merged = [list(both[0])]
    for left, right in both[1:].tolist():
        if left <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], right)
        else:
            merged.append([left, right])
    while len(merged) > 1 and merged[0][0] + 2 * np.pi <= merged[-1][1]:
        last, first = merged[-1], merged.pop(0)
        last[1] = max(last[1], first[1] + 2 * np.pi)
    if merged[-1][1] - merged[-1][0] >= 2 * np.pi:
        return np.empty((0, 2))
    return np.array(merged)


def without_small(gaps: Array, smallest: float) -> Array | None:
    """Drop closed gaps or vanished patches; None if all are as long as ``smallest``."""
    length, patch = lengths_of(gaps)
    if length.min() < smallest and len(gaps) > 1:
        keep = length >= smallest
        keep[int(np.argmax(length))] = True  # the last gap never closes
        return gaps[keep]  # the patches beside a closed gap merge
    if not patch.min() < smallest:
        return None
    keep = patch >= smallest
    if not keep.any():
        return np.empty((0, 2))
    # A gap starts after a kept patch (the one to the left of gap k is patch k - 1).
    lefts, rights = gaps[np.roll(keep, 1), 0], gaps[keep, 1]
    rights = np.sort(np.where(rights <= lefts[0], rights + 2 * np.pi, rights))
    return np.stack([lefts, rights], axis=1)
