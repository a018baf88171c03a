"""The way along a branch since touches were last looked for."""

from __future__ import annotations

from dataclasses import dataclass

from adhesis.solver.method import ContactState
from adhesis.solver.sharp.continuation.local_branch import LocalPoint, confirmed
from adhesis.solver.sharp.equilibrium.branch_point import Point


@dataclass
class Walk:
    """Points since the last look for touches, and states that wait for the next one.

    Attributes
    ----------
    trail : list of Point
        From the point of the last look, known to be clear.
    clearance : float
        Least clearance there.
    closed : float
        Bound on how far a gap may have closed since.
    pending : list of ContactState
        States that wait for the next look: they may lie beyond a touch.
    known : tuple
        How many points of the trail there were up to the last one that is an equilibrium of all
        edges, and ``closed`` there.
    """

    trail: list[Point]
    clearance: float
    closed: float
    pending: list[ContactState]
    known: tuple[int, float]

    def __init__(self, point: Point) -> None:
        self.trail, self.closed, self.pending = [point], 0.0, []
        self.clearance = point.clearance
        self.known = (1, 0.0)

    def add(self, point: Point, closed: float) -> None:
        """Go on to a point; a gap has closed by ``closed`` at most."""
        self.trail.append(point)
        self.closed += closed
        if not isinstance(point, LocalPoint):
            self.known = (len(self.trail), self.closed)

    def confirm(self) -> Point:
        """Make sure that the last point is an equilibrium of all edges."""
        self.trail[-1] = confirmed(self.trail[-1])
        self.known = (len(self.trail), self.closed)
        return self.trail[-1]

    def back(self) -> Point:
        """Go back to the last point that is one."""
        count, self.closed = self.known
        del self.trail[count:]
        return self.trail[-1]

    def restart(self, clearance: float) -> None:
        """Begin anew after a look, at a point that is one."""
        self.trail, self.clearance, self.closed = [self.trail[-1]], clearance, 0.0
        self.known = (1, 0.0)
