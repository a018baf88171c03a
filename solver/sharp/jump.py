"""A jump: descent in energy at fixed separation, and what touches afterwards."""

from __future__ import annotations

import numpy as np

from solver.jumps import Branch
from solver.method import ContactState
from solver.profile import Array
from solver.sharp.edges import CORRECTED, EdgeMechanics, Point
from solver.sharp.states import States, Trace
from solver.sharp.touch import Nucleation, Touch


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
        point = self._descend(start, at, touches or [])
        while branch == "loading" and point is not None:
            ready = self.nucleation.ready(self.nucleation.minima(point.field))
            grown = self._descend(point.field.gaps, at, ready) if ready else None
            if grown is None or self._same(grown.field.gaps, point.field.gaps):
                break
            point = grown
        after = self.states.after_loss(before, at)
        if point is not None:
            after = self.states.of_point(point)
        trace.jumps.append(self.states.jump(before, after, branch))
        trace.states.append(after)
        return point

    def _same(self, one: Array, other: Array) -> bool:
        """Whether two equilibria are one to the accuracy at which they are known."""
        return one.shape == other.shape and bool(np.abs(one - other).max() < 10 * self.edges.coarse)

    def _descend(self, gaps: Array, at: float, touches: list[Touch]) -> Point | None:
        """Descend to the next minimum of the energy; None when no contact is left."""
        if touches:
            gaps = self.nucleation.seeded(gaps, touches)
        while len(gaps):
            found = self.edges.relax(gaps, at, CORRECTED * self.edges.wave)
            if isinstance(found, Point):
                return found
            gaps = found
        return None
