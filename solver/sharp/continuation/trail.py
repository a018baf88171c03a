"""Accepted points of a branch since gaps were last searched for touches."""

from __future__ import annotations

from adhesis.solver.sharp.equilibrium.branch_point import Point


class Trail:
    """Accepted points since the last search for touches; at the first of them nothing overlaps.

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

    def add(self, point: Point, closed: float) -> None:
        """Append a point; a gap has closed by at most ``closed`` since the last."""
        self.points.append(point)
        self.closed += closed

    def restart(self, clearance: float) -> None:
        """Begin anew after a search, at the last point."""
        self.points = [self.points[-1]]
        self.clearance, self.closed = clearance, 0.0
