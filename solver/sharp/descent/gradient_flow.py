"""Descent in energy along a jump: integration of the edges' gradient flow, compiled.

The integrator solves the field, judges the step that led there (``flow_state``), and chooses the
next one, by linear kinetics (``linear_kinetics``) or by the rule that it is compared with, equal
speeds (``bound_constrained_step``). Its step-size control is ``step_size``. It ends with an event.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.bound_constrained_step import bound_constrained_step
from adhesis.solver.sharp.descent.edge_forces import (
    FlowProblem,
    ForceRows,
    Forces,
    add_interaction,
    forces_at,
)
from adhesis.solver.sharp.descent.flow_state import (
    State,
    accepted,
    accepted_share,
    bounded,
    initial_state,
    moved,
    share_to_minimum,
    taken_back,
    turned,
)
from adhesis.solver.sharp.descent.linear_kinetics import flow_step, hessian
from adhesis.solver.sharp.descent.saddle import QuadraticModel, step_off_saddle
from adhesis.solver.sharp.descent.step_size import keeps_tangent, turns_back
from adhesis.solver.sharp.descent.trajectory import (
    Comparison,
    Trajectory,
    begun,
    compared,
    extended,
    note_force,
    without_last,
)
from adhesis.solver.sharp.equilibrium.griffith import (
    EdgeLaw,
    edge_tangent,
    raise_orders,
    shortest_length,
    step_limits,
    symmetrise,
)
from adhesis.solver.sharp.field.solution import FieldModel, no_solution
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers, choose_orders
from adhesis.solver.sharp.tolerances import COMPARISONS, FIELDS_PER_COMPARISON

# Events that end a descent.
AT_REST = 0  # the steps have become short: Newton's iteration finds the equilibrium
VANISHED = 1  # a gap or patch is below the smallest length
STEP_LIMIT = 2  # the fields that were allowed are used up
NO_FIELD = 3  # the edges have no field
REJOINED = 4  # the descent is on the other one's trajectory again


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
    forces : array, shape (n - 1,)
        Norm of dU/dn at each of them but the last.
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
    forces: Array
    has_left: bool
    interaction: Array


@compiled
def descend(
    gaps: Array,
    prescribed: float,
    most_fields: int,
    least: Integers,
    equal_speeds: bool,
    system: FlowProblem,
    comparison: Comparison,
) -> Descent:
    """Descend in energy, d being ``prescribed``, until an event.

    No edge moves in a step by more than the longest step, or a quarter of the gap or patch that it
    may close. Forces are always fresh; a tangent serves several steps while edges run, unless one
    turns. ``least`` are the least orders of the gaps, empty for any.
    """
    law, rules = system.law, system.model.rules
    state = initial_state(gaps)
    trajectory = begun(gaps)
    orders = least
    edges = 2 * gaps.shape[0]
    solution = no_solution(map_gaps(gaps), np.empty(0, dtype=np.int64), system.model.device)
    rows = ForceRows(np.zeros((edges, edges)), np.zeros(edges, dtype=np.int64))
    interaction = np.zeros((edges, edges))
    values, matrix = np.zeros(edges), np.zeros((edges, edges))
    fields, tangents, event = 0, 0, STEP_LIMIT
    while fields < most_fields:
        fields += 1
        orders = raise_orders(least_orders(state.gaps, system.model), orders)
        now = forces_at(state.gaps, prescribed, orders, solution, system)
        solution = now.solution
        if not np.isfinite(solution.pressure):
            event = NO_FIELD
            break
        rows.known[:] = 0
        share = accepted_share(state, now.slope, share_to_minimum(state, now, rows, rules))
        if share < 1:
            state, trajectory = backed_up(state, share, trajectory, rows, interaction)
            continue
        add_interaction(rows.values, state.step, interaction)
        state = accepted(state, now.slope)
        note_force(trajectory, now.slope)
        if fields % FIELDS_PER_COMPARISON == 0:
            comparison = compared(comparison, state.gaps, law.longest_step)
            if comparison.matches == COMPARISONS:
                event = REJOINED
                break
        keeps = keeps_tangent(state.size)
        if not keeps:
            tangents += 1
            values, matrix = linearise(now, rows, equal_speeds, system)
        state, lengths = bounded(state, law.longest_step)
        model = QuadraticModel(values, matrix, step_limits(solution.nodes.table, lengths.reach))
        step = kinetic_step(model, now, equal_speeds, law.force_error)
        if keeps and turns_back(step, state.step, lengths.reach):
            state = turned(state)
            continue
        close_overlaps(step, solution.opening, model.limit, law.overlap_limit)
        if not keeps and np.abs(step).max() <= law.field_error:
            step, tried = step_off_saddle(
                step, model, state.gaps, prescribed, orders, equal_speeds, system
            )
            fields += tried
        length = np.abs(step).max()
        if not length < np.inf:
            event = NO_FIELD
            break
        state = moved(state, step, now, lengths, model.limit, rows, rules)
        trajectory = extended(trajectory, state.gaps)
        event = event_after(state.gaps, length, law)
        if event != STEP_LIMIT:
            break
    if event == VANISHED:
        add_interaction(rows.values, state.step, interaction)
    points = trajectory.points[: trajectory.length]
    forces = trajectory.forces[: trajectory.length - 1]
    return Descent(
        state.gaps, event, orders, fields, tangents, points, forces, comparison.has_left,
        interaction,
    )  # fmt: skip


@compiled
def least_orders(gaps: Array, model: FieldModel) -> Integers:
    """Choose the order of each gap's rule by the accuracy of the field."""
    return choose_orders(map_gaps(gaps), model.digits, model.rules.counts)


