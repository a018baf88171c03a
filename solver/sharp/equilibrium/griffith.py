"""Griffith's condition at the edges, C_e = C_c, limits of steps, and steps off a saddle."""

from __future__ import annotations

import numpy as np

from adhesis.solver._kernels import CLOSING_SHARE, EdgeLaw
from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.threads import one_thread
from adhesis.solver.sharp.gap.ends import lengths_of
from adhesis.solver.sharp.tolerances import EQUAL


def imbalance(opening: Array, gaps: Array, law: EdgeLaw) -> Array:
    """Compute C_e - C_c from C at every edge, positive where contact recedes, shape (2L,)."""
    return np.asarray(opening - law.critical_of(gaps, opening))


def step_limits(gaps: Array, longest: float) -> Array:
    """Limit the step of each edge: ``longest``, or a share of the gap or patch it may close."""
    length, patch = lengths_of(gaps)
    beside = np.stack([np.roll(patch, 1), patch], axis=1)
    closing = CLOSING_SHARE * np.minimum(length[:, None], beside)
    return np.minimum(longest, closing).ravel()


def positions(gaps: Array, origin: float) -> Array:
    """Measure the distance of every edge to the right of ``origin``, in [0, 2π)."""
    return np.asarray((gaps.ravel() - origin) % (2 * np.pi))


def leaving_step(hessian: Array, limit: Array, order: Array) -> Array | None:
    """Step off a saddle, along its softest modes, up to the limit of an edge; None off a minimum.

    One edge leads, outwards; it is the one that moves most freely in these modes, of equal ones the
    first in ``order`` (positions). Where symmetry makes several modes equally soft, the step is the
    leading edge's projection on all of them: which of equivalent edges leads does not matter.
    """
    with one_thread():
        values, vectors = np.linalg.eigh(hessian)
    if not values[0] < 0:
        return None
    soft = vectors[:, values <= min(values[0] + EQUAL * np.abs(values).max(), 0.0)]
    freedom = (soft**2).sum(axis=1)
    equal = np.flatnonzero(freedom > (1 - EQUAL) * freedom.max())
    step = soft @ soft[equal[np.argmin(order[equal])]]
    return np.asarray(step / np.abs(step / limit).max())
