"""Newton's steps of all edges of many gaps towards a minimum, until a window is needed; compiled.

In a jump a few edges run at a time, which a window of few gaps follows (``system.window_descent``).
Between two windows the response is renewed where edges have moved. Where all are near a minimum
Newton's steps lead there; else the next window is chosen, around the edge that is furthest from its
balance or, once all are near it, that Newton's step moves most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.gradient_flow import AT_REST, NO_FIELD, OUTGROWN, STEP_LIMIT
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import move_edges, step_limits
from adhesis.solver.sharp.equilibrium.linear_response import (
    LinearResponse,
    motion_to,
    pressure_at,
    solve_response,
)
from adhesis.solver.sharp.equilibrium.renewal import move_references, renew_held
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.tolerances import FAR_FROM_BALANCE, NEWTON_STEPS_IN_A_ROW


class Approach(NamedTuple):
    """Result of Newton's steps of all edges.

    Attributes
    ----------
    event : int
        STEP_LIMIT if a window is needed, AT_REST next to a minimum, NO_FIELD, or OUTGROWN where the
        response must be set up anew for the gaps that were reached.
    gaps : array, shape (L, 2)
    leading : int
        Gap in the middle of the window.
    longest : float
        Longest motion of an edge in the next of Newton's steps.
    steps : int
        Number of steps.
    """

    event: int
    gaps: Array
    leading: int
    longest: float
    steps: int


@compiled
def approach_minimum(
    response: LinearResponse, gaps: Array, prescribed: float, law: EdgeLaw, model: FieldModel
) -> Approach:
    """Take Newton's steps of all edges while they are stable and short."""
    pressure = pressure_at(response, prescribed, model.device)
    renew_held(response, np.zeros(gaps.shape[0], dtype=np.bool_), law, model)
    steps, leading, longest = 0, 0, np.inf
    while True:
        if not move_references(response, gaps, pressure, prescribed, law, model):
            return Approach(OUTGROWN, gaps, leading, longest, steps + 1)
        now = solve_response(response, prescribed, model.device)
        steps += 1
        pressure = now.pressure
        if not np.isfinite(pressure):
            return Approach(NO_FIELD, gaps, leading, longest, steps)
        step = now.motion - motion_to(response, gaps)
        longest = np.abs(step).max()
        if now.stable and longest < law.rest_step:
            return Approach(AT_REST, move_edges(gaps, step), leading, longest, steps)
        inside = np.all(np.abs(step) <= step_limits(map_gaps(gaps), law.longest_step))
        if not (now.stable and inside and steps <= NEWTON_STEPS_IN_A_ROW):
            leading = leading_gap(response.residual, step, law)
            return Approach(STEP_LIMIT, gaps, leading, longest, steps)
        gaps = move_edges(gaps, step)


@compiled
def leading_gap(residual: Array, step: Array, law: EdgeLaw) -> int:
    """Choose the gap in the middle of a window: of the edge furthest from balance or from rest."""
    if np.abs(residual).max() > FAR_FROM_BALANCE * law.critical:
        return int(np.argmax(np.abs(residual))) // 2
    return int(np.argmax(np.abs(step))) // 2
