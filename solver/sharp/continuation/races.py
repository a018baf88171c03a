"""Races: whether the order in which edges move decides where a descent ends."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.gap.ends import outward
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import (
    HELD_BACK,
    RAN,
)


class RaceCheck:
    """Estimates, from the forces that moving edges take from each other, whether they race.

    Parameters
    ----------
    edges : EdgeMechanics
    """

    def __init__(self, edges: EdgeMechanics) -> None:
        self._edges = edges

    def may_occur(self, start: Array, end: Point | None) -> bool:
        """Whether the order in which edges ran from ``start`` can have decided where they ended.

        The order matters only if running edges reduce each other's force; edges that increase it
        reach the same minimum in any order. The reduction is computed to first order in the motions
        with the tangent at the end. Where patches or gaps have gone it is not known.
        """
        if end is None or end.gaps.shape != start.shape:
            return True
        way = outward(end.gaps) * (end.gaps - start).ravel()
        runners = np.flatnonzero(np.abs(way) > RAN * self._edges.wave)
        if len(runners) < 2:
            return False
        way = way[runners]
        stiffness = self._edges.critical * self._edges.tangent(end, runners)
        taken = (stiffness + stiffness.T) * way * np.sign(way)[:, None]
        np.fill_diagonal(taken, 0.0)
        held_back = np.maximum(taken, 0.0).sum(axis=1)
        return not held_back.max() <= HELD_BACK * self._edges.critical**2
