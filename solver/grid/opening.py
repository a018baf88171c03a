"""Locate cracks that open inside patches of a grid, and insert them by removing nodes."""

from __future__ import annotations

import math

import numpy as np

from adhesis.solver.crack import (
    HEALED_PLACE,
    IN_PATCH,
    LONGEST_TRIAL_HALF_LENGTH,
    MOST_MAXIMA,
    NEAR_STRENGTH,
    Crack,
    has_healed,
    judge_maximum,
    largest_excess,
)
from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.edges import Indices
from adhesis.solver.grid.relax import Relaxation
from adhesis.solver.grid.states import EDGE_OFFSET
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.peaks import highest_peaks, parabola_vertex


class Openings:
    """Openings of patches where a maximum of tension inside them reaches the strength.

    Parameters
    ----------
    problem : Problem
    relaxation : Relaxation

    Attributes
    ----------
    healed : list of (position, tension)
        Cracks that closed again: nothing opens there unless the tension is larger.
    """

    def __init__(self, problem: Problem, relaxation: Relaxation) -> None:
        self._relaxation, self._lattice = relaxation, relaxation.lattice
        self._strength = problem.strength
        self._wave = problem.profile.shortest_wavelength
        self._modulus, self._gamma = problem.half_space.modulus, problem.work_of_adhesion
        self.healed: list[tuple[float, float]] = []

    @property
    def is_possible(self) -> bool:
        """Whether patches may open: the strength is finite."""
        return math.isfinite(self._strength)

    def minimum(self, contact: Contact) -> tuple[float, list[Crack]]:
        """Return the least value of all maxima of tension of a solved contact, and these maxima."""
        far = 1 - NEAR_STRENGTH
        if not self.is_possible or not contact.mask.any():
            return far, []
        tension = np.where(contact.mask, -contact.stress, np.nan)
        nodes = highest_peaks(tension, MOST_MAXIMA, NEAR_STRENGTH * self._strength)
        cracks = [self._crack_at(contact, tension, node) for node in nodes]
        near, period = HEALED_PLACE * self._wave, self._lattice.elastic.period
        cracks = [
            crack
            for crack in cracks
            if not has_healed(crack.position, crack.tension, self.healed, near, period)
        ]
        return min((crack.value for crack in cracks), default=far), cracks

    def insert_seeds(self, contact: Contact, cracks: list[Crack]) -> Contact:
        """Return an unsolved copy without the nodes of the cracks that open first."""
        opened = contact.copy()
        for crack in largest_excess(cracks):
            opened.mask[self._nodes(crack.position, crack.length)] = False
        return opened

    def barrier(self, cracks: list[Crack]) -> float:
        """Sum the barriers of the cracks that open first, in J/m² of nominal area."""
        total = sum(crack.barrier for crack in largest_excess(cracks))
        return self._gamma * total / self._lattice.elastic.period

    def heal(self, cracks: list[Crack]) -> None:
        """Record that the cracks that open first closed again."""
        self.healed += [(crack.position, crack.tension) for crack in largest_excess(cracks)]

    def _crack_at(self, contact: Contact, tension: Array, node: int) -> Crack:
        """Judge the maximum of tension at a node; a parabola through its neighbours refines it."""
        dx, n = self._lattice.dx, self._lattice.n
        shift, highest = parabola_vertex(tension[node - 1], tension[node], tension[(node + 1) % n])
        # nodes from the middle to the nearest edge
        turned = np.roll(contact.mask, -node)
        free = np.flatnonzero(~turned)
        edge = min(int(free[0]), n - int(free[-1])) if free.size else n
        toughness = float(self._lattice.adhesion[node]) / self._gamma
        position = (node + shift) * dx
        return judge_maximum(
            position,
            highest,
            self._strength,
            balanced=2 * self._modulus * self._gamma * toughness / math.pi,
            toughness=toughness,
            release=lambda half: self._release(contact, position, half),
            shortest=(0.5 + EDGE_OFFSET) * dx,
            longest=min(LONGEST_TRIAL_HALF_LENGTH * self._wave, IN_PATCH * edge * dx),
        )

    def _nodes(self, position: float, length: float) -> Indices:
        """Return the nodes of a crack."""
        dx, n = self._lattice.dx, self._lattice.n
        width = max(1, math.ceil(length / dx - 2 * EDGE_OFFSET))
        first = round(position / dx - 0.5 * (width - 1))
        return np.arange(first, first + width) % n

    def _release(self, contact: Contact, position: float, half: float) -> float:
        """Compute G/γ of a crack that is put into the patches of a contact."""
        nodes = self._nodes(position, 2 * half)
        opened = contact.copy()
        opened.mask[nodes] = False
        self._relaxation.solver.solve(opened, self._relaxation.tight)
        edges = self._relaxation.edges(opened)
        tips = np.isin(edges.outer, nodes[[0, -1]])
        adhesion = self._lattice.dx * self._lattice.adhesion[edges.inner[tips]]
        cost = edges.recession[tips] / adhesion
        return max(0.0, 1 - float(cost.max()))
