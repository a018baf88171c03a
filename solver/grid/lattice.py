"""The grid of one problem: its nodes, its half-space, and what adhesion and edges cost there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.grid.compliance import EdgeCompliance
from solver.grid.contact import EDGE_COMPLIANCE, Contact
from solver.grid.elasticity import ElasticGrid
from solver.problem import Problem
from solver.profile import Array


@dataclass(frozen=True, eq=False)
class Lattice:
    """What n equally spaced nodes know of a problem; arrays have the shape (n,).

    Attributes
    ----------
    elastic : ElasticGrid
    compliance : EdgeCompliance
    height : array
        h in m.
    adhesion : array
        γ sqrt(1 + h'²) in J/m².
    origin : int
        Node at the highest crest.
    """

    elastic: ElasticGrid
    compliance: EdgeCompliance
    height: Array
    adhesion: Array
    origin: int = 0

    @classmethod
    def of(cls, problem: Problem, n: int) -> Lattice:
        """Lattice of ``n`` nodes in one period of the problem's profile."""
        profile = problem.profile
        elastic = ElasticGrid(n, profile.period, problem.half_space.modulus)
        return cls(
            elastic,
            EdgeCompliance(elastic.kernel()),
            profile.heights(n),
            problem.work_of_adhesion * np.sqrt(1 + profile.slopes(n) ** 2),
            round(profile.highest_point[0] / elastic.dx) % n,
        )

    @property
    def n(self) -> int:
        """Number of nodes."""
        return self.elastic.n

    @property
    def dx(self) -> float:
        """Distance of two nodes, in m."""
        return self.elastic.dx

    def closing_gap(self, work_of_adhesion: float, curvature: float) -> float:
        """Gap in m that adhesion just closes beside an edge: the unit of tolerances on lengths.

        Without adhesion it is what the curvature (1/m) makes of half a node.
        """
        modulus = self.elastic.modulus
        closing = float(np.sqrt(2 * work_of_adhesion * EDGE_COMPLIANCE * self.dx / modulus))
        return max(closing, 0.125 * self.dx**2 * curvature)

    def gap(self, contact: Contact) -> Array:
        """Gap t = v - h + s in m at every node."""
        return contact.displacement - self.height + contact.separation

    def adhesion_energy(self, contact: Contact) -> float:
        """-Σ γ sqrt(1 + h'²) dx over the contact nodes, in J/m."""
        return -self.dx * float(np.sum(self.adhesion[contact.mask]))

    def energy(self, contact: Contact) -> float:
        """U in J/m, per period."""
        return contact.elastic_energy + self.adhesion_energy(contact)
