"""A stretch of a branch on which few edges move: a window follows, the rest responds linearly.

Towards a fold the edges around one place move ever faster while all others hardly do. They are
followed in a window (``exterior``), at the cost of a field of a few
gaps, as long as the others stay near the state about which they are linear. A point found so is
confirmed, that is solved with all gaps, before a state, a touch or a jump is told from it: an edge
elsewhere may have passed a fold of its own, which no linear response shows. Then there is no such
equilibrium, and the way from the last confirmed point on is gone once more: in a window around the
edge that was lost and, if that leads astray, too, with all gaps.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.continuation.predictor import Course
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.newton import equilibrium
from adhesis.solver.sharp.equilibrium.window import Window
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.gap.ends import outward
from adhesis.solver.sharp.mechanics import CORRECTED, EdgeMechanics

_HALF_WIDTH = 3  # gaps of a window on each side of the edge that leads
_MOVING = 0.15  # motion of an edge, in λ_min, that ends a stretch as a fold does
_BEFORE_FOLD = 0.5  # share of the way to its fold that an edge outside may go
_LEAST_SPAN = 0.1  # of the way that the motion of the edges outside allows, whatever their folds
_STILL = 0.05  # so far, in λ_min, edges outside move while they are taken as linear
_FAR = 4.0  # a fold is not believed beyond so many times the way that tells of it
_BEND = 0.5  # of its straight motion that of an edge outside is expected to bend by at most
_AWAY = 0.02  # further from where it was expected, in λ_min, no edge outside is found


class Astray(Exception):
    """No equilibrium of all edges is where a window led to; because of this edge (-1: unknown)."""

    def __init__(self, edge: int) -> None:
        super().__init__()
        self.edge = edge


class Stretch:
    """The window around the edge of a point that comes to its fold first, or is fastest.

    Parameters
    ----------
    edges : EdgeMechanics
    start : Point
        Solved with all gaps.
    lead : int, optional
        The edge, if another one is to lead.
    """

    def __init__(self, edges: EdgeMechanics, start: Point, lead: int | None = None) -> None:
        # A copy that knows no stretch: points hold theirs, and a circle would not be let go.
        self.edges, self.start = edges, copy(start)
        self.start.__dict__.pop("stretch", None)
        count = len(start.gaps)
        rates = np.abs(start.rate)
        folds = self._folds
        if lead is None:
            lead = int(np.argmin(np.fmin(_MOVING * edges.wave / rates, folds)))
        half = min(_HALF_WIDTH, (count - 3) // 2)  # two gaps at least lie outside
        self.first = (lead // 2 - half) % count
        self.inside = (self.first + np.arange(2 * half + 1)) % count
        out = np.ones(count, dtype=np.bool_)
        out[self.inside] = False
        self.others = np.flatnonzero(out)
        still = _STILL * edges.wave / rates.reshape(-1, 2)[self.others].max()
        # how far the edges outside are near enough to their first state
        before_fold = _BEFORE_FOLD * folds.reshape(-1, 2)[self.others].min()
        self.span = float(min(still, max(before_fold, _LEAST_SPAN * still)))

    @cached_property
    def _folds(self) -> Array:
        """Distance in d of the fold that the past of each edge tells of; inf for none."""
        start = self.start
        out = np.full(start.rate.shape, np.inf)
        if start.earlier is not None:
            ratio = start.earlier.rate / start.rate
            way = np.abs(start.at - start.earlier.at)
            rising = (ratio > 0) & (ratio < 1) & (way > 0)
            share = ratio[rising] ** 2
            out[rising] = way[rising] * share / (1 - share)
        return out

    def _bent(self, at: float) -> Array:
        """What the motion of the edges outside is more than straight, by their past.

        As ``predictor.Course`` has it: towards a fold like a
        root, else a parabola.
        """
        start = self.start
        out = np.zeros(start.rate.shape)
        if start.earlier is not None:
            way = start.at - start.earlier.at
            on = at - start.at
            known = way * on > 0
            change = (start.rate - start.earlier.rate)[known]
            bend = change * on * on / (2 * way[known])
            fold, way = self._folds[known], np.abs(way[known])
            near = fold < _FAR * way
            root, first = np.sqrt(fold[near]), np.sqrt(fold[near] + way[near])
            last = np.sqrt(np.maximum(fold[near] - abs(on), 0.0))
            b = change[near] / (1 / root - 1 / first)
            bend[near] = np.sign(on) * b * (2 * (root - last) - abs(on) / root)
            most = _BEND * np.abs(start.rate[known] * on)
            out[known] = np.clip(bend, -most, most)
        return (outward(start.gaps) * out).reshape(-1, 2)

    def expected(self, local: Array, at: float) -> Array:
        """All gaps at d = ``at`` where those of the window are ``local``."""
        gaps = self.window.extend(local, self.window.orders, at)
        gaps[self.others] += self._bent(at)[self.others]
        return gaps

    def goes_on(self, point: Point) -> Point:
        """Go on from another point that is solved with all gaps."""
        rates = np.abs(point.rate).reshape(-1, 2).max(axis=1)
        still = _STILL * self.edges.wave / float(rates[self.others].max())
        self.span = min(self.span, still)
        point = point.with_earlier(self.start)
        point.__dict__["stretch"] = self
        return point

    def begins(self, point: Point) -> bool:
        """Whether it begins at this point."""
        return not isinstance(point, LocalPoint) and self.start.field is point.field

    def holds(self, at: float) -> bool:
        """Whether the edges outside are still near their first state at ``at``."""
        return abs(at - self.start.at) <= self.span

    @cached_property
    def window(self) -> Window:
        """The window."""
        edges, start = self.edges, self.start
        return Window(
            start.gaps, edges.linearisation(start), self.first, len(self.inside), edges.law,
            edges.model,
        )  # fmt: skip

    def equilibrium(self, gaps: Array, at: float, reach: float) -> LocalPoint | None:
        """Stable equilibrium at d = ``at`` near these gaps, those outside on their way."""
        window = self.window
        turn = window.gaps[:-1] - self.start.gaps[self.inside]  # whole periods
        local = window.gaps.copy()
        local[:-1] = gaps[self.inside] + np.round(turn / (2 * np.pi)) * 2 * np.pi
        ends = np.append(local.ravel(), local[0, 0] + 2 * np.pi)
        if not np.all(np.diff(ends) > 0):
            return None
        edges = self.edges
        try:
            found, local, of, rate, slope, steps = equilibrium(
                local, at, max(reach, edges.settled), window.orders, True, edges.law, edges.model,
                window.exterior,
            )  # fmt: skip
        except np.linalg.LinAlgError:
            return None
        edges.count.newton_steps += steps
        edges.count.fields += steps
        edges.count.derivatives += steps
        if not found:
            return None
        # the others along their first tangent
        gaps = self.start.extrapolate(at)
        gaps[self.inside] = local[:-1] - np.round(turn / (2 * np.pi)) * 2 * np.pi
        rates = self.start.rate.copy().reshape(-1, 2)
        rates[self.inside] = rate[:-2].reshape(-1, 2)
        return LocalPoint(self, at, gaps, local, rates.ravel(), slope, of.pressure, of.separation)


class LocalPoint(Point):
    """A point of a stretch; its field is solved, and its edges corrected, when it is asked for."""

    def __init__(
        self,
        stretch: Stretch,
        at: float,
        gaps: Array,
        local: Array,
        rate: Array,
        slope: float,
        pressure: float,
        separation: float,
    ) -> None:
        self.__dict__.update(
            stretch=stretch, at=at, _gaps=gaps, _local=local, rate=rate, slope=slope,
            _pressure=pressure, _separation=separation,
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
    def _expected(self) -> Array:
        """Gaps, those outside the window as they follow it."""
        stretch: Stretch = self.__dict__["stretch"]
        return stretch.expected(self.__dict__["_local"], self.at)

    @cached_property
    def _full(self) -> tuple[Point | None, int]:
        """The equilibrium of all edges, or None and the edge that is lost."""
        edges: EdgeMechanics = self.__dict__["stretch"].edges
        found = edges.equilibrium(self._expected, self.at, CORRECTED * edges.wave)
        return found, -1 if found else edges.lost

    def confirmed(self) -> Point:
        """The equilibrium of all edges.

        Raises
        ------
        Astray
            If there is none here.
        """
        stretch: Stretch = self.__dict__["stretch"]
        full, lost = self._full
        if full is None:
            raise Astray(lost)
        away = np.abs(full.gaps - self._expected)
        away[stretch.inside] = 0.0
        if away.max() > _AWAY * stretch.edges.wave:
            raise Astray(int(np.argmax(away)))
        return stretch.goes_on(full)

    @cached_property
    def field(self) -> GapField:
        """Field of the corrected edges; where their equilibrium is lost, of these."""
        edges: EdgeMechanics = self.__dict__["stretch"].edges
        full, _ = self._full
        return full.field if full else edges.field(self.gaps, self.at)


def led_by(edges: EdgeMechanics, point: Point, edge: int) -> bool:
    """Let ``edge`` lead on from a point that is solved with all gaps; whether it did not before."""
    before: Stretch | None = point.__dict__.get("stretch")
    if edge < 0 or before is None or edge // 2 in before.inside:
        return False
    stretch = Stretch(edges, point, edge)
    if not stretch.span > 0:
        return False
    point.__dict__["stretch"] = stretch
    return True


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
    if not windows:
        reached = edges.equilibrium(course.gaps(at), at, reach)
        return None if reached is None else reached.with_earlier(confirmed(point))
    stretch: Stretch | None = point.__dict__.get("stretch")
    if stretch is None or not (stretch.holds(at) or stretch.begins(point)):
        point = confirmed(point)
        stretch = Stretch(edges, point)
        point.__dict__["stretch"] = stretch
    if not stretch.holds(at):
        at = point.at + float(np.copysign(stretch.span, at - point.at))
    return stretch.equilibrium(course.gaps(at), at, reach)