@compiled
def backed_up(
    state: State, share: float, trajectory: Trajectory, rows: ForceRows, interaction: Array
) -> tuple[State, Trajectory]:
    """Take the last step back to a ``share`` of it, and correct the record of the descent."""
    step = share * state.step
    state = taken_back(state, share)
    trajectory = without_last(trajectory)
    if share > 0:
        add_interaction(rows.values, step, interaction)
        trajectory = extended(trajectory, state.gaps)
    return state, trajectory


@compiled
def event_after(gaps: Array, length: float, law: EdgeLaw) -> int:
    """Detect an event after a step of this length; STEP_LIMIT if there is none."""
    if shortest_length(gaps) < law.smallest:
        return VANISHED
    return AT_REST if length < law.rest_step else STEP_LIMIT


@compiled
def linearise(
    now: Forces, rows: ForceRows, equal_speeds: bool, system: FlowProblem
) -> tuple[Array, Array]:
    """Linearise the forces about the present edges: values and matrix of the quadratic model."""
    of, opening, drift, derivatives = now.solution, now.solution.opening, now.drift, rows.values
    tangent, _ = edge_tangent(of, drift, system.model.rules)
    edges = tangent.shape[0]
    for e in range(edges):
        for f in range(edges):
            derivatives[e, f] = opening[e] * tangent[e, f]
        derivatives[e, e] += opening[e] * drift[e] * (1 - 2 * (e % 2))
    rows.known[:] = 1
    if equal_speeds:
        values, matrix = symmetrise(of, tangent, system.law.overlap_limit)
    else:
        positive = np.maximum(opening, 0.0)
        values, matrix = np.linalg.eigh(hessian(positive, now.residual, drift, tangent))
    return values, matrix


@compiled
def kinetic_step(model: QuadraticModel, now: Forces, equal_speeds: bool, faint: float) -> Array:
    """Choose the step of all edges, by linear kinetics or with equal speeds.

    By linear kinetics edges move in proportion to their excess energy release rates. With equal
    speeds, for comparison, edges out of equilibrium run, all at the same speed (their limit, twice
    as long for one that runs alone), and edges near equilibrium follow them by Newton's step.
    """
    if equal_speeds:
        return bound_constrained_step(model.matrix, model.values, -now.residual, model.limit)
    return flow_step(model.values, model.matrix, -now.slope, model.limit, faint)


@compiled
def close_overlaps(step: Array, opening: Array, limit: Array, overlapping: float) -> None:
    """Let contact grow as far as it may at edges beside which surfaces would overlap."""
    for e in range(step.shape[0]):
        if opening[e] < -overlapping:
            step[e] = limit[e]
