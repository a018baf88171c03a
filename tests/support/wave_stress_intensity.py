"""Stress intensity at the edges of a single wave, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from adhesis.solver.model.profile import Array
from adhesis.solver.references.single_wave import SingleWave


def stress_intensity(wave: SingleWave, a: ArrayLike, s: ArrayLike | None = None) -> Array:
    """Compute K in Pa·sqrt(m) with half-width a, at equilibrium or at separation s.

    Negative if surfaces overlap there.
    """
    psi = np.pi * np.asarray(a, dtype=float) / wave.period
    if s is None:
        tension = wave.adhesive_tension(a)
    else:
        tension = wave.full_contact_stress * np.sin(psi) ** 2 - wave.mean_stress_at(a, s)
    return np.asarray(tension * np.sqrt(wave.period / np.tan(psi)))
