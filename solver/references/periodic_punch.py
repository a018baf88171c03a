"""Koiter's periodic flat punch: equal flat strips in contact, cracks between them.

Strips |x| < a, period λ, on a half-space; rigid flat surface at mean distance s. With ψ = πx/λ,
y = sin²(πa/λ) and mean tension T = -p̄:

    σ(x) = -T cos ψ / sqrt(y - sin²ψ),   K = T sqrt(λ cot(πa/λ)),   s = -(λT/(πE*)) ln y.

Pull-off, where K²/(2E*) = γ: T = sqrt((2E*γ/λ) tan(πa/λ)). For a ≪ λ the load λT per unit depth
tends to that of one punch, sqrt(2πE*γa) (Kendall 1971); for a → λ/2 the tension grows without
bound: what stays open are isolated cracks of half-length c = λ/2 - a, T = sqrt(2E*γ/(πc))
(Griffith).

Source: Koiter, Ing.-Arch. 28 (1959) 168 (row of collinear cracks).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from adhesis.solver.model.profile import Array


def pull_off_stress(a: ArrayLike, period: float, modulus: float, work_of_adhesion: float) -> Array:
    """p̄ in Pa (negative: tension) at which strips of half-width a (m) come off.

    ``period`` is λ in m, ``modulus`` is E* in Pa, ``work_of_adhesion`` is γ in J/m².
    """
    tan = np.tan(np.pi * np.asarray(a, dtype=float) / period)
    return np.asarray(-np.sqrt(2 * modulus * work_of_adhesion / period * tan))


def punch_stress(x: ArrayLike, a: float, period: float, mean_stress: float) -> Array:
    """σ(x) in Pa at positions x in m (a strip is centred on 0) under the mean stress p̄ in Pa."""
    u = np.sin(np.pi * np.asarray(x, dtype=float) / period)
    inside = np.sin(np.pi * a / period) ** 2 - u**2
    root = np.sqrt(np.where(inside > 0, inside, 1.0))
    return np.where(inside > 0, mean_stress * np.sqrt(1 - u**2) / root, 0.0)


def punch_separation(a: ArrayLike, period: float, modulus: float, mean_stress: float) -> Array:
    """Mean gap s in m of strips of half-width a (m) under the mean stress p̄ in Pa."""
    y = np.sin(np.pi * np.asarray(a, dtype=float) / period) ** 2
    return np.asarray(mean_stress * period / (np.pi * modulus) * np.log(y))


def punch_stress_intensity(a: ArrayLike, period: float, mean_stress: float) -> Array:
    """K in Pa·sqrt(m) at the edges of strips of half-width a (m) under the mean stress p̄ in Pa."""
    psi = np.pi * np.asarray(a, dtype=float) / period
    return np.asarray(-mean_stress * np.sqrt(period / np.tan(psi)))
