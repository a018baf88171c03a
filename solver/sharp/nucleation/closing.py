"""Find where a gap first closes between two points of a branch.

Several gaps may have closed on the way. Each closes smoothly, while the least of all clearances has
a kink wherever another gap takes the lead: so each is interpolated by itself.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.tolerances import (
    TRIAL_FROM_END,
)


class ClearanceInterpolation:
    """Interpolation of the clearances of gaps that overlap at one end of a stretch of a branch.

    Parameters
    ----------
    clear, hit : float
        d where all of them are clear, and where all overlap.
    before, after : array, shape (gaps,)
        Their clearances there.
    clearances_of : callable
        Computes their clearances in another field.
    """

    def __init__(
        self,
        clear: float,
        hit: float,
        before: Array,
        after: Array,
        clearances_of: Callable[[GapField], Array],
    ) -> None:
        self._at = [clear, hit]
        self._values = [before, after]
        self._clearances_of = clearances_of

    def record(self, at: float, field: GapField) -> None:
        """Record the clearances in a field at d = ``at``."""
        self._at.append(at)
        self._values.append(self._clearances_of(field))

    def next_trial(self, clear: float, hit: float, wanted: float) -> float:
        """Return the share of the way from ``clear`` to ``hit`` at which to try next.

        There a gap first has the clearance ``wanted``, by a parabola through the clearances at both
        ends and at the nearest third d that was recorded.
        """
        low, high = self._at.index(clear), self._at.index(hit)
        way = hit - clear
        begin, end = self._values[low], self._values[high]
        sound = (begin > wanted) & (end < wanted) & (begin < np.inf)
        if not sound.any():
            return 0.5
        begin, end = begin[sound], end[sound]
        slope = end - begin
        bend = np.zeros(slope.shape)
        others = [i for i in range(len(self._at)) if i not in (low, high)]
        if others:
            third = min(others, key=lambda i: abs(self._at[i] - 0.5 * (clear + hit)))
            t = (self._at[third] - clear) / way
            bend = (self._values[third][sound] - begin - slope * t) / (t * (t - 1))
        # begin + slope t + bend t (t - 1) = wanted: between 0 and 1 there is one root
        b, c = slope - bend, begin - wanted
        root = np.sqrt(np.maximum(b * b - 4 * bend * c, 0.0))
        share = 2 * c / (root - b)
        first = float(np.where(np.isfinite(share), share, c / -slope).min())
        return min(max(first, TRIAL_FROM_END), 1 - TRIAL_FROM_END)
