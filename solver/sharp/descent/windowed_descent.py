"""Descent of many gaps in windows: where edges run, the rest responding linearly; compiled.

In a jump a few edges run at a time. The gaps around them are a window whose edges descend as those
of few gaps do (``gradient_flow``); all other gaps act on it as a linear exterior, their edges
following by their tangent. After some steps, or when the window has come to rest, the others are
put where their tangent leads, the response of what has moved is renewed, and the next window is
chosen: around the edge that is furthest from its balance or, once all are near it, that Newton's
step moves most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.edge_forces import FlowProblem
from adhesis.solver.sharp.descent.gradient_flow import (
    AT_REST,
    NO_FIELD,
    OUTGROWN,
    STEP_LIMIT,
    VANISHED,
    Descent,
    descend,
)
from adhesis.solver.sharp.descent.trajectory import Comparison
from adhesis.solver.sharp.equilibrium.griffith import (
    EdgeLaw,
    move_edges,
    shortest_length,
    step_limits,
)
from adhesis.solver.sharp.equilibrium.linear_exterior import extend_window, open_window
from adhesis.solver.sharp.equilibrium.linear_response import (
    LinearResponse,
    motion_to,
    pressure_at,
    solve_response,
)
from adhesis.solver.sharp.equilibrium.renewal import move_references, renew_held
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.tolerances import (
    FAR_FROM_BALANCE,
    FOLLOWING_SHARE,
    MOST_SHORT_WINDOWS,
    NEWTON_STEPS_IN_A_ROW,
    WINDOW_FIELDS,
    WINDOW_HALF_WIDTH,
    WINDOW_WIDEST,
)


class Span(NamedTuple):
    """Gaps of a window: the first, and how many."""

    first: int
    width: int


class WindowDescent(NamedTuple):
    """Descent in a window on a linearised state.

    Attributes
    ----------
    inside : Descent
        Of the window's gaps.
    outside : array, shape (2L,)
        Outward motion of the edges outside; 0 for those of the window.
    progress : float
        Longest motion of an edge inside.
    """

    inside: Descent
    outside: Array
    progress: float


@compiled
def descend_many(
    response: LinearResponse,
    gaps: Array,
    prescribed: float,
    most_fields: int,
    equal_speeds: bool,
    system: FlowProblem,
) -> Descent:
    """Descend as ``gradient_flow.descend`` does, with many gaps, on a response about such gaps.

    Trajectory and interaction are not known, and left empty. The event is OUTGROWN where the
    response must be set up anew for the gaps that were reached.
    """
    law, model = system.law, system.model
    fields, tangents, event = 0, 0, STEP_LIMIT
    count = gaps.shape[0]
    half = WINDOW_HALF_WIDTH
    newton_steps, short_windows = 0, 0
    orders = response.nodes.orders.copy()
    pressure = pressure_at(response, prescribed, model.device)
    while fields < most_fields:
        renew_held(response, np.zeros(count, dtype=np.bool_), law, model)
        if not move_references(response, gaps, pressure, prescribed, law, model):
            event = OUTGROWN
            break
        now = solve_response(response, prescribed, model.device)
        pressure = now.pressure
        fields += 1
        tangents += 1
        if not np.isfinite(pressure):
            event = NO_FIELD
            break
        step = now.motion - motion_to(response, gaps)
        if now.stable and np.abs(step).max() < law.rest_step:
            gaps = move_edges(gaps, step)
            event = AT_REST
            break
        limit = step_limits(map_gaps(gaps), law.longest_step)
        inside = np.all(np.abs(step) <= limit)
        if now.stable and newton_steps < NEWTON_STEPS_IN_A_ROW and inside:
            newton_steps += 1
            gaps = move_edges(gaps, step)
            continue
        newton_steps = 0
        width = min(2 * half + 1, count - 2)
        leading = leading_gap(response.residual, step, law)
        span = Span((leading - width // 2) % count, width)
        found = descend_in_window(
            response, gaps, span, prescribed, most_fields - fields, limit, equal_speeds, system
        )
        fields += found.inside.fields
        tangents += found.inside.tangents
        if found.inside.event == NO_FIELD:
            event = NO_FIELD
            break
        gaps = all_gaps(gaps, span, found)
        for i in range(width):
            k = (span.first + i) % count
            orders[k] = max(orders[k], found.inside.orders[i])
        if found.inside.event == VANISHED or shortest_length(gaps) < law.smallest:
            event = VANISHED
            break
        short_windows = 0 if found.progress > law.longest_step else short_windows + 1
        if found.progress > law.rest_step and short_windows <= MOST_SHORT_WINDOWS:
            half = WINDOW_HALF_WIDTH
        elif (
            2 * half + 1 >= count - 2
            or half >= WINDOW_WIDEST
            or short_windows > MOST_SHORT_WINDOWS
            or np.abs(step).max() < law.rest_step  # next to a fold
        ):
            event = AT_REST
            break
        else:
            half = min(2 * half, WINDOW_WIDEST)
    renew_held(response, np.zeros(count, dtype=np.bool_), law, model)
    none = np.empty((0, 0))
    return Descent(gaps, event, orders, fields, tangents, none, False, none)


@compiled
def leading_gap(residual: Array, step: Array, law: EdgeLaw) -> int:
    """Choose the gap in the middle of a window: of the edge furthest from balance or from rest."""
    if np.abs(residual).max() > FAR_FROM_BALANCE * law.critical:
        return int(np.argmax(np.abs(residual))) // 2
    return int(np.argmax(np.abs(step))) // 2


@compiled
def descend_in_window(
    response: LinearResponse,
    gaps: Array,
    span: Span,
    prescribed: float,
    most_fields: int,
    limit: Array,
    equal_speeds: bool,
    system: FlowProblem,
) -> WindowDescent:
    """Descend in a window; with all edges outside held if there is no field where they follow."""
    law, model = system.law, system.model
    known = response.nodes.orders
    count = known.shape[0]
    orders = np.zeros(span.width + 1, dtype=np.int64)
    for i in range(span.width):
        orders[i] = known[(span.first + i) % count]
    follow = FOLLOWING_SHARE * law.longest_step
    window, exterior, outside = open_window(
        response, gaps, span.first, span.width, follow, law, model
    )
    held = outside.factor.negative[-1] != 0
    fields, tangents = 0, 0
    while True:
        if held:
            window, exterior, outside = open_window(
                response, gaps, span.first, span.width, 0.0, law, model
            )
        inside_system = FlowProblem(law, model, exterior)
        alone = Comparison(np.empty((0, window.size)), False, 0)
        inside = descend(
            window, prescribed, min(WINDOW_FIELDS, most_fields - fields), orders, equal_speeds,
            inside_system, alone,
        )  # fmt: skip
        fields += inside.fields
        tangents += inside.tangents
        event = inside.event
        motion = np.empty(0)
        if event != NO_FIELD:
            motion = extend_window(
                inside.gaps, prescribed, inside.orders, exterior, outside, response, limit, model
            )  # fmt: skip
            if not np.all(np.isfinite(motion)):  # the window came to edges without a field
                event = NO_FIELD
        if event != NO_FIELD or held:
            break
        held = True
    progress = np.abs(inside.gaps[: span.width] - window[: span.width]).max()
    return WindowDescent(
        Descent(
            inside.gaps, event, inside.orders, fields, tangents, inside.trajectory, False,
            inside.interaction,
        ),
        motion,
        progress,
    )  # fmt: skip


@compiled
def all_gaps(gaps: Array, span: Span, found: WindowDescent) -> Array:
    """Put together the gaps of the whole period after a descent in a window on ``gaps``."""
    count = gaps.shape[0]
    result = move_edges(gaps, found.outside)
    for i in range(span.width):
        turn = 2 * np.pi if span.first + i >= count else 0.0
        result[(span.first + i) % count] = found.inside.gaps[i] - turn
    return result
