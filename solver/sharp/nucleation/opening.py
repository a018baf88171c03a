"""Where a gap opens inside a patch, and the crack that is put there: the mirror of a touch.

An interface of finite strength σ_th gives way at a local maximum of tension that reaches σ_th,
away from the edges, where tension is singular. With adhesion of zero range a gap has to have a
length to grow: on a flat piece under a uniform tension σ that of Griffith's crack,

    l = 4 E*γ/(πσ²),

beyond which G = K²/(2E*) exceeds γ. Where tension falls away from its maximum, K of a crack of the
half-length a is that of the mean of σ over cos φ, at the places a cos φ from the middle. Put there
is the shortest crack whose G exceeds γ by a tenth; the descent does the rest. Both have to hold,
strength and growth: where tension is so peaked that no crack that fits grows, nothing opens
(D. Leguillon, Eur. J. Mech. A 21, 61, 2002).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.peaks import highest_peaks
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.field.patch_tension import NodalTension, RefinedTension
from adhesis.solver.sharp.gap.ends import with_gaps
from adhesis.solver.sharp.gap.full_contact_stress import measure_at
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import (
    CRACK_GROWTH,
    CRACK_IN_PATCH,
    CRACK_NODES,
    CRACK_RATIO,
    EQUAL_TENSIONS,
    HEALED_PLACE,
    HEALED_TENSION,
    LONGEST_CRACK,
    MOST_MAXIMA,
    NEAR_STRENGTH,
    SHORTEST_CRACK,
    STRENGTH_EXCEEDED,
)

_COSINES = np.cos(np.pi * (np.arange(CRACK_NODES) + 0.5) / CRACK_NODES)


@dataclass(frozen=True)
class Crack:
    """A maximum of tension inside a patch, and the crack that can be put there.

    Attributes
    ----------
    theta : float
    tension : float
        In units of the strength.
    value : float
        What is left before it opens: not positive when it is time.
    length : float
        Of the crack, in θ; 0 where none is known.
    barrier : float
        Energy from the closed patch up to the crack at which G = γ, in units of γ/q0 per unit
        depth.
    """

    theta: float
    tension: float
    value: float
    length: float = 0.0
    barrier: float = 0.0


class Openings:
    """Finds where patches open inside and puts cracks there: a criterion of ``location.locate``.

    Parameters
    ----------
    problem : Problem
    edges : EdgeMechanics

    Attributes
    ----------
    strength : float
        σ_th in units of E*/2; infinite where nothing opens.
    tolerance : float
        Share of the strength by which a tension may exceed it.
    healed : list of Crack
        Cracks that closed again: nothing opens there unless the tension is larger.
    """

    tolerance = STRENGTH_EXCEEDED

    def __init__(self, problem: Problem, edges: EdgeMechanics) -> None:
        self.edges = edges
        self.strength = problem.strength / (problem.half_space.modulus / 2)
        self.healed: list[Crack] = []
        self._nodal = NodalTension(problem.profile) if self.is_possible else None

    @property
    def is_possible(self) -> bool:
        """Whether anything opens at all."""
        return math.isfinite(self.strength)

    def least(self, field: GapField) -> tuple[float, list[Crack]]:
        """Return the least value of all maxima of tension of a field, and those near the strength.

        1 where tension falls from all edges.
        """
        if self._nodal is None:
            return 1.0, []
        tension = self._nodal.of(field)
        far = NEAR_STRENGTH * self.strength
        nodes = highest_peaks(tension, MOST_MAXIMA, far)
        if not nodes:
            return 1 - NEAR_STRENGTH, []
        refined = RefinedTension.of(field)
        found = []
        for node in nodes:
            maximum = refined.maximum(node * self._nodal.step, self._nodal.step)
            if maximum is not None:
                found.append(self._crack_at(field, refined, *maximum))
        found = [crack for crack in found if not self._has_healed(crack)]
        return min((crack.value for crack in found), default=1 - NEAR_STRENGTH), found

    def ready(self, places: list[Crack]) -> list[Crack]:
        """Return the crack of the largest excess, and those that equal it."""
        least = min((crack.value for crack in places), default=1.0)
        return [crack for crack in places if crack.value <= min(least + EQUAL_TENSIONS, 0.0)]

    def seeded(self, gaps: Array, cracks: list[Crack]) -> Array:
        """Return the gaps with a crack at each place."""
        return with_gaps(
            gaps, np.array([c.theta for c in cracks]), np.array([c.length for c in cracks])
        )

    def heal(self, cracks: list[Crack]) -> None:
        """Note cracks that closed again."""
        self.healed += cracks

    def is_located(self, value: float, many: bool, near: bool) -> bool:
        """Whether a place with this value is exact enough.

        A maximum may appear with a tension above the strength: then no place is exact.
        """
        return near or value > -0.5 * self.tolerance

    def tracked(self, clear: Point, hit: Point) -> None:
        """Follow no maximum by itself."""

    def check_located(self, value: float, at: float) -> None:
        """Accept every place: see :meth:`is_located`."""

    def _has_healed(self, crack: Crack) -> bool:
        near = HEALED_PLACE * self.edges.wave
        return any(
            abs(np.angle(np.exp(1j * (crack.theta - other.theta)))) < near
            and crack.tension < HEALED_TENSION * other.tension
            for other in self.healed
        )

    def _crack_at(
        self, field: GapField, refined: RefinedTension, theta: float, tension: float
    ) -> Crack:
        """Judge one maximum of tension."""
        share = tension / self.strength
        value = 1 - share
        if value > 0:
            return Crack(theta, share, value)
        measure, _ = measure_at(theta, field.source.panels)
        griffith = 0.5 * self.edges.critical**2 * measure / tension**2  # half-length
        shortest = SHORTEST_CRACK * self.edges.wave / 2
        longest = min(
            LONGEST_CRACK * self.edges.wave / 2, CRACK_IN_PATCH * refined.edge_distance(theta)
        )
        first = max(shortest, CRACK_GROWTH * griffith)
        if first > longest:
            return Crack(theta, share, first / longest - 1)
        steps = int(np.log(longest / first) / np.log(CRACK_RATIO)) + 1
        half = first * CRACK_RATIO ** np.arange(steps)
        release = self._release(refined, theta, half) / measure
        grows = np.flatnonzero(release >= CRACK_GROWTH)
        if not grows.size:
            return Crack(theta, share, 1 - math.sqrt(release.max() / CRACK_GROWTH))
        end = float(half[grows[0]])
        barrier = measure * self._barrier(refined, theta, measure, griffith, end)
        return Crack(theta, share, value, 2 * end, barrier)

    def _barrier(
        self, refined: RefinedTension, theta: float, measure: float, griffith: float, end: float
    ) -> float:
        """Integrate 2(1 - G/γ) up to the half-length at which G = γ, which ``end`` is beyond."""
        steps = max(int(np.log(end / griffith) / np.log(CRACK_RATIO)), 0)
        half = np.append(griffith * CRACK_RATIO ** np.arange(steps + 1), end)
        release = self._release(refined, theta, half) / measure
        balanced = half[np.argmax(release >= 1)] if release.max() >= 1 else end
        way = float(balanced) * np.linspace(0, 1, CRACK_NODES + 1)
        left = 1 - self._release(refined, theta, way) / measure
        return float(2 * np.trapezoid(left, way))

    def _release(self, refined: RefinedTension, theta: float, half: Array) -> Array:
        """Compute G/γ of cracks with these half-lengths in the tension of an unbroken patch."""
        places = theta + np.multiply.outer(half, _COSINES)
        mean = refined.at(places.ravel()).reshape(places.shape).mean(axis=1)
        return np.asarray(2 * half * np.maximum(mean, 0.0) ** 2 / self.edges.critical**2)
