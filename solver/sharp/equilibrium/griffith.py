"""Griffith's condition at the edges, C_e = C_c, and motions of the edges."""

from __future__ import annotations

import numpy as np

from adhesis.solver._kernels import EdgeLaw
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.gap.ends import lengths_of, outward
from adhesis.solver.sharp.tolerances import CLOSING_SHARE


def imbalance(opening: Array, gaps: Array, law: EdgeLaw) -> Array:
    """Compute C_e - C_c from C at every edge, positive where contact recedes, shape (2L,)."""
    return np.asarray(opening - law.critical_of(gaps, opening))


def move_edges(gaps: Array, step: Array) -> Array:
    """Move the contact outwards by ``step`` at every edge."""
    return np.asarray(gaps + (outward(gaps) * step).reshape(-1, 2))


def step_limits(gaps: Array, longest: float) -> Array:
    """Limit the step of each edge: ``longest``, or a share of the gap or patch it may close."""
    length, patch = lengths_of(gaps)
    beside = np.stack([np.roll(patch, 1), patch], axis=1)
    closing = CLOSING_SHARE * np.minimum(length[:, None], beside)
    return np.minimum(longest, closing).ravel()
