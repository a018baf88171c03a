"""Few gaps: dense matrices of all their nodes and of all their edges."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.edge_forces import FlowProblem
from adhesis.solver.sharp.descent.gradient_flow import Descent, descend
from adhesis.solver.sharp.descent.track import Stage, Track
from adhesis.solver.sharp.descent.trajectory import Comparison
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.griffith import Law
from adhesis.solver.sharp.equilibrium.newton import equilibrium
from adhesis.solver.sharp.field.dense_solver import solve_plain
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.ends import outward
from adhesis.solver.sharp.gap.quadrature import RULES, choose_kinds
from adhesis.solver.sharp.system.edge_system import EdgeSystem, Equilibrium, Kinds
from adhesis.solver.sharp.tolerances import FASTEST_CLOSING


class DenseSystem(EdgeSystem):
    """Edges of few gaps."""

    uses_windows: ClassVar[bool] = False
    closing_factor: ClassVar[float] = FASTEST_CLOSING

    def solution(self, gaps: Array, prescribed: float, share: float) -> Solution:
        """Solve the field of these gaps to a ``share`` of the tolerance."""
        problem = self._problem
        digits = -np.log(share * problem.tolerance)
        kinds = choose_kinds(map_gaps(gaps), digits, RULES.counts)
        solved = solve_plain(
            gaps, prescribed, problem.law.hold, kinds, 2, RULES, problem.source.panels
        )
        return Solution(*solved)

    def stiffness(self, point: Point, edges: Kinds) -> Array:
        """Return ∂C_e/∂θ_f between some edges, the others held, shape (edges, edges)."""
        return point.field.derivatives[0][np.ix_(edges, edges)]

    def equilibrium(
        self, gaps: Array, prescribed: float, reach: float, kinds: Kinds, *, patient: bool
    ) -> Equilibrium:
        """Iterate for the equilibrium near these gaps, by the matrix of all edges."""
        problem = self._problem
        found, at, solution, rate, slope, steps = equilibrium(
            gaps, prescribed, reach, kinds, patient, problem.law, RULES, problem.source.panels
        )
        problem.count.newton(steps)
        return Equilibrium(found, at, Solution(*solution), rate, slope)

    def descend(
        self,
        gaps: Array,
        prescribed: float,
        most: int,
        kinds: Kinds,
        law: Law,
        track: Track,
        *,
        equal_speeds: bool,
        compare: bool,
    ) -> Descent:
        """Descend with all edges at once."""
        problem = FlowProblem(law, RULES, self._problem.source.panels)
        comparison = Comparison(track.of(gaps.size if compare else 0), track.has_left, 0)
        found = descend(gaps, prescribed, most, kinds, equal_speeds, problem, comparison)
        track.has_left = found.has_left
        if not compare:
            track.ways.append(found.trajectory)
            track.forces.append(found.forces)
            motion = outward(gaps) * (found.gaps - gaps).ravel()
            track.stages.append(Stage(motion, found.interaction))
        self._problem.count.descent(found.fields, found.tangents)
        return found

    def closing_motion(self, before: Array, after: Array) -> float:
        """Motion of all edges together."""
        return float(np.abs(after - before).sum())
