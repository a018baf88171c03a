"""Continuation in a window: a few gaps are followed while all others respond linearly.

Towards a fold the edges around one place move ever faster while all others hardly do. They are
followed in a window of a few gaps as long as the edges of the exterior stay near the state about
which their response is linear. A point found so is solved with all gaps before a state, a touch or
a jump is derived from it: an edge of the exterior may have passed a fold of its own, which no
linear response shows. Then there is no such equilibrium (:class:`LostTrack`), and the branch
returns to its last solved point.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.continuation.events import LostTrack
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.newton import equilibrium
from adhesis.solver.sharp.equilibrium.window import Window
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.gap.ends import outward
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import (
    BRANCH_WINDOW_HALF_WIDTH,
    CORRECTED,
    EXTERIOR_BEFORE_FOLD,
    EXTERIOR_BEND,
    EXTERIOR_LEAST_SPAN,
    EXTERIOR_MISSED,
    EXTERIOR_MOTION,
    FOLD_BELIEVED,
    WINDOW_LEAD_MOTION,
)


class LocalBranch:
    """A window around the edge of a point that reaches its fold first, or is fastest.

    Parameters
    ----------
    edges : EdgeMechanics
    start : Point
        Solved with all gaps.
    lead : int, optional
        Edge to put the window around, if not that one.

    Attributes
    ----------
    inside : int array
        Gaps of the window.
    span : float
        Distance in d from ``start`` over which the exterior is taken as linear.
    """

    def __init__(self, edges: EdgeMechanics, start: Point, lead: int | None = None) -> None:
        self.edges, self.start = edges, start
        count = len(start.gaps)
        rates = np.abs(start.rate)
        folds = self._fold_distances
        if lead is None:
            lead = int(np.argmin(np.fmin(WINDOW_LEAD_MOTION * edges.wave / rates, folds)))
        half = min(BRANCH_WINDOW_HALF_WIDTH, (count - 3) // 2)  # two gaps at least lie outside
        self._first = (lead // 2 - half) % count
        self.inside = (self._first + np.arange(2 * half + 1)) % count
        out = np.ones(count, dtype=np.bool_)
        out[self.inside] = False
        self._outside = np.flatnonzero(out)
        linear = EXTERIOR_MOTION * edges.wave / rates.reshape(-1, 2)[self._outside].max()
        before_fold = EXTERIOR_BEFORE_FOLD * folds.reshape(-1, 2)[self._outside].min()
        self.span = float(min(linear, max(before_fold, EXTERIOR_LEAST_SPAN * linear)))

    @cached_property
    def _fold_distances(self) -> Array:
        """Distance in d of the fold that the earlier rate of each edge predicts; inf for none."""
        start = self.start
        out = np.full(start.rate.shape, np.inf)
        if start.earlier is not None:
            ratio = start.earlier.rate / start.rate
            way = np.abs(start.at - start.earlier.at)
            rising = (ratio > 0) & (ratio < 1) & (way > 0)
            share = ratio[rising] ** 2
            out[rising] = way[rising] * share / (1 - share)
        return out

    def _curvature(self, at: float) -> Array:
        """Predict by how much the exterior edges leave their tangent, from their earlier rates.

        Towards a fold the motion is that of a square root, else a parabola, as in
        ``predictor.Predictor``.
        """
        start = self.start
        out = np.zeros(start.rate.shape)
        if start.earlier is not None:
            way = start.at - start.earlier.at
            on = at - start.at
            known = way * on > 0
            change = (start.rate - start.earlier.rate)[known]
            bend = change * on * on / (2 * way[known])
            fold, way = self._fold_distances[known], np.abs(way[known])
            near = fold < FOLD_BELIEVED * way
            root, first = np.sqrt(fold[near]), np.sqrt(fold[near] + way[near])
            last = np.sqrt(np.maximum(fold[near] - abs(on), 0.0))
            b = change[near] / (1 / root - 1 / first)
            bend[near] = np.sign(on) * b * (2 * (root - last) - abs(on) / root)
            most = EXTERIOR_BEND * np.abs(start.rate[known] * on)
            out[known] = np.clip(bend, -most, most)
        return (outward(start.gaps) * out).reshape(-1, 2)

    def expected(self, local: Array, at: float) -> Array:
        """Return all gaps at d = ``at`` where those of the window are ``local``."""
        gaps = self.window.extend(local, self.window.orders, at)
        gaps[self._outside] += self._curvature(at)[self._outside]
        return gaps

    def continued_at(self, point: Point) -> Point:
        """Note a further point of the branch that is solved with all gaps; return it with rates."""
        rates = np.abs(point.rate).reshape(-1, 2).max(axis=1)
        linear = EXTERIOR_MOTION * self.edges.wave / float(rates[self._outside].max())
        self.span = min(self.span, linear)
        return point.with_earlier(self.start)

    def begins_at(self, point: Point) -> bool:
        """Whether it begins at this point."""
        return not isinstance(point, LocalPoint) and self.start.field is point.field

    def is_valid(self, at: float) -> bool:
        """Whether the exterior is still linear at d = ``at``."""
        return abs(at - self.start.at) <= self.span

    @cached_property
    def window(self) -> Window:
        """Return the window; it is set up when it is first used."""
        edges, start = self.edges, self.start
        return Window(
            start.gaps, edges.linearisation(start), self._first, len(self.inside), edges.law,
            edges.model,
        )  # fmt: skip

    def equilibrium(self, gaps: Array, at: float, reach: float) -> LocalPoint | None:
        """Return the stable equilibrium of the window at d = ``at`` near these gaps, or None."""
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
        # the exterior along its first tangent
        gaps = self.start.extrapolate(at)
        gaps[self.inside] = local[:-1] - np.round(turn / (2 * np.pi)) * 2 * np.pi
        rates = self.start.rate.copy().reshape(-1, 2)
        rates[self.inside] = rate[:-2].reshape(-1, 2)
        return LocalPoint(self, at, gaps, local, rates.ravel(), slope, of.pressure, of.separation)


class LocalPoint(Point):
    """A point found in a window; it is solved with all gaps when its field is asked for.

    Attributes
    ----------
    branch : LocalBranch
        On which it was found.
    """

    branch: LocalBranch

    def __init__(
        self,
        branch: LocalBranch,
        at: float,
        gaps: Array,
        local: Array,
        rate: Array,
        slope: float,
        pressure: float,
        separation: float,
    ) -> None:
        # Point is frozen
        self.__dict__.update(
            branch=branch, at=at, _gaps=gaps, _local=local, rate=rate, slope=slope,
            _pressure=pressure, _separation=separation,
        )  # fmt: skip

    @property
    def gaps(self) -> Array:
        """Gaps, those of the exterior along their tangent."""
        gaps: Array = self.__dict__["_gaps"]
        return gaps

    @property
    def pressure(self) -> float:
        """2p̄/E* with the linear response of the exterior."""
        return float(self.__dict__["_pressure"])

    @property
    def separation(self) -> float:
        """Separation q0 s, likewise."""
        return float(self.__dict__["_separation"])

    @cached_property
    def _expected(self) -> Array:
        """Gaps, those of the exterior as they respond to the window."""
        return self.branch.expected(self.__dict__["_local"], self.at)

    @cached_property
    def _solved(self) -> tuple[Point | None, int]:
        """Equilibrium of all edges, or None and the edge that has lost its own."""
        edges = self.branch.edges
        return edges.correct(self._expected, self.at, CORRECTED * edges.wave)

    def confirmed(self) -> Point:
        """Return the equilibrium of all edges.

        Raises
        ------
        LostTrack
            If there is none here.
        """
        solved, lost = self._solved
        if solved is None:
            raise LostTrack(lost, self.at)
        missed = np.abs(solved.gaps - self._expected)
        missed[self.branch.inside] = 0.0
        if missed.max() > EXTERIOR_MISSED * self.branch.edges.wave:
            raise LostTrack(int(np.argmax(missed)), self.at)
        return self.branch.continued_at(solved)

    @cached_property
    def field(self) -> GapField:
        """Field of the corrected edges; where their equilibrium is lost, of these."""
        solved, _ = self._solved
        return solved.field if solved else self.branch.edges.field(self.gaps, self.at)


def confirmed(point: Point) -> Point:
    """Return ``point`` solved with all gaps; raises :class:`LostTrack` if it is no equilibrium."""
    return point.confirmed() if isinstance(point, LocalPoint) else point


def around_edge(edges: EdgeMechanics, point: Point, edge: int, known: LocalBranch | None) -> (
    LocalBranch | None
):  # fmt: skip
    """Return a window around ``edge`` at a solved point, where ``known`` lost track of that edge.

    None if the edge is unknown or lies in that window, or if the new one is valid nowhere.
    """
    if edge < 0 or known is None or edge // 2 in known.inside:
        return None
    window = LocalBranch(edges, point, edge)
    return window if window.span > 0 else None
