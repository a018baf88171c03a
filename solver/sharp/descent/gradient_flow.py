"""Descent in energy along a jump: integration of the edges' gradient flow, compiled.

Where edges run, a step follows the flow through a model of the openings (``model_flow``), over
several shortest waves. Near equilibria and saddles, and where a gap closes or a patch vanishes, it
follows the linear flow (``short_step``). Either is judged by the field at its end (``step_size``).
For comparison edges move with equal speeds. A descent ends with an event.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.descent.edge_forces import (
    FlowProblem,
    Forces,
    energy_rises,
    forces_at,
    norm,
)
from adhesis.solver.sharp.descent.edge_model import model_about
from adhesis.solver.sharp.descent.model_flow import (
    ModelFlow,
    add_forces,
    flow_through,
    near_balance,
    no_flow,
)
from adhesis.solver.sharp.descent.short_step import short_step
from adhesis.solver.sharp.descent.step_size import (
    StepSize,
    after_long_step,
    after_short_step,
    initial_size,
    may_raise,
    model_error,
)
from adhesis.solver.sharp.descent.trajectory import (
    Comparison,
    Trajectory,
    append_point,
    start_trajectory,
    update_comparison,
)
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import (
    edge_tangent,
    move_edges,
    raise_orders,
    shortest_length,
    step_limits,
)
from adhesis.solver.sharp.field.solution import FieldModel, no_solution
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers, choose_orders
from adhesis.solver.sharp.tolerances import COMPARISONS, LEAST_REACH, LONG_CLOSING, RUNNING_LENGTH

# Events that end a descent.
AT_REST = 0  # the steps have become short: Newton's iteration finds the equilibrium
VANISHED = 1  # a gap or patch is below the smallest length
STEP_LIMIT = 2  # the fields that were allowed are used up
NO_FIELD = 3  # the edges have no field
REJOINED = 4  # the descent is on the other one's trajectory again
OUTGROWN = 5  # some of many gaps need more nodes than their linear response has


class Descent(NamedTuple):
    """Result of a descent.

    Attributes
    ----------
    gaps : array, shape (L, 2)
        Where it ended.
    event : int
        Why: one of the events of this module.
    orders : int array, shape (L,)
        Order of the quadrature rule of each gap.
    fields, tangents : int
        Fields and tangents that were computed.
    trajectory : array, shape (n, 2L)
        Edges that it went through.
    has_left : bool
        Whether it has been away from the trajectory that it is compared with.
    interaction : array, shape (2L, 2L)
        Force, as C², that the outward motion of each edge (columns) took from every edge (rows).
    """

    gaps: Array
    event: int
    orders: Integers
    fields: int
    tangents: int
    trajectory: Array
    has_left: bool
    interaction: Array


class Step(NamedTuple):
    """Step that has not been judged yet.

    Attributes
    ----------
    gaps : array, shape (L, 2)
        At its end.
    motion : array, shape (2L,)
        Outward motion of the contact at every edge.
    length : float
        Of the largest motion.
    flow : ModelFlow
        Through the model; without points for a short step.
    curvature : array, shape (2L, 2L)
        Of the energy, at the start of a short step.
    """

    gaps: Array
    motion: Array
    length: float
    flow: ModelFlow
    curvature: Array


@compiled_for_both
def descend(
    gaps: Array,
    prescribed: float,
    most_fields: int,
    least: Integers,
    equal_speeds: bool,
    problem: FlowProblem,
    comparison: Comparison,
) -> Descent:
    """Descend in energy, d being ``prescribed``, until an event.

    No edge moves in a step by more than the reach of the step, or a quarter of the gap or patch
    that it may close. ``least`` are the least orders of the gaps, empty for any.
    """
    law, model = problem.law, problem.model
    trajectory = start_trajectory(gaps)
    interaction = np.zeros((gaps.size, gaps.size))
    tangent = interaction
    orders = raise_orders(least_orders(gaps, model), least)
    start = no_solution(map_gaps(gaps), np.empty(0, dtype=np.int64), model.device)
    now = forces_at(gaps, prescribed, orders, start, problem)
    fields, tangents, size = 1, 0, initial_size()
    event = STEP_LIMIT if np.isfinite(now.solution.pressure) else NO_FIELD
    accepted, is_long, strongest = True, False, 0.0
    last = now.solution
    while event == STEP_LIMIT:
        if accepted:
            strongest = max(strongest, norm(now.slope))
            if is_long or fields % 2 == 0:
                comparison = update_comparison(comparison, gaps, law.longest_step)
            if comparison.matches == COMPARISONS:
                event = REJOINED
                break
            tangent, _ = edge_tangent(now.solution, now.drift, model.rules)
            tangents += 1
        if fields >= most_fields:
            break
        step, tried = next_step(
            gaps, prescribed, orders, now, tangent, size, strongest, equal_speeds, problem
        )
        fields += tried
        is_long = step.flow.points.shape[0] > 0
        event = detect_event(step, law)
        if event == STEP_LIMIT:
            orders = raise_orders(least_orders(step.gaps, model), orders)
            there = forces_at(step.gaps, prescribed, orders, last, problem)
            fields += 1
            accepted, size = judge_step(step, now, there, size, law)
            if np.isfinite(there.solution.pressure):
                last = there.solution
            elif not is_long:
                event = NO_FIELD
            if accepted:
                now = there
        if event != NO_FIELD and (accepted or event != STEP_LIMIT):
            trajectory = extend_by_step(trajectory, step)
            add_interaction(step, interaction)
            gaps = step.gaps
    points = trajectory.points[: trajectory.length]
    return Descent(gaps, event, orders, fields, tangents, points, comparison.has_left, interaction)


@compiled
def least_orders(gaps: Array, model: FieldModel) -> Integers:
    """Choose the order of each gap's rule by the accuracy of the field."""
    return choose_orders(map_gaps(gaps), model.digits, model.rules.counts)


