"""Predict the next points of a branch, and the fold ahead, from two points and their rates.

A branch turns back in d where it folds, while the edge that leads goes on: d is a smooth function
of how far it has gone, with an extremum at the fold, and so are all other edges. Two points with
their rates give a cubic of each. Where the way on is long against the way between them, the rates
alone are believed, which is a parabola: then edges move as a δ + 2b sqrt(δ), δ = |d - d_c|. If no
edge leads, the rates give a parabola in d.
"""

from __future__ import annotations

import math

import numpy as np

from adhesis.solver._kernels import PREDICTION_TRUSTED, OtherFold, TwoPoints
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.branch_point import Point
from adhesis.solver.sharp.tolerances import (
    BEYOND_FOLD,
    LEFT_BEFORE_FOLD,
)


class Predictor:
    """Predict a branch beyond a point and the one before it; beyond one alone it is straight.

    Attributes
    ----------
    fastest : float
        Largest |dn/dd| of an edge at ``point``.
    leading : LeadingEdge
        The edge that leads to the fold that is seen; only with a point before.
    fold_distance : float
        Distance in d of the fold beyond ``point``; inf if none is seen.
    """

    def __init__(self, point: Point) -> None:
        self.point = point
        self.way, self.fold_distance = 0.0, math.inf
        rate, earlier = point.rate, point.previous
        if earlier is None or earlier.rate.shape != rate.shape or earlier.d == point.d:
            self.fastest = float(np.abs(rate).max())
            return
        self.way = point.d - earlier.d
        self._points = TwoPoints(point.gaps, rate, earlier.gaps, earlier.rate, self.way)
        self.leading = leading = self._points.leading_edge()
        self.fastest, self.fold_distance = leading.fastest, leading.fold_distance

    def other_fold(self) -> OtherFold:
        """Predict the nearest fold in which other gaps lead; at infinity if none is seen."""
        if math.isinf(self.fold_distance):
            return OtherFold()
        return self._points.other_fold(self.leading.edge)

    def gaps(self, d: float) -> Array:
        """Gaps that are expected at ``d``."""
        point = self.point
        on = d - point.d
        if not (on * self.way > 0 and abs(on) < PREDICTION_TRUSTED * abs(self.way)):
            return point.extrapolate(d)
        return self._points.predict_gaps(on, self.leading)

    def reach(self, most: float, finest: float) -> float:
        """Step along which the edge that leads is expected to move no further than ``most``.

        Towards a fold it leads near to it, and from next to it (``finest``) across.
        """
        straight: float = most / max(self.fastest, 1e-300)
        if math.isinf(self.fold_distance):
            return straight
        if self.fold_distance < 0.7 * finest:
            return self.across(finest)
        leading = self.leading
        most = most / abs(leading.gone)
        if math.isfinite(leading.here) and most < leading.fold:
            polynomial = leading.here + most * (leading.square + most * leading.cube)
            straight = abs(self.way) * most * polynomial
        else:
            straight = self.fold_distance
        left = max(LEFT_BEFORE_FOLD * self.fold_distance, BEYOND_FOLD * finest)
        return float(min(straight, self.fold_distance - left))

    def across(self, finest: float) -> float:
        """Step across the fold that is seen."""
        return self.across_fold(self.fold_distance, finest)

    def across_fold(self, distance: float, finest: float) -> float:
        """Step across a fold at this distance."""
        return (1 + LEFT_BEFORE_FOLD) * distance + BEYOND_FOLD * finest
