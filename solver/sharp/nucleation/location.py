"""Locate on a branch where contact appears in a gap, or a gap in contact.

Both are the same search: a criterion has a value for every field, positive while nothing nucleates;
where it is not at the end of a trail of points, the place is located from which on it is not.
``nucleation.Nucleation`` is the criterion of touches, ``opening.Cracks`` that of gaps that open
inside patches.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from adhesis.solver.sharp.branch_point import Point
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import BISECTION_AFTER

Seed = TypeVar("Seed")


@dataclass(frozen=True, eq=False)
class Located(Generic[Seed]):
    """Point of a branch at which something nucleates, its seeds, and how late it is in d."""

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

        ``near`` states whether one with a positive value is as near as the resolution.
        """
        ...


def locate(
    criterion: Criterion[Seed],
    edges: EdgeMechanics,
    trail: list[Point],
    resolution: float,
) -> Located[Seed] | None:
    """Locate where along a trail a criterion begins to be met, with the seeds.

    None if it is not met at its end. The trail starts at a point known to be clear; between its
    points the search ends at ``resolution`` (d).
    """
    if criterion.minimum(trail[-1].field)[0] > 0:
        return None
    # Each trial is expensive: the values at both ends show where to begin.
    clear, hit = trail[:2]
    clear_value, _ = criterion.minimum(clear.field)
    hit_value, hit_candidates = criterion.minimum(hit.field)
    for point in trail[2:]:
        if hit_value <= 0:
            break
        clear, clear_value, hit = hit, hit_value, point
        hit_value, hit_candidates = criterion.minimum(hit.field)
    cleared = 0  # trials one after the other that were clear
    for _ in range(sys.float_info.mant_dig):
        if criterion.is_located(hit_value, abs(clear.d - hit.d) <= resolution):
            break
        share = 0.5
        # The least value may be that of another candidate than the hit: then a secant creeps.
        if clear_value > 0 and cleared < BISECTION_AFTER:
            # to a fifth of the tolerance below zero, and off both ends
            share = (clear_value + 0.2 * criterion.tolerance) / (clear_value - hit_value)
            share = min(max(share, 0.02), 0.98)
        trial = clear.d + (hit.d - clear.d) * share
        if trial in (clear.d, hit.d):  # there its value differs by the error of the field
            return Located(clear, criterion.choose_seeds(hit_candidates), 0.0)
        between = edges.equilibrium_between(clear, hit, trial)
        if between is None:
            break
        value, candidates = criterion.minimum(between.field)
        cleared = cleared + 1 if value > 0 else 0
        if value > 0:
            clear, clear_value = between, value
        else:
            hit, hit_candidates, hit_value = between, candidates, value
    # estimate the distance from the exact location by a secant
    late = abs(clear.d - hit.d)
    if clear_value > hit_value:
        late *= -hit_value / (clear_value - hit_value)
    return Located(hit, criterion.choose_seeds(hit_candidates), late)
