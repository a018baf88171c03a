"""Word what is known of loops whose mean stress does not reach their preload."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from adhesis.ensemble.quantities import stress_text

INSTEAD = "Rougher profiles, a stiffer material or a smaller preload let loops reach it"


def highest_stress(loading: ArrayLike) -> float:
    """Return the highest mean stress in Pa at the load steps of loops, NaN where there is none."""
    return float(np.max(np.nan_to_num(loading, nan=-np.inf)))


def most_reached(highest: float) -> str:
    """Return "at load steps the mean stress is at most 3 kPa", or that all contact is in tension.

    Between load steps it may be higher, up to a jump: rows of results hold load steps alone.
    """
    if highest <= 0:
        return "at load steps the mean stress is a tension wherever there is contact"
    return f"at load steps the mean stress is at most {stress_text(highest)}"
