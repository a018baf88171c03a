"""Locate on a branch where contact appears in a gap, and insert it (docs/methods.md, rules 4, 11).

The least clearance of a field is positive while nothing touches; where it is not at the end of a
trail of points, :meth:`Nucleation.locate` finds the place from which on it is not.

With adhesion a touching point grows at once to its first equilibrium; on the parabola κx²/2 half
its width is nearly b = (16 Γ/(π κ²))^(1/3), Γ = 2γ q0/E* (lengths in 1/q0). A seed b/2 wide, but no
longer than ``LONGEST_STEP``, is put there; the descent does the rest. Without adhesion a patch
has no width at first touch: its seed is put when the overlap is large enough for the narrowest
patch that is followed. With a finite range of adhesion a seed is put that grows: G stays below γ by
a tenth at both edges.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from adhesis.solver._kernels import (
    SearchedGaps,
    SearchLengths,
    search,
)
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import EQUAL_CRESTS, Array, Integers
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.gap.ends import with_patches
from adhesis.solver.sharp.mechanics import EdgeMechanics, Point
from adhesis.solver.sharp.tolerances import (
    GROWTH,
    HEALED_OPENING,
    IN_GAP,
    LONGEST_TRIAL_HALF_WIDTH,
    OVERLAP,
    TRIAL_WIDTHS,
)


@dataclass(frozen=True)
class Touch:
    """Local minimum of an opening: position, value, and width of its seed, in units of 1/q0."""

    theta: float
    opening: float
    width: float


@dataclass(frozen=True, eq=False)
class Located:
    """Point of a branch at which surfaces touch, the touches, and how late it is in d."""

    point: Point
    touches: list[Touch]
    late: float


class Minima(NamedTuple):
    """Local minima of the openings of some gaps, as in :class:`Touch`, shape (minima,) each.

    A clearance is what is left before a seed is put.
    """

    theta: Array
    opening: Array
    width: Array
    clearance: Array


class Nucleation:
    """Finds touches in the gaps of a field and along a branch, and inserts their seed patches.

    Attributes
    ----------
    searched : SearchedGaps
        Gaps as they were when they were last searched; set by a caller that continues from another
        state.
    equal : float
        Touches whose clearances differ by less are equal, in units of 1/q0.
    tolerance : float
        Overlap that is allowed in a state, in units of 1/q0.
    range : float
        Of adhesion, in units of 1/q0.
    healed : list of (position, opening)
        Touches whose patches did not hold: none is tried there in the same load step unless the
        opening is smaller.
    heals : int
        Number of touches that did not hold, so far.
    healed_at : float
        d of the last of them.
    """

    def __init__(self, problem: Problem, edges: EdgeMechanics) -> None:
        self.problem, self.edges = problem, edges
        self.searched = SearchedGaps()
        self.range = problem.attraction_range * problem.profile.q0
        self.healed: list[tuple[float, float]] = []
        self.heals, self.healed_at = 0, math.nan
        largest_opening = edges.critical * np.sqrt(edges.adhesion.largest)  # on a flat piece
        self._lengths = SearchLengths(
            wave=float(edges.wave),
            closing_per_motion=float(largest_opening / np.sqrt(edges.wave)),
            surface=edges.surface,
            narrowest=self.edges.narrowest,
            longest_step=float(edges.longest_step),
            range=self.range,
        )
        self.equal = EQUAL_CRESTS * problem.profile.h_max * problem.profile.q0
        self.tolerance = OVERLAP * problem.profile.h_max * problem.profile.q0

    def first_touch(self, opening: float = 0.0) -> tuple[float, list[Touch]]:
        """Return the separation q0 s at which the first seeds are put, and the touches.

        These are at the first crest (:attr:`Problem.first_crest`), in units of 1/q0 at an
        ``opening`` within the range; there are none where no patch grows there.
        """
        profile = self.problem.profile
        crests = profile.crests()
        chosen = self._first_of_equal(crests.position)
        curvature = crests.curvature[chosen] / profile.q0
        theta = crests.position[chosen] * profile.q0
        widths = self._lengths.seed_widths(curvature)
        clearance = self._lengths.clearances(np.full(len(theta), self.range), curvature)
        separation = profile.h_max * profile.q0 - float(clearance.max()) + opening
        if opening > 0:
            d = 0.0 if self.edges.is_load else separation
            left, width = self._judge(np.empty((0, 2)), d, theta, opening, float(widths[0]))
            if left > 0:
                return separation, []
            widths = np.full(len(theta), width)
        touches = [Touch(float(a), opening, float(w)) for a, w in zip(theta, widths, strict=True)]
        return separation, touches

    def choose(self, minima: Minima) -> list[Touch]:
        """Choose the touch of the largest overlap; of equal ones, one and its copies."""
        over = minima.clearance
        least = float(over.min(initial=np.inf))
        if least > 0:
            return []
        # without adhesion patches come and go smoothly, in any order
        equal = self.equal if self.edges.critical > 0 else np.inf
        deepest = np.flatnonzero(over <= min(least + equal, 0.0))
        deepest = deepest[self._first_of_equal(minima.theta[deepest] / self.problem.profile.q0)]
        if self.edges.critical > 0 and self.edges.symmetry.parts > 1:
            deepest = self._copies_of(int(deepest[0]), minima)
        return [
            Touch(float(minima.theta[i]), float(minima.opening[i]), float(minima.width[i]))
            for i in deepest
        ]

    def _copies_of(self, first: int, minima: Minima) -> Integers:
        """Find a touch and its copies in the equal parts of the period.

        The error of the field may keep some of them from touching, by less than an overlap that is
        allowed.
        """
        part = 2 * np.pi / self.edges.symmetry.parts
        near = np.flatnonzero(minima.clearance <= self.tolerance)
        apart = (minima.theta[near] - minima.theta[first] + 0.5 * part) % part - 0.5 * part
        return np.asarray(near[np.abs(apart) < self.edges.longest_step])

    def _first_of_equal(self, position: Array) -> Integers:
        """Choose those of equal touches at which contact begins; without adhesion all."""
        if self.edges.critical > 0:
            return self.problem.first_of_equal(position, self.edges.symmetry.parts)
        return np.arange(len(position))

    def minimum(self, field: GapField) -> tuple[float, Minima]:
        """Return the least clearance of a field, and the minima of the gaps that may have closed.

        Only those are searched; see ``kernels/clearance.hpp``.
        """
        least, count, found, self.searched = search(field.solution, self.searched, self._lengths)
        self.edges.count.openings += count
        theta, opening, widths, rim, clearance = found
        touching: Any = ()
        if self.range > 0:
            touching = np.flatnonzero((opening > 0) & (clearance <= 0) & (rim > self.range))
        for i in touching:
            if self._has_healed(theta[i], opening[i]):
                clearance[i] = opening[i]
                continue
            where = field.gaps, field.prescribed, theta[i : i + 1]
            clearance[i], widths[i] = self._judge(*where, float(opening[i]), float(widths[i]))
        least = min(least, float(clearance.min(initial=np.inf)))
        return least, Minima(theta, opening, widths, clearance)

    def _judge(
        self, gaps: Array, prescribed: float, theta: Array, opening: float, width: float
    ) -> tuple[float, float]:
        """Return the clearance of equal minima within the range, and the width of their seeds.

        The opening has to close by the clearance, at least, before a patch grows.
        """
        first = float(theta[0])
        apart = np.abs((gaps.ravel() - first + np.pi) % (2 * np.pi) - np.pi).min(initial=np.inf)
        longest = 2 * min(LONGEST_TRIAL_HALF_WIDTH * self.edges.wave, IN_GAP * apart)

        def release(width: float) -> float:
            if not self.edges.narrowest <= width <= longest:
                return np.inf
            seeded = with_patches(gaps, theta, np.full(len(theta), width))
            return float(self.edges.release(seeded, prescribed, first, 0.5 * width).max())

        width = min(width, longest)
        rate = release(width)
        for ratio in (1 / TRIAL_WIDTHS, TRIAL_WIDTHS):
            while rate > 1 / GROWTH and (other := release(ratio * width)) < rate:
                width, rate = ratio * width, other
        # G falls with the square of the opening, or more slowly
        left = opening * (1 - 1 / math.sqrt(GROWTH * max(rate, 1e-300)))
        return max(opening - self.range, left), width

    def insert(self, gaps: Array, touches: list[Touch]) -> Array:
        """Return the gaps with a seed patch at each touch."""
        return with_patches(
            gaps,
            np.array([t.theta for t in touches]),
            np.array([t.width for t in touches]),
        )

    def way_since_healed(self, touches: list[Touch], d: float) -> float:
        """Return the way in d since patches at these places last did not hold; 0 if they did."""
        healed = any(self._has_healed(touch.theta, math.inf) for touch in touches)
        return abs(d - self.healed_at) if healed else 0.0

    def _has_healed(self, theta: float, opening: float) -> bool:
        near = self.edges.longest_step  # the widest seed: one covers the other's place
        return any(
            abs((theta - place + np.pi) % (2 * np.pi) - np.pi) < near
            and opening > HEALED_OPENING * before
            for place, before in self.healed
        )

    def heal(self, touches: list[Touch], d: float) -> bool:
        """Record touches whose patches did not hold at ``d``; returns whether there are any.

        Surfaces that overlap touch in any case.
        """
        if self.range > 0:
            healed = [(touch.theta, touch.opening) for touch in touches if touch.opening > 0]
            self.healed += healed
            self.heals, self.healed_at = self.heals + len(healed), d
            return bool(healed)
        return False

    def locate(self, trail: list[Point]) -> Located | None:
        """Locate where along a trail surfaces begin to touch, and at which places.

        None if they do not at its end. The trail starts at a point known to be clear.
        """
        if self.minimum(trail[-1].field)[0] > 0:
            return None
        # Each trial is expensive: the values at both ends show where to begin.
        clear, hit = trail[:2]
        clear_value, _ = self.minimum(clear.field)
        hit_value, hit_minima = self.minimum(hit.field)
        for point in trail[2:]:
            if hit_value <= 0:
                break
            clear, clear_value, hit = hit, hit_value, point
            hit_value, hit_minima = self.minimum(hit.field)
        aim = 0.2 * self.tolerance  # so far below zero, and in d: no gap closes by as much in that
        # The least value may be that of another minimum than the hit: then a secant creeps. As long
        # as an end stays its value counts half as much with every trial (the Illinois method).
        cleared: bool | None = None  # whether the last trial was clear
        stayed = 1.0  # share with which the value at the other end counts
        for _ in range(sys.float_info.mant_dig):
            # within the range a value may fall at once, where surfaces part beside a minimum
            is_near = abs(clear.d - hit.d) <= aim and hit_value > -self.range
            if is_near or hit_value > -0.5 * self.tolerance:
                break
            share = 0.5
            if clear_value > 0:
                above = (clear_value + aim) * (stayed if cleared is False else 1.0)
                below = (hit_value + aim) * (stayed if cleared else 1.0)
                share = min(max(above / (above - below), 0.02), 0.98)  # off both ends
            trial = clear.d + (hit.d - clear.d) * share
            if trial in (clear.d, hit.d):  # there its value differs by the error of the field
                return Located(clear, self.choose(hit_minima), 0.0)
            between = self.edges.equilibrium_between(clear, hit, trial)
            if between is None:
                break
            value, minima = self.minimum(between.field)
            stayed = 0.5 * stayed if cleared == (value > 0) else 1.0
            cleared = value > 0
            if cleared:
                clear, clear_value = between, value
            else:
                hit, hit_minima, hit_value = between, minima, value
        # estimate the distance from the exact location by a secant
        late = abs(clear.d - hit.d)
        if clear_value > hit_value:
            late *= -hit_value / (clear_value - hit_value)
        return Located(hit, self.choose(hit_minima), late)
