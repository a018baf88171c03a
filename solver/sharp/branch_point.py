"""Points of a branch: equilibria of the edges, with their rates there and before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.gap.ends import move_edges
from adhesis.solver.values import with_values


class PreviousPoint(NamedTuple):
    """d, and rate and place of every edge, at the point before one; see :class:`Point`."""

    d: float
    rate: Array
    gaps: Array


class PinnedEdges(NamedTuple):
    """Place of C of every pinned edge between both critical openings, and its derivative by d.

    It is 0 where an edge begins to advance and 1 where it begins to recede; NaN for other edges.
    """

    share: Array
    rate: Array

    def distance(self, step: float) -> float:
        """Return the way in d, along ``step``, after which an edge begins to move; inf if none."""
        rate = self.rate * np.sign(step)
        left = np.where(rate > 0, 1 - self.share, self.share)
        moving = np.isfinite(rate) & (rate != 0) & (left > 0)
        return float((left[moving] / np.abs(rate[moving])).min(initial=np.inf))


@dataclass(frozen=True, eq=False)
class Point:
    """An equilibrium of edges, stable on a branch, or the field of edges next to one.

    Attributes
    ----------
    d : float
        What is prescribed: q0 s at fixed separation.
    field : GapField
    rate : array, shape (2L,)
        dn/dd of every edge along the branch, n the outward motion of the contact.
    slope : float
        dY/dd along the branch: Y is p, under a load q0 s.
    previous : PreviousPoint, optional
        The point before it on its branch.
    pinned : PinnedEdges, optional
        With two works of adhesion.
    """

    d: float
    field: GapField
    rate: Array
    slope: float
    previous: PreviousPoint | None = None
    pinned: PinnedEdges | None = None

    @property
    def gaps(self) -> Array:
        """Gap ends, shape (L, 2)."""
        return self.field.gaps

    @property
    def pressure(self) -> float:
        """2p̄/E*, to the accuracy of the equilibrium."""
        return self.field.nearly[0]

    @property
    def separation(self) -> float:
        """Separation q0 s, to the accuracy of the equilibrium."""
        return self.field.nearly[1]

    def with_previous(self, previous: PreviousPoint | None) -> Self:
        """Return this point with the one before it."""
        return with_values(self, previous=previous)

    def extrapolate(self, d: float) -> Array:
        """Extrapolate the gaps to ``d``, along the tangent."""
        return move_edges(self.gaps, self.rate * (d - self.d))
