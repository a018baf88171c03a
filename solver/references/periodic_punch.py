"""Koiter's periodic flat punch: equal flat strips in contact, cracks between them.

Strips |x| < a, period λ, on a half-space; rigid flat surface at mean distance s. With ψ = πx/λ,
y = sin²(πa/λ) and mean tension T = -p̄:

    σ(x) = -T cos ψ / sqrt(y - sin²ψ),   K = T sqrt(λ cot(πa/λ)),   s = -(λT/(πE*)) ln y.

Pull-off, where K²/(2E*) = γ: T = sqrt((2E*γ/λ) tan(πa/λ)). For a ≪ λ the load λT per unit depth
tends to that of one punch, sqrt(2πE*γa) (Kendall 1971); for a → λ/2 the tension grows without
bound: the gaps are isolated cracks of half-length c = λ/2 - a, T = sqrt(2E*γ/(πc)) (Griffith).

Source: Koiter, Ing.-Arch. 28 (1959) 168 (row of collinear cracks).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from adhesis.solver.model.profile import Array


def pull_off_stress(a: ArrayLike, period: float, modulus: float, work_of_adhesion: float) -> Array:
    """Compute p̄ in Pa (negative: tension) at the pull-off of strips of half-width a (m).

    ``period`` is λ in m, ``modulus`` is E* in Pa, ``work_of_adhesion`` is γ in J/m².
    """
    tan = np.tan(np.pi * np.asarray(a, dtype=float) / period)
    return np.asarray(-np.sqrt(2 * modulus * work_of_adhesion / period * tan))
