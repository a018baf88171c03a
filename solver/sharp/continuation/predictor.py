"""How a branch goes on beyond two of its points: a predictor, and the fold that may lie ahead.

A branch turns back in d where it folds, while the edge that leads goes on: d is a smooth function
of how far it has gone, with an extremum at the fold, and so are all other edges. Two points with
their rates give a cubic of each. Where the way on is long against the way between them, the rates
alone are believed, which is a parabola: then edges move as a δ + 2b sqrt(δ), δ = |d - d_c|. If no
edge leads, the rates give a parabola in d.
"""

from __future__ import annotations

import math

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.tolerances import (
    BEYOND_FOLD,
    CUBIC_OF_OTHERS_TRUSTED,
    CUBIC_TRUSTED,
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
        # d as a polynomial of how far the leading edge goes on; both in units of their ways
        self._way_by_lead: tuple[float, float, float] | None = None
        self._fold = math.inf  # where that has its extremum
        rate = point.rate
        self._lead = lead = int(abs(rate).argmax())
        self.fastest = abs(float(rate[lead]))
        earlier = point.previous
        if earlier is None or earlier.rate.shape != rate.shape or earlier.at == point.at:
            return
        self.way = way = point.at - earlier.at
        self._earlier = earlier
        edge = divmod(lead, 2)
        gone = float(point.gaps[edge] - earlier.gaps[edge]) * (1 - 2 * edge[1])
        self._gone = gone
        before, here = gone / (way * float(earlier.rate[lead])), gone / (way * float(rate[lead]))
        if 0 < before < math.inf and 0 < here < math.inf:
            self._look_ahead(before, here)

    def _look_ahead(self, before: float, here: float) -> None:
        """Find the fold from d's derivatives by the way of the leading edge at both points."""
        square, cube = 2 * here + before - 3, here + before - 2
        self._way_by_lead = here, square, cube
        root = square * square - 3 * cube * here
        if root >= 0 and math.sqrt(root) > square:
            fold = here / (math.sqrt(root) - square)
            if fold < CUBIC_TRUSTED:
                self._fold = fold
                self.fold_distance = abs(self.way) * fold * (here + fold * (square + fold * cube))
                return
        # by the derivatives alone
        self._way_by_lead = here, (here - before) / 2, 0.0
        if before > here and here * here < 2 * PREDICTION_TRUSTED * (before - here):
            self._fold = here / (before - here)
            self.fold_distance = abs(self.way) * here * self._fold / 2

    def _led(self, on: float, by: tuple[float, float, float]) -> float:
        """How far the leading edge has gone where d has gone ``on``, both in units of ways."""
        if on * abs(self.way) >= self.fold_distance:
            return self._fold
        here, square, cube = by
        low, high = 0.0, min(self._fold, 2 * on / here)
        while high < self._fold and high * (here + high * (square + high * cube)) < on:
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
            newton = lead - value / slope if slope > 0 else math.inf
            if abs(newton - lead) < 1e-9 * high:
                break
            lead = newton if low < newton < high else 0.5 * (low + high)
        return lead

    def gaps(self, at: float) -> Array:
        """Gaps that are expected at d = ``at``."""
        point = self.point
        on = at - point.at
        if not (on * self.way > 0 and abs(on) < PREDICTION_TRUSTED * abs(self.way)):
            return point.extrapolate(at)
        led = math.nan
        if self._way_by_lead is not None:
            led = self._led(on / self.way, self._way_by_lead)
        earlier = self._earlier
        gaps: Array = predict_gaps(
            point.gaps, point.rate, earlier.gaps, earlier.rate, on, self.way, self._lead,
            self._gone, led,
        )  # fmt: skip
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
        most = most / abs(self._gone)
        if most < self._fold and self._way_by_lead is not None:
            here, square, cube = self._way_by_lead
            straight = abs(self.way) * most * (here + most * (square + most * cube))
        else:
            straight = self.fold_distance
        left = max(LEFT_BEFORE_FOLD * self.fold_distance, LEAST_LEFT_BEFORE_FOLD * finest)
        return float(min(straight, self.fold_distance - left))

    def across(self, finest: float) -> float:
        """Step across the fold that is seen."""
        return (1 + LEFT_BEFORE_FOLD) * self.fold_distance + BEYOND_FOLD * finest


@compiled
def predict_gaps(
    gaps: Array, rate: Array, gaps_before: Array, rate_before: Array, on: float, way: float,
    lead: int, gone: float, led: float,
) -> Array:  # fmt: skip
    """Predict gaps at a distance ``on`` in d, from two points that are ``way`` apart.

    The edge ``lead`` has ``gone`` so far between them, and goes ``led`` times as far; NaN if no
    edge leads.
    """
    here_by, before_by = gone / rate[lead], gone / rate_before[lead]
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
