"""A wavy parabola on a half-space, with adhesion: small-scale hysteresis in one patch.

Rigid h = -x²/(2R) - A (1 - cos kx), symmetric contact |x| < a without a gap inside, line load P per
unit depth. For a symmetric profile the load without edge singularity is
½E* ∫ x (-h') / sqrt(a² - x²) dx over |x| < a; the waves add ½E*Ak ∫ x sin kx / sqrt(a² - x²) dx, so

    P(a) = πE*a²/(4R) + (π/2) E* A k a J1(ka) - sqrt(2πE*γa).

P(a) folds where dP/da = 0; between two folds the contact cannot rest under given load, and an edge
that is driven past one jumps: loading and unloading jump at different loads.

Source: Guduru, J. Mech. Phys. Solids 55 (2007) 445 (for the sphere); here the plane-strain form.
Valid while the surfaces do not overlap inside or reopen, i.e. for waves shallow against γ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import j0, j1

from adhesis.solver.model.profile import Array


@dataclass(frozen=True)
class WavyParabola:
    """The load curve of a wavy parabola.

    Parameters
    ----------
    radius : float
        R in m.
    amplitude, wave_number : float
        A in m (a crest at x = 0 if positive) and k in rad/m.
    modulus : float
        E* in Pa.
    work_of_adhesion : float
        γ in J/m².
    """

    radius: float
    amplitude: float
    wave_number: float
    modulus: float
    work_of_adhesion: float

    def load(self, a: ArrayLike) -> Array:
        """P in N/m of the equilibrium with half-width a in m."""
        a = np.asarray(a, dtype=float)
        k = self.wave_number
        smooth = np.pi * self.modulus * a**2 / (4 * self.radius)
        waves = 0.5 * np.pi * self.modulus * self.amplitude * k * a * j1(k * a)
        adhesion = np.sqrt(2 * np.pi * self.modulus * self.work_of_adhesion * a)
        return np.asarray(smooth + waves - adhesion)

    def load_slope(self, a: ArrayLike) -> Array:
        """dP/da in N/m² (negative: unstable under given load)."""
        a = np.asarray(a, dtype=float)
        k = self.wave_number
        smooth = np.pi * self.modulus * a / (2 * self.radius)
        waves = 0.5 * np.pi * self.modulus * self.amplitude * k**2 * a * j0(k * a)
        adhesion = 0.5 * np.sqrt(2 * np.pi * self.modulus * self.work_of_adhesion / a)
        return np.asarray(smooth + waves - adhesion)

    def folds(self, a_max: float) -> Array:
        """Half-widths in m, ascending, where dP/da changes sign in (0, a_max].

        The sampling that brackets them has 200 points per wavelength 2π/k; two folds closer than
        that (a wave about to lose its folds) may be missed together.
        """
        count = max(1000, int(200 * a_max * self.wave_number / (2 * np.pi)))
        a = a_max * np.arange(1, count + 1) / count
        slope = self.load_slope(a)
        turns = np.flatnonzero(np.sign(slope[1:]) != np.sign(slope[:-1]))
        return np.array(
            [brentq(lambda b: float(self.load_slope(b)), a[i], a[i + 1]) for i in turns]
        )
