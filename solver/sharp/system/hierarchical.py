"""Many gaps: their interaction on a tree of clusters, and windows of few gaps that move."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.edge_forces import FlowProblem
from adhesis.solver.sharp.descent.gradient_flow import Descent
from adhesis.solver.sharp.descent.track import Track
from adhesis.solver.sharp.descent.windowed_descent import descend_many
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.edge_elimination import openings_between_edges
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw
from adhesis.solver.sharp.equilibrium.hierarchical_newton import equilibrium_many
from adhesis.solver.sharp.field.exterior import NO_EXTERIOR
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, choose_orders
from adhesis.solver.sharp.system.edge_system import EdgeSystem, Integers
from adhesis.solver.sharp.tolerances import CLOSING_BY_MOTION, CLOSING_OF_MANY


class HierarchicalSystem(EdgeSystem):
    """Edges of many gaps."""

    uses_windows: ClassVar[bool] = True
    closing_factor: ClassVar[float] = CLOSING_OF_MANY

    def solution(self, gaps: Array, prescribed: float, share: float, fields: int) -> Solution:
        """Solve these gaps to a ``share`` of the tolerance, with S or (two fields) S and S'."""
        problem = self._problem
        model = problem.model._replace(digits=problem.model.digits - math.log(share))
        orders = choose_orders(map_gaps(gaps), model.digits, GAUSS_RULES.counts)
        solution: Solution = solve_many(gaps, prescribed, orders, fields, model)[0]
        return solution

    def stiffness(self, point: Point, edges: Integers) -> Array:
        """Return ∂C_e/∂θ_f between some edges, the others held; the diagonal is not given."""
        problem = self._problem
        by_edge: Array = openings_between_edges(
            point.gaps, point.at, point.field.solution.nodes.orders, edges, problem.model
        )
        return by_edge

    def equilibrium(
        self, gaps: Array, prescribed: float, reach: float, orders: Integers, *, patient: bool
    ) -> tuple[Point | None, int]:
        """Iterate for the equilibrium near these gaps, the edges of each gap eliminated."""
        problem = self._problem
        found, at, about, rate, slope, steps = equilibrium_many(
            gaps, prescribed, reach, orders, patient, problem.law, problem.model
        )
        problem.count.newton(steps)
        if not found:
            return None, int(np.argmax(np.abs(rate))) if np.isfinite(rate).all() else -1
        field = problem.solved(at, prescribed, about.solution)
        return Point(prescribed, field, rate, slope, linearisation=about), -1

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
    ) -> Descent:
        """Descend in windows, one after the other; the track is not known."""
        track.is_complete = False
        problem = FlowProblem(law, self._problem.model, NO_EXTERIOR)
        found: Descent = descend_many(gaps, prescribed, most, orders, equal_speeds, problem)
        self._problem.count.descent(found.fields, found.tangents)
        return found

    def closing_motion(self, before: Array, after: Array) -> float:
        """Motion of the edges of one gap, times how many gaps that concerns."""
        return float(CLOSING_BY_MOTION * np.abs(after - before).sum(axis=1).max())
