"""The stepper on a known curve: it finds a fold, and a touch where the clearance leaps.

The branch here is one gap whose half-width is a = a0 + sqrt(d - d_fold), with a fold at d_fold, or
a = a0 + slope·d without a fold; no elastic field is solved.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, cast

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.continuation.branch import (
    Branch,
    Fold,
    Resolution,
    Target,
)
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.nucleation.location import equilibrium_between, locate

WAVE, FOLD = 1.0, 0.2


@dataclass
class Curve:
    """Stands for the mechanics of edges: equilibria are those of a known curve."""

    fold: float | None = FOLD
    smallest: float = 1e-9
    critical: float = 1.0
    wave: float = WAVE
    is_load: bool = False
    closing_factor: float = 1.0
    asked: int = 0
    pins: bool = False
    source: ClassVar[Any] = SimpleNamespace(is_patterned=False)

    def half_width(self, at: float) -> float:
        """Half of the gap's length."""
        return 0.5 + (0.1 * at if self.fold is None else float(np.sqrt(at - self.fold)))

    def rate(self, at: float) -> float:
        """Derivative of the half-width by d."""
        return 0.1 if self.fold is None else 0.5 / float(np.sqrt(at - self.fold))

    def point(self, at: float, clearance: float = 0.0) -> Point:
        """Point of the curve."""
        a = self.half_width(at)
        gaps = np.array([[3 - a, 3 + a]])
        field = SimpleNamespace(gaps=gaps, nearly=(-at * at, at), separation=at)
        # n is the outward motion of the contact: the gap opens with d
        rate = np.full(2, -self.rate(at))
        return Point(at, cast(Any, field), rate, -2 * at, clearance)

    def equilibrium(
        self, gaps: Any, at: float, reach: float, memory: Array | None = None
    ) -> Point | None:
        """Point of the curve, if it is within reach."""
        self.asked += 1
        if self.fold is not None and at <= self.fold:
            return None
        point = self.point(at)
        return point if np.abs(point.gaps - gaps).max() < reach else None


def branch(curve: Curve, start: float, jump: float) -> Branch:
    """Make a branch that is followed down to 0, to a resolution of folds."""
    closing = SimpleNamespace(between=lambda point, reached, name: abs(reached.at - point.at))
    resolution = Resolution(jump, 1e-3, np.inf, 1.0, 1e-9, 0.5, 0.0, 0.05)
    aim = Target(0.0, 0.0, "loading")
    return Branch(cast(Any, curve), cast(Any, closing), resolution, curve.point(start), aim)


def test_a_branch_ends_in_its_fold_at_the_resolution_that_is_asked():
    for jump in (1e-3, 1e-6, 1e-9):
        curve = Curve()
        followed, places = branch(curve, 0.9, jump), []
        while not isinstance(event := followed.advance(), Fold):
            places.append(event.point.at)
        assert event.at < FOLD < event.point.at
        assert event.point.at - event.at < 2 * jump
        assert curve.asked < 80  # a bisection alone would need as many points for each digit
        assert places == sorted(places, reverse=True)


class Clearance:
    """Clear down to d = 0.6, by 1e-5 there, and from there on an overlap by as much."""

    tolerance = 1e-6

    def minimum(self, field: Any) -> tuple[float, float]:
        """Value at a field, and its place."""
        at = field.separation
        return at - 0.6 + (1e-5 if at > 0.6 else -1e-5), at

    def choose_seeds(self, place: float) -> list[float]:
        """Seed at a place."""
        return [place]

    def is_located(self, value: float, near: bool) -> bool:
        """Whether the overlap is small."""
        return near and value > -0.5 * self.tolerance

    def track_between(self, clear: Point, hit: Point) -> None:
        """Few gaps."""

    def validate_location(self, value: float, at: float) -> None:
        """Nothing to check."""


def test_a_touch_where_the_clearance_leaps_is_at_the_last_clear_point():
    """By the error of the field: no smaller step makes the overlap small."""
    curve = Curve(fold=None)
    trail = [curve.point(at) for at in (0.8, 0.5)]
    solve = equilibrium_between(cast(Any, curve))
    found, _ = locate(cast(Any, Clearance()), solve, trail, 1e-4, 0.0)
    assert found is not None
    assert 0 < found.point.at - 0.6 < 1e-15
    assert (found.seeds, found.late) == ([0.6], 0.0)
