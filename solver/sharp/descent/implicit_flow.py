"""Descent in energy along a jump: the gradient flow of the edges, on the tree of gaps; compiled.

With n the outward motions and f = C_c² - C² the forces, the edges follow ṅ = f. Few of them run at
a time: their tangent, with all others following, is condensed from the linear response
(``condensed``). With it the flow of these edges is integrated through a model of their openings
(``model_flow``), over several shortest waves where they run, and over a fraction of one near
equilibria and saddles, where a gap closes or a patch vanishes. The field at the end of each step
shows how wrong the model was. The others follow linearly.

Where the edges are not stable, those that run are damped in the response: in the tangent of their
gap a force 1/Δτ resists their motion. The condensed tangent is taken without it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.descent.edge_model import model_about
from adhesis.solver.sharp.descent.model_flow import (
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
    condensed_residual,
    follow_edges,
    stiffness_of,
    undamped,
)
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
from adhesis.solver.sharp.equilibrium.renewal import condense_gaps, damp_edges, move_references
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import (
    CLOSING_SHARE,
    DAMPING_GROWTH,
    FOLLOWING,
    FURTHEST_FOLLOWING,
    LEAST_DAMPING,
    LEAST_REACH,
    LONG_CLOSING,
    MOST_DAMPING,
    REACH_CUT,
    RUNNING,
    RUNNING_LENGTH,
    SHORT_REACH,
    SHORTEST_REACH,
    SOFT_SHARE,
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
    """

    event: int
    gaps: Array
    steps: int
    reach: float


@compiled_for_both
def descend(
    response: LinearResponse,
    gaps: Array,
    prescribed: float,
    most: int,
    equal_speeds: bool,
    runs: Flags,
    reach: float,
    law: EdgeLaw,
    model: FieldModel,
) -> Descent:
    """Descend in energy, d being ``prescribed``, until an event.

    ``runs`` marks the edges that run already, and is changed in place; ``reach`` is that of the
    first long step.

    With equal speeds, for comparison, each edge has the time Δτ in which its own force would move
    it by the longest step.
    """
    damping = np.zeros(gaps.size)
    edges: Integers = np.flatnonzero(runs)  # that run, and those beside them
    before, flow = gaps, no_flow()
    pressure = pressure_at(response, prescribed, model.device)
    strongest, event, steps = 0.0, STEP_LIMIT, 0
    moved, judges = True, False
    stiffness = np.empty((0, 0))
    damped = LEAST_DAMPING
    _damp(damping, runs, damped, response)
    while steps < most:
        if moved:
            if not move_references(response, gaps, damping, pressure, prescribed, law, model):
                event = OUTGROWN
                break
        else:
            condense_gaps(response, damp_edges(response, gaps, damping), model)
        steps, moved, stiffness = steps + 1, False, np.empty((0, 0))
        now = solve_response(response, prescribed, law, model.device)
        if not np.isfinite(now.pressure):
            event = NO_FIELD
            break
        if not now.stable:
            if not _run_soft(runs, response, damped > DAMPING_GROWTH):
                damped *= DAMPING_GROWTH
            if damped > MOST_DAMPING:
                if not judges:
                    event = NO_FIELD
                    break
                # the step was too long
                gaps, judges, moved = before, False, True
                damped, reach = LEAST_DAMPING, max(REACH_CUT * reach, SHORTEST_REACH)
            _damp(damping, runs, damped, response)
            continue
        pressure = now.pressure
        if judges:
            judges = False
            stiffness = stiffness_of(response, edges, now, model.device)
            residual = condensed_residual(stiffness, response, edges, now)
            error = model_error(flow, residual, edges, gaps, law, model.panels)
            length = np.abs(flow.motion).max() / law.longest_step
            reach = max(next_reach(reach, length, error), SHORTEST_REACH)
            if error > 1 and length > 1.5 * SHORTEST_REACH:
                gaps, moved = before, True
                continue
        if _run_more(runs, response, now.motion - response.here, law):
            _damp(damping, runs, damped, response)
            continue
        some = _beside(runs)
        if stiffness.shape[0] == 0 or some.shape[0] != edges.shape[0]:
            edges = some
            stiffness = stiffness_of(response, edges, now, model.device)
        residual = condensed_residual(stiffness, response, edges, now)
        tangent = undamped(stiffness, response, edges)
        force = force_at(residual, edges, gaps, law, model.panels)
        strongest = max(strongest, force)
        is_long = reach >= LEAST_REACH and not near_balance(force, strongest, law)
        far = False
        while True:
            openings = model_about(edges, gaps, residual, tangent, law, model.panels)
            most_motion, share = min(reach, SHORT_REACH) * law.longest_step, CLOSING_SHARE
            if is_long:
                most_motion, share = reach * law.longest_step, LONG_CLOSING
            limit = step_limits(map_gaps(gaps), most_motion, share)[edges]
            flow = flow_through(
                openings, limit, equal_speeds, is_long, strongest, law, model.panels
            )
            size = largest(flow.motion)
            to = response.here[edges] + flow.motion
            way, pressure = follow_edges(stiffness, response, edges, to, now, model.device)
            way -= response.here
            way[edges] = flow.motion  # without rounding
            far = _run_far(runs, edges, way, law)
            there = move_edges(gaps, way)
            vanished = shortest_length(there) < law.smallest
            runs_on = flow.is_at_limit or size > RUNNING_LENGTH * law.longest_step
            if far or not is_long or (runs_on and not vanished):
                break
            is_long = False
            now = solve_response(response, prescribed, law, model.device)
        if far:
            _damp(damping, runs, damped, response)
            continue
        judges = edges.shape[0] > 0
        before, gaps, moved = gaps, there, True
        if vanished:
            event = VANISHED
            break
        if largest(way) < law.rest_step and not flow.is_at_limit:
            event = AT_REST
            break
        _damp(damping, runs, damped, response)
    return Descent(event, gaps, steps, reach)


