"""Leave a saddle of the energy, along its softest modes, one edge leading."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.tolerances import EQUAL


def positions(gaps: Array, origin: float) -> Array:
    """Measure the distance of every edge to the right of ``origin``, in [0, 2π)."""
    return np.asarray((gaps.ravel() - origin) % (2 * np.pi))


def leaving_step(hessian: Array, limit: Array, order: Array) -> Array | None:
    """Step off a saddle, along its softest modes, up to the limit of an edge; None off a minimum.

    One edge leads, outwards; it is the one that moves most freely in these modes, of equal ones the
    first in ``order`` (positions). Where symmetry makes several modes equally soft, the step is the
    leading edge's projection on all of them: which of equivalent edges leads does not matter.
    """
    values, vectors = np.linalg.eigh(hessian)
    if not values[0] < 0:
        return None
    soft = vectors[:, values <= min(values[0] + EQUAL * np.abs(values).max(), 0.0)]
    freedom = (soft**2).sum(axis=1)
    equal = np.flatnonzero(freedom > (1 - EQUAL) * freedom.max())
    step = soft @ soft[equal[np.argmin(order[equal])]]
    return np.asarray(step / np.abs(step / limit).max())
