"""Predict the next points of a branch, and the fold ahead, from two points and their rates.

A branch turns back in d where it folds, while the edge that leads goes on: d is a smooth function
of how far it has gone, with an extremum at the fold, and so are all other edges. Two points with
their rates give a cubic of each. Where the way on is long against the way between them, the rates
alone are believed, which is a parabola: then edges move as a δ + 2b sqrt(δ), δ = |d - d_c|. If no
edge leads, the rates give a parabola in d.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.tolerances import (
    BEYOND_FOLD,
    CUBIC_OF_OTHERS_TRUSTED,
    CUBIC_TRUSTED,
    LEADING_SHARE,
    LEAST_LEFT_BEFORE_FOLD,
    LEFT_BEFORE_FOLD,
    PREDICTION_TRUSTED,
    PREDICTOR_ITERATIONS,
)


class Predictor:
    """Predict a branch beyond two of its points; beyond one point alone it is straight.

    Parameters
    ----------
    point : Point
        With the point before it, if that is known.

    Attributes
    ----------
    fastest : float
        Largest |dn/dd| of an edge at ``point``.
    fold_distance : float
        Distance in d of the fold beyond ``point``; inf if none is seen.
    """

    def __init__(self, point: Point) -> None:
        self.point = point
        self.way, self.fold_distance = 0.0, math.inf
        rate, earlier = point.rate, point.previous
        if earlier is None or earlier.rate.shape != rate.shape or earlier.at == point.at:
            self.fastest = float(np.abs(rate).max())
            return
        self.way, self._earlier = point.at - earlier.at, earlier
        self._leading = leading = leading_edge(
            point.gaps, rate, earlier.gaps, earlier.rate, self.way
        )
        self.fastest, self.fold_distance = leading.fastest, leading.fold_distance

    @property
    def leading_edge(self) -> int:
        """Edge that leads to the fold that is seen."""
        return int(self._leading.edge)

    def other_fold(self) -> OtherFold:
        """Predict the nearest fold in which other gaps lead; at infinity if none is seen."""
        if math.isinf(self.fold_distance):
            return OtherFold(-1, math.inf)
        point, earlier = self.point, self._earlier
        other: OtherFold = other_fold(
            point.gaps, point.rate, earlier.gaps, earlier.rate, self.way, self._leading.edge
        )
        return other

    def gaps(self, at: float) -> Array:
        """Gaps that are expected at d = ``at``."""
        point = self.point
        on = at - point.at
        if not (on * self.way > 0 and abs(on) < PREDICTION_TRUSTED * abs(self.way)):
            return point.extrapolate(at)
        earlier = self._earlier
        gaps: Array = predict_gaps(
            point.gaps, point.rate, earlier.gaps, earlier.rate, on, self.way, self._leading
        )
        return gaps

    def reach(self, most: float, finest: float) -> float:
        """Step along which no edge is expected to move further than ``most``.

        Towards a fold it leads near to it, and from next to it (``finest``) across.
        """
        straight: float = most / max(self.fastest, 1e-300)
        if math.isinf(self.fold_distance):
            return straight
        if self.fold_distance < 0.8 * finest:
            return self.across(finest)
        leading = self._leading
        most = most / abs(leading.gone)
        if math.isfinite(leading.here) and most < leading.fold:
            polynomial = leading.here + most * (leading.square + most * leading.cube)
            straight = abs(self.way) * most * polynomial
        else:
            straight = self.fold_distance
        left = max(LEFT_BEFORE_FOLD * self.fold_distance, LEAST_LEFT_BEFORE_FOLD * finest)
        return float(min(straight, self.fold_distance - left))

    def across(self, finest: float) -> float:
        """Step across the fold that is seen."""
        return self.across_fold(self.fold_distance, finest)

    def across_fold(self, distance: float, finest: float) -> float:
        """Step across a fold at this distance."""
        return (1 + LEFT_BEFORE_FOLD) * distance + BEYOND_FOLD * finest


class OtherFold(NamedTuple):
    """Fold ahead that others lead to than the leading edge: their edge, -1 for none, and distance.

    Attributes
    ----------
    edge : int
    distance : float
        In d.
    """

    edge: int
    distance: float


class LeadingEdge(NamedTuple):
    """The edge that leads between two points of a branch, and d along its motion.

    d is a polynomial of how far the edge goes on, both in units of their ways between the points:
    here·λ + square·λ² + cube·λ³; NaN if no edge leads.

    Attributes
    ----------
    edge : int
    fastest, gone : float
        |dn/dd| at the second point, and how far it has gone between them.
    here, square, cube : float
    fold, fold_distance : float
        Where the polynomial has its extremum, and that distance in d; inf without one.
    """

    edge: int
    fastest: float
    gone: float
    here: float
    square: float
    cube: float
    fold: float
    fold_distance: float


@compiled
def leading_edge(
    gaps: Array, rate: Array, gaps_before: Array, rate_before: Array, way: float
) -> LeadingEdge:
    """Find the leading edge of two points that are ``way`` apart in d, and the fold ahead.

    Of the edges that are not much slower than the fastest it is the one that comes to a fold first;
    the fastest, if none does.
    """
    fastest = np.abs(rate).max()
    leading = _follow_edge(int(np.argmax(np.abs(rate))), gaps, rate, gaps_before, rate_before, way)
    for edge in range(rate.shape[0]):
        if abs(rate[edge]) > LEADING_SHARE * fastest:
            other = _follow_edge(edge, gaps, rate, gaps_before, rate_before, way)
            if other.fold_distance < leading.fold_distance:
                leading = other
    return leading


@compiled
def other_fold(
    gaps: Array, rate: Array, gaps_before: Array, rate_before: Array, way: float, leading: int
) -> OtherFold:
    """Find the nearest fold ahead that other gaps lead than the leading edge's and those beside."""
    fastest, count, found, nearest = np.abs(rate).max(), gaps.shape[0], -1, np.inf
    for edge in range(rate.shape[0]):
        apart = abs(edge // 2 - leading // 2)
        if min(apart, count - apart) > 1 and abs(rate[edge]) > LEADING_SHARE * fastest:
            other = _follow_edge(edge, gaps, rate, gaps_before, rate_before, way)
            if other.fold_distance < nearest:
                found, nearest = edge, other.fold_distance
    return OtherFold(found, nearest)


@compiled
def _follow_edge(
    edge: int, gaps: Array, rate: Array, gaps_before: Array, rate_before: Array, way: float
) -> LeadingEdge:
    """Take d as a polynomial of the motion of one edge."""
    k, side = edge // 2, edge % 2
    fastest = np.abs(rate).max()
    gone = (gaps[k, side] - gaps_before[k, side]) * (1 - 2 * side)
    before, here = gone / (way * rate_before[edge]), gone / (way * rate[edge])
    if not (0 < before < np.inf and 0 < here < np.inf):
        return LeadingEdge(edge, fastest, gone, np.nan, np.nan, np.nan, np.inf, np.inf)
    square, cube = 2 * here + before - 3, here + before - 2
    root = square * square - 3 * cube * here
    if root >= 0 and np.sqrt(root) > square:
        fold = here / (np.sqrt(root) - square)
        if fold < CUBIC_TRUSTED:
            distance = abs(way) * fold * (here + fold * (square + fold * cube))
            return LeadingEdge(edge, fastest, gone, here, square, cube, fold, distance)
    # by the derivatives alone
    square = (here - before) / 2
    fold, distance = np.inf, np.inf
    if before > here and here * here < 2 * PREDICTION_TRUSTED * (before - here):
        fold = here / (before - here)
        distance = abs(way) * here * fold / 2
    return LeadingEdge(edge, fastest, gone, here, square, 0.0, fold, distance)


@compiled
def _led(on: float, way: float, leading: LeadingEdge) -> float:
    """Solve for the way of the leading edge where d has gone ``on``, both in units of ways."""
    here, square, cube, fold = leading.here, leading.square, leading.cube, leading.fold
    if on * abs(way) >= leading.fold_distance:
        return fold
    low, high = 0.0, min(fold, 2 * on / here)
    while high < fold and high * (here + high * (square + high * cube)) < on:
        low, high = high, 2 * high
        if high > PREDICTION_TRUSTED * 2 * on / here:
            return low
    lead = min(on / here, high)
    for _ in range(PREDICTOR_ITERATIONS):
        value = lead * (here + lead * (square + lead * cube)) - on
        if value > 0:
            high = lead
        else:
            low = lead
        slope = here + lead * (2 * square + 3 * lead * cube)
        newton = lead - value / slope if slope > 0 else np.inf
        if abs(newton - lead) < 1e-9 * high:
            break
        lead = newton if low < newton < high else 0.5 * (low + high)
    return lead


@compiled
def predict_gaps(
    gaps: Array,
    rate: Array,
    gaps_before: Array,
    rate_before: Array,
    on: float,
    way: float,
    leading: LeadingEdge,
) -> Array:
    """Predict gaps at a distance ``on`` in d from two points that are ``way`` apart."""
    here_by = leading.gone / rate[leading.edge]
    before_by = leading.gone / rate_before[leading.edge]
    led = np.nan if np.isnan(leading.here) else _led(on / way, way, leading)
    out = np.empty_like(gaps)
    for e in range(rate.shape[0]):
        k, side = e // 2, e % 2
        sign = 1.0 - 2 * side
        if np.isnan(led):
            motion = rate[e] * on + (rate[e] - rate_before[e]) * on * on / (2 * way)
        else:
            here, before = rate[e] * here_by, rate_before[e] * before_by
            moved = sign * (gaps[k, side] - gaps_before[k, side])
            if led < CUBIC_OF_OTHERS_TRUSTED:
                square, cube = 2 * here + before - 3 * moved, here + before - 2 * moved
                motion = led * (here + led * (square + led * cube))
            else:
                motion = led * (here + led * (here - before) / 2)
        out[k, side] = gaps[k, side] + sign * motion
    return out
