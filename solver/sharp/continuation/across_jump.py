"""First prediction after a jump, from the branch before it.

A jump moves a few edges far and the others little. These go on as before, and one of them is often
the next to come to a fold.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array, Integers
from adhesis.solver.sharp.equilibrium.branch_point import Point, PreviousPoint
from adhesis.solver.sharp.gap.ends import outward


def carry_previous(earlier: PreviousPoint, before: Point, after: Point, near: float) -> Point:
    """Give the point ``after`` a jump a previous point, as if its branch had begun earlier.

    Edges that the jump moved by less than ``near`` (in θ) have the motion and the rate of the
    branch from ``earlier`` to ``before`` the jump; the others move straight. If the fastest edge is
    one that the jump moved, the point is returned as it is: nothing is known of the branch then.
    """
    k, side = divmod(int(np.argmax(np.abs(after.rate))), 2)
    if np.abs(before.gaps[:, side] - after.gaps[k, side]).min() >= near:
        return after
    way = before.at - earlier.at
    rate = after.rate.reshape(-1, 2).copy()
    motion = outward(after.gaps).reshape(-1, 2) * rate * way
    known_motion, known_rate = before.gaps - earlier.gaps, earlier.rate.reshape(-1, 2)
    for side in range(2):
        nearest = _nearest(before.gaps[:, side], after.gaps[:, side])
        kept = np.abs(before.gaps[nearest, side] - after.gaps[:, side]) < near
        motion[kept, side] = known_motion[nearest[kept], side]
        rate[kept, side] = known_rate[nearest[kept], side]
    return after.with_previous(PreviousPoint(after.at - way, rate.ravel(), after.gaps - motion))


def _nearest(places: Array, wanted: Array) -> Integers:
    """Find the nearest of some rising places to each of those wanted."""
    above = np.minimum(np.searchsorted(places, wanted), len(places) - 1)
    below = np.maximum(above - 1, 0)
    return np.where(wanted - places[below] < places[above] - wanted, below, above)
