"""Many gaps: their linear response on a tree of clusters, and windows of few gaps in descents."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.gradient_flow import (
    AT_REST,
    NO_FIELD,
    OUTGROWN,
    REJOINED,
    STEP_LIMIT,
    VANISHED,
    Descent,
)
from adhesis.solver.sharp.descent.newton_approach import Approach, approach_minimum
from adhesis.solver.sharp.descent.track import Track
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.edge_interaction import openings_between_edges
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import shortest_length
from adhesis.solver.sharp.equilibrium.hierarchical_newton import (
    EquilibriumOfMany,
    equilibrium_many,
)
from adhesis.solver.sharp.equilibrium.linear_response import LinearResponse
from adhesis.solver.sharp.field.dense_solver import (
    FixedEdgeResponse,
    GapField,
    check_definite,
    respond_at_fixed_edges,
    solve,
)
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.field.separate_gaps import solve_separately
from adhesis.solver.sharp.field.solution import FieldModel, LoadingDevice, Solution
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, choose_orders
from adhesis.solver.sharp.system.edge_problem import EdgeProblem
from adhesis.solver.sharp.system.edge_system import EdgeSystem, Integers
from adhesis.solver.sharp.system.kept_responses import KeptResponses
from adhesis.solver.sharp.system.window_descent import KnownState, Windows
from adhesis.solver.sharp.tolerances import (
    CLOSING_BY_MOTION,
    CLOSING_OF_MANY,
    FINER_FIELD,
    RACE_FIELD,
    RACE_MARGIN,
    RESPONSE_TRIALS,
)


class HierarchicalSystem(EdgeSystem):
    """Edges of many gaps.

    Their linear response is kept from one state to the next.
    """

    uses_windows: ClassVar[bool] = True
    closing_factor: ClassVar[float] = CLOSING_OF_MANY

    def __init__(self, problem: EdgeProblem) -> None:
        super().__init__(problem)
        self.responses = KeptResponses(problem)
        self._started: tuple[Point, KnownState] | None = None
        self._next_to_fold: SolutionNextToFold | None = None

    def solution(self, gaps: Array, prescribed: float, share: float, fields: int) -> Solution:
        """Solve these gaps to a ``share`` of the tolerance, with S or (two fields) S and S'."""
        model, orders = self._accuracy(gaps, share)
        solution: Solution = solve_many(gaps, prescribed, orders, fields, model)[0]
        return solution

    def _accuracy(self, gaps: Array, share: float) -> tuple[FieldModel, Integers]:
        """Model and orders for a ``share`` of the tolerance."""
        model = self._problem.model
        model = model._replace(digits=model.digits - math.log(share))
        return model, choose_orders(map_gaps(gaps), model.digits, GAUSS_RULES.counts)

    def response_before_fold(self, point: Point) -> FixedEdgeResponse:
        """Return the response at a point next to a fold, the edges around the fastest held."""
        return respond_at_fixed_edges(self._solve_next_to_fold(point).solution)

    def fold_displacement(self, point: Point) -> float:
        """Estimate how far in d the error of the field displaces the fold next to a point."""
        near = self._solve_next_to_fold(point)
        known, count = point.field.solution.opening[near.edges], len(near.edges)
        response = respond_at_fixed_edges(near.solution)
        change = near.solution.opening[:count] - known
        return point.fold_displacement(change, response.opening[:count], near.edges)

    def _solve_next_to_fold(self, point: Point) -> SolutionNextToFold:
        """Solve the gaps around the fastest edge, more accurately; all gaps if others may fold.

        All gaps, too, where the others leave the window no solution.
        """
        if self._next_to_fold is None or self._next_to_fold.point is not point:
            window = self.start(point).window(point.gaps)
            solution = None
            if window is not None and window.exterior_is_stable:
                model, orders = self._accuracy(window.gaps, FINER_FIELD)
                orders[-1] = 0
                self._problem.count.fields += 1
                solution = solve(
                    window.gaps, point.at, np.maximum(orders, window.orders), 1, model,
                    window.exterior,
                )  # fmt: skip
                edges: Integers = np.add.outer(2 * window.inside, np.arange(2)).ravel()
            # In steep profiles the exterior's linear response may leave the window no solution.
            if solution is None or not math.isfinite(solution.pressure):
                self._problem.count.fields += 1
                solution = self.solution(point.gaps, point.at, FINER_FIELD, 1)
                edges = np.arange(point.gaps.size)
            self._next_to_fold = SolutionNextToFold(point, solution, edges)
        return self._next_to_fold

    def stiffness(self, point: Point, edges: Integers) -> Array:
        """Return ∂C_e/∂θ_f between some edges, the others held; the diagonal is not given.

        At fixed p, and as if gaps further from these edges than ``RACE_MARGIN`` were closed.
        """
        gap, count = edges // 2, len(point.gaps)
        beside = np.arange(-RACE_MARGIN, RACE_MARGIN + 1)
        inside = np.unique((gap[:, None] + beside) % count)
        gaps = np.ascontiguousarray(point.gaps[inside])
        model, orders = self._accuracy(gaps, RACE_FIELD)
        by_edge: Array = openings_between_edges(
            gaps, orders, 2 * np.searchsorted(inside, gap) + edges % 2,
            point.field.solution.opening[edges],
            model._replace(device=LoadingDevice(0.0, 1.0)),
        )  # fmt: skip
        return by_edge

    def equilibrium(
        self, gaps: Array, prescribed: float, reach: float, orders: Integers, *, strict: bool
    ) -> Point | None:
        """Iterate for the equilibrium near these gaps, the edges of each gap eliminated."""
        problem = self._problem
        start = gaps
        for _ in range(RESPONSE_TRIALS):
            near = self.responses.near(start, prescribed, orders)
            if near is None:
                break
            found: EquilibriumOfMany = equilibrium_many(
                near.response, start, prescribed, reach, strict, problem.law, problem.model
            )
            problem.count.add_newton(found.corrections)
            if found.found:
                near.settled = found.gaps
                return self._point(prescribed, near.response, found)
            if not found.is_outgrown:
                break
            start = found.gaps
            near.is_outgrown = True
        return None

    def _point(
        self, prescribed: float, response: LinearResponse, found: EquilibriumOfMany
    ) -> Point:
        """Make the point of an equilibrium."""
        problem = self._problem
        # copies, as the response is changed in place
        table, orders = response.nodes.table.copy(), response.nodes.orders.copy()

        def solve() -> Solution:
            solution: Solution = solve_separately(
                found.gaps, table, orders, found.potential, found.pressure, prescribed,
                problem.model,
            )  # fmt: skip
            return solution

        field = FieldOfMany(
            problem, found.gaps, prescribed, found.pressure, found.separation, solve
        )
        return Point(prescribed, field, found.rate, found.slope)

    def field_on_demand(
        self, gaps: Array, prescribed: float, pressure: float, separation: float
    ) -> GapField:
        """Return the field of a known equilibrium, with its p and q0 s; solved when asked for."""
        return FieldOfMany(
            self._problem, gaps, prescribed, pressure, separation,
            lambda: self.solution(gaps, prescribed, 1.0, 2),
        )  # fmt: skip

    def start(self, point: Point) -> KnownState:
        """Return a point as the start of a descent."""
        if self._started is None or self._started[0] is not point:
            leading = int(np.argmax(np.abs(point.rate))) // 2
            state = KnownState(self._problem, self.responses, point.gaps, point.at, leading)
            self._started = point, state
        return self._started[1]

    def descend(
        self,
        gaps: Array,
        prescribed: float,
        most: int,
        orders: Integers,
        law: EdgeLaw,
        track: Track,
        *,
        equal_speeds: bool,
        start: KnownState | None = None,
    ) -> Descent:
        """Descend in windows, one after the other; of the track only the first rest is known.

        The first window is opened on the ``start``, if there is one.
        """
        problem, count = self._problem, self._problem.count
        track.is_complete = False
        windows = Windows(problem, law, prescribed, equal_speeds)
        before, begun = count.fields, len(gaps)

        def end(event: int) -> Descent:
            none = np.empty((0, 0))
            least = orders if len(orders) == len(gaps) else np.empty(0, dtype=np.int64)
            return Descent(gaps, event, least, count.fields - before, 0, none, False, none)

        found = None if start is None else windows.first(start, gaps, track)
        while True:
            if found is not None:
                gaps = found.gaps
                if track.rejoined:
                    return end(REJOINED)
                if len(gaps) != begun or shortest_length(gaps) < law.smallest:
                    return end(VANISHED)
                if windows.is_at_end:
                    return end(AT_REST)
            if count.fields - before >= most:
                return end(STEP_LIMIT)
            near = self.responses.near(gaps, prescribed, orders)
            if near is None:
                return end(NO_FIELD)
            approach: Approach = approach_minimum(
                near.response, gaps, prescribed, law, problem.model
            )
            count.add_descent(approach.steps, approach.steps)
            gaps, found = approach.gaps, None
            if approach.event == OUTGROWN:  # maybe as it is of other gaps, as many
                near.is_outgrown = True
                continue
            orders = near.response.nodes.orders.copy()
            if approach.event != STEP_LIMIT:
                return end(approach.event)
            found = windows.next(near.response, approach)
            if found is None:
                return end(NO_FIELD)

    def closing_motion(self, before: Array, after: Array) -> float:
        """Motion of the edges of one gap, times how many gaps that concerns."""
        return float(CLOSING_BY_MOTION * np.abs(after - before).sum(axis=1).max())


