"""Grid of one problem: nodes, half-space, work of adhesion and edge compliance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.grid.compliance import EdgeCompliance
from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.elasticity import ElasticGrid
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array


class Lattice:
    """A problem discretised on n equally spaced nodes, dx apart in m; arrays have the shape (n,).

    Attributes
    ----------
    height : array
        h in m.
    adhesion : array
        γ(x) sqrt(1 + h'²), or γ(x) by the flat measure, in J/m².
    origin : int
        Node at the first crest.
    equal_parts : int
        Of the period.
    """

    def __init__(self, problem: Problem, n: int) -> None:
        profile = problem.profile
        self.elastic = ElasticGrid(n, profile.period, problem.half_space.modulus)
        self.n, self.dx = n, self.elastic.dx
        self.compliance = EdgeCompliance(self.elastic.kernel())
        self.height = profile.heights(n)
        x = self.dx * np.arange(n, dtype=np.float64)
        self.adhesion = problem.toughness(x, profile.slopes(n))
        self.control, self.h_max = problem.control, profile.h_max
        self.origin = round(problem.first_crest / self.dx) % n
        self.equal_parts = problem.equal_parts

    def extra_compliance(self, contact: Contact, nodes: NDArray[np.intp]) -> tuple[float, Array]:
        """Compute c and g of the compliance c g gᵀ that a free separation adds; c = 0 at fixed s.

        g = ∂t/∂s of nodes beside an edge with the contact set fixed, by reciprocity also the share
        of a force on the node that changes the mean stress; c = dx/(λ (k - ∂p̄/∂s)).
        """
        if contact.response is None or not contact.mask.any():
            return 0.0, np.zeros(nodes.size)
        k, per_separation = self.control.stiffness, float(contact.response.stress.mean())
        gap_rate = 1 - contact.response.displacement[nodes]
        return self.dx / (self.elastic.period * (k + per_separation)), gap_rate

    def conjugate(self, contact: Contact) -> float:
        """Compute Y of ``control``: p̄ in Pa, under a load s - h_max in m."""
        mean_stress = float(contact.stress.mean())
        return self.control.conjugate(contact.separation, mean_stress, self.h_max)

    def gap(self, contact: Contact, nodes: NDArray[np.intp] | slice = slice(None)) -> Array:
        """Compute the gap t = v - h + s in m at some nodes, by default at all."""
        return contact.displacement[nodes] - self.height[nodes] + contact.separation

    def adhesion_energy(self, contact: Contact) -> float:
        """Compute the energy of adhesion of the contact nodes, in J/m."""
        return -self.dx * float(self.adhesion[contact.mask].sum())

    def energy(self, contact: Contact) -> float:
        """Compute W of ``control`` in J/m, per period: U at fixed separation.

        Under a tension W of a state without contact is -∞.
        """
        energy = contact.elastic_energy + self.adhesion_energy(contact)
        if self.control.is_load and contact.prescribed > 0 and not contact.mask.any():
            return -np.inf
        mean_stress = float(contact.stress.mean())
        return self.control.potential(
            energy, contact.separation, mean_stress, self.h_max, self.elastic.period
        )
