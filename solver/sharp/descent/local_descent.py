"""Descent that begins in a window on a known equilibrium.

Where a jump begins all gaps have just been solved, and only a few edges run: at a fold, where a
seed was put, where a gap closed. So the descent begins in a window there, the other gaps responding
linearly about the known state (``windowed_descent``), and goes on through closing gaps and
vanishing patches inside it. Where it comes to rest all gaps are solved once more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.counters import Counters
from adhesis.solver.sharp.descent.edge_forces import FlowProblem
from adhesis.solver.sharp.descent.gradient_flow import NO_FIELD, VANISHED, Descent, descend
from adhesis.solver.sharp.descent.trajectory import Comparison
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw
from adhesis.solver.sharp.equilibrium.linear_response import LinearResponse
from adhesis.solver.sharp.equilibrium.window import Window
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.ends import without_small
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import (
    LOCAL_WINDOW_FIELDS,
    LOCAL_WINDOW_MARGIN,
    LOCAL_WINDOW_WIDEST,
)


@dataclass(frozen=True, eq=False)
class LocalDescent:
    """Result of a descent in a window: all gaps, those of the window, and the event."""

    gaps: Array
    window_gaps: Array
    event: int


class Response(Protocol):
    """Linear response about gaps, until its version changes."""

    response: LinearResponse
    version: int


class Responses(Protocol):
    """Linear responses of the gaps of one problem."""

    def at(self, gaps: Array, prescribed: float) -> Response | None:
        """Return the response about these gaps; None if they have no field."""
        ...


class KnownState:
    """A solved equilibrium from which gaps differ in one place only.

    Parameters
    ----------
    responses : Responses
    gaps : array, shape (L, 2)
        Gaps of the equilibrium.
    prescribed : float
        d.
    leading_gap : int
        Middle of the window where no gap differs.
    """

    def __init__(
        self, responses: Responses, gaps: Array, prescribed: float, leading_gap: int
    ) -> None:
        self._responses, self._gaps, self._prescribed = responses, gaps, prescribed
        self._leading_gap = leading_gap
        self._windows: dict[tuple[int, int, int], Window] = {}  # two descents begin in one

    def window(self, gaps: Array, law: EdgeLaw, model: FieldModel) -> Window | None:
        """Open a window around the gaps that differ; None if they lie in many places."""
        known = self._gaps
        count = len(known)
        nearest = np.minimum(np.searchsorted(gaps[:, 0], known[:, 0]), len(gaps) - 1)
        differs = (gaps[nearest] != known).any(axis=1)
        if not differs.any() and len(gaps) > count:  # a crack lies in the patch before this gap
            new = np.setdiff1d(gaps[:, 0], known[:, 0])
            differs[np.searchsorted(known[:, 0], new) % count] = True
        changed = np.flatnonzero(differs)
        if changed.size == 0:
            changed = np.array([self._leading_gap])
        # the longest run of unchanged gaps lies outside
        apart = np.diff(np.append(changed, changed[0] + count))
        longest = int(np.argmax(apart))
        begin = int(changed[(longest + 1) % changed.size])
        width = count - int(apart[longest]) + 1 + 2 * LOCAL_WINDOW_MARGIN
        if width > min(LOCAL_WINDOW_WIDEST, count - 2):
            return None
        span = (begin - LOCAL_WINDOW_MARGIN) % count, width
        about = self._responses.at(known, self._prescribed)
        if about is None:
            return None
        place = *span, about.version
        if place not in self._windows:
            self._windows[place] = Window(known, about.response, *span, law, model)
        return self._windows[place]

    def descend(
        self,
        gaps: Array,
        prescribed: float,
        law: EdgeLaw,
        model: FieldModel,
        count: Counters,
        smallest: float,
        *,
        equal_speeds: bool,
    ) -> LocalDescent | None:
        """Descend at d = ``prescribed`` in a window; None if there is none, or no field.

        Gaps and patches shorter than ``smallest`` are left out on the way; the work is counted.
        """
        window = self.window(gaps, law, model)
        if window is None or not window.exterior_is_stable:
            return None
        system = FlowProblem(law, model, window.exterior)
        inside, orders = window.restrict(gaps), window.orders
        while True:
            found = _descend_inside(inside, prescribed, orders, equal_speeds, system)
            inside, orders = found.gaps, found.orders
            count.fields += found.fields
            count.descent_steps += found.fields
            count.derivatives += found.tangents
            left = without_small(inside, smallest) if found.event == VANISHED else None
            if left is None or len(left) < 3 or (left[-1] != inside[-1]).any():
                break
            inside = left
        if found.event == NO_FIELD:
            return None
        everywhere = window.extend(inside, orders, prescribed)
        if everywhere is None:
            return None
        return LocalDescent(everywhere, inside, found.event)


def _descend_inside(
    inside: Array, prescribed: float, orders: Integers, equal_speeds: bool, system: FlowProblem
) -> Descent:
    """Descend in a window, from orders that its gaps may have had before some went."""
    if len(inside) != len(orders):
        orders = np.zeros(len(inside), dtype=np.int64)
    alone = Comparison(np.empty((0, inside.size)), False, 0)
    return descend(inside, prescribed, LOCAL_WINDOW_FIELDS, orders, equal_speeds, system, alone)