class SolutionNextToFold(NamedTuple):
    """Solution of the gaps around the edge that leads to a fold, the others following linearly.

    Attributes
    ----------
    point : Point
        The last one before the fold.
    solution : Solution
        Of these gaps and perhaps their exterior, more accurate than that of the path.
    edges : int array
        Their edges among all.
    """

    point: Point
    solution: Solution
    edges: Integers


class FieldOfMany(GapField):
    """Field of many gaps in equilibrium, solved when it is asked for.

    Parameters
    ----------
    problem : EdgeProblem
    gaps : array, shape (L, 2)
    prescribed : float
        d.
    pressure, separation : float
        p and q0 s to the accuracy of the equilibrium.
    solve : callable
        Solves the field.
    """

    def __init__(
        self,
        problem: EdgeProblem,
        gaps: Array,
        prescribed: float,
        pressure: float,
        separation: float,
        solve: Callable[[], Solution],
    ) -> None:
        self.source, self.gaps, self.prescribed = problem.source, gaps, prescribed
        self.tolerance, self.device = problem.tolerance, problem.model.device
        self.nearly = pressure, separation
        self._solve: Callable[[], Solution] | None = solve

    @property
    def solution(self) -> Solution:
        """Solution of equation (1), solved at first access."""
        if self._solve is not None:
            self._solution, self._solve = self._solve(), None  # it holds a response
            check_definite(self._solution)
        return self._solution
