"""Races: whether the order in which edges move decides where a descent ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.track import Track
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.gap.ends import outward
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import (
    HELD_BACK,
    OTHER_MINIMUM,
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

    def may_occur(self, start: Array, end: Point | None, track: Track) -> bool:
        """Whether the order in which edges ran from ``start`` can have decided where they ended.

        The order matters only if running edges reduce each other's force; edges that increase it
        reach the same minimum in any order. The reduction is computed to first order in the motions
        with the tangent at the end or, where patches or gaps have gone, along the ``track``, for
        every set of gaps on it. For many gaps it is not known there.
        """
        if end is None or end.field.gaps.shape != start.shape:
            return not track.is_complete or any(
                self._hold_back(stage.way, stage.taken) for stage in track.stages
            )
        gaps = end.field.gaps
        way = outward(gaps) * (gaps - start).ravel()
        runners = self._runners(way)
        if len(runners) < 2:
            return False
        opening = end.field.solution.opening[runners]
        stiffness = opening[:, None] * self._edges.stiffness(end, runners)
        return self._hold_back(way[runners], (stiffness + stiffness.T) * way[runners])

    def _runners(self, way: Array) -> NDArray[np.int64]:
        return np.flatnonzero(np.abs(way) > RAN * self._edges.wave)

    def _hold_back(self, way: Array, taken: Array) -> bool:
        """Whether the motion of runners (columns) took so much force from others (rows)."""
        runners = self._runners(way)
        if len(runners) < 2:
            return False
        taken = taken[np.ix_(runners, runners)] * np.sign(way[runners])[:, None]
        np.fill_diagonal(taken, 0.0)
        held_back = np.maximum(taken, 0.0).sum(axis=1)
        return bool(held_back.max() > HELD_BACK * self._edges.critical**2)


class MirrorCheck:
    """Finds jumps by which a mirror-symmetric state loses its symmetry.

    The mirror image of their end is another end with the same energy: which of the two is reached
    is a convention (docs/methods.md, rule 7).

    Parameters
    ----------
    edges : EdgeMechanics
    axes : array, shape (axes,)
        About which the profile is its own mirror image, in θ.
    """

    def __init__(self, edges: EdgeMechanics, axes: Array) -> None:
        self._near, self._axes = OTHER_MINIMUM * edges.wave, axes

    def is_symmetric(self, gaps: Array) -> bool:
        """Whether these gaps are their own mirror image."""
        return any(self._is_image(gaps, axis) for axis in self._axes)

    def is_broken(self, before: Array, after: Array) -> bool:
        """Whether a symmetry of the gaps ``before`` is not one of those ``after``."""
        return any(
            self._is_image(before, axis) and not self._is_image(after, axis) for axis in self._axes
        )

    def _is_image(self, gaps: Array, axis: float) -> bool:
        """Whether these gaps are their own image about this axis."""
        image = 2 * axis - gaps[:, ::-1]
        apart = np.abs((image[:, None] - gaps[None] + np.pi) % (2 * np.pi) - np.pi)
        nearest = apart.max(axis=2).min(axis=1, initial=np.inf)
        return bool((nearest < self._near).all())
