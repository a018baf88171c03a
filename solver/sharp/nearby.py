"""Descent that begins in a window on a known state, and windows as Python uses them.

Where a jump begins all gaps have just been solved, and only a few edges run: at a fold, where a
seed was put, where a gap closed. So the descent begins in a window there, the other gaps responding
linearly about the known state (:mod:`adhesis.solver.sharp.window`), and goes on through closing
gaps and vanishing patches inside it. Where it comes to rest all gaps are solved once more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.profile import Array
from adhesis.solver.sharp.balance import Law
from adhesis.solver.sharp.counters import Counters
from adhesis.solver.sharp.descent import LOST, NARROW, descend, limits
from adhesis.solver.sharp.gaps import without_small
from adhesis.solver.sharp.rules import RULES
from adhesis.solver.sharp.source import Panels
from adhesis.solver.sharp.window import About, following, open_window

_BESIDE = 4  # gaps of a window on each side of what has changed
_WIDEST = 24  # changes further apart are not those of one window
_STEPS = 300  # steps in a window before all gaps are solved again

Kinds = NDArray[np.int64]


class Window:
    """A window on a solved state: its gaps, the others as one gap more, the last one.

    Parameters
    ----------
    gaps : array, shape (L, 2)
        All gaps of the state.
    about : About
        What is known of it.
    first, width : int
        First gap of the window, and how many.
    law : Law
    panels : Panels

    Attributes
    ----------
    gaps : array, shape (width + 1, 2)
        Angles rise beyond the period where the window goes on at its beginning.
    kinds : int array, shape (width + 1,)
    panels : Panels
        With the outside.
    sound : bool
        Whether the others are stable by themselves.
    """

    def __init__(
        self, gaps: Array, about: About, first: int, width: int, law: Law, panels: Panels
    ) -> None:
        self._all, self._about, self._law = gaps, about, law
        self.gaps, outside, self._outer = open_window(
            about, first, width, np.inf, law, RULES, panels
        )
        inside = (first + np.arange(width)) % len(gaps)
        self.kinds: Kinds = np.append(about.of.kinds[inside], 0)
        self.panels = panels._replace(outside=outside)
        self.sound = bool(self._outer.response.negative == 0)
        # beyond the middle of the patch in which the period ends
        self._end = 0.5 * (gaps[-1, 1] + gaps[0, 0] + 2 * np.pi)

    def rows(self, gaps: Array) -> Array:
        """Of other gaps of all, those inside the window, and the outside as the last."""
        left, right = self.gaps[0, 0], self.gaps[-2, 1]
        both = np.concatenate([gaps, gaps + 2 * np.pi])
        inside = both[(both[:, 0] >= left) & (both[:, 1] <= right)]
        return np.concatenate([inside, self.gaps[-1:]])

    def everywhere(self, local: Array, kinds: Kinds, at: float) -> Array:
        """All gaps at d = ``at`` for those of the window, the others following."""
        of, outer = self._about.of, self._outer
        motion = following(
            local, at, kinds, outer, self._about, limits(of.table, self._law.longest), self._law,
            RULES, self.panels,
        )  # fmt: skip
        outside = self._all[outer.order] + motion.reshape(-1, 2) * [1.0, -1.0]
        inside = local[:-1].copy()
        inside[inside.mean(axis=1) > self._end] -= 2 * np.pi
        gaps = np.concatenate([inside, outside])
        return np.asarray(gaps[np.argsort(gaps[:, 0], kind="stable")])


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
    about : About
    leads : int
        The gap that leads where no gap is different.
    """

    def __init__(self, known: Array, about: About, leads: int) -> None:
        self._known, self._about, self._leads = known, about, leads
        self._windows: dict[tuple[int, int], Window] = {}  # two descents begin in one

    def window(self, gaps: Array, law: Law, panels: Panels) -> Window | None:
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
            self._windows[place_of] = Window(known, self._about, *place_of, law, panels)
        return self._windows[place_of]

    def descend(
        self,
        gaps: Array,
        at: float,
        law: Law,
        panels: Panels,
        count: Counters,
        smallest: float,
        *,
        equal_speeds: bool,
    ) -> Rest | None:
        """Descend at d = ``at`` in a window from ``gaps``; None if there is none, or no field.

        Gaps and patches shorter than ``smallest`` are left out on the way; the work is counted.
        """
        window = self.window(gaps, law, panels)
        if window is None or not window.sound:
            return None
        local, kinds = window.rows(gaps), window.kinds
        while True:
            if len(local) != len(kinds):
                kinds = np.zeros(len(local), dtype=np.int64)
            local, ended, fields, tangents, kinds, _, _, _ = descend(
                local, at, _STEPS, kinds, equal_speeds, law, RULES, window.panels,
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
        found = window.everywhere(local, kinds, at)
        return Rest(found, local, ended) if np.isfinite(found).all() else None
