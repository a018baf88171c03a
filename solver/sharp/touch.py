"""Where the surfaces touch inside a gap, and the patch that is put there.

Contact nucleates only where the opening has closed to zero. With adhesion a touching point grows at
once, along a path on which the energy only falls, to its first equilibrium; on the parabola κx²/2
that is (16 Γ/(π κ²))^(1/3) wide, Γ = 2γ q0/E* (lengths in 1/q0). A seed of half that width is put
at the touching point; the descent does the rest. Without adhesion a patch has no width at first
touch: it is put when the overlap is large enough for the narrowest patch that is followed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from solver.problem import Problem
from solver.profile import Array
from solver.sharp.edges import CORRECTED, EdgeMechanics, Point, with_patches
from solver.sharp.field import GapField
from solver.sharp.opening import fine_opening


@dataclass(frozen=True)
class Touch:
    """Local minimum of an opening: place, value and curvature κ, in units of 1/q0."""

    theta: float
    opening: float
    curvature: float


class Nucleation:
    """Finds touching points and puts seeds there."""

    def __init__(self, problem: Problem, edges: EdgeMechanics) -> None:
        self.problem, self.edges = problem, edges

    def first_touch(self) -> tuple[float, list[Touch]]:
        """Separation q0 s at which the first patches are put, and where.

        That is at every crest as high as the highest.
        """
        profile = self.problem.profile
        crests = profile.crests()
        curvature = crests.curvature / profile.q0
        theta = crests.position * profile.q0
        highest = [Touch(float(a), 0.0, float(c)) for a, c in zip(theta, curvature, strict=True)]
        overlap = max(self.clearance(t) for t in highest)
        return profile.h_max * profile.q0 - overlap, highest

    def minima(self, field: GapField) -> list[Touch]:
        """Local minima of the opening inside the gaps."""
        self.edges.count.openings += 1
        found: list[Touch] = []
        for k in range(len(field.gaps)):
            shape = fine_opening(field, k)
            x, y = shape.theta, shape.opening
            i = np.flatnonzero((y[1:-1] <= y[:-2]) & (y[1:-1] < y[2:])) + 1
            # parabola through three nodes, Newton's form
            first = (y[i] - y[i - 1]) / (x[i] - x[i - 1])
            second = (y[i + 1] - y[i]) / (x[i + 1] - x[i])
            half = (second - first) / (x[i + 1] - x[i - 1])
            slope = first + half * (x[i] - x[i - 1])
            at, low = x[i] - slope / (2 * half), y[i] - slope**2 / (4 * half)
            found += map(Touch, at.tolist(), low.tolist(), (2 * half).tolist())
        return found

    def clearance(self, touch: Touch) -> float:
        """Opening left before a patch is put there; negative or zero when it is time."""
        width = self._width(touch)
        narrowest = 3 * self.edges.smallest
        # Overlap of a narrow patch of width w: κw²/8 times a logarithm of the distance over which
        # the surface follows it, 10 to 20 here.
        return touch.opening + (4 * touch.curvature * width**2 if width <= narrowest else 0.0)

    def ready(self, minima: list[Touch]) -> list[Touch]:
        """Those of the minima at which it is time to put a patch."""
        return [t for t in minima if self.clearance(t) <= 0]

    def least(self, field: GapField) -> tuple[float, list[Touch]]:
        """Least clearance of a field, and all its minima."""
        minima = self.minima(field)
        return min((self.clearance(t) for t in minima), default=np.inf), minima

    def located(
        self, trail: list[Point], resolution: float
    ) -> tuple[tuple[Point, list[Touch]] | None, float]:
        """First point of a trail at which surfaces touch inside a gap, with the touches.

        Else None and the least clearance at the end of the trail. The trail starts at a point known
        to be clear; between its points the touch is located to ``resolution`` (q0 s).
        """
        hit = trail[-1]
        hit_value, hit_minima = self.least(hit.field)
        if hit_value > 0:
            return None, hit_value
        clear_value = np.nan
        # over the points of the trail, then within one step of it
        low, high = 0, len(trail) - 1
        while high - low > 1:
            middle = (low + high) // 2
            value, minima = self.least(trail[middle].field)
            if value > 0:
                low, clear_value = middle, value
            else:
                high, hit, hit_minima, hit_value = middle, trail[middle], minima, value
        clear = trail[low].at
        while clear - hit.at > resolution and hit_value < 0:
            share = 0.5
            if np.isfinite(clear_value):
                # secant, kept off the ends
                share = min(max(clear_value / (clear_value - hit_value), 0.02), 0.98)
            aim = clear + (hit.at - clear) * share
            point = self.edges.equilibrium(hit.predicted(aim), aim, CORRECTED * self.edges.wave)
            if point is None:
                break
            value, minima = self.least(point.field)
            if value > 0:
                clear, clear_value = aim, value
            else:
                hit, hit_minima, hit_value = point, minima, value
        return (hit, self.ready(hit_minima)), 0.0

    def seeded(self, gaps: Array, touches: list[Touch]) -> Array:
        """Edges with a seed at each touch."""
        return with_patches(
            gaps,
            np.array([t.theta for t in touches]),
            np.array([self._width(t) for t in touches]),
        )

    def _width(self, touch: Touch) -> float:
        surface = math.pi * self.edges.critical**2 / 8  # Γ
        first = (16 * surface / (math.pi * touch.curvature**2)) ** (1 / 3)
        return float(min(max(0.5 * first, 3 * self.edges.smallest), self.edges.longest_step))
