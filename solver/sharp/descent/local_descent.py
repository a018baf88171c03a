"""Descent that begins in a window on a known state.

Where a jump begins all gaps have just been solved, and only a few edges run: at a fold, where a
seed was put, where a gap closed. So the descent begins in a window there, the other gaps responding
linearly about the known state (``windowed_descent``), and goes on
through closing gaps and vanishing patches inside it. Where it comes to rest all gaps are solved
once more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.counters import Counters
from adhesis.solver.sharp.descent.gradient_flow import LOST, NARROW, descend
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw
from adhesis.solver.sharp.equilibrium.linear_exterior import Linearisation
from adhesis.solver.sharp.equilibrium.window import Window
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.ends import without_small

_BESIDE = 4  # gaps of a window on each side of what has changed
_WIDEST = 24  # changes further apart are not those of one window
_STEPS = 300  # steps in a window before all gaps are solved again

@dataclass(frozen=True, eq=False)
class Rest:
    """Where a descent in a window ended: all gaps, those of the window, and how."""

    gaps: Array
    local: Array
    ended: int


class Start:
    """A solved state that gaps are like, but for one place.

    Parameters
    ----------
    known : array, shape (L, 2)
        Its gaps.
    about : Linearisation
    leads : int
        The gap that leads where no gap is different.
    """

    def __init__(self, known: Array, about: Linearisation, leads: int) -> None:
        self._known, self._about, self._leads = known, about, leads
        self._windows: dict[tuple[int, int], Window] = {}  # two descents begin in one

    def window(self, gaps: Array, law: EdgeLaw, model: FieldModel) -> Window | None:
        """Window around what is different in ``gaps``; None if that lies in many places."""
        known = self._known
        count = len(known)
        place = np.minimum(np.searchsorted(gaps[:, 0], known[:, 0]), len(gaps) - 1)
        changed = np.flatnonzero((gaps[place] != known).any(axis=1))
        if changed.size == 0:
            changed = np.array([self._leads])
        # the widest run of gaps that are the same lies outside
        apart = np.diff(np.append(changed, changed[0] + count))
        widest = int(np.argmax(apart))
        begin = int(changed[(widest + 1) % changed.size])
        width = count - int(apart[widest]) + 1 + 2 * _BESIDE
        if width > min(_WIDEST, count - 2):
            return None
        place_of = (begin - _BESIDE) % count, width
        if place_of not in self._windows:
            self._windows[place_of] = Window(known, self._about, *place_of, law, model)
        return self._windows[place_of]

    def descend(
        self,
        gaps: Array,
        at: float,
        law: EdgeLaw,
        model: FieldModel,
        count: Counters,
        smallest: float,
        *,
        equal_speeds: bool,
    ) -> Rest | None:
        """Descend at d = ``at`` in a window from ``gaps``; None if there is none, or no field.

        Gaps and patches shorter than ``smallest`` are left out on the way; the work is counted.
        """
        window = self.window(gaps, law, model)
        if window is None or not window.exterior_is_stable:
            return None
        local, orders = window.restrict(gaps), window.orders
        while True:
            if len(local) != len(orders):
                orders = np.zeros(len(local), dtype=np.int64)
            local, ended, fields, tangents, orders, _, _, _ = descend(
                local, at, _STEPS, orders, equal_speeds, law, model, window.exterior,
                np.empty((0, local.size)), False,
            )  # fmt: skip
            count.fields += fields
            count.descent_steps += fields
            count.derivatives += tangents
            rest = without_small(local, smallest) if ended == NARROW else None
            if rest is None or len(rest) < 3 or (rest[-1] != local[-1]).any():
                break
            local = rest
        if ended == LOST:
            return None
        found = window.extend(local, orders, at)
        return Rest(found, local, ended) if np.isfinite(found).all() else None
