"""How a branch goes on beyond two of its points: a predictor, and the fold that may lie ahead.

Near a fold at d_c the edges move as a δ + 2b sqrt(δ), δ = |d - d_c|, and the rate of the edge that
leads goes as 1/sqrt(δ): two rates tell where it would be infinite, ahead or behind. Elsewhere the
rates of two points give a parabola.
"""

from __future__ import annotations

import numpy as np

from solver.profile import Array
from solver.sharp.edges import Point
from solver.sharp.gaps import outward

_FAR = 4.0  # a course is not believed beyond so many times the way between its points


class Course:
    """The course of a branch through two points; beyond one point alone it is straight.

    Parameters
    ----------
    point : Point
        With the point before it, if that is known.

    Attributes
    ----------
    fastest : float
        Largest |dn/dd| of an edge at ``point``.
    ahead : float
        Distance in d of the fold beyond ``point``; inf if none is seen.
    """

    def __init__(self, point: Point) -> None:
        self.point = point
        self.way, self.ahead, self._fold = 0.0, np.inf, np.inf
        rate = point.rate
        lead = int(np.argmax(np.abs(rate)))
        self.fastest = abs(float(rate[lead]))
        earlier = point.before
        if earlier is None or earlier.rate.shape != rate.shape or earlier.at == point.at:
            return
        self.way = point.at - earlier.at
        self._before = earlier.rate
        before = float(earlier.rate[lead])
        if before * rate[lead] > 0 and self.fastest != abs(before):
            ratio = (before / float(rate[lead])) ** 2  # δ of this point over δ of the earlier one
            fold = abs(self.way) * ratio / (1 - ratio)  # negative: behind
            if abs(fold) < _FAR * abs(self.way):
                self._fold = fold
                self.ahead = fold if fold > 0 else np.inf

    def gaps(self, at: float) -> Array:
        """Gaps that are expected at d = ``at``."""
        point = self.point
        on = at - point.at
        rate = point.rate
        motion = rate * on
        if on * self.way > 0 and abs(on) < _FAR * abs(self.way):
            if np.isfinite(self._fold):
                root = np.sqrt(abs(self._fold))
                first = np.sqrt(abs(self._fold + abs(self.way)))
                last = np.sqrt(max((self._fold - abs(on)) * np.sign(self._fold), 0.0))
                b = (rate - self._before) / (1 / root - 1 / first)
                motion = (rate - b / root) * on + 2 * b * np.copysign(abs(root - last), on)
            else:
                motion += (rate - self._before) * on * on / (2 * self.way)
        gaps: Array = point.gaps + (outward(point.gaps) * motion).reshape(-1, 2)
        return gaps

    def reach(self, most: float, finest: float) -> float:
        """Step along which no edge is expected to move further than ``most``.

        Towards a fold it leads near to it, and from next to it (``finest``) across.
        """
        straight: float = most / max(self.fastest, 1e-300)
        if np.isinf(self.ahead):
            return straight
        if self.ahead < 0.8 * finest:
            return finest
        root = np.sqrt(self.ahead)
        left = max(root - most / (2 * self.fastest * root), 0.0) ** 2
        return float(self.ahead - max(left, 0.1 * self.ahead, 0.4 * finest))
