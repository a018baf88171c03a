"""Find the patches of a set of contact nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Integers


def patch_ranges(mask: NDArray[np.bool_]) -> tuple[Integers, Integers]:
    """Find first node and number of nodes of every patch of a contact set, shape (patches,) each.

    Sorted by the first node; a patch may extend across the end of the period. A contact set without
    a free node is one patch that starts at node 0.
    """
    before = np.concatenate([mask[-1:], mask[:-1]])  # as np.roll, ten times as fast
    (first,) = np.nonzero(mask & ~before)
    if first.size == 0:
        whole = 1 if mask.any() else 0  # one patch without an end, or none
        return np.zeros(whole, dtype=np.int64), np.full(whole, mask.size)
    (behind,) = np.nonzero(before & ~mask)  # the node after the end of each patch
    if behind[0] < first[0]:  # the period begins within the last patch
        behind = np.append(behind[1:], behind[0] + mask.size)
    return first, behind - first
