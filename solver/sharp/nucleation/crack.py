"""Locate cracks that open inside patches, and insert them (docs/methods.md, rule 11).

An interface of finite strength gives way at a local maximum of tension that reaches the strength,
away from the edges, where tension is singular. With edges of zero range a crack grows only beyond a
length, on a flat piece under a uniform tension σ that of Griffith,

    l = 4 E*γ/(πσ²),

from which on G = K²/(2E*) exceeds γ, K² = πσ²l/2. The shortest crack is put into a patch whose G
exceeds γ by a tenth at both tips. Both conditions have to hold, strength and growth, as in finite
fracture mechanics (D. Leguillon, Eur. J. Mech. A 21, 61, 2002).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.field.patch_tension import InnerTension, TensionMaximum
from adhesis.solver.sharp.gap.ends import with_gaps
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import (
    GROWTH,
    IN_PATCH,
    LONGEST_TRIAL_HALF_LENGTH,
    NEAR_STRENGTH,
    STRENGTH_EXCEEDED,
)

_RATIO = 1.1  # of the lengths of cracks that are tried one after the other


@dataclass(frozen=True)
class Crack:
    """A maximum of tension inside a patch, and the crack that can be put there; in 1/q0.

    Attributes
    ----------
    position : float
    value : float
        Margin before it opens, a share of the strength, of the crack's length or of sqrt(G);
        not positive if it opens.
    length : float
        Of the crack; 0 if it does not open.
    barrier : float
        Energy per unit depth from the closed patch up to the crack at which G = γ, in units of
        γ/q0.
    """

    position: float
    value: float
    length: float = 0.0
    barrier: float = 0.0


class Cracks:
    """Criterion of openings inside patches for ``nucleation.locate``, which also inserts cracks.

    Attributes
    ----------
    strength : float
        σ_th in units of E*/2; infinite where nothing opens.
    tolerance : float
        Share of the strength by which a tension may exceed it.
    """

    tolerance = STRENGTH_EXCEEDED

    def __init__(self, problem: Problem, edges: EdgeMechanics) -> None:
        self.edges = edges
        self.strength = problem.strength / (problem.half_space.modulus / 2)
        self.inner = InnerTension(problem)

    @property
    def is_possible(self) -> bool:
        """Whether patches may open: the strength is finite."""
        return math.isfinite(self.strength)

    def minimum(self, field: GapField) -> tuple[float, list[Crack]]:
        """Return the least value of all maxima of tension of a field, and those near the strength.

        The value is positive, too, where tension falls from all edges.
        """
        maxima = self.inner.maxima(field, NEAR_STRENGTH * self.strength)
        found = [self._crack_at(field, maximum) for maximum in maxima]
        return min((crack.value for crack in found), default=1 - NEAR_STRENGTH), found

    def choose(self, candidates: list[Crack]) -> list[Crack]:
        """Choose the crack of the largest excess, and those that equal it; none if none opens.

        Those are equal that differ by less than a tension is located to.
        """
        least = min((crack.value for crack in candidates), default=1.0)
        return [crack for crack in candidates if crack.value <= min(least + self.tolerance, 0.0)]

    def insert(self, gaps: Array, cracks: list[Crack]) -> Array:
        """Return the gaps with these cracks inserted."""
        centres = np.array([crack.position for crack in cracks])
        return with_gaps(gaps, centres, np.array([crack.length for crack in cracks]))

    def is_located(self, value: float, near: bool) -> bool:
        """Return whether a maximum with this value is located finely enough.

        A maximum may appear with a tension above the strength: then no point of the branch is.
        """
        return near or value > -0.5 * self.tolerance

    def _crack_at(self, field: GapField, maximum: TensionMaximum) -> Crack:
        wave, critical = self.edges.wave, self.edges.critical
        theta, tension, distance = maximum
        work, _ = self.edges.adhesion.work(theta, False)
        return judge_maximum(
            theta,
            tension / self.strength,
            # γ = π E* C_c²/(16 q0), σ = E* S/2
            balanced=0.5 * critical**2 * work / tension**2,
            toughness=work,
            release=lambda half: self._release(field, theta, half),
            shortest=0.5 * self.edges.narrowest,
            longest=min(LONGEST_TRIAL_HALF_LENGTH * wave, IN_PATCH * distance),
        )

    def _release(self, field: GapField, theta: float, half: float) -> float:
        """Compute G/γ of a crack that is put into the patches of a field."""
        gaps = with_gaps(field.gaps, np.array([theta]), np.array([2 * half]))
        return float(self.edges.release(gaps, field.prescribed, theta, half).min())


def judge_maximum(
    position: float,
    share: float,
    balanced: float,
    toughness: float,
    release: Callable[[float], float],
    shortest: float,
    longest: float,
) -> Crack:
    """Judge whether a patch opens at a maximum of tension, and with which crack.

    ``share`` is the tension over the strength, ``balanced`` the half-length at which G = γ there
    under a uniform tension, and ``toughness`` γ of a unit of length there, over γ. ``release``
    returns G/γ of the crack of a half-length, the smaller of those at its two tips; half-lengths
    are tried from the ``shortest`` to the ``longest``.
    """
    first = max(shortest, GROWTH * balanced)
    if share < 1:
        return Crack(position, 1 - share)
    if first > longest:
        return Crack(position, first / longest - 1)
    half, rate = [0.0], [0.0]
    # G rises with the length up to where tension falls, or the crack takes part of the mean gap
    while first <= longest and rate[-1] == max(rate) < GROWTH * share**2:
        half.append(first)
        rate.append(release(first))
        first *= _RATIO
    value = max(1 - share, 1 - math.sqrt(max(rate) / GROWTH))
    if value > 0:
        return Crack(position, value)
    grows = int(np.argmax(np.array(rate) >= GROWTH))
    barrier = toughness * _barrier(half[: grows + 1], rate[: grows + 1])
    return Crack(position, value, 2 * half[grows], barrier)


def _barrier(half: list[float], rate: list[float]) -> float:
    """Integrate 2(1 - G/γ) over the half-length of a crack, up to that at which G = γ."""
    last = int(np.argmax(np.array(rate) >= 1))
    share = (1 - rate[last - 1]) / (rate[last] - rate[last - 1])
    lengths = [*half[:last], half[last - 1] + share * (half[last] - half[last - 1])]
    return 2 * float(np.trapezoid([1 - g for g in rate[:last]] + [0.0], lengths))
