"""Accepted points of a branch since gaps were last searched for touches."""

from __future__ import annotations

from adhesis.solver.sharp.continuation.local_branch import LocalBranch, LocalPoint, confirmed
from adhesis.solver.sharp.equilibrium.branch_point import Point


class Trail:
    """Points from the last search on, which found the first of them clear.

    Parameters
    ----------
    point : Point

    Attributes
    ----------
    points : list of Point
    clearance : float
        Least clearance of a gap at the first point.
    closed : float
        Bound on how far a gap may have closed since.
    """

    def __init__(self, point: Point) -> None:
        self.points = [point]
        self.clearance, self.closed = point.clearance, 0.0
        self._windows: list[LocalBranch | None] = [None]  # on which a solved point was found
        self._solved = (1, 0.0)  # points up to the last one solved with all gaps; closed there

    def add(self, point: Point, closed: float, window: LocalBranch | None) -> None:
        """Append a point, found on ``window``; a gap has closed by at most ``closed`` since."""
        self.points.append(point)
        self._windows.append(window)
        self.closed += closed
        if not isinstance(point, LocalPoint):
            self._solved = (len(self.points), self.closed)

    def open_window(self, window: LocalBranch) -> None:
        """Note the window that begins at the last point, if that is solved with all gaps."""
        if not isinstance(self.points[-1], LocalPoint):
            self._windows[-1] = window

    def confirm(self) -> Point:
        """Solve the last point with all gaps and return it.

        Raises
        ------
        LostTrack
        """
        self.points[-1] = confirmed(self.points[-1])
        self._solved = (len(self.points), self.closed)
        return self.points[-1]

    def return_to_solved(self) -> tuple[Point, LocalBranch | None]:
        """Drop the points after the last one solved with all gaps; return that and its window."""
        count, self.closed = self._solved
        del self.points[count:], self._windows[count:]
        return self.points[-1], self._windows[-1]

    def restart(self, clearance: float) -> None:
        """Begin anew after a search, at the last point, which is solved with all gaps."""
        self.points, self._windows = [self.points[-1]], [self._windows[-1]]
        self.clearance, self.closed = clearance, 0.0
        self._solved = (1, 0.0)