@compiled
def next_step(
    gaps: Array, prescribed: float, orders: Integers, now: Forces, tangent: Array, size: StepSize,
    strongest: float, equal_speeds: bool, problem: FlowProblem,
) -> tuple[Step, int]:  # fmt: skip
    """Choose the next step from solved edges; also returns the number of fields that took.

    It is a long one where the edges run in the model, and a short one otherwise, where forces that
    were as large as ``strongest`` are nearly balanced, and where a gap or patch would be gone: no
    field could judge that.
    """
    law, panels = problem.law, problem.model.panels
    table = now.solution.nodes.table
    none = np.empty((0, 0))
    if size.reach >= LEAST_REACH and not near_balance(norm(now.slope), strongest, law):
        limit = step_limits(table, size.reach * law.longest_step, LONG_CLOSING)
        model = model_about(gaps, now, tangent, law, panels)
        flow = flow_through(model, limit, equal_speeds, strongest, law, panels)
        length = np.abs(flow.motion).max()
        if flow.is_at_limit or length > RUNNING_LENGTH * law.longest_step:
            end = flow.points[-1].copy().reshape(gaps.shape)
            if not shortest_length(end) < law.smallest:
                return Step(end, flow.motion, length, flow, none), 0
    limit = step_limits(table, size.share * law.longest_step)
    motion, curvature, tried = short_step(
        gaps, prescribed, orders, now, tangent, limit, equal_speeds, problem
    )
    length = np.abs(motion).max()
    return Step(move_edges(gaps, motion), motion, length, no_flow(), curvature), tried


@compiled
def judge_step(
    step: Step, before: Forces, after: Forces, size: StepSize, law: EdgeLaw
) -> tuple[bool, StepSize]:
    """Judge a step by the field at its end: whether it is accepted, and the next step size."""
    solved = np.isfinite(after.solution.pressure)
    flow = step.flow
    if flow.points.shape[0] > 0:
        error = np.inf
        if solved:
            error = model_error(flow, after.solution.opening, law.critical)
        return error <= 1, after_long_step(size, step.length / law.longest_step, error)
    rises = solved and energy_rises(before.slope, after.slope, step.motion)
    return solved and (not rises or may_raise(size)), after_short_step(size, not rises)


@compiled
def detect_event(step: Step, law: EdgeLaw) -> int:
    """Detect an event after a step; STEP_LIMIT if there is none."""
    if not step.length < np.inf:
        return NO_FIELD
    if shortest_length(step.gaps) < law.smallest:
        return VANISHED
    return AT_REST if step.length < law.rest_step else STEP_LIMIT


@compiled
def extend_by_step(trajectory: Trajectory, step: Step) -> Trajectory:
    """Add the points of a step to a trajectory."""
    points = step.flow.points
    for i in range(points.shape[0]):
        trajectory = append_point(trajectory, points[i])
    if points.shape[0] == 0:
        trajectory = append_point(trajectory, step.gaps.ravel())
    return trajectory


@compiled
def add_interaction(step: Step, interaction: Array) -> None:
    """Add to ``interaction`` what the edges took from each other in a step."""
    if step.flow.points.shape[0] > 0:
        interaction += step.flow.interaction
    else:
        add_forces(step.curvature, step.motion, interaction)
