"""Mechanics of the contact edges of one problem with all its gaps on one tree, however many."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.gradient_flow import AT_REST, NO_FIELD, OUTGROWN, Descent
from adhesis.solver.sharp.descent.track import Track
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.griffith import (
    EdgeLaw,
    imbalance,
    move_edges,
    step_limits,
)
from adhesis.solver.sharp.field.dense_solver import (
    FixedEdgeResponse,
    GapField,
    respond_at_fixed_edges,
)
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.field.separate_gaps import solve_separately
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, Integers, choose_orders
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.one_tree.implicit_flow import FlowEnd, flow_edges
from adhesis.solver.sharp.one_tree.kept_trees import KeptTrees
from adhesis.solver.sharp.one_tree.running_tangent import is_stable, tangent_between
from adhesis.solver.sharp.one_tree.saddle_step import edge_positions, step_off
from adhesis.solver.sharp.one_tree.tree_newton import TreeEquilibrium, equilibrium_on_tree
from adhesis.solver.sharp.system.edge_problem import EdgeProblem
from adhesis.solver.sharp.system.edge_system import EdgeSystem
from adhesis.solver.sharp.system.hierarchical import FieldOfMany
from adhesis.solver.sharp.system.kept_responses import KeptResponses
from adhesis.solver.sharp.system.window_descent import KnownState
from adhesis.solver.sharp.tolerances import (
    CLOSING_BY_MOTION,
    CLOSING_OF_MANY,
    EQUAL_GAINS,
    FINER_FIELD,
    FIRST_REACH,
    RAN,
    RESPONSE_TRIALS,
    RESTS,
)


class TreeSystem(EdgeSystem):
    """Edges of any number of gaps, whose linear response is kept from one state to the next."""

    uses_windows: ClassVar[bool] = True
    closing_factor: ClassVar[float] = CLOSING_OF_MANY

    def __init__(self, problem: EdgeProblem) -> None:
        super().__init__(problem)
        self.responses = KeptTrees(problem)
        self._finer: tuple[Point, Solution] | None = None

    def solution(self, gaps: Array, prescribed: float, share: float, fields: int) -> Solution:
        """Solve these gaps to a ``share`` of the tolerance, with S or (two fields) S and S'."""
        model = self._problem.model
        model = model._replace(digits=model.digits - math.log(share))
        orders = choose_orders(map_gaps(gaps), model.digits, GAUSS_RULES.counts)
        solution: Solution = solve_many(gaps, prescribed, orders, fields, model)[0]
        return solution

    def response_before_fold(self, point: Point) -> FixedEdgeResponse:
        """Return the response at a point next to a fold, the edges held."""
        return respond_at_fixed_edges(self._solve_finer(point))

    def fold_displacement(self, point: Point) -> float:
        """Estimate how far in d the error of the field displaces the fold next to a point."""
        finer = self._solve_finer(point)
        change = finer.opening - point.field.solution.opening
        return point.fold_displacement(change, respond_at_fixed_edges(finer).opening)

    def _solve_finer(self, point: Point) -> Solution:
        """Solve the field of a point more accurately than that of the path."""
        if self._finer is None or self._finer[0] is not point:
            self._problem.count.fields += 1
            self._finer = point, self.solution(point.gaps, point.at, FINER_FIELD, 1)
        return self._finer[1]

    def stiffness(self, point: Point, edges: Integers) -> Array:
        """Return ∂(C_e - C_c)/∂n_f between some edges, n outward, all others following."""
        problem, near = self._problem, self.responses.at(point.gaps, point.at)
        if near is None:
            return np.full((len(edges), len(edges)), np.nan)
        by_edge: Array = tangent_between(
            near.response, edges, point.at, problem.law, problem.model.device
        )
        return by_edge

    def equilibrium(
        self, gaps: Array, prescribed: float, reach: float, orders: Integers, *, strict: bool
    ) -> Point | None:
        """Iterate for the equilibrium near these gaps, the edges of each gap eliminated."""
        problem = self._problem
        for _ in range(RESPONSE_TRIALS):
            near = self.responses.near(gaps, prescribed, orders)
            if near is None:
                break
            found: TreeEquilibrium = equilibrium_on_tree(
                near.response, gaps, prescribed, reach, strict, problem.law, problem.model
            )
            problem.count.add_newton(found.corrections)
            if found.found:
                near.settled = found.gaps
                return self._point(prescribed, near.response, found)
            if not found.is_outgrown:
                break
            gaps = found.gaps
            near.is_outgrown = True
        return None

    def _point(self, prescribed: float, response: Any, found: TreeEquilibrium) -> Point:
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
        """Descend with all edges at once; a saddle where they come to rest is left.

        Nothing is known of the track.
        """
        track.is_complete = False
        steps, none = 0, np.empty((0, 0))
        end: FlowEnd | None = None
        for _ in range(RESTS):
            end, orders = self._flow(gaps, prescribed, most - steps, orders, law, equal_speeds)
            gaps, steps = end.gaps, steps + end.steps
            left_saddle = self._leave_saddle(gaps, prescribed) if end.event == AT_REST else None
            if left_saddle is None:
                break
            gaps = left_saddle
        event = NO_FIELD if end is None else end.event
        return Descent(gaps, event, orders, steps, 0, none, False, none)

    def _flow(
        self,
        gaps: Array,
        prescribed: float,
        most: int,
        orders: Integers,
        law: EdgeLaw,
        equal_speeds: bool,
    ) -> tuple[FlowEnd, Integers]:
        """Follow the flow of the edges; returns the orders that it came to, too."""
        problem = self._problem
        runs, reach = np.zeros(gaps.size, dtype=bool), FIRST_REACH
        while True:
            near = self.responses.near(gaps, prescribed, orders)
            if near is None:
                return FlowEnd(NO_FIELD, gaps, 0, reach), orders
            end: FlowEnd = flow_edges(
                near.response, gaps, prescribed, most, equal_speeds, runs, reach, law,
                problem.model,
            )  # fmt: skip
            problem.count.add_descent(end.steps, end.steps)
            if end.event != OUTGROWN:
                return end, near.response.nodes.orders.copy()
            gaps, reach = end.gaps, end.reach
            near.is_outgrown = True

    def _leave_saddle(self, gaps: Array, prescribed: float) -> Array | None:
        """Move edges without force off a saddle of the energy; None where they are stable.

        Both directions along the softest modes are tried, and that on which energy falls more is
        taken, of equal ones that in which the leading edge goes outwards.
        """
        law, device = self._problem.law, self._problem.model.device
        near = self.responses.at(gaps, prescribed)
        if near is None or is_stable(near.response, prescribed, law, device):
            return None
        every = np.arange(gaps.size)
        tangent = tangent_between(near.response, every, prescribed, law, device)
        by_edge = near.response.opening[:, None] * tangent
        limit = step_limits(map_gaps(gaps), law.longest_step)
        step = step_off(by_edge + by_edge.T, limit, edge_positions(gaps, law.origin))
        if step is None:
            return None
        onwards, backwards = (
            self._force_along(move_edges(gaps, way), way, prescribed) for way in (step, -step)
        )
        if not max(onwards, backwards) > 0:
            return None
        forward = onwards >= backwards * (1 - EQUAL_GAINS)
        left: Array = move_edges(gaps, step if forward else -step)
        return left

    def _force_along(self, gaps: Array, step: Array, prescribed: float) -> float:
        """Compute the force along a ``step`` at its end: positive where the energy falls."""
        problem = self._problem
        problem.count.fields += 1
        solution = self.solution(gaps, prescribed, 1.0, 1)
        residual, _ = imbalance(solution, problem.law, problem.source.panels)
        return -float((residual * (2 * solution.opening - residual)) @ step)

    def closing_motion(self, before: Array, after: Array) -> float:
        """Motion of the edges of one gap, times how many gaps that concerns."""
        return float(CLOSING_BY_MOTION * np.abs(after - before).sum(axis=1).max())


