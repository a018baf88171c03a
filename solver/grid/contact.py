"""Stress of a given set of contact nodes, by preconditioned conjugate gradients.

With the contact set Ω given, the stress solves V_ΩΩ σ = (h - s)_Ω. V is positive definite on every
Ω that leaves a node free. The opposite-order operator E*|q|/2, restricted to Ω, is the
preconditioner: with it the number of iterations grows only like log n (see e.g. Rey, Anciaux &
Molinari, Comput. Mech. 60 (2017) for FFT contact solvers). Two pairs of transforms an iteration.

Where the separation is not fixed (``control``) a second solution, V_ΩΩ σ₁ =
1, tells how the stress follows it: σ = σ₀ - (s - s₀) σ₁, and s from what is prescribed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.grid.elasticity import ElasticGrid
from adhesis.solver.grid.kernels import advance, dot, turn
from adhesis.solver.method import PathError
from adhesis.solver.model.control import Control
from adhesis.solver.model.profile import Array

Mask = NDArray[np.bool_]

EDGE_COMPLIANCE = 1.7286
"""S E*/dx at the edge of a long isolated patch (numerical)."""

_MAX_ITERATIONS = 500
_NOTHING = 1e-9  # of the residual wanted: below it there is nothing left to solve
# Error of the energy that a unit of tolerance allows, in closing energies.
_ENERGY_TOLERANCE = 0.05


@dataclass
class Yield:
    """How a contact gives way where its separation is not fixed.

    Attributes
    ----------
    stress, displacement : array, shape (n,)
        σ₁ in Pa/m and Vσ₁: what a unit of separation takes from the stress.
    """

    stress: Array
    displacement: Array

    def copy(self) -> Yield:
        """Return a copy that shares no array with this one."""
        return Yield(self.stress.copy(), self.displacement.copy())


@dataclass
class Contact:
    """A contact set with its stress, not necessarily in equilibrium with respect to its edges.

    Attributes
    ----------
    separation : float
        s in m.
    prescribed : float
        What the control prescribes, x of ``control``.
    mask : bool array, shape (n,)
        The contact nodes Ω.
    stress : array, shape (n,)
        σ in Pa, zero outside Ω.
    displacement : array, shape (n,)
        v = Vσ in m.
    residual : float
        max |h - s - v| over Ω, in m.
    elastic_energy : float
        In J/m, from below; its error is of second order in the residual.
    energy_error : float
        Estimate from above of that error, in J/m.
    yields : Yield or None
        None at fixed separation.
    """

    separation: float
    prescribed: float
    mask: Mask
    stress: Array
    displacement: Array
    residual: float = 0.0
    elastic_energy: float = 0.0
    energy_error: float = 0.0
    yields: Yield | None = None

    def copy(self) -> Contact:
        """Return a copy that shares no array with this one."""
        return Contact(
            self.separation,
            self.prescribed,
            self.mask.copy(),
            self.stress.copy(),
            self.displacement.copy(),
            self.residual,
            self.elastic_energy,
            self.energy_error,
            self.yields.copy() if self.yields is not None else None,
        )

    def at(self, prescribed: float, control: Control) -> Contact:
        """Return a copy, yet to be solved, where x is ``prescribed``."""
        moved = self.copy()
        moved.prescribed = prescribed
        if control.is_fixed:
            moved.separation = prescribed
        return moved


class ContactSolver:
    """Conjugate gradients on the contact sets of one grid.

    Parameters
    ----------
    elastic : ElasticGrid
    height : array, shape (n,)
        h in m.
    closing_gap : float
        Gap in m that adhesion just closes beside an edge: the unit of residuals.
    control : Control

    Attributes
    ----------
    solves, iterations : int
        Counters.
    """

    def __init__(
        self, elastic: ElasticGrid, height: Array, closing_gap: float, control: Control
    ) -> None:
        self.control = control
        self.elastic = elastic
        self.height = height
        self.closing_gap = closing_gap
        # Energy of closing that gap by one node, about γ dx.
        self._closing_energy = closing_gap**2 * elastic.modulus / (2 * EDGE_COMPLIANCE)
        self.solves = 0
        self.iterations = 0

    def empty(self, separation: float) -> Contact:
        """Contact state without contact nodes."""
        n = self.elastic.n
        prescribed = self.control.prescribed(separation, 0.0)
        nothing = np.zeros(n)
        contact = Contact(separation, prescribed, np.zeros(n, dtype=bool), nothing, np.zeros(n))
        if not self.control.is_fixed:
            contact.yields = Yield(np.zeros(n), np.zeros(n))
        return contact

    def solve(self, contact: Contact, tolerance: float) -> None:
        """Bring stress, displacement and energy of ``contact`` to its contact set, in place.

        Starts from the stress that is there, restricted to Ω.

        Parameters
        ----------
        contact : Contact
        tolerance : float
            Largest residual displacement on Ω, in units of the closing gap.

        Raises
        ------
        PathError
            If there is no free node, or the iteration stalls above the tolerance.
        """
        self.solves += 1
        most = tolerance * self.closing_gap
        energy_tolerance = _ENERGY_TOLERANCE * tolerance * self._closing_energy
        inside = contact.mask.astype(np.float64)
        target = self.height - contact.separation
        stress = contact.stress
        displacement, contact.residual, gain = self._solve(
            inside, stress, contact.displacement, target, most, energy_tolerance
        )
        contact.displacement = displacement
        contact.energy_error = gain if np.isfinite(gain) else 0.0
        if contact.yields is not None:
            self._give_way(contact, contact.yields, inside, most)
            target = self.height - contact.separation
            displacement = contact.displacement
        # max over σ of ∫σ(h - s) - ½∫σv is the elastic energy: errors enter quadratically.
        contact.elastic_energy = self.elastic.dx * (
            dot(stress, target) - 0.5 * dot(stress, displacement)
        )

    def _give_way(self, contact: Contact, gives: Yield, inside: Array, most: float) -> None:
        """Bring a solved contact to the separation that belongs to what is prescribed, in place."""
        scale = float(np.abs(self.height).max())
        gives.displacement, residual, _ = self._solve(
            inside, gives.stress, gives.displacement, np.ones_like(inside), most / scale, np.inf
        )
        mean, per_separation = float(contact.stress.mean()), float(gives.stress.mean())
        control = self.control
        if control.is_load:
            if per_separation == 0:
                return  # no contact carries nothing
            way = (mean + contact.prescribed) / per_separation
        else:
            compliance = 1 / control.stiffness
            rest = contact.prescribed - contact.separation + mean * compliance
            way = rest / (1 + per_separation * compliance)
        contact.stress -= way * gives.stress
        contact.displacement = contact.displacement - way * gives.displacement
        contact.separation += way
        contact.residual += abs(way) * residual

    def _solve(
        self,
        inside: Array,
        stress: Array,
        displacement: Array,
        target: Array,
        most: float,
        energy_tolerance: float,
    ) -> tuple[Array, float, float]:
        """Bring ``stress``, in place, to where its displacement is the target on Ω.

        ``displacement`` is that of the stress as it is, and left as it is.

        Returns the displacement, the largest residual, and what the last iteration gained, in J/m.
        """
        elastic = self.elastic
        kept = stress * inside
        if np.array_equal(kept, stress):
            displacement = displacement.copy()
        else:
            stress[:] = kept
            displacement = elastic.displacement(stress).copy()
        residual = (target - displacement) * inside
        direction = np.zeros_like(residual)
        rz_before = 0.0
        gain = np.inf
        largest = float(np.abs(residual).max())
        for _ in range(_MAX_ITERATIONS):
            if (largest <= most and gain <= energy_tolerance) or largest <= _NOTHING * most:
                break
            correction = elastic.precondition(residual)
            rz = dot(residual, correction)
            turn(direction, inside, correction, rz / rz_before if rz_before else 0.0)
            response = elastic.displacement(direction)
            curvature = dot(direction, response)
            if curvature <= 0:
                raise PathError(
                    "method 'grid' has no free node left: full contact has no solution at a mean "
                    "gap; more nodes, or a smaller turning point, leave one"
                )
            step = rz / curvature
            largest = advance(stress, displacement, residual, direction, response, inside, step)
            # Twice what one iteration adds to the energy bounds what all later ones will: gains
            # fall faster than by two thirds. A residual alone says little beside full contact,
            # where V hardly resists a uniform one.
            gain = elastic.dx * step * rz
            rz_before = rz
            self.iterations += 1
        else:
            raise PathError(
                f"method 'grid' does not solve the stress of {int(inside.sum())} contact nodes: "
                f"the gap inside contact stays {largest:.3g} m, {most:.3g} m are wanted; the "
                "method 'sharp', or more nodes, may get past it"
            )
        return displacement, largest, gain
