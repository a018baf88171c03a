"""Bound the clearance left in gaps since they were last searched.

The fine opening of a gap (``opening_series``) costs as much as many fields, and most gaps are far
from touching. Inside a gap the surface is free: between two states with nearly the same edges its
opening changes smoothly, so the nodes of the field show by how much it has closed. Only beside an
edge that moves there is more: C sqrt(r) changes by C δ/(2 sqrt(r)), for which that a fourth of the
shortest wave away is taken.

A gap is searched again when a good part of its clearance can be gone, or of its opening at any
node: a minimum may appear there, whatever others there are. Beside the ends of a gap openings are
small in any case; there it is searched again when one is negative.
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


class SearchedGaps(NamedTuple):
    """Gaps as they were when they were last searched.

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


class RemainingClearance(NamedTuple):
    """Clearance that is left in gaps since they were searched.

    Attributes
    ----------
    clearance : array, shape (L,)
        Negative where a gap has to be searched.
    index_before : int array, shape (L,)
        Index of each gap among those searched; negative where it has to be searched.
    to_search : int array
        The gaps that have to be searched.
    is_unchanged : bool
        Whether there are none, and no gap has gone.
    """

    clearance: Array
    index_before: Integers
    to_search: Integers
    is_unchanged: bool


NONE_SEARCHED = SearchedGaps(
    np.empty((0, 2)), np.empty(0, dtype=np.int64), np.zeros(1, dtype=np.int64), np.empty(0),
    np.empty(0), np.empty(0),
)  # fmt: skip


@compiled
def _low_opening(f: float, order: int, node: int, rules: GaussRules) -> float:
    """Compute the opening of the lower modes at a node from f."""
    eta = rules.eta[rules.vector_start[order] + node]
    opening: float = f * np.sqrt(1 - eta * eta)
    return opening


@compiled_for_both
def clearance_left(
    gaps: Array,
    nodes: Nodes,
    f: Array,
    rules: GaussRules,
    searched: SearchedGaps,
    max_displacement: float,
    closing_per_motion: float,
) -> RemainingClearance:
    """Compute a lower bound of the clearance in each gap.

    Nodes that moved further than ``max_displacement`` are not compared; ``closing_per_motion`` is
    the closing beside an edge over the motion of the edge.
    """
    orders, offset, theta = nodes.orders, nodes.offset, nodes.theta
    within = NO_MINIMUM_WITHIN / COMPARABLE * max_displacement
    left = np.full(gaps.shape[0], -1.0)
    index = np.full(gaps.shape[0], -1)
    j = 0
    for k in range(gaps.shape[0]):
        while j < searched.gaps.shape[0] and searched.gaps[j, 0] < gaps[k, 0] - max_displacement:
            j += 1
        if j == searched.gaps.shape[0]:
            break
        begin = gaps[k, 0] - searched.gaps[j, 0]
        end = gaps[k, 1] - searched.gaps[j, 1]
        if (
            abs(begin) > max_displacement
            or abs(end) > max_displacement
            or orders[k] != searched.orders[j]
        ):
            continue
        grown = max(begin, 0.0) + max(-end, 0.0)
        closed = 0.0
        most = 0.0
        m = rules.counts[orders[k]]
        comparable = True
        none_inside = True
        for i in range(m):
            at = searched.offset[j] + i
            # the slope between the node's neighbours, or the gap's end
            if i > 0:
                before, low = searched.theta[at - 1], searched.opening[at - 1]
            else:
                before, low = searched.gaps[j, 0], 0.0
            if i < m - 1:
                after, high = searched.theta[at + 1], searched.opening[at + 1]
            else:
                after, high = searched.gaps[j, 1], 0.0
            here = theta[offset[k] + i]
            moved = here - searched.theta[at]
            was = searched.opening[at] + (high - low) / (after - before) * moved
            now = _low_opening(f[offset[k] + i], orders[k], i, rules)
            closed = max(closed, was - now)
            most = max(most, was)
            if abs(moved) > max_displacement:
                comparable = False
            # a minimum may appear at any node, but hardly beside the ends
            if min(here - gaps[k, 0], gaps[k, 1] - here) > within:
                none_inside = False
                rest = was - CLOSING_SAFETY * max(was - now, 0.0) - closing_per_motion * grown
                comparable = comparable and rest > CLEARANCE_LEFT * was
            elif now < 0 <= was:
                comparable = False
        if not comparable:
            continue
        clearance = searched.clearance[j]
        if clearance == np.inf and none_inside:
            clearance = most
        rest = clearance - CLOSING_SAFETY * closed - closing_per_motion * grown
        if clearance == np.inf or rest > CLEARANCE_LEFT * clearance:
            left[k] = rest if searched.clearance[j] < np.inf else np.inf
            index[k] = j
    to_search: Integers = np.flatnonzero(index < 0)
    is_unchanged = gaps.shape[0] == searched.gaps.shape[0] and to_search.shape[0] == 0
    return RemainingClearance(left, index, to_search, is_unchanged)


@compiled
def update_searched(
    gaps: Array,
    nodes: Nodes,
    f: Array,
    rules: GaussRules,
    searched: SearchedGaps,
    index: Integers,
    clearance: Array,
) -> SearchedGaps:
    """Update the searched gaps by those just searched, whose ``index`` is negative."""
    orders, offset, theta = nodes.orders, nodes.offset, nodes.theta
    new_gaps = gaps.copy()
    new_theta = theta.copy()
    new_opening = np.empty(theta.shape[0])
    new_clearance = clearance.copy()
    for k in range(gaps.shape[0]):
        j = index[k]
        if j >= 0:
            new_gaps[k] = searched.gaps[j]
            new_clearance[k] = searched.clearance[j]
        for i in range(rules.counts[orders[k]]):
            at = offset[k] + i
            if j >= 0:
                new_theta[at] = searched.theta[searched.offset[j] + i]
                new_opening[at] = searched.opening[searched.offset[j] + i]
            else:
                new_opening[at] = _low_opening(f[at], orders[k], i, rules)
    return SearchedGaps(
        new_gaps, orders.copy(), offset.copy(), new_theta, new_opening, new_clearance
    )
