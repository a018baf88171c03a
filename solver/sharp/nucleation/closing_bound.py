"""Bound on how far a gap can have closed along a branch, so that touches are searched in time."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.jump import Branch
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.griffith import total_length
from adhesis.solver.sharp.mechanics import EdgeMechanics


class ClosingBound:
    """Estimates, on the safe side, of how far gaps close locally; in units of q0 s.

    Parameters
    ----------
    edges : EdgeMechanics
    """

    def __init__(self, edges: EdgeMechanics) -> None:
        self._edges = edges

    def over(self, point: Point, reached: Point, branch: Branch) -> float:
        """Return by how much a gap may have closed from one point of a branch to the next."""
        if branch == "loading":
            return abs(reached.at - point.at) * self._rate(reached)
        # While the mean gap widens only edges that run can close a gap elsewhere.
        motion = self._edges.system(point.gaps).closing_motion(point.gaps, reached.gaps)
        return float(self._edges.critical / np.sqrt(self._edges.wave) * motion)

    def _rate(self, point: Point) -> float:
        """Closing of a gap along the branch by d."""
        rate = self.rate_held(point)
        if self._edges.is_fixed:
            return rate
        # d(q0 s)/dd along the branch, from d = weight q0 s - compliance p and dY/dd
        weight, compliance = self._edges.model.device
        mean = 1 + compliance * point.slope if weight else point.slope
        return float(rate * max(1.0, abs(mean)))

    def rate_held(self, point: Point) -> float:
        """Return the closing of a gap by q0 s while edges are held.

        The mean gap closes by the gaps alone, the faster the less of the period they take.
        """
        factor = self._edges.system(point.gaps).closing_factor
        return factor * 2 * np.pi / float(total_length(point.gaps))
