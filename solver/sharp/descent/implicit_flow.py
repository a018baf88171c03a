"""Descent in energy along a jump: the gradient flow of the edges, by linearly implicit steps.

With n the outward motions and f = C_c² - C² the forces, a step (1/Δτ + H) Δn = f is Newton's step
with a damping 1/Δτ at the edges that run: one more term in the tangent of each gap, so one pass of
the tree of all gaps gives it (``linear_response``). All other edges follow by their tangent. As the
forces fall the damping goes to zero, and the last step is Newton's. The damping is raised where the
edges are not stable with it: the step would not be downhill.

Where edges run, a step goes over several shortest waves: the flow of these edges is followed
through a model of their openings (``model_flow``), made of their tangent with all others following
(``condensed``), and the field at its end shows how wrong the model was.
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
    near_balance,
    no_flow,
    norm,
)
from adhesis.solver.sharp.descent.step_size import (
    model_error,
    next_reach,
)
from adhesis.solver.sharp.equilibrium.condensed import condense_tangent, follow_edges
from adhesis.solver.sharp.equilibrium.griffith import (
    EdgeLaw,
    critical_opening,
    move_edges,
    shortest_length,
    step_limits,
)
from adhesis.solver.sharp.equilibrium.linear_response import (
    Flags,
    LinearResponse,
    pressure_at,
    solve_response,
)
from adhesis.solver.sharp.equilibrium.renewal import move_references
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import (
    FIRST_REACH,
    FURTHEST_FOLLOWING,
    LEAST_REACH,
    LONG_CLOSING,
    LONGEST_REACH,
    MODEL_STEP,
    MOST_DAMPING,
    RATE_GROWTH,
    REACH_CUT,
    RECOVERY,
    RUNNING,
    RUNNING_LENGTH,
    SLOWEST,
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
    """

    event: int
    gaps: Array
    steps: int


class LongStep(NamedTuple):
    """Step through the model that the field at its end is to judge.

    Attributes
    ----------
    edges : int array
        That run in it; none for no step.
    flow : ModelFlow
    """

    edges: Integers
    flow: ModelFlow


@compiled
def no_long_step() -> LongStep:
    """Make a step that is none."""
    return LongStep(np.empty(0, dtype=np.int64), no_flow())


@compiled_for_both
def descend(
    response: LinearResponse,
    gaps: Array,
    prescribed: float,
    most: int,
    equal_speeds: bool,
    law: EdgeLaw,
    model: FieldModel,
) -> Descent:
    """Descend in energy, d being ``prescribed``, until an event.

    Edges that have begun to run are damped until the end. With equal speeds, for comparison, each
    has the time Δτ in which its own force would move it by the longest step.
    """
    damping = np.zeros(gaps.size)
    runs = np.zeros(gaps.size, dtype=np.bool_)
    before, tried = gaps, no_long_step()
    reach, last = FIRST_REACH, np.zeros(gaps.size)
    pressure, strongest, event, steps = (
        pressure_at(response, prescribed, model.device), 0.0, STEP_LIMIT, 0
    )  # fmt: skip
    least = 1 / (MODEL_STEP * law.longest_step)
    growth = least
    while steps < most:
        if not move_references(response, gaps, damping, pressure, prescribed, law, model):
            event = OUTGROWN
            break
        steps += 1
        now = solve_response(response, prescribed, model.device)
        if not np.isfinite(now.pressure):
            event = NO_FIELD
            break
        if not now.stable:
            growth *= RATE_GROWTH
            if tried.edges.shape[0] > 0 and growth > MOST_DAMPING * least:
                gaps, tried, growth = before, no_long_step(), least
                reach = REACH_CUT
            _run_soft(runs, response, growth > MOST_DAMPING * least)
            _damp(damping, runs, response, growth, equal_speeds, law)
            if growth > MOST_DAMPING**2 * least:
                event = NO_FIELD
                break
            continue
        if tried.edges.shape[0] > 0:
            residual, _ = condense_tangent(response, tried.edges, now, law, model.device)
            error = model_error(tried.flow, _openings(residual, tried.edges, gaps, law, model), law)
            length = np.abs(tried.flow.motion).max() / law.longest_step
            reach = next_reach(reach, length, error)
            tried = no_long_step()
            if error > 1:
                gaps = before
                continue
        ahead = now.motion - response.here
        if _run_more(runs, response, ahead, law):
            _damp(damping, runs, response, growth, equal_speeds, law)
            continue
        pressure = now.pressure
        force = forces_of(response, runs)
        strongest = max(strongest, norm(force))
        balanced = near_balance(norm(force), strongest, law)
        if reach >= LEAST_REACH and runs.any() and not balanced:
            edges = _beside(runs)
            residual, tangent = condense_tangent(response, edges, now, law, model.device)
            openings = model_about(edges, gaps, residual, tangent, law, model.panels)
            limit = step_limits(map_gaps(gaps), reach * law.longest_step, LONG_CLOSING)[edges]
            flow = flow_through(openings, limit, equal_speeds, strongest, law, model.panels)
            length = np.abs(flow.motion).max()
            if flow.is_at_limit or length > RUNNING_LENGTH * law.longest_step:
                to = response.here[edges] + flow.motion
                way = follow_edges(response, edges, to, now, model.device) - response.here
                there = move_edges(gaps, way)
                if _run_far(runs, edges, way, law):
                    _damp(damping, runs, response, growth, equal_speeds, law)
                    continue
                if not shortest_length(there) < law.smallest:
                    before, gaps, tried = gaps, there, LongStep(edges, flow)
                    growth = least
                    _damp(damping, runs, response, growth, equal_speeds, law)
                    continue
        limit = step_limits(map_gaps(gaps), MODEL_STEP * law.longest_step)
        share = 1.0
        for e in range(limit.shape[0]):
            if abs(ahead[e]) > limit[e]:
                share = min(share, limit[e] / abs(ahead[e]))
        ahead *= share
        gaps = move_edges(gaps, ahead)
        if np.abs(ahead).max() < law.rest_step and share == 1 and growth < 1.5 * least:
            event = AT_REST
            break
        if shortest_length(gaps) < law.smallest:
            event = VANISHED
            break
        along = 0.0
        for e in range(limit.shape[0]):
            along += ahead[e] * last[e]
        last = ahead
        reach = min(RECOVERY * reach, LONGEST_REACH)
        growth = 2 * growth if along < 0 else max(0.5 * growth, least)
        _damp(damping, runs, response, growth, equal_speeds, law)
    if event == OUTGROWN:
        response.nodes.table[:] = np.nan
    return Descent(event, gaps, steps)


