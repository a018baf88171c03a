"""Locate contact that nucleates inside gaps, and insert seed patches.

Contact nucleates only where the opening has closed to zero. With adhesion a touching point grows at
once, along a path on which the energy only falls, to its first equilibrium; on the parabola κx²/2
that is (16 Γ/(π κ²))^(1/3) wide, Γ = 2γ q0/E* (lengths in 1/q0). A seed of half that width is put
at the touching point; the descent does the rest. Without adhesion a patch has no width at first
touch: its seed is put when the overlap is large enough for the narrowest patch that is followed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from adhesis.solver._kernels import (
    SearchedGaps,
    SearchLengths,
    clearance_left,
    least_clearances,
    search,
)
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import EQUAL_CRESTS, Array, Integers
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.errors import NoState
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.gap.ends import with_patches
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.nucleation.location import ClearanceInterpolation
from adhesis.solver.sharp.tolerances import OVERLAP


@dataclass(frozen=True)
class Touch:
    """Local minimum of an opening: position, value and curvature κ, in units of 1/q0."""

    theta: float
    opening: float
    curvature: float


class Minima(NamedTuple):
    """Local minima of the openings of some gaps, as in :class:`Touch`, shape (minima,) each."""

    theta: Array
    opening: Array
    curvature: Array


class Nucleation:
    """Criterion of touches for ``location.locate``, which also inserts seed patches.

    Attributes
    ----------
    searched : SearchedGaps
        Gaps as they were when they were last searched; set by a caller that continues from another
        state.
    equal : float
        Touches whose clearances differ by less are equal, in units of 1/q0.
    tolerance : float
        Overlap that is allowed in a state, in units of 1/q0.
    """

    def __init__(self, problem: Problem, edges: EdgeMechanics) -> None:
        self.problem, self.edges = problem, edges
        self.searched = SearchedGaps()
        self._lengths = SearchLengths(
            wave=float(edges.wave),
            closing_per_motion=float(edges.largest_opening / np.sqrt(edges.wave)),
            surface=edges.surface,
            narrowest=float(3 * edges.smallest),
            widest=float(edges.longest_step),
        )
        self.equal = EQUAL_CRESTS * problem.profile.h_max * problem.profile.q0
        self.tolerance = OVERLAP * problem.profile.h_max * problem.profile.q0

    def first_touch(self) -> tuple[float, list[Touch]]:
        """Return the separation q0 s at which the first seeds are put, and the touches.

        These are at the highest crest (:meth:`Profile.first_of_equal`).
        """
        profile = self.problem.profile
        crests = profile.crests()
        chosen = self._choose(crests.position)
        curvature = crests.curvature[chosen] / profile.q0
        theta = crests.position[chosen] * profile.q0
        highest = [Touch(float(a), 0.0, float(c)) for a, c in zip(theta, curvature, strict=True)]
        overlap = float(self.clearance(np.zeros_like(curvature), curvature).max())
        return profile.h_max * profile.q0 - overlap, highest

    def clearance(self, opening: Array, curvature: Array) -> Array:
        """Compute the opening left at minima before a seed is put; not positive at a touch."""
        return self._lengths.clearances(opening, curvature)

    def choose_seeds(self, minima: Minima) -> list[Touch]:
        """Choose the touch of the largest overlap; of equal ones, one and its copies."""
        over = self.clearance(minima.opening, minima.curvature)
        least = float(over.min(initial=np.inf))
        if least > 0:
            return []
        # without adhesion patches come and go smoothly, in any order
        equal = self.equal if self.edges.critical > 0 else np.inf
        deepest = np.flatnonzero(over <= min(least + equal, 0.0))
        deepest = deepest[self._choose(minima.theta[deepest] / self.problem.profile.q0)]
        return [
            Touch(float(minima.theta[i]), float(minima.opening[i]), float(minima.curvature[i]))
            for i in deepest
        ]

    def _choose(self, position: Array) -> Integers:
        """Choose those of equal touches at which contact begins; without adhesion all."""
        if self.edges.critical > 0:
            parts = self.problem.equal_parts
            return self.problem.profile.first_of_equal(position, parts)
        return np.arange(len(position))

    def minimum(self, field: GapField) -> tuple[float, Minima]:
        """Return the least clearance of a field, and the minima of the gaps that may have closed.

        Only those are searched; see ``kernels/clearance.hpp``.
        """
        least, count, found, self.searched = search(field.solution, self.searched, self._lengths)
        self.edges.count.openings += count
        return least, Minima(*found)

    def is_located(self, value: float, near: bool) -> bool:
        """Return whether a touch is located finely enough; see ``location.Criterion``."""
        return value > -0.5 * self.tolerance

    def validate_location(self, value: float, at: float) -> None:
        """Raise if surfaces overlap at the touch that was located."""
        if value < -self.tolerance and self.edges.critical > 0:
            raise NoState("surfaces overlap, and no first touch is found", at)

    def _clearance_of(self, field: GapField, indices: Integers) -> Array:
        """Compute the clearance of each of some gaps."""
        self.edges.count.openings += len(indices)
        return least_clearances(field.solution, indices, self._lengths)

    def track_between(self, clear: Point, hit: Point) -> ClearanceInterpolation | None:
        """Track the gaps that are open at one point and overlap at another."""
        remaining = clearance_left(hit.field.solution, self.searched, self._lengths)
        closed = np.flatnonzero(remaining <= 0)
        after = self._clearance_of(hit.field, closed)
        closed, after = closed[after < 0], after[after < 0]
        if len(closed) == 0 or clear.gaps.shape != hit.gaps.shape:
            return None
        before = self._clearance_of(clear.field, closed)
        return ClearanceInterpolation(
            clear.at, hit.at, before, after, lambda field: self._clearance_of(field, closed)
        )

    def insert_seeds(self, gaps: Array, touches: list[Touch]) -> Array:
        """Return the gaps with a seed patch at each touch."""
        return with_patches(
            gaps,
            np.array([t.theta for t in touches]),
            self._lengths.seed_widths(np.array([t.curvature for t in touches])),
        )
