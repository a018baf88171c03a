"""A window of few gaps on a solved state of many, as Python uses it."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.equilibrium.griffith import Law, step_limits
from adhesis.solver.sharp.equilibrium.linear_exterior import About, following, open_window
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import RULES, Kinds


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
        limit = step_limits(of.table, self._law.longest)
        motion = following(
            local, at, kinds, outer, self._about, limit, self._law, RULES, self.panels
        )
        outside = self._all[outer.order] + motion.reshape(-1, 2) * [1.0, -1.0]
        inside = local[:-1].copy()
        inside[inside.mean(axis=1) > self._end] -= 2 * np.pi
        gaps = np.concatenate([inside, outside])
        return np.asarray(gaps[np.argsort(gaps[:, 0], kind="stable")])
