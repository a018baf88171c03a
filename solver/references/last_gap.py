"""One gap in an otherwise closed contact, and the tension in the rest of it.

The gap |x| < b lies in a trough of an even profile of period λ, everything else is in contact. With
ψ = πx/λ, β = πb/λ and q(x) = -σ_full(x) - p̄, the tension of full contact under the mean stress p̄
(``full_contact``), and sin ψ' = sin β sin φ inside the gap,

    K = m sqrt(λ tan β),    m = (2/π) ∫_0^{π/2} q dφ,
    s = (1/λ) ∫_gap q w dx,    w = (2λ/(πE*)) arccosh(cos ψ/cos β),
    tension(x) = q(x) + sin ψ/sqrt(sin²ψ - sin²β) (2/π) ∫_0^{π/2} q sin²β cos²φ/(sin²ψ - sin²ψ') dφ

outside; w is the opening under a unit tension, and s follows by reciprocity. At equilibrium
K²/(2E*) = γ sqrt(1 + h'(b)²), which gives p̄ as a function of b. For q = const these are Koiter's
collinear cracks (``periodic_punch``).

Source: Tada, Paris & Irwin, The Stress Analysis of Cracks Handbook: collinear cracks with forces on
their faces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.optimize import brentq

from adhesis.solver.model.profile import Array, Profile
from adhesis.solver.references.full_contact import full_contact_stress

_NODES, _WEIGHTS = legendre.leggauss(200)  # of the integrals over φ


@dataclass(frozen=True)
class LastGap:
    """The gap of an even profile with its deepest trough at x = 0.

    Parameters
    ----------
    profile : Profile
        With real coefficients.
    modulus : float
        E* in Pa.
    work_of_adhesion : float
        γ in J/m².
    """

    profile: Profile
    modulus: float
    work_of_adhesion: float

    @property
    def amplitude(self) -> float:
        """Largest tension in Pa of full contact without a mean stress."""
        x = np.linspace(0, self.profile.period, 64 * self.profile.highest_harmonic)
        return float(self._full(x).max())

    def mean_stress(self, b: float) -> float:
        """Compute p̄ in Pa of the equilibrium with the half-length b in m."""
        _, inside = self._nodes(b)
        toughness = np.sqrt(1 + float(self.profile.at(b, 1)) ** 2) * self.work_of_adhesion
        tangent = self.profile.period * np.tan(self._beta(b))
        needed = np.sqrt(2 * self.modulus * toughness / tangent)
        return float(self._mean(self._full(inside)) - needed)

    def separation(self, b: float) -> float:
        """Compute s in m of that equilibrium."""
        period, beta = self.profile.period, self._beta(b)
        angle, inside = self._nodes(b)
        psi = np.pi * inside / period
        unit = 2 * period / (np.pi * self.modulus) * np.arccosh(np.cos(psi) / np.cos(beta))
        # dx = (λ/π) dψ, cos ψ dψ = sin β cos φ dφ
        weight = period / np.pi * np.sin(beta) * np.cos(angle) / np.cos(psi)
        tension = self._full(inside) - self.mean_stress(b)
        return float(np.pi * self._mean(tension * unit * weight) / period)

    def tension(self, b: float, x: float) -> float:
        """Compute the tension in Pa at x (m) outside the gap, in that equilibrium."""
        period, beta = self.profile.period, self._beta(b)
        angle, inside = self._nodes(b)
        pressure = self.mean_stress(b)
        here, there = np.sin(np.pi * x / period) ** 2, np.sin(np.pi * inside / period) ** 2
        kernel = np.sin(beta) ** 2 * np.cos(angle) ** 2 / (here - there)
        pull = self._mean((self._full(inside) - pressure) * kernel)
        own = float(self._full(np.array([x]))[0]) - pressure
        return float(own + np.sqrt(here / (here - np.sin(beta) ** 2)) * pull)

    def half_length_at(self, tension: float, x: float, low: float, high: float) -> float:
        """Find b in m between two others at which the tension at x is a given one, in Pa."""
        return float(brentq(lambda b: self.tension(b, x) - tension, low, high, xtol=1e-15 * high))

    def _beta(self, b: float) -> float:
        return float(np.pi * b / self.profile.period)

    def _nodes(self, b: float) -> tuple[Array, Array]:
        """Return Gauss nodes φ from 0 to π/2, and their positions x inside the gap."""
        angle = np.pi / 4 * (_NODES + 1)
        inside = np.arcsin(np.sin(self._beta(b)) * np.sin(angle))
        return angle, np.asarray(inside * self.profile.period / np.pi)

    def _mean(self, values: Array) -> float:
        """Average over φ: (2/π) ∫_0^{π/2} … dφ."""
        return float(values @ _WEIGHTS) / 2

    def _full(self, x: Array) -> Array:
        """Compute the tension of full contact without a mean stress."""
        return -full_contact_stress(self.profile, self.modulus, x)
