"""Solve the stress of a given set of contact nodes by preconditioned conjugate gradients.

With the contact set Ω given, the stress solves V_ΩΩ σ = (h - s)_Ω. V is positive definite on every
Ω that leaves a node free. The opposite-order operator E*|q|/2, restricted to Ω, is the
preconditioner: with it the number of iterations grows only like log n (see e.g. Rey, Anciaux &
Molinari, Comput. Mech. 60 (2017) for FFT contact solvers). Two pairs of transforms an iteration.

If the separation is not fixed (``control``), a second solution, V_ΩΩ σ₁ = 1, gives the change of
the stress with s: σ = σ₀ - (s - s₀) σ₁, with s from the prescribed value.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.grid.elasticity import ElasticGrid
from adhesis.solver.method import PathError
from adhesis.solver.model.control import Control
from adhesis.solver.model.profile import Array

Mask = NDArray[np.bool_]

EDGE_COMPLIANCE = 1.7286
"""S E*/dx at the edge of a long isolated patch (numerical)."""

_MAX_ITERATIONS = 500
_NEGLIGIBLE = 1e-9  # of the wanted residual: below it is rounding
# Error of the energy allowed per unit of tolerance, in closing energies.
_ENERGY_TOLERANCE = 0.05


@dataclass
class SeparationResponse:
    """Change of a contact per unit of separation, for controls that do not fix the separation.

    Attributes
    ----------
    stress, displacement : array, shape (n,)
        σ₁ in Pa/m and Vσ₁, by which stress and displacement fall per unit of separation.
    """

    stress: Array
    displacement: Array


@dataclass
class Contact:
    """A contact set with its stress, not necessarily in equilibrium with respect to its edges.

    Attributes
    ----------
    separation : float
        s in m.
    prescribed : float
        x of ``control``.
    mask : bool array, shape (n,)
        The contact nodes Ω.
    stress : array, shape (n,)
        σ in Pa, zero outside Ω.
    displacement : array, shape (n,)
        v = Vσ in m.
    residual : float
        max |h - s - v| over Ω, in m.
    elastic_energy : float
        In J/m, a lower bound; its error is of second order in the residual.
    energy_error : float
        Upper estimate of that error, in J/m.
    response : SeparationResponse or None
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
    response: SeparationResponse | None = None

    def copy(self) -> Contact:
        """Return a copy that shares no array with this one."""
        arrays = {name: getattr(self, name).copy() for name in ("mask", "stress", "displacement")}
        response = self.response
        if response is not None:
            response = SeparationResponse(response.stress.copy(), response.displacement.copy())
        return replace(self, **arrays, response=response)


class ContactSolver:
    """Conjugate gradients on the contact sets of one grid.

    Attributes
    ----------
    height : array, shape (n,)
        h in m.
    closing_gap : float
        Largest gap in m that adhesion closes beside an edge: the unit of residuals.
    solves : int
        Counter.
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

    def empty(self, separation: float) -> Contact:
        """Return a contact without contact nodes."""
        n = self.elastic.n
        prescribed = self.control.prescribed(separation, 0.0)
        mask = np.zeros(n, dtype=bool)
        contact = Contact(separation, prescribed, mask, np.zeros(n), np.zeros(n))
        if not self.control.is_fixed:
            contact.response = SeparationResponse(np.zeros(n), np.zeros(n))
        return contact

    def solve(self, contact: Contact, tolerance: float) -> None:
        """Solve stress, displacement and energy of ``contact`` for its contact set, in place.

        The initial guess is the present stress, restricted to Ω; ``tolerance`` is the largest
        residual displacement there, in closing gaps.

        Raises
        ------
        PathError
            If there is no free node, or the iteration does not converge.
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
        if contact.response is not None:
            self._adjust_separation(contact, contact.response, inside, most)
            target = self.height - contact.separation
            displacement = contact.displacement
        # The elastic energy is the maximum over σ of ∫σ(h - s) - ½∫σv: errors enter quadratically.
        contact.elastic_energy = self.elastic.dx * float(
            (stress * target).sum() - 0.5 * (stress * displacement).sum()
        )

    def _adjust_separation(
        self, contact: Contact, response: SeparationResponse, inside: Array, most: float
    ) -> None:
        """Move a solved contact to the separation that the prescribed value implies, in place."""
        scale = float(np.abs(self.height).max())
        unit = np.ones_like(inside)
        response.displacement, residual, _ = self._solve(
            inside, response.stress, response.displacement, unit, most / scale, np.inf
        )
        mean, per_separation = float(contact.stress.mean()), float(response.stress.mean())
        control = self.control
        if control.is_load:
            if per_separation == 0:
                return  # without contact the load is not carried at any separation
            change = (mean + contact.prescribed) / per_separation
        else:
            compliance = 1 / control.stiffness
            rest = contact.prescribed - contact.separation + mean * compliance
            change = rest / (1 + per_separation * compliance)
        contact.stress -= change * response.stress
        contact.displacement = contact.displacement - change * response.displacement
        contact.separation += change
        contact.residual += abs(change) * residual

    def _solve(
        self,
        inside: Array,
        stress: Array,
        displacement: Array,
        target: Array,
        most: float,
        energy_tolerance: float,
    ) -> tuple[Array, float, float]:
        """Solve in place for the ``stress`` whose displacement on Ω is the target.

        ``displacement`` is that of the initial stress and is not changed. Returns the displacement,
        the largest residual in m, and the energy gained by the last iteration in J/m.
        """
        elastic = self.elastic
        if stress[inside == 0].any():
            stress *= inside
            displacement = elastic.displacement(stress)
        displacement = displacement.copy()
        residual = (target - displacement) * inside
        direction = np.zeros_like(residual)
        rz_before = np.inf
        gain = np.inf
        for _ in range(_MAX_ITERATIONS):
            largest = float(np.abs(residual).max())
            if (largest <= most and gain <= energy_tolerance) or largest <= _NEGLIGIBLE * most:
                break
            correction = elastic.precondition(residual)
            rz = float((residual * correction).sum())
            direction *= rz / rz_before
            direction += inside * correction
            response = elastic.displacement(direction)
            curvature = float((direction * response).sum())
            if curvature <= 0:
                raise PathError(
                    "method 'grid' has no free node left: contact is full, or was on the way of a "
                    "long step; more load steps or nodes, or a smaller turning point, leave one"
                )
            step = rz / curvature
            stress += step * direction
            response *= step
            displacement += response
            residual -= inside * response
            # Twice the energy gained by one iteration bounds the sum of all later gains, which
            # fall faster than by two thirds each. The residual alone is a poor measure near full
            # contact, where V is nearly singular for a uniform one.
            gain = elastic.dx * step * rz
            rz_before = rz
        else:
            raise PathError(
                f"method 'grid' does not solve the stress of {int(inside.sum())} contact nodes: "
                f"the gap inside contact stays {largest:.3g} m, {most:.3g} m are wanted; the "
                "method 'sharp', or more nodes, may get past it"
            )
        return displacement, largest, gain
