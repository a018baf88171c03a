"""Locate on a branch where contact appears in a gap, or a gap in contact.

Both are the same search: a criterion has a value for every field, positive while nothing happens,
and the first point of a branch is looked for at which it is not. ``nucleation.Nucleation`` is the
criterion of touches, ``opening.Openings`` its mirror image, that of gaps that open inside patches.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.nucleation.closing import Closing
from adhesis.solver.sharp.tolerances import (
    BISECTION_EVERY,
    CLEAR_TRIALS,
    CORRECTED,
    TOUCH_TRIALS,
)

Seed = TypeVar("Seed")


@dataclass(frozen=True, eq=False)
class Located(Generic[Seed]):
    """The point of a branch at which something nucleates, what, and how late (in d) at most."""

    point: Point
    seeds: list[Seed]
    late: float


class Tracked(Protocol):
    """Values of several places, each followed by itself along a stretch of a branch."""

    @property
    def closing(self) -> Closing:
        """What is known of them."""
        ...

    def values(self, field: GapField) -> Array:
        """Compute their values in another field."""
        ...


class Criterion(Protocol[Seed]):
    """What nucleates, and when."""

    @property
    def tolerance(self) -> float:
        """Value below zero that is allowed in a state."""
        ...

    def least(self, field: GapField) -> tuple[float, Any]:
        """Return the least value of a field, and the places from which seeds are chosen."""
        ...

    def ready(self, places: Any) -> list[Seed]:
        """Return the seeds of the least value, and of those that equal it; none if positive."""
        ...

    def is_located(self, value: float, many: bool, near: bool) -> bool:
        """Whether a place with this value is exact enough.

        Parameters
        ----------
        value : float
        many : bool
            Whether there are many gaps, for which each trial is expensive.
        near : bool
            Whether a point with a positive value is as near as the resolution.
        """
        ...

    def tracked(self, clear: Point, hit: Point) -> Tracked | None:
        """Return the places whose values change sign between two points, of many gaps."""
        ...

    def check_located(self, value: float, at: float) -> None:
        """Raise if a point found at d = ``at`` with this value cannot be used."""
        ...


def locate(
    criterion: Criterion[Seed],
    edges: EdgeMechanics,
    trail: list[Point],
    resolution: float,
    clearance: float,
) -> tuple[Located[Seed] | None, float]:
    """Locate the first point of a trail at which a criterion is met, with its seeds.

    Else None and the least value at the end of the trail. The trail starts at a point known to be
    clear, by ``clearance`` at least; between its points the place is located to ``resolution``
    (q0 s).
    """
    hit = trail[-1]
    hit_value, hit_places = criterion.least(hit.field)
    if hit_value > 0:
        return None, hit_value
    clear_value = np.nan
    # over the points of the trail, then within one step of it
    low, high = 0, len(trail) - 1
    while high - low > 1:
        middle = (low + high) // 2
        value, places = criterion.least(trail[middle].field)
        if value > 0:
            low, clear_value = middle, value
        else:
            high, hit, hit_places, hit_value = middle, trail[middle], places, value
    last = trail[low]
    clear = last.at
    # Of many gaps each trial is expensive: those at both ends show where to begin, and the least
    # value below zero is enough.
    many = edges.uses_windows(last.gaps)
    if many and low == 0 and clearance > 0:
        clear_value = clearance
    tracked = criterion.tracked(last, hit) if many else None
    cleared = 0  # trials one after the other that were clear
    for trials in range(1, TOUCH_TRIALS + 1):
        if criterion.is_located(hit_value, many, abs(clear - hit.at) <= resolution):
            break
        share = 0.5
        if tracked is not None and trials % BISECTION_EVERY:
            share = tracked.closing.aim(clear, hit.at, -0.2 * criterion.tolerance)
        # The least value may be that of another place than the hit: then a secant creeps.
        elif tracked is None and np.isfinite(clear_value) and cleared < CLEAR_TRIALS:
            # secant to half of the value that is allowed, kept off the ends
            aimed = clear_value + 0.2 * criterion.tolerance
            share = min(max(aimed / (clear_value - hit_value), 0.02), 0.98)
        aim = clear + (hit.at - clear) * share
        if aim in (clear, hit.at):  # there its value differs by the error of the field
            return Located(last, criterion.ready(hit_places), 0.0), 0.0
        point = None
        reach = CORRECTED * edges.wave
        if many:
            point = edges.equilibrium(last.interpolate(hit, aim), aim, reach)
        for start in (last, hit) if share < 0.5 else (hit, last):
            if point is None:
                point = edges.equilibrium(start.extrapolate(aim), aim, reach)
        if point is None:
            break
        value, places = criterion.least(point.field)
        if tracked is not None:
            tracked.closing.note(aim, tracked.values(point.field))
        cleared = cleared + 1 if value > 0 else 0
        if value > 0:
            last, clear, clear_value = point, aim, value
        else:
            hit, hit_places, hit_value = point, places, value
    criterion.check_located(hit_value, hit.at)
    # it was met so much earlier as the value says
    late = abs(clear - hit.at)
    if clear_value > hit_value:
        late *= -hit_value / (clear_value - hit_value)
    return Located(hit, criterion.ready(hit_places), late), 0.0
