"""Many gaps: their linear response on a tree of clusters, and windows of few gaps in descents."""

from __future__ import annotations

import math
from functools import cached_property
from typing import ClassVar

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.edge_forces import FlowProblem
from adhesis.solver.sharp.descent.gradient_flow import NO_FIELD, OUTGROWN, STEP_LIMIT, Descent
from adhesis.solver.sharp.descent.track import Track
from adhesis.solver.sharp.descent.windowed_descent import descend_many
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.edge_interaction import openings_between_edges
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw
from adhesis.solver.sharp.equilibrium.hierarchical_newton import (
    EquilibriumOfMany,
    equilibrium_many,
)
from adhesis.solver.sharp.equilibrium.linear_response import LinearResponse
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.field.exterior import NO_EXTERIOR
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.field.separate_gaps import solve_separately
from adhesis.solver.sharp.field.solution import FieldModel, Solution
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, choose_orders
from adhesis.solver.sharp.system.edge_problem import EdgeProblem
from adhesis.solver.sharp.system.edge_system import EdgeSystem, Integers
from adhesis.solver.sharp.system.kept_responses import KeptResponses
from adhesis.solver.sharp.tolerances import (
    CLOSING_BY_MOTION,
    CLOSING_OF_MANY,
    FINER_FIELD,
    RACE_FIELD,
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

    def finer_openings(self, field: GapField) -> Array:
        """Return C at the edges of a field, shape (L, 2), by a more accurate one."""
        if isinstance(field, FieldOfMany):
            opening = field.fixed_edge_solution.opening  # a fold needs its responses, too
        else:
            opening = self.solution(field.gaps, field.prescribed, FINER_FIELD, 1).opening
        return opening.reshape(-1, 2)

    def stiffness(self, point: Point, edges: Integers) -> Array:
        """Return ∂C_e/∂θ_f between some edges, the others held; the diagonal is not given."""
        model, orders = self._accuracy(point.gaps, RACE_FIELD)
        by_edge: Array = openings_between_edges(point.gaps, point.at, orders, edges, model)
        return by_edge

    def equilibrium(
        self, gaps: Array, prescribed: float, reach: float, orders: Integers, *, patient: bool
    ) -> Point | None:
        """Iterate for the equilibrium near these gaps, the edges of each gap eliminated."""
        problem = self._problem
        start = gaps
        for _ in range(RESPONSE_TRIALS):
            near = self.responses.near(start, prescribed, orders)
            if near is None:
                break
            found: EquilibriumOfMany = equilibrium_many(
                near.response, start, prescribed, reach, patient, problem.law, problem.model
            )
            problem.count.add_newton(found.corrections)
            if found.found:
                near.settled = found.gaps
                return PointOfMany(_Found(problem, prescribed, near.response, found))
            if not found.is_outgrown:
                break
            start = found.gaps
            near.is_outgrown = True
        return None

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
        system = FlowProblem(law, self._problem.model, NO_EXTERIOR)
        fields = tangents = 0
        while True:
            near = self.responses.near(gaps, prescribed, orders)
            if near is None:
                none = np.empty((0, 0))
                return Descent(gaps, NO_FIELD, orders, fields, tangents, none, False, none)
            found: Descent = descend_many(
                near.response, gaps, prescribed, most - fields, equal_speeds, system
            )
            self._problem.count.add_descent(found.fields, found.tangents)
            fields += found.fields
            tangents += found.tangents
            gaps, orders = found.gaps, found.orders
            if found.event != OUTGROWN:
                return found._replace(fields=fields, tangents=tangents)
            near.is_outgrown = True
            fields += 1
            if fields >= most:
                return found._replace(event=STEP_LIMIT, fields=fields, tangents=tangents)

    def closing_motion(self, before: Array, after: Array) -> float:
        """Motion of the edges of one gap, times how many gaps that concerns."""
        return float(CLOSING_BY_MOTION * np.abs(after - before).sum(axis=1).max())


class FieldOfMany(GapField):
    """Field of many gaps, each solved by itself in the potential of the others."""

    @cached_property
    def fixed_edge_solution(self) -> Solution:
        """Solution of all gaps together, for the responses at held edges, and more accurate."""
        digits = -math.log(FINER_FIELD * self.tolerance)
        model = FieldModel(self.device, digits, GAUSS_RULES, self.source.panels)
        orders = choose_orders(map_gaps(self.gaps), digits, GAUSS_RULES.counts)
        solution: Solution = solve_many(self.gaps, self.prescribed, orders, 1, model)[0]
        return solution


class _Found:
    """An equilibrium, and the field between its edges once it is asked for."""

    def __init__(
        self, problem: EdgeProblem, at: float, response: LinearResponse, found: EquilibriumOfMany
    ) -> None:
        self._problem, self.at, self.equilibrium = problem, at, found
        # the response will change
        self._table, self._orders = response.nodes.table.copy(), response.nodes.orders.copy()

    @cached_property
    def field(self) -> GapField:
        """Field between the edges."""
        problem, found = self._problem, self.equilibrium
        solution: Solution = solve_separately(
            found.gaps, self._table, self._orders, found.potential, found.pressure,
            self.at, problem.model,
        )  # fmt: skip
        return FieldOfMany(
            problem.source, found.gaps, self.at, problem.tolerance, problem.model.device, solution
        )


class PointOfMany(Point):
    """A point of a branch of many gaps, whose field is solved when it is asked for."""

    def __init__(self, found: _Found) -> None:
        rate, slope = found.equilibrium.rate, found.equilibrium.slope
        # Point is frozen
        self.__dict__.update(found=found, at=found.at, rate=rate, slope=slope)

    @property
    def _found(self) -> _Found:
        found: _Found = self.__dict__["found"]
        return found

    @property
    def field(self) -> GapField:
        """Field between its edges."""
        return self._found.field

    @property
    def gaps(self) -> Array:
        """Gap ends, shape (L, 2)."""
        return self._found.equilibrium.gaps

    @property
    def pressure(self) -> float:
        """2p̄/E*."""
        return self._found.equilibrium.pressure

    @property
    def separation(self) -> float:
        """Separation q0 s."""
        return self._found.equilibrium.separation
