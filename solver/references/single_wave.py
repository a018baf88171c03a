"""Contact of one wave with a half-space: Westergaard without adhesion, Johnson with adhesion.

Rigid wave h = A cos(q0 x), q0 = 2π/λ, on an elastic half-space (plane strain, frictionless),
contact |x| < a around the crest, periodic in λ. With ψ = πx/λ, y = sin²(πa/λ), p* = πE*A/λ:

    σ(x)  = cos ψ [2p* sqrt(y - sin²ψ) - p1 / sqrt(y - sin²ψ)]             in contact
    t(x)  = 2A [u sqrt(u² - y) + (p1/p* - y) arcosh(u/sqrt(y))],  u = |sin ψ|    in the gap
    p̄     = p* y - p1
    s     = A (1 - y + y ln y) - (λ p1/(πE*)) ln y = mean gap
    K     = p1 sqrt(λ cot(πa/λ))
    U_e   = λ A p* [y²/4 - (p̄/p*)² ln y / 2] = ½ ∫ σ (h - s) dx

for any a and s; p1 is the mean tension of the superposed flat periodic punch. At equilibrium an
edge has K²/(2E*) = γ' with γ' = γ in the *flat measure* of the papers, so
p1 = sqrt(2E*γ tan(πa/λ)/λ), and p1/p* = α sqrt(tan(πa/λ)), α² = 2γλ/(π²E*A²).

The solvers of this package measure the adhesive area along the profile instead,
γ' = γ sqrt(1 + h'²) (the *arc measure*). It raises γ' by at most the factor 1 + (A q0)²/2, so with
W ∝ γ^κ, κ = 1.25 to 1.27 in the range of α from 0.05 to 0.6, losses differ by less than
0.7 (A q0)²; at A q0 = 1e-4 that is 7e-9. Both measures are implemented here, both exact.

At fixed separation the loop has two jumps: at first touch (s = A) the contact grows from zero to
the half-width a_in with s(a_in) = A; on unloading the branch ends where ds/da = 0, at s_out, and
the contact is lost. Between them loading and unloading follow the same branch, so the loss does
not depend on the largest penetration.

With a stiffness k (Pa/m of nominal area) the prescribed value is u = Δ + p̄/k, Δ = A - s, and the
potential is W = U + λ p̄²/(2k). First touch is at u = 0, the branch is stable where du/da > 0, and
it has two ends: u_out, where contact is lost, and u_full, beyond which the wave runs into full
contact (at fixed separation that end is s = 0). Under load control (k = 0) the same holds with p̄
instead of u and U - λ p̄ Δ instead of W; the drop at the loss of contact is U: the work of the load
afterwards is not counted.

Sources: Westergaard, J. Appl. Mech. 6 (1939) 49; Johnson, Int. J. Solids Struct. 32 (1995) 423;
the loop at fixed separation: Carbone & Mangialardi, J. Mech. Phys. Solids 52 (2004) 1267. The
energies and the gap follow from the stress by elementary integration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import ellipeinc

from adhesis.solver.model.problem import Measure
from adhesis.solver.model.profile import Array


def _root(function: Callable[[float], Array], low: float, high: float) -> float:
    """Find the zero of a function that changes sign between ``low`` and ``high``, to rounding."""
    eps = float(np.finfo(float).eps)
    found = brentq(lambda a: float(function(a)), low, high, xtol=1e-300, rtol=4 * eps, maxiter=500)
    return float(found)


@dataclass(frozen=True)
class WaveLoop:
    """The exact loop, at fixed separation or under another control.

    Attributes
    ----------
    touch_half_width : float
        a_in in m, reached by the jump at first touch.
    fold_half_width, fold_separation, fold_mean_stress : float
        At the end of the branch on unloading: a_out in m, s_out in m, p̄ in Pa before the jump.
    touch_drop, fold_drop : float
        Energy drops of the two jumps, J/m² of nominal area.
    """

    touch_half_width: float
    fold_half_width: float
    fold_separation: float
    fold_mean_stress: float
    touch_drop: float
    fold_drop: float

    @property
    def loss(self) -> float:
        """Loss of one loop, J/m² of nominal area."""
        return self.touch_drop + self.fold_drop


@dataclass(frozen=True)
class SingleWave:
    """Exact contact of h = A cos(q0 x) with a half-space.

    Half-widths a are in m, 0 < a < λ/2; functions of a and x broadcast.

    Parameters
    ----------
    amplitude, period : float
        A and λ in m, positive.
    modulus : float
        E* = E/(1 - ν²) in Pa, positive.
    work_of_adhesion : float
        γ in J/m², not negative; 0 gives Westergaard's contact.
    measure : {"flat", "arc"}
        Measure of the adhesive area, see the module.

    Raises
    ------
    ValueError
        If a value breaks these rules.
    """

    amplitude: float
    period: float
    modulus: float
    work_of_adhesion: float
    measure: Measure = "flat"

    def __post_init__(self) -> None:
        for name in ("amplitude", "period", "modulus"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value!r}: it must be positive and finite")
        if not (np.isfinite(self.work_of_adhesion) and self.work_of_adhesion >= 0):
            raise ValueError(f"work_of_adhesion is {self.work_of_adhesion!r}: it must be ≥ 0")

    @classmethod
    def with_alpha(
        cls,
        alpha: float,
        amplitude: float,
        period: float,
        modulus: float,
        measure: Measure = "flat",
    ) -> SingleWave:
        """Make the wave with Johnson's parameter α (see :attr:`alpha`)."""
        gamma = (np.pi * alpha * amplitude) ** 2 * modulus / (2 * period)
        return cls(amplitude, period, modulus, float(gamma), measure)

    # ------------------------------------------------------------------ groups

    @property
    def alpha(self) -> float:
        """Johnson's α = (√2/π)(λ/A) sqrt(γ/(E*λ)), dimensionless."""
        root = np.sqrt(self.work_of_adhesion / (self.modulus * self.period))
        return float(np.sqrt(2) / np.pi * self.period / self.amplitude * root)

    @property
    def full_contact_stress(self) -> float:
        """p* = πE*A/λ in Pa: the mean pressure that closes the wave without adhesion."""
        return np.pi * self.modulus * self.amplitude / self.period

    @property
    def steepest_slope(self) -> float:
        """A q0, the largest |h'|."""
        return 2 * np.pi * self.amplitude / self.period

    @property
    def energy_scale(self) -> float:
        """λ A p* in J/m."""
        return self.period * self.amplitude * self.full_contact_stress

    # ------------------------------------------------------------------ equilibrium branch

    def _angle(self, a: ArrayLike) -> tuple[Array, Array, Array]:
        """Compute ψ = πa/λ, y = sin²ψ, and ln y without cancellation at either end."""
        psi = np.pi * np.asarray(a, dtype=float) / self.period
        y = np.sin(psi) ** 2
        with np.errstate(divide="ignore"):
            log = np.where(y < 0.5, np.log(y), np.log1p(-(np.cos(psi) ** 2)))
        return psi, y, log

    def adhesive_tension(self, a: ArrayLike) -> Array:
        """Compute p1(a) in Pa at equilibrium, the mean tension of the superposed flat punch."""
        psi, _, _ = self._angle(a)
        p1 = self.full_contact_stress * self.alpha * np.sqrt(np.tan(psi))
        if self.measure == "arc":
            p1 = p1 * (1 + (self.steepest_slope * np.sin(2 * psi)) ** 2) ** 0.25
        return np.asarray(p1)

    def _tension_rate(self, psi: Array) -> Array:
        """Compute d ln p1/dψ."""
        double = np.sin(2 * psi)
        rate = 1 / double
        if self.measure == "arc":
            k2 = self.steepest_slope**2
            rate = rate + k2 * double * np.cos(2 * psi) / (1 + k2 * double**2)
        return np.asarray(rate)

    def mean_stress(self, a: ArrayLike) -> Array:
        """Compute p̄(a) in Pa at equilibrium, compression positive."""
        return np.asarray(self.full_contact_stress * self._angle(a)[1] - self.adhesive_tension(a))

    def separation(self, a: ArrayLike) -> Array:
        """Compute s(a) in m at equilibrium."""
        _, y, log = self._angle(a)
        # At a = 0 the limit is s = A: p̄ ln y → 0.
        with np.errstate(invalid="ignore"):
            term = np.where(y > 0, self.mean_stress(a) / self.full_contact_stress * log, 0.0)
        return np.asarray(self.amplitude * (1 - y + term))

    def separation_slope(self, a: ArrayLike) -> Array:
        """Compute ds/da along the equilibrium branch; negative where it is stable at fixed s."""
        psi, _, log = self._angle(a)
        p = self.adhesive_tension(a) / self.full_contact_stress
        slope = (np.sin(2 * psi) - p * self._tension_rate(psi)) * log - 2 * p / np.tan(psi)
        return np.asarray(np.pi * self.amplitude / self.period * slope)

    # ------------------------------------------------------------------ any a at any s

    def mean_stress_at(self, a: ArrayLike, s: ArrayLike) -> Array:
        """Compute p̄ in Pa of the elastic solution with half-width a at separation s."""
        _, y, log = self._angle(a)
        ratio = np.asarray(s, dtype=float) / self.amplitude - 1 + y
        return np.asarray(self.full_contact_stress * ratio / log)

    def elastic_energy_at(self, a: ArrayLike, s: ArrayLike) -> Array:
        """Compute ½∫σ(h - s)dx in J/m with half-width a at separation s."""
        _, y, log = self._angle(a)
        p = self.mean_stress_at(a, s) / self.full_contact_stress
        return np.asarray(self.energy_scale * (y**2 / 4 - p**2 * log / 2))

    def adhesion_energy(self, a: ArrayLike) -> Array:
        """Compute -γ × (length of the contact in the chosen measure), J/m."""
        half = np.asarray(a, dtype=float)
        if self.measure == "arc":
            q0 = 2 * np.pi / self.period
            half = ellipeinc(q0 * half, -(self.steepest_slope**2)) / q0
        return np.asarray(-2 * self.work_of_adhesion * half)

    def energy_at(self, a: ArrayLike, s: ArrayLike) -> Array:
        """Compute U(a, s) in J/m per period, elastic plus adhesion energy."""
        return self.elastic_energy_at(a, s) + self.adhesion_energy(a)

    def energy(self, a: ArrayLike) -> Array:
        """Compute U in J/m along the equilibrium branch."""
        _, y, log = self._angle(a)
        p = self.mean_stress(a) / self.full_contact_stress
        with np.errstate(invalid="ignore"):
            term = np.where(y > 0, p**2 * log / 2, 0.0)
        return np.asarray(self.energy_scale * (y**2 / 4 - term) + self.adhesion_energy(a))

    # ------------------------------------------------------------------ fields

    def stress(self, x: ArrayLike, a: ArrayLike) -> Array:
        """Compute σ(x) in Pa at equilibrium for half-width a; 0 off contact, crest at x = 0."""
        _, y, _ = self._angle(a)
        u = np.sin(np.pi * np.asarray(x, dtype=float) / self.period)
        inside = y - u**2
        root = np.sqrt(np.where(inside > 0, inside, 1.0))
        value = 2 * self.full_contact_stress * root - self.adhesive_tension(a) / root
        return np.where(inside > 0, np.sqrt(1 - u**2) * value, 0.0)

    def gap(self, x: ArrayLike, a: ArrayLike) -> Array:
        """Compute t(x) in m at equilibrium with half-width a; 0 in contact, crest at x = 0."""
        _, y, _ = self._angle(a)
        edge = np.sqrt(y)
        u = np.maximum(np.abs(np.sin(np.pi * np.asarray(x, dtype=float) / self.period)), edge)
        p1 = self.adhesive_tension(a) / self.full_contact_stress
        root = np.sqrt((u - edge) * (u + edge))
        return np.asarray(2 * self.amplitude * (u * root + (p1 - y) * np.arccosh(u / edge)))

    # ------------------------------------------------------------------ the loop

    @cached_property
    def fold_half_width(self) -> float:
        """a_out in m, at the end of the branch on unloading (ds/da = 0); 0 without adhesion."""
        return self.stable_range(np.inf)[0]

    def half_width(self, s: float) -> float:
        """Compute the half-width a in m of the stable state at separation s in m.

        Raises
        ------
        ValueError
            If there is no such state: s ≤ 0 (beyond full contact) or s > s_out.
        """
        low, high = self.fold_half_width, 0.5 * self.period * (1 - 1e-15)
        top = float(self.separation(low))
        if not 0 < s <= top:
            raise ValueError(f"separation is {s!r}: stable contact needs 0 < s ≤ s_out = {top!r}")
        if s == top:
            return low
        return _root(lambda a: self.separation(a) - s, low, high)

    @cached_property
    def loop(self) -> WaveLoop:
        """The exact loop at fixed separation; see :class:`WaveLoop`."""
        return self.loop_under(np.inf)

    # ------------------------------------------------------------------ any control

    def mean_stress_slope(self, a: ArrayLike) -> Array:
        """Compute dp̄/da along the branch, in Pa/m; positive where it is stable under load."""
        psi, _, _ = self._angle(a)
        tension = self.adhesive_tension(a) * self._tension_rate(psi)
        slope = self.full_contact_stress * np.sin(2 * psi) - tension
        return np.asarray(np.pi / self.period * slope)

    def displacement(self, a: ArrayLike, stiffness: float) -> Array:
        """Compute u(a) = Δ + p̄/k in m at equilibrium, k in Pa/m, positive; Δ if infinite."""
        return np.asarray(self.amplitude - self.separation(a) + self.mean_stress(a) / stiffness)

    def _prescribed(self, a: ArrayLike, stiffness: float) -> Array:
        """Compute the prescribed value: u in m, or p̄ in Pa if the stiffness is 0."""
        return self.mean_stress(a) if stiffness == 0 else self.displacement(a, stiffness)

    def _prescribed_slope(self, a: ArrayLike, stiffness: float) -> Array:
        if stiffness == 0:
            return self.mean_stress_slope(a)
        return np.asarray(self.mean_stress_slope(a) / stiffness - self.separation_slope(a))

    def stable_range(self, stiffness: float) -> tuple[float, float]:
        """Compute the half-widths (a_out, a_full) in m of the stable branch, k in Pa/m.

        Raises
        ------
        ValueError
            If no state is stable: contact runs to full contact from first touch.
        """
        # the slope is negative at both ends and has at most one positive stretch between them
        ends = 1e-9 * self.period, (0.5 - 1e-9) * self.period
        a = np.linspace(*ends, 20001)
        slope_at = partial(self._prescribed_slope, stiffness=stiffness)
        slope = slope_at(a)
        top = int(np.argmax(slope))
        if slope[top] <= 0:
            raise ValueError(f"no state is stable with a stiffness of {stiffness!r} Pa/m")

        full = _root(slope_at, a[top], ends[1]) if slope[-1] < 0 else ends[1]
        return _root(slope_at, ends[0], a[top]) if slope[0] < 0 else 0.0, full

    def half_width_under(self, stiffness: float, prescribed: float) -> float:
        """Compute a in m of the stable state at u = ``prescribed`` in m (k = 0: p̄ in Pa).

        Raises
        ------
        ValueError
            If there is no such state.
        """
        low, high = self.stable_range(stiffness)
        least = float(self._prescribed(low, stiffness))
        most = float(self._prescribed(high, stiffness))
        if not least <= prescribed <= most:
            raise ValueError(
                f"prescribed is {prescribed!r}: stable contact needs {least!r} to {most!r}"
            )
        return _root(lambda a: self._prescribed(a, stiffness) - prescribed, low, high)

    def loop_under(self, stiffness: float) -> WaveLoop:
        """Compute the exact loop with a stiffness in Pa/m of nominal area (0: a load).

        Raises
        ------
        ValueError
            If contact runs to full contact from first touch.
        """
        a_in = self.half_width_under(stiffness, 0.0)
        a_out, _ = self.stable_range(stiffness)

        def spring(a: float) -> float:
            return 0.0 if stiffness == 0 else float(self.mean_stress(a)) ** 2 / (2 * stiffness)

        return WaveLoop(
            touch_half_width=a_in,
            fold_half_width=a_out,
            fold_separation=float(self.separation(a_out)),
            fold_mean_stress=float(self.mean_stress(a_out)),
            touch_drop=-float(self.energy(a_in)) / self.period - spring(a_in),
            fold_drop=float(self.energy(a_out)) / self.period + spring(a_out),
        )
