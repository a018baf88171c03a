"""Points of a branch: stable equilibria of the edges, how they move there, and did before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.equilibrium.linear_exterior import About
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.gap.ends import outward

_SHORT = 0.3  # share of the way to an earlier point below which a nearer one tells less of a branch
_CHANGED = 0.3  # share by which the rate of an edge may change in a jump that does not concern it


class Past(NamedTuple):
    """Of every edge of a branch, d at an earlier place and its rate there; NaN if not known."""

    at: Array
    rate: Array


class Before(NamedTuple):
    """d, and rate and place of every edge, at an earlier point of a branch; see :class:`Point`."""

    at: float
    rate: Array
    gaps: Array


@dataclass(frozen=True, eq=False)
class Point:
    """A stable equilibrium on a branch.

    Attributes
    ----------
    at : float
        d, what is prescribed: q0 s at fixed separation.
    field : GapField
    rate : array, shape (2L,)
        dn/dd of every edge along the branch, n the outward motion of the contact.
    slope : float
        dY/dd along the branch: Y is p, under a load q0 s.
    clearance : float
        Opening that is left inside the gaps, at least, before surfaces touch; 0 if not known.
    before : Before, optional
        The point before it on its branch.
    about : About, optional
        Of many gaps: what windows on it are opened with.
    past : Past, optional
        Likewise: how its edges moved earlier.
    """

    at: float
    field: GapField
    rate: Array
    slope: float
    clearance: float = 0.0
    before: Before | None = None
    about: About | None = None
    past: Past | None = None

    @property
    def gaps(self) -> Array:
        """Gap ends, shape (L, 2)."""
        return self.field.gaps

    @property
    def pressure(self) -> float:
        """2p̄/E*."""
        return self.field.pressure

    @property
    def separation(self) -> float:
        """Separation q0 s."""
        return self.field.separation

    def cleared(self, clearance: float) -> Self:
        """Return this point with its clearance known."""
        return self._with("clearance", clearance)

    def behind(self, before: Before | None) -> Self:
        """Return this point with the one before it known."""
        return self._with("before", before)

    def _with(self, name: str, value: object) -> Self:
        point = object.__new__(type(self))  # copy() and replace() take ten times as long
        point.__dict__.update(self.__dict__)
        point.__dict__[name] = value
        return point

    def fold_displacement(self, change: Array) -> float:
        """Change in d of the fold next to this point when the openings C of given edges change.

        At a fold ∂(C_e - C_c)/∂n_f is singular. The rates of the edges diverge along its right null
        vector. Scaled by sqrt(C_e/C_f) it is symmetric, so its left null vector is
        ψ_e = C_e dn_e/dd. In first order the fold is moved to where ψ·(δC + δd ∂C/∂d) = 0.

        Parameters
        ----------
        change : array, shape (L, 2)
            δC.
        """
        left = self.field.opening.ravel() * self.rate
        by_prescribed = self.field.opening_by_prescribed.ravel()
        return -float(left @ change.ravel() / (left @ by_prescribed))

    def after(self, earlier: Point) -> Point:
        """Return this point with what ``earlier``, one of the same gaps, tells of its past."""
        at, rate = np.full(earlier.rate.shape, earlier.at), earlier.rate
        if earlier.past is not None:
            # rates of too near a point tell little
            near = np.abs(self.at - at) < _SHORT * np.abs(self.at - earlier.past.at)
            at = np.where(near, earlier.past.at, at)
            rate = np.where(near, earlier.past.rate, rate)
        return self._with("past", Past(at, rate))

    def heir(self, earlier: Point, near: float) -> Point:
        """Return this point, which a jump led to from ``earlier``, with the past of its edges.

        Those that moved by less than ``near``, and whose rate is still much the same.
        """
        past = Past(np.full(self.rate.shape, np.nan), np.full(self.rate.shape, np.nan))
        if earlier.past is not None:
            place = np.searchsorted(earlier.gaps[:, 0], self.gaps[:, 0] - near)
            place = np.minimum(place, len(earlier.gaps) - 1)
            edge = (2 * place[:, None] + [0, 1]).ravel()
            moved = np.abs(earlier.gaps[place] - self.gaps).ravel()
            other = np.abs(earlier.rate[edge] - self.rate) > _CHANGED * np.abs(self.rate)
            same = (moved < near) & ~other
            past.at[same] = earlier.past.at[edge[same]]
            past.rate[same] = earlier.past.rate[edge[same]]
        return self._with("past", past)

    def towards(self, other: Point, at: float) -> Array:
        """Gaps at d = ``at`` between this point and another of the same branch, by a cubic."""
        way = other.at - self.at
        t = (at - self.at) / way
        sign = outward(self.gaps)
        begin, end = ((sign * p.rate * way).reshape(-1, 2) * (t * (1 - t)) for p in (self, other))
        straight = self.gaps + (other.gaps - self.gaps) * (t * t * (3 - 2 * t))
        cubic: Array = straight + begin * (1 - t) - end * t
        return cubic

    def predicted(self, at: float) -> Array:
        """Gaps at d = ``at``, along the tangent."""
        motion = outward(self.gaps) * self.rate * (at - self.at)
        return self.gaps + motion.reshape(-1, 2)
