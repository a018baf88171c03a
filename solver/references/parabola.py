"""One parabola (cylinder) on a half-space, with adhesion: JKR in plane strain.

Rigid h = -x²/(2R), contact |x| < a, line load P per unit depth (compression positive):

    σ(x) = (E*/(2R)) sqrt(a² - x²) - sqrt(2E*γa/π) / sqrt(a² - x²)
    P(a) = πE*a²/(4R) - sqrt(2πE*γa)

The load is least where dP/da = 0: a = (2R²γ/(πE*))^(1/3), P = -(3/4)(4πE*γ²R)^(1/3). There is no
separation: the displacement of a half-plane under a line load has no finite reference.

Sources: Barquins, J. Adhesion 26 (1988) 1; Chaudhury, Weaver, Hui & Kramer, J. Appl. Phys. 80
(1996) 30.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from adhesis.solver.model.profile import Array


def parabola_load(a: ArrayLike, radius: float, modulus: float, work_of_adhesion: float) -> Array:
    """Compute P in N/m of the equilibrium with half-width a in m.

    ``radius`` is R in m, ``modulus`` is E* in Pa, ``work_of_adhesion`` is γ in J/m².
    """
    a = np.asarray(a, dtype=float)
    repulsion = np.pi * modulus * a**2 / (4 * radius)
    return np.asarray(repulsion - np.sqrt(2 * np.pi * modulus * work_of_adhesion * a))


def parabola_pull_off(
    radius: float, modulus: float, work_of_adhesion: float
) -> tuple[float, float]:
    """Compute the half-width in m and the load in N/m (negative) at the least load."""
    a = (2 * radius**2 * work_of_adhesion / (np.pi * modulus)) ** (1 / 3)
    return float(a), float(-0.75 * (4 * np.pi * modulus * work_of_adhesion**2 * radius) ** (1 / 3))
