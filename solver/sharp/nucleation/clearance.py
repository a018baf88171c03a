"""How much of a gap's clearance can have been used up since it was looked at.

The fine opening of a gap (``opening_series``) costs as much as many fields, and most gaps are far
from touching. Inside a gap the surface is free: between two states with nearly the same edges its
opening changes smoothly, so the nodes of the field show by how much it has closed. Only beside an
edge that moves there is more: C sqrt(r) changes by C δ/(2 sqrt(r)), for which that a fourth of the
shortest wave away is taken.

A gap is looked at again when a good part of its clearance can be gone, or of its opening at any
node: a minimum may appear there, whatever others there are. Beside the ends of a gap openings are
small in any case; there it is looked at again when one is negative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.field.solution import Nodes
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers
from adhesis.solver.sharp.tolerances import (
    CLEARANCE_LEFT,
    CLOSING_SAFETY,
    COMPARABLE,
    NO_MINIMUM_WITHIN,
)


class Seen(NamedTuple):
    """Gaps as they were when they were looked at.

    Attributes
    ----------
    gaps : array, shape (L, 2)
    orders, offset : int array
        Of the field's nodes.
    theta, opening : array, shape (nodes,)
        Nodes, and the opening of the lower modes there.
    clearance : array, shape (L,)
        Infinite where there is no minimum.
    """

    gaps: Array
    orders: Integers
    offset: Integers
    theta: Array
    opening: Array
    clearance: Array


class Left(NamedTuple):
    """Clearance that is left of gaps that were seen.

    Attributes
    ----------
    clearance : array, shape (L,)
        Negative where a gap has to be looked at.
    place : int array, shape (L,)
        Place of each gap among those seen; negative where it has to be looked at.
    fresh : int array
        The gaps that have to be looked at.
    is_same : bool
        Whether there are none, and no gap has gone.
    """

    clearance: Array
    place: Integers
    fresh: Integers
    is_same: bool


NOT_SEEN = Seen(
    np.empty((0, 2)), np.empty(0, dtype=np.int64), np.zeros(1, dtype=np.int64), np.empty(0),
    np.empty(0), np.empty(0),
)  # fmt: skip


@compiled
def _low_opening(f: float, kind: int, node: int, rules: GaussRules) -> float:
    eta = rules.eta[rules.vector_start[kind] + node]
    opening: float = f * np.sqrt(1 - eta * eta)
    return opening


@compiled_for_both
def clearance_left(
    gaps: Array,
    nodes: Nodes,
    f: Array,
    rules: GaussRules,
    seen: Seen,
    near: float,
    beside: float,
) -> Left:
    """Compute the clearance that is surely left in each gap.

    Nodes further than ``near`` from their place are not compared; ``beside`` is the closing beside
    an edge for its motion.
    """
    orders, offset, theta = nodes.orders, nodes.offset, nodes.theta
    within = NO_MINIMUM_WITHIN / COMPARABLE * near
    left = np.full(gaps.shape[0], -1.0)
    place = np.full(gaps.shape[0], -1)
    j = 0
    for k in range(gaps.shape[0]):
        while j < seen.gaps.shape[0] and seen.gaps[j, 0] < gaps[k, 0] - near:
            j += 1
        if j == seen.gaps.shape[0]:
            break
        begin = gaps[k, 0] - seen.gaps[j, 0]
        end = gaps[k, 1] - seen.gaps[j, 1]
        if abs(begin) > near or abs(end) > near or orders[k] != seen.orders[j]:
            continue
        grown = max(begin, 0.0) + max(-end, 0.0)
        closed = 0.0
        most = 0.0
        m = rules.counts[orders[k]]
        comparable = True
        none_inside = True
        for i in range(m):
            at = seen.offset[j] + i
            # the slope between the node's neighbours, or the gap's end
            if i > 0:
                before, low = seen.theta[at - 1], seen.opening[at - 1]
            else:
                before, low = seen.gaps[j, 0], 0.0
            if i < m - 1:
                after, high = seen.theta[at + 1], seen.opening[at + 1]
            else:
                after, high = seen.gaps[j, 1], 0.0
            here = theta[offset[k] + i]
            moved = here - seen.theta[at]
            was = seen.opening[at] + (high - low) / (after - before) * moved
            now = _low_opening(f[offset[k] + i], orders[k], i, rules)
            closed = max(closed, was - now)
            most = max(most, was)
            if abs(moved) > near:
                comparable = False
            # a minimum may appear at any node, but hardly beside the ends
            if min(here - gaps[k, 0], gaps[k, 1] - here) > within:
                none_inside = False
                rest = was - CLOSING_SAFETY * max(was - now, 0.0) - beside * grown
                comparable = comparable and rest > CLEARANCE_LEFT * was
            elif now < 0 <= was:
                comparable = False
        if not comparable:
            continue
        clearance = seen.clearance[j]
        if clearance == np.inf and none_inside:
            clearance = most
        rest = clearance - CLOSING_SAFETY * closed - beside * grown
        if clearance == np.inf or rest > CLEARANCE_LEFT * clearance:
            left[k] = rest if seen.clearance[j] < np.inf else np.inf
            place[k] = j
    fresh: Integers = np.flatnonzero(place < 0)
    is_same = gaps.shape[0] == seen.gaps.shape[0] and fresh.shape[0] == 0
    return Left(left, place, fresh, is_same)


@compiled
def noted(
    gaps: Array,
    nodes: Nodes,
    f: Array,
    rules: GaussRules,
    seen: Seen,
    place: Integers,
    clearance: Array,
) -> Seen:
    """Note what was seen: gaps just looked at (``place`` negative) with their clearance."""
    orders, offset, theta = nodes.orders, nodes.offset, nodes.theta
    new_gaps = gaps.copy()
    new_theta = theta.copy()
    new_opening = np.empty(theta.shape[0])
    new_clearance = clearance.copy()
    for k in range(gaps.shape[0]):
        j = place[k]
        if j >= 0:
            new_gaps[k] = seen.gaps[j]
            new_clearance[k] = seen.clearance[j]
        for i in range(rules.counts[orders[k]]):
            at = offset[k] + i
            if j >= 0:
                new_theta[at] = seen.theta[seen.offset[j] + i]
                new_opening[at] = seen.opening[seen.offset[j] + i]
            else:
                new_opening[at] = _low_opening(f[at], orders[k], i, rules)
    return Seen(new_gaps, orders.copy(), offset.copy(), new_theta, new_opening, new_clearance)
