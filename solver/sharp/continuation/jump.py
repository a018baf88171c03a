"""A jump: descent in energy at fixed separation, and what touches afterwards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.method import ContactState
from adhesis.solver.model.jump import Branch
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.local_descent import Start
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.gap.ends import outward
from adhesis.solver.sharp.mechanics import CORRECTED, EdgeMechanics, FullContact, NoState, Track
from adhesis.solver.sharp.nucleation.nucleation import Nucleation, Touch
from adhesis.solver.sharp.output.contact_states import States, Trace

_MOST_TOUCHES = 10_000  # nucleations in one jump; more is a bug
_RAN = 0.05  # an edge that went further than this, in λ_min, ran
_HELD_BACK = 0.03  # runners that take less than this share of C_c² from each other do not race
_ELSEWHERE = 0.01  # edges this far apart, in λ_min, are those of different minima

Rival = Point | None | FullContact
"""Where equal speeds led: a minimum, no contact, or full contact (under a load)."""


class Jumps:
    """Jumps of one problem.

    Parameters
    ----------
    edges : EdgeMechanics
    nucleation : Nucleation
    states : States
    """

    def __init__(self, edges: EdgeMechanics, nucleation: Nucleation, states: States) -> None:
        self.edges, self.nucleation, self.states = edges, nucleation, states

    def run(
        self,
        trace: Trace,
        before: ContactState,
        start: Array,
        at: float,
        branch: Branch,
        touches: list[Touch] | None = None,
        known: Point | None = None,
    ) -> Point | None:
        """Descend at q0 s = ``at`` from the gaps ``start``; adds the jump and the state after it.

        The gaps are those of a ``known`` equilibrium, or nearly.

        Returns the minimum as it was found: next to a fold it may not be found again from its own
        edges. None if no contact is left.
        """
        rivals: list[Rival] = []
        point = self._descend(start, at, touches or [], rivals, known)
        point = self._settle(
            point,
            at,
            lambda gaps, touching, before: self._descend(gaps, at, touching, rivals, before),
        )
        after = self._after(before, point, at)
        other = after
        if rivals:
            try:
                rival = self._settle_rival(rivals[0], at)
            except FullContact:  # elsewhere, but with no energy that could be compared
                other = replace(after)
            else:
                if not self._alike(rival, point):
                    other = self._after(before, rival, at)
        trace.jumps.append(self.states.jump(before, after, branch, other))
        trace.states.append(after)
        if known is not None and point is not None and len(point.gaps) >= self.edges.many:
            point = point.carry_rates(known, CORRECTED * self.edges.wave)
        return point

    def _after(self, before: ContactState, point: Point | None, at: float) -> ContactState:
        """State that a descent led to."""
        return self.states.after_loss(before, at) if point is None else self.states.of_point(point)

    def _settle_rival(self, point: Rival, at: float) -> Point | None:
        """Go on with equal speeds, from a minimum that they reached, until nothing touches."""
        if isinstance(point, FullContact):
            raise point
        return self._settle(
            point,
            at,
            lambda gaps, touching, before: self._relax(
                self.nucleation.seeded(gaps, touching),
                at,
                equal_speeds=True,
                start=self.edges.start(before),
            ),
        )

    def _settle(
        self,
        point: Point | None,
        at: float,
        descend: Callable[[Array, list[Touch], Point | None], Point | None],
    ) -> Point | None:
        """Let contact nucleate wherever surfaces overlap in a minimum, the deepest place first.

        Raises
        ------
        PathError
            If an overlap stays.
        """
        # without adhesion patches narrower than the least are left out, and overlap so much
        adhesive = self.edges.critical > 0
        for _ in range(_MOST_TOUCHES):
            if point is None:
                if not (adhesive and self.states.overlaps_when_detached(at)):
                    return None
                _, touches = self.nucleation.first_touch()
                point = descend(np.empty((0, 2)), touches, None)
                continue
            least, minima = self.nucleation.least(point.field)
            if least > 0:
                return point.with_clearance(least)
            grown = descend(point.field.gaps, self.nucleation.ready(minima), point)
            if grown is not None and self._same(grown.field.gaps, point.field.gaps):
                if adhesive and least < -self.nucleation.overlap:
                    break
                return point
            point = grown
        raise NoState("surfaces overlap, and no patch comes to rest there", at)

    def _alike(self, one: Point | None, other: Point | None) -> bool:
        """Whether two descents led to one minimum."""
        if one is None or other is None:
            return one is other
        here, there = one.field.gaps, other.field.gaps
        apart = max(_ELSEWHERE * self.edges.wave, 10 * self.edges.coarse)
        return here.shape == there.shape and bool(np.abs(here - there).max() < apart)

    def _same(self, one: Array, other: Array) -> bool:
        """Whether two equilibria are one to the accuracy at which they are known."""
        return one.shape == other.shape and bool(np.abs(one - other).max() < 10 * self.edges.coarse)

    def _descend(
        self,
        gaps: Array,
        at: float,
        touches: list[Touch],
        rivals: list[Rival],
        known: Point | None = None,
    ) -> Point | None:
        """Descend to the next minimum of the energy; None when no contact is left.

        Where edges may have raced, a minimum that equal speeds lead to instead is added to
        ``rivals``, unless there is one.
        """
        if touches:
            gaps = self.nucleation.seeded(gaps, touches)
        track = Track()
        start = self.edges.start(known)
        point = self._relax(gaps, at, track=track, start=start)
        if not rivals and self._may_have_raced(gaps, point, track):
            try:
                rival = self._relax(gaps, at, equal_speeds=True, track=track, start=start)
            except FullContact as full:
                rivals.append(full)
            else:
                if not track.met and not self._alike(rival, point):
                    rivals.append(rival)
        return point

    def _relax(
        self,
        gaps: Array,
        at: float,
        *,
        equal_speeds: bool = False,
        track: Track | None = None,
        start: Start | None = None,
    ) -> Point | None:
        reach = CORRECTED * self.edges.wave
        while len(gaps):
            found = self.edges.relax(
                gaps, at, reach, equal_speeds=equal_speeds, track=track, start=start
            )
            if isinstance(found, Point):
                return found
            gaps, start = found, None
        return None

    def _may_have_raced(self, start: Array, end: Point | None, track: Track) -> bool:
        """Whether the order in which edges ran from ``start`` can have decided where they ended.

        It can where they hold each other back: edges that only help each other on reach the same
        minimum in any order. So the force is asked for that the runners took from each other: to
        first order in their ways and with the tangent at the end or, where patches or gaps went,
        along the ``track``, for every set of gaps on it. Of many gaps that is not known.
        """
        if end is None and len(start) == 1:
            return False
        if end is None or end.field.gaps.shape != start.shape:
            return not track.whole or any(
                self._hold_back(stage.way, stage.taken) for stage in track.stages
            )
        gaps = end.field.gaps
        way = outward(gaps) * (gaps - start).ravel()
        runners = self._runners(way)
        if len(runners) < 2:
            return False
        opening = end.field.solution.opening[runners]
        stiffness = opening[:, None] * self.edges.stiffness(end, runners)
        return self._hold_back(way[runners], (stiffness + stiffness.T) * way[runners])

    def _runners(self, way: Array) -> NDArray[np.int64]:
        return np.flatnonzero(np.abs(way) > _RAN * self.edges.wave)

    def _hold_back(self, way: Array, taken: Array) -> bool:
        """Whether the motion of runners (columns) took so much force from others (rows)."""
        runners = self._runners(way)
        if len(runners) < 2:
            return False
        taken = taken[np.ix_(runners, runners)] * np.sign(way[runners])[:, None]
        np.fill_diagonal(taken, 0.0)
        held_back = np.maximum(taken, 0.0).sum(axis=1)
        return bool(held_back.max() > _HELD_BACK * self.edges.critical**2)
