"""Locate on a branch where contact appears in a gap, or a gap in contact.

Both are the same search: a criterion has a value for every field, positive while nothing nucleates,
and the first point of a branch is located at which it is not positive. ``nucleation.Nucleation`` is
the criterion of touches, ``opening.Openings`` that of gaps that open inside patches.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.nucleation.closing import ClearanceInterpolation
from adhesis.solver.sharp.tolerances import (
    BISECTION_AFTER,
    LONGEST_STEP,
)

Seed = TypeVar("Seed")


@dataclass(frozen=True, eq=False)
class Located(Generic[Seed]):
    """Point of a branch at which something nucleates, its seeds, and the lateness in d at most."""

    point: Point
    seeds: list[Seed]
    late: float


class Criterion(Protocol[Seed]):
    """Nucleation criterion: a value for every field, positive while nothing nucleates."""

    @property
    def tolerance(self) -> float:
        """Value below zero that is allowed in a state."""
        ...

    def minimum(self, field: GapField) -> tuple[float, Any]:
        """Return the least value of a field, and the candidates from which seeds are chosen."""
        ...

    def choose_seeds(self, candidates: Any) -> list[Seed]:
        """Return the seeds of the least value, and of those that equal it; none if positive."""
        ...

    def is_located(self, value: float, near: bool) -> bool:
        """Return whether a point with this value is located finely enough.

        Parameters
        ----------
        value : float
        near : bool
            Whether a point with a positive value is as near as the resolution.
        """
        ...

    def track_between(self, clear: Point, hit: Point) -> ClearanceInterpolation | None:
        """Track each value that changes sign between two points by itself, or return None."""
        ...

    def validate_location(self, value: float, at: float) -> None:
        """Raise if a point located at d = ``at`` with this value cannot be used."""
        ...


def secant_share(clear_value: float, hit_value: float, tolerance: float) -> float:
    """Return the share of the way from a clear point to a hit at which to try next.

    By a secant to a fifth of the tolerance below zero, kept off both ends.
    """
    return min(max((clear_value + 0.2 * tolerance) / (clear_value - hit_value), 0.02), 0.98)


def locate(
    criterion: Criterion[Seed],
    edges: EdgeMechanics,
    trail: list[Point],
    resolution: float,
    clearance: float,
) -> tuple[Located[Seed] | None, float]:
    """Locate the first point of a trail at which a criterion is met, with its seeds.

    Else None and the least value at the end of the trail. The trail starts at a point known to be
    clear, by ``clearance`` at least; between its points the search ends at ``resolution`` (q0 s).
    """
    hit = trail[-1]
    hit_value, hit_candidates = criterion.minimum(hit.field)
    if hit_value > 0:
        return None, hit_value
    clear_value = np.nan
    # over the points of the trail, then within one step of it
    low, high = 0, len(trail) - 1
    while high - low > 1:
        middle = (low + high) // 2
        value, candidates = criterion.minimum(trail[middle].field)
        if value > 0:
            low, clear_value = middle, value
        else:
            high, hit, hit_candidates, hit_value = middle, trail[middle], candidates, value
    last = trail[low]
    clear = last.at
    # Each trial is expensive: the values at both ends show where to begin.
    if low == 0 and clearance > 0:
        clear_value = clearance
    tracked = criterion.track_between(last, hit)
    cleared = 0  # trials one after the other that were clear
    for trials in range(1, sys.float_info.mant_dig + 1):
        if criterion.is_located(hit_value, abs(clear - hit.at) <= resolution):
            break
        share = 0.5
        if tracked is not None and trials % BISECTION_AFTER:
            share = tracked.next_trial(clear, hit.at, -0.2 * criterion.tolerance)
        # The least value may be that of another candidate than the hit: then a secant creeps.
        elif tracked is None and np.isfinite(clear_value) and cleared < BISECTION_AFTER:
            share = secant_share(clear_value, hit_value, criterion.tolerance)
        trial = clear + (hit.at - clear) * share
        if trial in (clear, hit.at):  # there its value differs by the error of the field
            return Located(last, criterion.choose_seeds(hit_candidates), 0.0), 0.0
        reach = LONGEST_STEP * edges.wave
        gaps = last.interpolate(hit, trial)
        point = edges.equilibrium(gaps, trial, reach, memory=last.gaps)
        for start in (last, hit) if share < 0.5 else (hit, last):
            if point is None:
                gaps = start.extrapolate(trial)
                point = edges.equilibrium(gaps, trial, reach, memory=last.gaps)
        if point is None:
            break
        value, candidates = criterion.minimum(point.field)
        if tracked is not None:
            tracked.record(trial, point.field)
        cleared = cleared + 1 if value > 0 else 0
        if value > 0:
            last, clear, clear_value = point, trial, value
        else:
            hit, hit_candidates, hit_value = point, candidates, value
    criterion.validate_location(hit_value, hit.at)
    # estimate the distance from the exact location by a secant
    late = abs(clear - hit.at)
    if clear_value > hit_value:
        late *= -hit_value / (clear_value - hit_value)
    return Located(hit, criterion.choose_seeds(hit_candidates), late), 0.0
