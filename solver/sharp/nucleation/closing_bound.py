"""Bound the closing of gaps along a branch, so that touches are searched in time."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.jump import Branch
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import CLOSING_BY_MOTION


class ClosingBound:
    """Upper estimates of the local closing of gaps, in units of q0 s.

    Parameters
    ----------
    edges : EdgeMechanics
    """

    def __init__(self, edges: EdgeMechanics) -> None:
        self._edges = edges

    def between(self, point: Point, reached: Point, branch: Branch) -> float:
        """Bound the closing of a gap from one point of a branch to the next."""
        if branch == "loading":
            return abs(reached.at - point.at) * self._rate(reached)
        # While the mean gap widens only edges that run can close a gap elsewhere.
        motion = CLOSING_BY_MOTION * np.abs(reached.gaps - point.gaps).sum(axis=1).max()
        return float(self._edges.largest_opening / np.sqrt(self._edges.wave) * motion)

    def _rate(self, point: Point) -> float:
        """Bound the closing of a gap along the branch per unit of d."""
        rate = self.rate_at_fixed_edges(point)
        if self._edges.is_fixed:
            return rate
        # d(q0 s)/dd along the branch, from d = weight q0 s - compliance p and dY/dd
        device = self._edges.model.device
        load = device.separation_weight == 0
        mean = point.slope if load else 1 + device.compliance * point.slope
        return float(rate * max(1.0, abs(mean)))

    def rate_at_fixed_edges(self, point: Point) -> float:
        """Bound the closing of a gap per unit of q0 s at fixed edges.

        The mean gap closes by the gaps alone, the faster the less of the period they take.
        """
        return 2 * np.pi / float(np.diff(point.gaps).sum())
