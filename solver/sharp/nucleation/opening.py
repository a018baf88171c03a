"""Locate cracks that open inside patches, and insert them.

An interface of finite strength gives way at a local maximum of tension that reaches the strength,
away from the edges, where tension is singular. The crack is that of ``solver.crack``.
"""

from __future__ import annotations

import math

import numpy as np

from adhesis.solver.crack import (
    IN_PATCH,
    LONGEST_TRIAL_HALF_LENGTH,
    MOST_MAXIMA,
    NEAR_STRENGTH,
    Crack,
    judge_maximum,
    largest_excess,
)
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.peaks import highest_peaks
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.field.patch_tension import RefinedTension, nodal_tension
from adhesis.solver.sharp.gap.ends import with_gaps
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import (
    SHORTEST_CRACK,
    STRENGTH_EXCEEDED,
)


class Cracks:
    """Criterion of openings inside patches for ``location.locate``, which also inserts cracks.

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
    """

    tolerance = STRENGTH_EXCEEDED

    def __init__(self, problem: Problem, edges: EdgeMechanics) -> None:
        self.edges = edges
        self.strength = problem.strength / (problem.half_space.modulus / 2)
        self._nodal = nodal_tension(problem) if self.is_possible else None

    @property
    def is_possible(self) -> bool:
        """Whether patches may open: the strength is finite."""
        return math.isfinite(self.strength)

    def minimum(self, field: GapField) -> tuple[float, list[Crack]]:
        """Return the least value of all maxima of tension of a field, and those near the strength.

        The value is positive, too, where tension falls from all edges.
        """
        if self._nodal is None:
            return 1.0, []
        tension = self._nodal.of(field)
        nodes = highest_peaks(tension, MOST_MAXIMA, NEAR_STRENGTH * self.strength)
        if not nodes:
            return 1 - NEAR_STRENGTH, []
        refined = RefinedTension.of(field)
        found = []
        for node in nodes:
            maximum = refined.maximum(node * self._nodal.step, self._nodal.step)
            if maximum is not None:
                found.append(self._crack_at(field, refined, *maximum))
        return min((crack.value for crack in found), default=1 - NEAR_STRENGTH), found

    def choose_seeds(self, candidates: list[Crack]) -> list[Crack]:
        """Choose the crack of the largest excess, and those that equal it."""
        return largest_excess(candidates)

    def insert_seeds(self, gaps: Array, cracks: list[Crack]) -> Array:
        """Return the gaps with these cracks inserted."""
        centres = np.array([crack.position for crack in cracks])
        return with_gaps(gaps, centres, np.array([crack.length for crack in cracks]))

    def is_located(self, value: float, near: bool) -> bool:
        """Return whether a maximum with this value is located finely enough.

        A maximum may appear with a tension above the strength: then no point of the branch is.
        """
        return near or value > -0.5 * self.tolerance

    def _crack_at(
        self, field: GapField, refined: RefinedTension, theta: float, tension: float
    ) -> Crack:
        """Judge one maximum of tension."""
        wave, critical = self.edges.wave, self.edges.critical
        work, _ = self.edges.adhesion.work(theta, False)
        return judge_maximum(
            theta,
            tension,
            self.strength,
            balanced=0.5 * critical**2 * work,  # γ = π E* C_c²/(16 q0), σ = E* S/2
            toughness=work,
            release=lambda half: self._release(field, theta, half),
            shortest=0.5 * SHORTEST_CRACK * wave,
            longest=min(LONGEST_TRIAL_HALF_LENGTH * wave, IN_PATCH * refined.edge_distance(theta)),
        )

    def _release(self, field: GapField, theta: float, half: float) -> float:
        """Compute G/γ of a crack that is put into the patches of a field."""
        gaps = with_gaps(field.gaps, np.array([theta]), np.array([2 * half]))
        return float(self.edges.release(gaps, field.prescribed, theta, half).min())
