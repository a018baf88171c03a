"""The stepper on a known curve, whose fold it finds.

The branch is one gap whose half-width is a = a0 + sqrt(d - d_fold); no elastic field is solved.
"""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, cast

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.continuation.branch import Fold, Resolution, StableBranch, Target
from adhesis.solver.sharp.mechanics import Point

WAVE, FOLD = 1.0, 0.2


@dataclass
class Curve:
    """Stands for the mechanics of edges: equilibria are those of a known curve."""

    smallest: float = 1e-9
    critical: float = 1.0
    wave: float = WAVE
    longest_step: float = 0.05 * WAVE
    is_load: bool = False
    asked: int = 0
    adhesion: ClassVar[Any] = SimpleNamespace(least=1.0, largest=1.0, pins=False)

    def point(self, d: float) -> Point:
        a = 0.5 + float(np.sqrt(d - FOLD))
        gaps = np.array([[3 - a, 3 + a]])
        field = SimpleNamespace(gaps=gaps, nearly=(-d * d, d), separation=d)
        # n is the outward motion of the contact: the gap opens with d
        rate = np.full(2, -0.5 / float(np.sqrt(d - FOLD)))
        return Point(d, cast(Any, field), rate, -2 * d)

    def equilibrium(
        self, gaps: Any, d: float, reach: float, memory: Array | None = None
    ) -> Point | None:
        self.asked += 1
        if d <= FOLD:
            return None
        point = self.point(d)
        return point if np.abs(point.gaps - gaps).max() < reach else None


def branch(curve: Curve, start: float, jump: float) -> StableBranch:
    """Make a branch that is followed down to 0, to a resolution of folds."""
    resolution = Resolution(jump, 1e-3, np.inf, 1.0, 1e-9, 0.5, 0.0, 0.05)
    aim = Target(0.0, 0.0, "loading")
    return StableBranch(cast(Any, curve), resolution, cast(Any, None), curve.point(start), aim)


def test_a_branch_ends_in_its_fold_at_the_resolution_that_is_asked():
    for jump in (1e-3, 1e-6, 1e-9):
        curve = Curve()
        followed, places = branch(curve, 0.9, jump), []
        while not isinstance(event := followed.advance(), Fold):
            places.append(event.point.d)
        assert event.d < FOLD < event.point.d
        assert event.point.d - event.d < 2 * jump
        assert curve.asked < 45  # 34 to 64 where no fold is seen ahead
        assert places == sorted(places, reverse=True)