@compiled
def forces_of(response: LinearResponse, runs: Flags) -> Array:
    """Compute the forces C_c² - C |C| on the edges that run, in the references; else 0."""
    out = np.zeros(runs.shape[0])
    for e in range(runs.shape[0]):
        if runs[e]:
            opening = response.opening[e]
            critical = opening - response.residual[e]
            out[e] = critical * critical - opening * abs(opening)
    return out


@compiled
def _damp(
    damping: Array,
    runs: Flags,
    response: LinearResponse,
    growth: float,
    equal_speeds: bool,
    law: EdgeLaw,
) -> None:
    """Damp the edges that run: 1/Δτ by the largest force or, with equal speeds, by the own one."""
    force = np.abs(forces_of(response, runs))
    most = max(force.max(), 1e-6 * law.critical * law.critical)
    for e in range(damping.shape[0]):
        if runs[e]:
            own = max(force[e], SLOWEST * most) if equal_speeds else most
            damping[e] = growth * own


@compiled
def _run_soft(runs: Flags, response: LinearResponse, everywhere: bool) -> None:
    """Let the edges of gaps next to a fold run, or those of all."""
    for e in range(runs.shape[0]):
        if everywhere or response.softness[e // 2] > 1:
            runs[e] = True


@compiled
def _run_more(runs: Flags, response: LinearResponse, ahead: Array, law: EdgeLaw) -> bool:
    """Let edges run that are out of balance or move far; returns whether they are more."""
    more = False
    for e in range(runs.shape[0]):
        far = abs(response.residual[e]) > RUNNING * law.critical or abs(ahead[e]) > law.rest_step
        if far and not runs[e]:
            runs[e], more = True, True
    return more


@compiled
def _run_far(runs: Flags, edges: Integers, way: Array, law: EdgeLaw) -> bool:
    """Let edges run that would follow too far; returns whether there are any."""
    inside = np.zeros(runs.shape[0], dtype=np.bool_)
    inside[edges] = True
    more = False
    for e in range(runs.shape[0]):
        # written so that NaN is too far
        near = abs(way[e]) <= FURTHEST_FOLLOWING * law.longest_step
        if not (inside[e] or near):
            runs[e], more = True, True
    return more


@compiled
def _beside(runs: Flags) -> Integers:
    """List the edges that run, and those beside them."""
    count = runs.shape[0]
    some = runs.copy()
    for e in range(count):
        if runs[e]:
            some[(e + 1) % count] = True
            some[e - 1] = True
    return np.flatnonzero(some)


@compiled
def _openings(
    residual: Array, edges: Integers, gaps: Array, law: EdgeLaw, model: FieldModel
) -> Array:
    """Compute C from C - C_c at some edges."""
    out = residual.copy()
    for i in range(edges.shape[0]):
        critical, _ = critical_opening(gaps[edges[i] // 2, edges[i] % 2], law, model.panels)
        out[i] += critical
    return out