class TreeMechanics(EdgeMechanics):
    """Fields, equilibria and descents of the edges of one problem, with one system of edges."""

    def __init__(self, *problem: Any) -> None:
        super().__init__(*problem)
        self._tree = TreeSystem(self)

    def system(self, gaps: Array) -> TreeSystem:
        """Return the system of edges."""
        return self._tree

    @property
    def responses(self) -> KeptResponses:
        """Linear responses."""
        return self._tree.responses

    def field_again(
        self, gaps: Array, prescribed: float, pressure: float, separation: float
    ) -> GapField:
        """Return the field of a known equilibrium, with its p and q0 s; solved when asked for."""
        return FieldOfMany(
            self, gaps, prescribed, pressure, separation,
            lambda: self._tree.solution(gaps, prescribed, 1.0, 2),
        )  # fmt: skip

    def stiffness(self, point: Point, edges: Integers) -> Array:
        """Return ∂(C_e - C_c)/∂n_f between some edges, n outward, all others following."""
        return self._tree.stiffness(point, edges)

    def relax(
        self,
        gaps: Array,
        prescribed: float,
        reach: float,
        *,
        equal_speeds: bool = False,
        track: Track | None = None,
        start: KnownState | None = None,
    ) -> Point | Array:
        """Descend in energy at a prescribed value to the next minimum; see the base class.

        A descent with equal speeds that stays next to the fold where it begins shows no other end.
        """
        found = super().relax(
            gaps, prescribed, reach, equal_speeds=equal_speeds, track=track, start=start
        )
        if equal_speeds and track is not None and isinstance(found, Point):
            stayed = found.gaps.shape == gaps.shape
            track.rejoined = stayed and np.abs(found.gaps - gaps).max() < RAN * self.wave
        return found

    def start(self, point: Point | None) -> KnownState | None:
        """Return None: a descent needs no window to begin in."""
        return None
