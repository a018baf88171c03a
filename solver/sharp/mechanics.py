"""Mechanics of the contact edges of one problem: fields and equilibria of its gaps.

Equilibria are the points of a branch, with the rates of the edges there and before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from adhesis.solver._kernels import (
    Adhesion,
    EdgeLaw,
    Equilibrium,
    Field,
    FieldModel,
    LinearResponse,
    LoadingDevice,
    ProfileAdhesion,
    set_up_response,
    shortest_length,
    solve_field,
)
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.field.gap_field import GapField, check_definite
from adhesis.solver.sharp.gap.ends import move_edges
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.symmetry import Symmetry
from adhesis.solver.sharp.tolerances import (
    BY_FIELD,
    DESCENT_HANDS_OVER,
    FIELD_ACCURACY,
    FIELD_ERROR,
    LONGEST_STEP,
    NEWTON_TOLERANCE,
    SMALLEST_LENGTH,
    SMALLEST_OF_SEED,
)
from adhesis.solver.values import with_values

FIXED_SEPARATION = LoadingDevice(1.0, 0.0)


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

    def distances(self, step: float) -> Array:
        """Return the way in d, along ``step``, after which each edge begins to move; inf if never.

        Negative where its opening is beyond a critical one by the error of the field.
        """
        rate = self.rate * np.sign(step)
        left = np.where(rate > 0, 1 - self.share, self.share)
        moving = np.isfinite(rate) & (rate != 0)
        never = np.full(len(rate), np.inf)
        return np.asarray(np.divide(left, np.abs(rate), out=never, where=moving))

    def distance(self, step: float) -> float:
        """Return the way in d, along ``step``, after which an edge begins to move; inf if none."""
        ways = self.distances(step)
        return float(ways[ways > 0].min(initial=np.inf))


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

    def with_previous(self, previous: PreviousPoint | None) -> Self:
        """Return this point with the one before it."""
        return with_values(self, previous=previous)

    def extrapolate(self, d: float) -> Array:
        """Extrapolate the gaps to ``d``, along the tangent."""
        return move_edges(self.gaps, self.rate * (d - self.d))


@dataclass
class Counters:
    """Numbers of field solutions (also by the linear response), energies, fine openings, steps."""

    fields: int = 0
    energies: int = 0
    openings: int = 0
    newton_steps: int = 0
    descent_steps: int = 0


class EdgeMechanics:
    """Fields and equilibria of the edges of one problem, with its tolerances and counters.

    Lengths in units of 1/q0. The linear response of the gaps is kept from one state to the next,
    and changes in place.

    Attributes
    ----------
    critical : float
        4 sqrt(q0 γ/(π E*)): the critical opening on a flat piece where γ(x) = γ.
    tolerance : float
        Relative accuracy of the field.
    wave : float
        λ_min in θ.
    newton_tolerance, field_error : float
        Correction that ends Newton's iteration; displacement of an equilibrium that the error of
        the field can cause.
    smallest, narrowest : float
        Narrower patches and gaps are removed; width of the narrowest patch or gap that is put.
    surface : float
        Γ = 2γ q0/E* where adhesion is weakest.
    symmetry : Symmetry
        Of profile and adhesion.
    """

    def __init__(
        self,
        source: StressSource,
        critical: float,
        tolerance: float,
        device: LoadingDevice = FIXED_SEPARATION,
        adhesion: Adhesion | None = None,
        symmetry: Symmetry | None = None,
    ) -> None:
        self.source, self.critical, self.tolerance = source, critical, tolerance
        self.symmetry = symmetry or Symmetry(1, np.empty(0), 0.0)
        self.adhesion = adhesion or ProfileAdhesion(source.panels)
        self.wave = 2 * np.pi / source.top
        self.newton_tolerance = min(NEWTON_TOLERANCE, BY_FIELD * tolerance) * self.wave
        self.field_error = max(self.newton_tolerance, FIELD_ERROR * tolerance * self.wave)
        self.longest_step = LONGEST_STEP * self.wave
        # far below the half-width at which a patch on the sharpest crest first comes to rest,
        # nearly (16 Γ/(π κ²))^(1/3) with Γ = π C_c²/8, where adhesion is weakest
        weakest = critical**2 * self.adhesion.least
        self.surface = np.pi * weakest / 8  # Γ
        seed = (2 * weakest / source.sharpest**2) ** (1 / 3)
        self.smallest = SMALLEST_LENGTH * self.wave
        if critical > 0:
            self.smallest = min(self.smallest, SMALLEST_OF_SEED * seed)
        self.narrowest = float(3 * self.smallest)
        self.law = EdgeLaw(
            adhesion=self.adhesion,
            critical=float(critical),
            newton_tolerance=self.newton_tolerance,
            field_error=self.field_error,
            rest_step=DESCENT_HANDS_OVER * self.wave,
            longest_step=self.longest_step,
            smallest=float(self.smallest),
            rough_rate=float(max(critical, np.sqrt(source.m2 * self.wave)) / self.wave),
            force_error=float(tolerance * critical**2),
        )
        self.model = FieldModel(
            device=device,
            digits=float(-np.log(tolerance)),
            panels=source.panels,
        )
        self.count = Counters()
        self.forget()

    def law_at(self, memory: Array) -> EdgeLaw:
        """Return the law of edges that were at ``memory`` in the state before."""
        if not self.adhesion.pins:
            return self.law
        law = EdgeLaw(self.law)
        law.memory = memory
        return law

    @property
    def is_fixed(self) -> bool:
        """Whether the separation is prescribed."""
        return self.model.device.compliance == 0

    @property
    def is_load(self) -> bool:
        """Whether the mean stress is prescribed."""
        return self.model.device.separation_weight == 0

    def forget(self) -> None:
        """Forget the response: results depend on it within the error of the field."""
        self._response: LinearResponse | None = None

    def response_near(self, gaps: Array, prescribed: float) -> LinearResponse | None:
        """Return a response of as many gaps; None if these have no field."""
        if not shortest_length(gaps) > 0:
            return None
        if self._response is None or self._response.gap_count != len(gaps):
            self.count.fields += 1
            law = self.law_at(gaps)
            self._response = set_up_response(gaps, prescribed, law, self.model)
        return self._response

    def response_at(self, gaps: Array, prescribed: float, law: EdgeLaw) -> LinearResponse | None:
        """Return the response about these gaps; None if they have no field."""
        response = self.response_near(gaps, prescribed)
        if response is None or response.settle(gaps, prescribed, law, self.model):
            return response
        self.forget()
        return None

    def solution(self, gaps: Array, prescribed: float, share: float = 1.0) -> Field:
        """Solve the field of these gaps to a ``share`` of the tolerance."""
        self.count.fields += 1
        model = self.model
        if share < 1:
            model = FieldModel(model.device, model.digits - math.log(share), model.panels)
        return solve_field(gaps, prescribed, model)

    def field(
        self, gaps: Array, prescribed: float, nearly: tuple[float, float] | None = None
    ) -> GapField:
        """Return the field of these gaps, with p and q0 s where they are known."""
        return GapField(
            self.source, gaps, prescribed, lambda: self.solution(gaps, prescribed), nearly
        )

    def release(self, gaps: Array, prescribed: float, theta: float, half: float) -> Array:
        """Compute G/γ at the two edges next to θ ± ``half``, all edges being held."""
        ends = gaps.ravel()
        apart = (ends - theta - half * np.array([[-1.0], [1.0]]) + np.pi) % (2 * np.pi) - np.pi
        nearest = np.abs(apart).argmin(axis=1)
        opening = self.field(gaps, prescribed).edge_opening.ravel()[nearest]
        work = np.array([self.adhesion.work(end, False)[0] for end in ends[nearest]])
        return np.asarray(np.maximum(opening, 0.0) ** 2 / (self.critical**2 * work))

    def fold_displacement(self, point: Point, step: float) -> float:
        """Estimate how far in d the error of the field displaces the end of a branch.

        The branch ends within a ``step`` of the point. The error δC of the openings is their
        difference from those of a more accurate field. At a fold ∂(C_e - C_c)/∂n_f is singular. The
        rates of the edges diverge along its right null vector. Scaled by sqrt(C_e/C_f) it is
        symmetric, so its left null vector is ψ_e = C_e dn_e/dd. In first order the fold is moved to
        where ψ·(δC + δd ∂C/∂d) = 0. At a pitchfork, whose mode the rates lack, that is where the
        edges are in the places at which it softens. Where pinned edges begin to move in the step,
        the branch may end for one that runs then: at another d, if its opening is wrong.
        """
        finer = self.solution(point.gaps, point.d, FIELD_ACCURACY)
        check_definite(finer)
        change = finer.edge_opening - point.field.solution.edge_opening
        _, _, by_prescribed = finer.by_prescribed()  # ∂C/∂d at fixed edges
        left = point.field.edge_opening.ravel() * point.rate
        displaced = abs(float(left @ change / (left @ by_prescribed))) if left.any() else 0.0
        if point.pinned is None:
            return displaced
        for e in np.flatnonzero(point.pinned.distances(step) <= abs(step)):
            works = [
                self.adhesion.work(point.gaps.flat[e], recedes)[0] for recedes in (False, True)
            ]
            pinning_range = self.critical * float(np.diff(np.sqrt(works))[0])
            displaced = max(
                displaced, abs(float(change[e] / (pinning_range * point.pinned.rate[e])))
            )
        return displaced

    def equilibrium(
        self,
        gaps: Array,
        prescribed: float,
        reach: float,
        *,
        strict: bool = True,
        memory: Array | None = None,
    ) -> Point | None:
        """Return the equilibrium near these gaps, a stable one if ``strict``, or None.

        None if an edge would move further than ``reach`` (in θ), the iteration stalls, or the
        equilibrium is not stable. Unless ``strict``, gaps that are nearly in equilibrium are taken
        as they are, stable or not: a minimum next to a fold, or a saddle. ``memory`` is where
        the edges were in the state before, which matters with two works of adhesion; here if not
        given.
        """
        reach = max(reach, self.newton_tolerance)
        if strict and self.critical > 0 and self.symmetry.is_symmetric(gaps):
            # Beyond a pitchfork Newton's iteration finds the symmetric state all the same, and the
            # tangents of a response that moved there are not exact enough to show it.
            self.forget()
        law = self.law_at(gaps if memory is None else memory)
        near = self.response_near(gaps, prescribed)
        if near is None:
            return None
        found = near.find_equilibrium(gaps, prescribed, reach, strict, law, self.model)
        self.count.newton_steps += found.corrections
        self.count.fields += found.corrections
        if not found.found:
            if math.isnan(found.pressure):
                self.forget()
            return None
        return self._point(prescribed, found)

    def equilibrium_between(self, clear: Point, hit: Point, d: float) -> Point | None:
        """Return the equilibrium between two points of a branch; None if it is not found.

        Of two that have the same edges, as at a fold, these are held.
        """
        if clear.gaps is hit.gaps:
            return self.hold(clear, d)
        share = (d - clear.d) / (hit.d - clear.d)
        gaps, reach = clear.gaps + share * (hit.gaps - clear.gaps), self.longest_step
        point = self.equilibrium(gaps, d, reach, memory=clear.gaps)
        near = abs(d - clear.d) < abs(hit.d - d)
        for start in (clear, hit) if near else (hit, clear):
            if point is None:
                point = self.equilibrium(start.extrapolate(d), d, reach, memory=clear.gaps)
        return point

    def hold(self, point: Point, d: float) -> Point:
        """Return the edges of a point at another ``d``."""
        return Point(d, self.field(point.gaps, d), point.rate, math.nan)

    def _point(self, prescribed: float, found: Equilibrium) -> Point:
        field = self.field(found.gaps, prescribed, (found.pressure, found.separation))
        pinned = PinnedEdges(found.pinned_share, found.pinned_rate) if self.adhesion.pins else None
        return Point(prescribed, field, found.rate, found.slope, pinned=pinned)
