"""A jump: descent in energy at fixed separation, and what touches afterwards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.jumps import Branch
from solver.method import ContactState
from solver.profile import Array
from solver.sharp.edges import CORRECTED, EdgeMechanics, FullContact, Point
from solver.sharp.states import States, Trace
from solver.sharp.touch import Nucleation, Touch

_RAN = 0.05  # an edge that went further than this, in λ_min, ran


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
    ) -> Point | None:
        """Descend at q0 s = ``at`` from the gaps ``start``; adds the jump and the state after it.

        Returns the minimum as it was found: next to a fold it may not be found again from its own
        edges. None if no contact is left.
        """
        point, ran = self._settle(start, at, branch, touches or [])
        after = self._after(before, point, at)
        other = after
        if ran:
            try:
                rival, _ = self._settle(start, at, branch, touches or [], equal_speeds=True)
            except FullContact:  # elsewhere, and it has no energy that could be compared
                other = replace(after)
            else:
                if not self._alike(rival, point):
                    other = self._after(before, rival, at)
        trace.jumps.append(self.states.jump(before, after, branch, other))
        trace.states.append(after)
        return point

    def _after(self, before: ContactState, point: Point | None, at: float) -> ContactState:
        """State that a descent led to."""
        return self.states.after_loss(before, at) if point is None else self.states.of_point(point)

    def _settle(
        self,
        start: Array,
        at: float,
        branch: Branch,
        touches: list[Touch],
        *,
        equal_speeds: bool = False,
    ) -> tuple[Point | None, bool]:
        """Descend from the gaps ``start`` until nothing touches any more.

        Returns the minimum, None if no contact is left, and whether several edges ran.
        """
        point, ran = self._descend(start, at, touches, equal_speeds)
        while branch == "loading" and point is not None:
            ready = self.nucleation.ready(self.nucleation.minima(point.field))
            if not ready:
                break
            grown, more = self._descend(point.field.gaps, at, ready, equal_speeds)
            if grown is None or self._same(grown.field.gaps, point.field.gaps):
                break
            point, ran = grown, ran or more
        return point, ran

    def _alike(self, one: Point | None, other: Point | None) -> bool:
        """Whether two descents led to one minimum."""
        if one is None or other is None:
            return one is other
        return self._same(one.field.gaps, other.field.gaps)

    def _same(self, one: Array, other: Array) -> bool:
        """Whether two equilibria are one to the accuracy at which they are known."""
        return one.shape == other.shape and bool(np.abs(one - other).max() < 10 * self.edges.coarse)

    def _descend(
        self, gaps: Array, at: float, touches: list[Touch], equal_speeds: bool
    ) -> tuple[Point | None, bool]:
        """Descend to the next minimum of the energy, as :meth:`_settle` does."""
        if touches:
            gaps = self.nucleation.seeded(gaps, touches)
        ran = False
        while len(gaps):
            found = self.edges.relax(
                gaps, at, CORRECTED * self.edges.wave, equal_speeds=equal_speeds
            )
            if isinstance(found, Point):
                return found, ran or self._several_ran(gaps, found.field.gaps)
            ran = True
            gaps = found
        return None, ran

    def _several_ran(self, before: Array, after: Array) -> bool:
        """Whether more than one edge went further than edges near equilibrium do."""
        way = np.abs(after - before)
        return int(np.count_nonzero(way > _RAN * self.edges.wave)) > 1
