"""A stretch of a branch on which few edges move: a window follows, the rest responds linearly.

Towards a fold the edges around one place move ever faster while all others hardly do. They are
followed in a window (:mod:`solver.sharp.outside`), at the cost of a field of a few gaps, as long as
the others stay near the state about which they are linear. A point found so is confirmed, that is
solved with all gaps, before a state, a touch or a jump is told from it: an edge elsewhere may have
passed a fold of its own, which no linear response shows. Then there is no such equilibrium, and the
way from the last confirmed point on is gone once more, with all gaps.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from solver.profile import Array
from solver.sharp.coordinate import map_gaps
from solver.sharp.course import Course
from solver.sharp.edges import CORRECTED, EdgeMechanics, Point
from solver.sharp.equilibrium import equilibrium
from solver.sharp.field import RULES, GapField, Solution, choose_kinds
from solver.sharp.outside import Outside
from solver.sharp.window import surroundings

_HALF_WIDTH = 3  # gaps of a window on each side of the fastest edge
_STILL = 0.05  # so far, in λ_min, edges outside move while they are taken as linear
_AWAY = 0.02  # further from where it was expected, in λ_min, no edge outside is found


class Astray(Exception):
    """No equilibrium of all edges is where a window led to."""


class Stretch:
    """The window around the fastest edge of a point.

    Parameters
    ----------
    edges : EdgeMechanics
    start : Point
        Solved with all gaps.
    """

    def __init__(self, edges: EdgeMechanics, start: Point) -> None:
        self.edges, self.start = edges, start
        count = len(start.gaps)
        rates = np.abs(start.rate).reshape(-1, 2).max(axis=1)
        half = min(_HALF_WIDTH, (count - 3) // 2)  # two gaps at least lie outside
        self.first = (int(np.argmax(rates)) - half) % count
        self.inside = (self.first + np.arange(2 * half + 1)) % count
        self.others = np.setdiff1d(np.arange(count), self.inside)
        self.still = float(rates[self.others].max())

    def goes_on(self, point: Point) -> None:
        """Go on from another point that is solved with all gaps."""
        rates = np.abs(point.rate).reshape(-1, 2).max(axis=1)
        self.still = max(self.still, float(rates[self.others].max()))
        point.__dict__["stretch"] = self

    def holds(self, at: float) -> bool:
        """Whether the edges outside are still near their first state at ``at``."""
        return abs(at - self.start.at) * self.still <= _STILL * self.edges.wave

    @cached_property
    def _model(self) -> tuple[Array, NDArray[np.int64], Outside]:
        """Window with its outside as the last gap, its kinds, and the response of the outside."""
        gaps, law = self.start.gaps, self.edges.law
        kinds = choose_kinds(map_gaps(gaps), law.digits, RULES.counts)
        self.edges.count.fields += 1
        self.edges.count.derivatives += 1
        window, *outside = surroundings(
            gaps, self.start.at, kinds, self.first, len(self.inside), np.inf, law, RULES,
            self.edges.source.panels,
        )  # fmt: skip
        return window, np.append(kinds[self.inside], 0), Outside(*outside)

    def equilibrium(self, gaps: Array, at: float, reach: float) -> LocalPoint | None:
        """Stable equilibrium at d = ``at`` near these gaps, those outside on their way."""
        window, kinds, outside = self._model
        turn = window[:-1] - self.start.gaps[self.inside]  # whole periods
        local = window.copy()
        local[:-1] = gaps[self.inside] + np.round(turn / (2 * np.pi)) * 2 * np.pi
        ends = np.append(local.ravel(), local[0, 0] + 2 * np.pi)
        if not np.all(np.diff(ends) > 0):
            return None
        edges = self.edges
        try:
            found, local, solution, rate, slope, steps = equilibrium(
                local, at, max(reach, edges.settled), kinds, True, edges.law, RULES,
                edges.source.panels._replace(outside=outside),
            )  # fmt: skip
        except np.linalg.LinAlgError:
            return None
        edges.count.newton_steps += steps
        edges.count.fields += steps
        edges.count.derivatives += steps
        if not found:
            return None
        # the others along their first tangent
        gaps = self.start.predicted(at)
        gaps[self.inside] = local[:-1] - np.round(turn / (2 * np.pi)) * 2 * np.pi
        rates = self.start.rate.copy().reshape(-1, 2)
        rates[self.inside] = rate[:-2].reshape(-1, 2)
        of = Solution(*solution)
        return LocalPoint(self, at, gaps, rates.ravel(), slope, of.pressure, of.separation)


class LocalPoint(Point):
    """A point of a stretch; its field is solved, and its edges corrected, when it is asked for."""

    def __init__(
        self,
        stretch: Stretch,
        at: float,
        gaps: Array,
        rate: Array,
        slope: float,
        pressure: float,
        separation: float,
    ) -> None:
        self.__dict__.update(
            stretch=stretch, at=at, _gaps=gaps, rate=rate, slope=slope, _pressure=pressure,
            _separation=separation,
        )  # fmt: skip

    @property
    def gaps(self) -> Array:
        """Gaps, those outside the window along their tangent."""
        gaps: Array = self.__dict__["_gaps"]
        return gaps

    @property
    def pressure(self) -> float:
        """2p̄/E* with the linear response of the outside."""
        return float(self.__dict__["_pressure"])

    @property
    def separation(self) -> float:
        """q0 s, likewise."""
        return float(self.__dict__["_separation"])

    @cached_property
    def _full(self) -> Point | None:
        edges: EdgeMechanics = self.__dict__["stretch"].edges
        return edges.equilibrium(self.gaps, self.at, CORRECTED * edges.wave)

    def confirmed(self) -> Point:
        """The equilibrium of all edges.

        Raises
        ------
        Astray
            If there is none here.
        """
        stretch: Stretch = self.__dict__["stretch"]
        full = self._full
        if full is None:
            raise Astray
        away = float(np.abs(full.gaps - self.gaps)[stretch.others].max())
        if away > _AWAY * stretch.edges.wave:
            raise Astray
        stretch.goes_on(full)
        return full

    @cached_property
    def field(self) -> GapField:
        """Field of the corrected edges; where their equilibrium is lost, of these."""
        edges: EdgeMechanics = self.__dict__["stretch"].edges
        return self._full.field if self._full else edges.field(self.gaps, self.at)


def confirmed(point: Point) -> Point:
    """``point``, solved with all gaps; raises :class:`Astray` if it is no equilibrium."""
    return point.confirmed() if isinstance(point, LocalPoint) else point


def advance(edges: EdgeMechanics, course: Course, at: float, windows: bool) -> Point | None:
    """Stable equilibrium at d = ``at`` near where ``course`` leads, or None.

    With ``windows``, in a window where only few edges move.

    Raises
    ------
    Astray
        If the point of the course is no equilibrium of all edges.
    """
    reach = CORRECTED * edges.wave
    point = course.point
    if len(point.gaps) < edges.many:
        return edges.equilibrium(course.gaps(at), at, reach)
    stretch: Stretch | None = point.__dict__.get("stretch")
    if stretch is None or not stretch.holds(at) or not windows:
        point = confirmed(point)
        stretch = Stretch(edges, point)
        if not stretch.holds(at) or not windows:
            return edges.equilibrium(course.gaps(at), at, reach)
        point.__dict__["stretch"] = stretch
    return stretch.equilibrium(course.gaps(at), at, reach)