@compiled
def force_at(
    residual: Array, edges: Integers, gaps: Array, law: EdgeLaw, panels: Panels
) -> float:
    """Compute the norm of the forces C_c² - C |C| from C - C_c at some edges."""
    square = 0.0
    for i in range(edges.shape[0]):
        critical, _ = critical_opening(gaps[edges[i] // 2, edges[i] % 2], law, panels)
        opening = residual[i] + critical
        square += (critical * critical - opening * abs(opening)) ** 2
    return float(np.sqrt(square))


@compiled
def _damp(damping: Array, runs: Flags, times: float, response: LinearResponse) -> None:
    """Damp the edges that run by so many times the tangent of their gaps."""
    tangent = response.tangent
    for e in range(damping.shape[0]):
        damping[e] = 0.0
        if runs[e]:
            damping[e] = times * (abs(tangent[e, 0]) + abs(tangent[e, 1]))


@compiled
def _run_soft(runs: Flags, response: LinearResponse, everywhere: bool) -> bool:
    """Let the edges of gaps next to a fold run, or those of all; returns whether they are more."""
    more, softest = False, response.softness.max()
    for e in range(runs.shape[0]):
        soft = response.softness[e // 2] > SOFT_SHARE * softest
        if not runs[e] and (everywhere or soft):
            runs[e], more = True, True
    return more


@compiled
def _run_more(runs: Flags, response: LinearResponse, ahead: Array, law: EdgeLaw) -> bool:
    """Let edges run that are out of balance or move far; returns whether they are more."""
    more = False
    for e in range(runs.shape[0]):
        unbalanced = abs(response.residual[e]) > RUNNING * law.critical
        far = abs(ahead[e]) > FOLLOWING * law.longest_step
        if (unbalanced or far) and not runs[e]:
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
