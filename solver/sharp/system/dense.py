"""Few gaps: dense matrices of all their nodes and of all their edges."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.edge_forces import FlowProblem
from adhesis.solver.sharp.descent.gradient_flow import Descent, descend
from adhesis.solver.sharp.descent.track import Stage, Track
from adhesis.solver.sharp.descent.trajectory import Comparison
from adhesis.solver.sharp.equilibrium.branch_point import NO_MEMORY, Point
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import total_motion
from adhesis.solver.sharp.equilibrium.newton import equilibrium
from adhesis.solver.sharp.equilibrium.pinning import remember
from adhesis.solver.sharp.field.dense_solver import (
    FixedEdgeResponse,
    respond_at_fixed_edges,
    solve,
)
from adhesis.solver.sharp.field.exterior import NO_EXTERIOR
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.ends import outward
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, choose_orders
from adhesis.solver.sharp.system.edge_system import EdgeSystem, Integers
from adhesis.solver.sharp.system.window_descent import KnownState
from adhesis.solver.sharp.tolerances import FASTEST_CLOSING, FINER_FIELD


class DenseSystem(EdgeSystem):
    """Edges of few gaps."""

    uses_windows: ClassVar[bool] = False
    closing_factor: ClassVar[float] = FASTEST_CLOSING

    def solution(self, gaps: Array, prescribed: float, share: float, fields: int) -> Solution:
        """Solve these gaps to a ``share`` of the tolerance, with S or (two fields) S and S'."""
        problem = self._problem
        model = problem.model._replace(digits=float(-np.log(share * problem.tolerance)))
        orders = choose_orders(map_gaps(gaps), model.digits, GAUSS_RULES.counts)
        solution: Solution = solve(gaps, prescribed, orders, fields, model, NO_EXTERIOR)
        return solution

    def response_before_fold(self, point: Point) -> FixedEdgeResponse:
        """Return the response at a point next to a fold, all edges held."""
        return respond_at_fixed_edges(point.field.solution)

    def fold_displacement(self, point: Point) -> float:
        """Estimate how far in d the error of the field displaces the fold next to a point."""
        self._problem.count.fields += 1
        finer = self.solution(point.gaps, point.at, FINER_FIELD, 1)
        change = finer.opening - point.field.solution.opening
        return point.fold_displacement(change, self.response_before_fold(point).opening)

    def stiffness(self, point: Point, edges: Integers) -> Array:
        """Return ∂C_e/∂θ_f between some edges, the others held, shape (edges, edges)."""
        return point.field.derivatives[0][np.ix_(edges, edges)]

    def equilibrium(
        self, gaps: Array, prescribed: float, reach: float, orders: Integers, *, strict: bool
    ) -> Point | None:
        """Iterate for the equilibrium near these gaps, by the matrix of all edges."""
        problem = self._problem
        law = problem.law_of(gaps)
        found, at, solution, rate, slope, steps = equilibrium(
            gaps, prescribed, reach, orders, strict, law, problem.model, NO_EXTERIOR
        )
        problem.count.add_newton(steps)
        if not found:
            return None
        held = remember(law.held, at, law.band) if problem.pins else NO_MEMORY
        field = problem.solved(at, prescribed, solution)
        return Point(prescribed, field, rate, slope, held=held)

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
        """Descend with all edges at once."""
        problem = FlowProblem(law, self._problem.model, NO_EXTERIOR)
        comparison = Comparison(track.of(gaps.size if equal_speeds else 0), track.has_left, 0)
        found = descend(gaps, prescribed, most, orders, equal_speeds, problem, comparison)
        track.has_left = found.has_left
        if not equal_speeds:
            track.ways.append(found.trajectory)
            motion = outward(gaps) * (found.gaps - gaps).ravel()
            track.stages.append(Stage(motion, found.interaction))
        self._problem.count.add_descent(found.fields, found.tangents)
        return found

    def closing_motion(self, before: Array, after: Array) -> float:
        """Motion of all edges together."""
        return float(total_motion(before, after))
