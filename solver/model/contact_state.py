"""Equilibrium contact state, as returned by every method."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.values import ByValue


@dataclass(frozen=True, eq=False, repr=False)
class ContactState(ByValue):
    """An equilibrium contact state.

    Immutable; two states are equal if all numbers but ``internal`` are.

    Attributes
    ----------
    separation : float
        s in m; equals the mean gap.
    edges : array, shape (patches, 2)
        Left and right edge of each patch in m, 0 ≤ left < λ, left < right, sorted by the left
        edge; the right edge of the last patch may exceed λ.
    mean_stress : float
        p̄ in Pa, compression positive.
    elastic_energy, adhesion_energy : float
        ½∫σ(h - s)dx and -∫γ sqrt(1 + h'²)dx over the contact of one period, in J/m; in the flat
        measure without the root (:meth:`~adhesis.solver.model.problem.Problem.toughness`).
    contact_fraction : float
        A/A0.
    tangent : float
        dp̄/ds along the branch in Pa/m, or dY/dx if another quantity than the separation is
        prescribed (:mod:`adhesis.solver.model.control`); NaN if the method does not compute it.
    edge_friction : float
        Energy in J/m, per period, that edges have dissipated on the way to the state as they
        receded: what both works of adhesion differ by, over the length along the profile; without
        the fall of the solid under a load.
    hold_energy : float
        Contribution of the control to the potential, in J/m per period; 0 at fixed separation.
    internal : object
        Private data from which the method continues the path.

    References
    ----------
    docs/theory.md, "1. The problem"
    """

    separation: float
    edges: Array
    mean_stress: float
    elastic_energy: float
    adhesion_energy: float
    contact_fraction: float
    tangent: float = float("nan")
    hold_energy: float = 0.0
    edge_friction: float = 0.0
    internal: Any = field(default=None, repr=False, compare=False)

    @classmethod
    def detached(cls, separation: float) -> ContactState:
        """Make the state without contact at ``separation`` (m)."""
        return cls(separation, np.empty((0, 2)), 0.0, 0.0, 0.0, 0.0)

    @property
    def patches(self) -> int:
        """Number of contact patches in one period."""
        return len(self.edges)

    @property
    def energy(self) -> float:
        """U = elastic + adhesion energy of one period, in J/m."""
        return self.elastic_energy + self.adhesion_energy

    @property
    def potential(self) -> float:
        """Potential W of :mod:`adhesis.solver.model.control` in J/m; U at fixed separation."""
        return self.energy + self.hold_energy
