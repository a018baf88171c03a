"""Full contact of any periodic profile.

The surface of the half-space follows the profile everywhere, v = h (zero mean). From
v_q = 2σ_q/(E*|q|) the stress, up to its mean, and the elastic energy per nominal area are

    σ_q = E*|q| h_q / 2,      U/λ = ½ mean(σ h) = ½ Σ_{m≥1} E* m q0 |a_m|²,

for one wave A cos(qx): σ = ½E*qA cos(qx) and E*qA²/8.

Source: Johnson, Contact Mechanics (1985), section 13.2; Persson, Surf. Sci. Rep. 61 (2006) 201.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from adhesis.solver.model.profile import Array, Profile


def full_contact_stress(profile: Profile, modulus: float, x: ArrayLike) -> Array:
    """Compute σ(x) - p̄ in Pa at positions x in m, shape of ``x``; ``modulus`` is E* in Pa."""
    m = np.flatnonzero(profile.coefficients)
    amplitude = modulus * m * profile.q0 * profile.coefficients[m]  # 2 · E*|q| a_m/2
    phase = np.multiply.outer(np.asarray(x, dtype=float) * profile.q0, m)
    return np.asarray(np.cos(phase) @ amplitude.real - np.sin(phase) @ amplitude.imag)


def full_contact_energy(profile: Profile, modulus: float) -> float:
    """Compute the elastic energy in J/m² of nominal area; ``modulus`` is E* in Pa."""
    m = np.arange(profile.coefficients.size)
    return float(0.5 * modulus * profile.q0 * np.sum(m * np.abs(profile.coefficients) ** 2))
