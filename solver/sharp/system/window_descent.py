"""Descent of many gaps in windows of few, the others responding linearly.

In a jump a few edges run at a time. The gaps around them are a window, whose edges descend as those
of few gaps do (``gradient_flow``), through gaps that close and patches that vanish in it. All other
gaps act on it as a linear exterior, their edges following by their tangent. When the window has
come to rest, or after some steps, the response of what has moved is renewed, and the next window
chosen (``newton_approach``).

The first window of a jump is opened on the known state from which its gaps differ in one place: at
a fold, where a seed was put, where a gap closed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.edge_forces import FlowProblem
from adhesis.solver.sharp.descent.gradient_flow import (
    AT_REST,
    NO_FIELD,
    VANISHED,
    Descent,
    descend,
)
from adhesis.solver.sharp.descent.newton_approach import Approach
from adhesis.solver.sharp.descent.track import Track
from adhesis.solver.sharp.descent.trajectory import Comparison
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.linear_response import LinearResponse
from adhesis.solver.sharp.equilibrium.window import Window
from adhesis.solver.sharp.gap.ends import without_small
from adhesis.solver.sharp.system.edge_problem import EdgeProblem
from adhesis.solver.sharp.system.kept_responses import KeptResponses
from adhesis.solver.sharp.tolerances import (
    FIRST_WINDOW_MARGIN,
    FIRST_WINDOW_WIDEST,
    FOLLOWING_SHARE,
    FURTHEST_FOLLOWING,
    MOST_SHORT_WINDOWS,
    SAME_REST,
    WINDOW_FIELDS,
    WINDOW_HALF_WIDTH,
    WINDOW_WIDEST,
)


class WindowDescent(NamedTuple):
    """Descent in a window.

    Attributes
    ----------
    gaps : array, shape (L, 2)
        All gaps, those outside having followed.
    window_gaps : array, shape (width + 1, 2)
        Those of the window, the last one being the exterior.
    event : int
        An event of ``gradient_flow``.
    progress : float
        Longest motion of an edge inside; infinite where a gap or patch has gone.
    """

    gaps: Array
    window_gaps: Array
    event: int
    progress: float


def descend_in_window(
    window: Window,
    gaps: Array,
    prescribed: float,
    problem: EdgeProblem,
    law: EdgeLaw,
    *,
    equal_speeds: bool,
    is_first: bool,
) -> WindowDescent | None:
    """Descend from ``gaps`` inside a window, and let the others follow.

    The descent goes on where a gap or patch has gone, as long as the others follow linearly. None
    where it comes to edges without a field, or in a first window at once to others that follow too
    far: next to a fold of others, what runs inside is not what runs.
    """
    flow = FlowProblem(law, problem.model, window.exterior)
    inside, orders = window.restrict(gaps), window.orders
    begun, fields = inside, 0
    reached: WindowDescent | None = None
    while True:
        if len(inside) != len(orders):  # those of gaps that have gone are not known
            orders = np.zeros(len(inside), dtype=np.int64)
        alone = Comparison(np.empty((0, inside.size)), False, 0)
        most = WINDOW_FIELDS - fields
        found: Descent = descend(inside, prescribed, most, orders, equal_speeds, flow, alone)
        inside, orders = found.gaps, found.orders
        problem.count.add_descent(found.fields, found.tangents)
        fields += found.fields
        if found.event == NO_FIELD:
            return reached
        everywhere, following = window.extend(inside, orders, prescribed)
        # written so that NaN is too far
        is_linear = following <= FURTHEST_FOLLOWING * law.longest_step
        if not (is_linear or (reached is None and not is_first and math.isfinite(following))):
            return reached
        progress = math.inf
        if inside.shape == begun.shape:
            progress = float(np.abs(inside[:-1] - begun[:-1]).max())
        reached = WindowDescent(everywhere, inside, found.event, progress)
        left = without_small(inside, law.smallest) if found.event == VANISHED else None
        if left is None or len(left) < 3 or (left[-1] != inside[-1]).any():
            return reached
        if not is_linear or fields >= WINDOW_FIELDS:
            return reached
        inside = left


class KnownState:
    """An equilibrium, from which gaps differ in one place only.

    Parameters
    ----------
    problem : EdgeProblem
    responses : KeptResponses
    gaps : array, shape (L, 2)
        Gaps of the equilibrium.
    prescribed : float
        d.
    leading_gap : int
        Middle of the window where no gap differs.
    """

    def __init__(
        self,
        problem: EdgeProblem,
        responses: KeptResponses,
        gaps: Array,
        prescribed: float,
        leading_gap: int,
    ) -> None:
        self._problem, self._responses = problem, responses
        self._gaps, self._prescribed, self._leading_gap = gaps, prescribed, leading_gap
        # a descent and the one that it is compared with begin in one window
        self._windows: dict[tuple[int, int, int], Window] = {}

    def window(self, gaps: Array) -> Window | None:
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
        width = count - int(apart[longest]) + 1 + 2 * FIRST_WINDOW_MARGIN
        if width > min(FIRST_WINDOW_WIDEST, count - 2):
            return None
        span = (begin - FIRST_WINDOW_MARGIN) % count, width
        about = self._responses.at(known, self._prescribed)
        if about is None:
            return None
        place = *span, about.version
        if place not in self._windows:
            law, model = self._problem.law, self._problem.model
            self._windows[place] = Window(known, about.response, *span, np.inf, law, model)
        return self._windows[place]


class Windows:
    """The windows of one descent, one after the other, and when it is at its end.

    Parameters
    ----------
    problem : EdgeProblem
    law : EdgeLaw
    prescribed : float
        d.
    equal_speeds : bool
    """

    def __init__(
        self, problem: EdgeProblem, law: EdgeLaw, prescribed: float, equal_speeds: bool
    ) -> None:
        self._problem, self._law = problem, law
        self._prescribed, self._equal_speeds = prescribed, equal_speeds
        self._half, self._short = WINDOW_HALF_WIDTH, 0
        self.is_at_end = False

    def first(self, start: KnownState, gaps: Array, track: Track) -> WindowDescent | None:
        """Descend in the window where gaps differ from a known state; None if there is none.

        Where it comes to rest is noted in the track or, with equal speeds, compared with that.
        """
        window = start.window(gaps)
        if window is None or not window.exterior_is_stable:
            return None
        found = self._descend(window, gaps, True)
        if found is not None and found.event == AT_REST:
            rest = found.window_gaps
            if not self._equal_speeds:
                track.rest = rest
            elif track.rest is not None and track.rest.shape == rest.shape:
                apart = np.abs(track.rest - rest).max()
                track.rejoined = bool(apart < SAME_REST * self._problem.wave)
        return found

    def next(self, response: LinearResponse, approach: Approach) -> WindowDescent | None:
        """Descend in the window that Newton's steps ask for; None if it has no field.

        If the edges outside cannot follow they are held.
        """
        gaps, law = approach.gaps, self._law
        count = len(gaps)
        width = min(2 * self._half + 1, count - 2)
        first = (approach.leading - width // 2) % count
        found = None
        for following in (FOLLOWING_SHARE * law.longest_step, 0.0):
            model = self._problem.model
            window = Window(gaps, response, first, width, following, law, model)
            if window.exterior_is_stable or following == 0:
                found = self._descend(window, gaps, False)
            if found is not None:
                self._judge(found, approach, count)
                break
        return found

    def _descend(self, window: Window, gaps: Array, is_first: bool) -> WindowDescent | None:
        return descend_in_window(
            window, gaps, self._prescribed, self._problem, self._law,
            equal_speeds=self._equal_speeds, is_first=is_first,
        )  # fmt: skip

    def _judge(self, found: WindowDescent, approach: Approach, count: int) -> None:
        """Widen the next window where nothing moved in the last, or end the descent."""
        law = self._law
        self._short = 0 if found.progress > law.longest_step else self._short + 1
        many = self._short > MOST_SHORT_WINDOWS
        if found.progress > law.rest_step and not many:
            self._half = WINDOW_HALF_WIDTH
            return
        widest = 2 * self._half + 1 >= count - 2 or self._half >= WINDOW_WIDEST
        next_to_fold = approach.longest < law.rest_step
        self.is_at_end = widest or many or next_to_fold
        self._half = min(2 * self._half, WINDOW_WIDEST)
