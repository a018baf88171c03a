"""Descent in energy along a jump: the gradient flow of the edges, on the tree of gaps; compiled.

With n the outward motions and f = C_c² - C² the forces, the edges follow ṅ = f. Few of them run at
a time. These, and those beside them, are held in the linear response, so that the others are
stable and follow; of the held ones the tangent is condensed (``condensed``). With it their flow is
integrated through a model of their openings (``model_flow``), over several shortest waves where
they run, and over a fraction of one near equilibria and saddles, where a gap closes or a patch
vanishes. The field at the end of each step shows how wrong the model was.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.descent.edge_model import model_about
from adhesis.solver.sharp.descent.model_flow import (
    ModelFlow,
    flow_through,
    largest,
    near_balance,
    no_flow,
)
from adhesis.solver.sharp.descent.step_size import (
    model_error,
    next_reach,
)
from adhesis.solver.sharp.equilibrium.condensed import (
    HeldEdges,
    follow_edges,
    residual_of,
    tangent_of,
)
from adhesis.solver.sharp.equilibrium.edge_law import (
    EdgeLaw,
    Flags,
    at_memory,
    critical_of,
    critical_opening,
    way_from_memory,
)
from adhesis.solver.sharp.equilibrium.griffith import (
    move_edges,
    rest_within,
    shortest_length,
    step_limits,
)
from adhesis.solver.sharp.equilibrium.linear_response import (
    LinearResponse,
    ResponseSolution,
    imbalance_of,
    motion_to,
    pressure_at,
    solve_response,
)
from adhesis.solver.sharp.equilibrium.renewal import condense_gaps, hold_edges, move_references
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import (
    CLOSING_SHARE,
    FOLLOWING,
    FURTHEST_FOLLOWING,
    HELD_BACK,
    LEAST_REACH,
    LONG_CLOSING,
    LONGEST_STEP,
    RAN,
    RUNNING,
    RUNNING_LENGTH,
    SHORTEST_REACH,
)

# Events that end a descent.
AT_REST = 0  # the steps have become short: Newton's iteration finds the equilibrium
VANISHED = 1  # a gap or patch is below the smallest length
STEP_LIMIT = 2  # the steps that were allowed are used up
NO_FIELD = 3  # the edges have no field
OUTGROWN = 4  # some gap needs more nodes than the linear response has


class Descent(NamedTuple):
    """Result of a descent.

    Attributes
    ----------
    event : int
        Why it ended: one of the events of this module.
    gaps : array, shape (L, 2)
        Where it ended.
    steps : int
        Solutions of the linear response.
    reach : float
        Of the next long step, in longest steps.
    raced : bool
        Whether the order in which the edges ran may have decided where they ended: some took so
        much force from others. Edges that increase each other's force end alike in any order.
    """

    event: int
    gaps: Array
    steps: int
    reach: float
    raced: bool


class Running(NamedTuple):
    """What a descent knows of the way that its edges have come.

    Attributes
    ----------
    edges : bool array, shape (2L,)
        Those that run; changed in place.
    start : array, shape (L, 2)
        Where they began to run.
    reach : float
        Of the first long step, in longest steps.
    """

    edges: Flags
    start: Array
    reach: float


@compiled_for_both
def descend(
    response: LinearResponse,
    gaps: Array,
    prescribed: float,
    most: int,
    equal_speeds: bool,
    running: Running,
    law: EdgeLaw,
    model: FieldModel,
) -> Descent:
    """Descend in energy, d being ``prescribed``, until an event.

    Without adhesion the edges are stable but where patches come or go: all take Newton's steps,
    each edge within its limit. With equal speeds, for comparison, each edge has the time Δτ in
    which its own force would move it by the longest step.
    """
    runs, reach = running.edges, running.reach
    held, before, flow = _held_edges(runs, gaps, law), gaps, no_flow()
    edges: Integers = np.flatnonzero(held)
    pressure = pressure_at(response, prescribed, model.device)
    strongest, event, steps = 0.0, STEP_LIMIT, 0
    moved, judges = True, False
    tangent = np.empty((0, 0))
    while steps < most:
        if not moved:
            condense_gaps(response, hold_edges(response, gaps, held, law), law, model)
        elif not move_references(response, gaps, held, pressure, prescribed, law, model):
            event = OUTGROWN
            break
        steps, moved = steps + 1, False
        now = solve_response(response, prescribed, law, model.device)
        if not np.isfinite(now.pressure):
            event = NO_FIELD
            break
        pressure, residual = now.pressure, residual_of(response, edges, now)
        if judges:
            judges = False
            error = model_error(flow, residual, edges, gaps, law, model.panels)
            length = largest(flow.motion) / law.longest_step
            reach = max(next_reach(reach, length, error), SHORTEST_REACH)
            if error > 1 and length > 1.5 * SHORTEST_REACH:
                gaps, moved = before, True
                continue
        more = _run_more(runs, response, now.motion - response.here, law)
        if not (now.stable or more):
            more = _run_weakest(runs, held, response, now)
            if not more:
                event = NO_FIELD
                break
        if not more:
            tangent = tangent_of(response, edges, now, model.device)
            openings = HeldEdges(edges, residual, tangent)
            flow, strongest = _flow_on(
                openings, gaps, strongest, reach, equal_speeds, law, model.panels
            )
            way, pressure = follow_edges(response, edges, flow.motion, now, model.device)
            way -= motion_to(response, gaps)
            way[edges] = flow.motion  # without rounding
            is_cut, more = _limit_others(runs, held, way, gaps, law)
        if more:
            held = _held_edges(runs, gaps, law)
            edges = np.flatnonzero(held)
            continue
        judges, moved = edges.shape[0] > 0, True
        before, gaps = gaps, move_edges(gaps, way)
        if shortest_length(gaps) < law.smallest:
            event = VANISHED
            break
        if largest(way) < rest_within(gaps, law) and not (flow.is_at_limit or is_cut):
            event = AT_REST
            break
    raced = law.critical > 0 and _may_race(edges, tangent, running.start, gaps, law)
    return Descent(event, gaps, steps, reach, raced)


@compiled
def _flow_on(
    held: HeldEdges,
    gaps: Array,
    strongest: float,
    reach: float,
    equal_speeds: bool,
    law: EdgeLaw,
    panels: Panels,
) -> tuple[ModelFlow, float]:
    """Let held edges flow through the model; returns also the largest norm of forces so far.

    A long step that comes to rest, or to where a gap or patch vanishes, is taken as a short one.
    """
    edges = held.edges
    force = force_at(held.residual, edges, gaps, law, panels)
    strongest = max(strongest, force)
    is_long = reach >= LEAST_REACH and not near_balance(force, strongest, law)
    while True:
        openings = model_about(edges, gaps, held.residual, held.tangent, law, panels)
        most, share = min(reach, 1.0) * law.longest_step, CLOSING_SHARE
        if is_long:
            most, share = reach * law.longest_step, LONG_CLOSING
        limit = step_limits(map_gaps(gaps), most, share)[edges]
        flow = flow_through(openings, limit, equal_speeds, is_long, strongest, law, panels)
        motion = np.zeros(gaps.size)
        motion[edges] = flow.motion
        vanished = shortest_length(move_edges(gaps, motion)) < law.smallest
        runs_on = flow.is_at_limit or largest(motion) > RUNNING_LENGTH * law.longest_step
        if not is_long or (runs_on and not vanished):
            return flow, strongest
        is_long = False


@compiled
def _limit_others(
    runs: Flags, held: Flags, way: Array, gaps: Array, law: EdgeLaw
) -> tuple[bool, bool]:
    """Let edges run that would follow too far; returns whether any was cut, and any is to run.

    Without adhesion the motions are cut instead.
    """
    if law.critical == 0:
        return _cut(way, step_limits(map_gaps(gaps), law.longest_step)), False
    return False, _run_far(runs, held, way, gaps, law)


@compiled
def _may_race(edges: Integers, tangent: Array, start: Array, gaps: Array, law: EdgeLaw) -> bool:
    """Whether edges that have run from ``start`` took much force C_c² - C² from each other.

    By the tangent at their end, to first order. The order of both ends of a gap or patch that has
    vanished does not matter.
    """
    ran = RAN * law.longest_step / LONGEST_STEP
    count = tangent.shape[0]
    for i in range(count):
        one, side = edges[i] // 2, edges[i] % 2
        way = (1 - 2 * side) * (gaps[one, side] - start[one, side])
        if abs(way) < ran:
            continue
        taken = 0.0
        for j in range(count):
            two, other = edges[j] // 2, edges[j] % 2
            apart = abs(gaps[one, side] - gaps[two, other])
            if i == j or min(apart, 2 * np.pi - apart) < law.smallest:
                continue
            along = (1 - 2 * other) * (gaps[two, other] - start[two, other])
            if abs(along) > ran:
                force = law.critical * (tangent[i, j] + tangent[j, i]) * along
                taken += max(force * np.sign(way), 0.0)
        # not written as > : a force that is no number may be large
        if not taken <= HELD_BACK * law.critical * law.critical:
            return True
    return False


@compiled
def force_at(residual: Array, edges: Integers, gaps: Array, law: EdgeLaw, panels: Panels) -> float:
    """Compute the norm of the forces C_c² - C |C| from C - C_c at some edges."""
    square = 0.0
    for i in range(edges.shape[0]):
        theta = gaps[edges[i] // 2, edges[i] % 2]
        advancing, _ = critical_opening(theta, law, panels)
        opening = residual[i] + advancing
        critical, _, _ = critical_of(edges[i], theta, opening, law, panels)
        square += (critical * critical - opening * abs(opening)) ** 2
    return float(np.sqrt(square))


@compiled
def _run_weakest(runs: Flags, held: Flags, response: LinearResponse, now: ResponseSolution) -> bool:
    """Let the softest edge run where the others are not stable; False if all are held.

    It is sought among the gaps of the smallest run of the tree that is not stable.
    """
    negative, ranges = response.factor.negative, response.tree.gap_range
    first, last = 0, runs.shape[0] // 2 - 1
    for run in range(negative.shape[0]):
        if negative[run] > 0:
            first, last = ranges[run, 0], ranges[run, 1]
            break
    weakest, softest = -1, -1.0
    tangent, by_pressure = response.tangent, response.opening_by_pressure
    for e in range(2 * first, 2 * last + 2):
        if not held[e]:
            stiff = abs(tangent[e, 0]) + abs(tangent[e, 1])
            soft = abs(now.by_pressure[e] / by_pressure[e]) * stiff
            if soft > softest:
                weakest, softest = e, soft
    if weakest < 0:
        return False
    runs[weakest] = True
    return True


@compiled
def _run_more(runs: Flags, response: LinearResponse, ahead: Array, law: EdgeLaw) -> bool:
    """Let edges run that are out of balance; returns whether they are more.

    If none runs yet, those run, too, that Newton's step moves far.
    """
    more, none = False, not runs.any()
    if law.critical == 0:
        return False
    for e in range(runs.shape[0]):
        residual, _ = imbalance_of(response, e, law.pinning)
        pinned = law.pinning > 0 and response.held[e]
        unbalanced = abs(residual) > RUNNING * law.critical and not pinned
        far = abs(ahead[e]) > FOLLOWING * law.longest_step
        if (unbalanced or (none and far)) and not runs[e]:
            runs[e], more = True, True
    return more


@compiled
def _run_far(runs: Flags, held: Flags, way: Array, gaps: Array, law: EdgeLaw) -> bool:
    """Let edges run that would follow too far, or across their memory; returns whether any do."""
    more = False
    for e in range(runs.shape[0]):
        # written so that NaN is too far
        near = abs(way[e]) <= FURTHEST_FOLLOWING * law.longest_step
        if law.pinning > 0:
            gone = way_from_memory(e, gaps[e // 2, e % 2], law)
            near = near and gone * (gone + way[e]) >= 0
        if not (held[e] or near):
            runs[e], more = True, True
    return more


@compiled
def _cut(way: Array, limit: Array) -> bool:
    """Cut the motion of every edge to its limit; returns whether any was longer."""
    is_cut = False
    for e in range(way.shape[0]):
        if abs(way[e]) > limit[e]:
            way[e], is_cut = np.sign(way[e]) * limit[e], True
    return is_cut


@compiled
def _held_edges(runs: Flags, gaps: Array, law: EdgeLaw) -> Flags:
    """Mark the edges that run, those beside them, and those at their memory, which may be pinned.

    All of these are in the model of the openings.
    """
    count = runs.shape[0]
    some = at_memory(gaps, law)
    for e in range(count):
        if runs[e]:
            some[e] = True
            some[(e + 1) % count] = True
            some[e - 1] = True
    return some
