"""Equilibrium of many gaps by Newton's iteration on their linear response, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import move_edges, shortest_length
from adhesis.solver.sharp.equilibrium.linear_response import (
    LinearResponse,
    motion_to,
    no_motion,
    pressure_at,
    solve_response,
)
from adhesis.solver.sharp.equilibrium.renewal import (
    move_references,
    outdated_references,
)
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.tolerances import (
    HIERARCHICAL_NEWTON_GROWTH,
    MOST_CORRECTIONS,
    STALLED_SHARE,
)


class EquilibriumOfMany(NamedTuple):
    """Result of Newton's iteration on many gaps.

    Attributes
    ----------
    found : bool
        Whether a stable equilibrium was found within reach.
    is_outgrown : bool
        Whether the iteration ended because a gap or run needs more nodes than the response has.
    gaps : array, shape (L, 2)
    potential : array, shape (N,)
        Of the other gaps at the reference nodes, as G.
    rate : array, shape (2L,)
        dn/dd of every edge along the branch.
    pressure, separation : float
    slope : float
        dY/dd along the branch: Y is p, under a load q0 s.
    corrections : int
    """

    found: bool
    is_outgrown: bool
    gaps: Array
    potential: Array
    rate: Array
    pressure: float
    separation: float
    slope: float
    corrections: int


@compiled_for_both
def equilibrium_many(
    response: LinearResponse,
    gaps: Array,
    prescribed: float,
    reach: float,
    strict: bool,
    law: EdgeLaw,
    model: FieldModel,
) -> EquilibriumOfMany:
    """Find the equilibrium next to ``gaps`` on the linear response about nearby gaps.

    The references of gaps follow where they move by more than that to which the response is
    accurate. Where the edges are not stable on the way, or the corrections hardly shrink, the
    iteration ends.
    """
    travelled = np.zeros(gaps.size)
    last = np.inf
    judged_again = False
    found = False
    is_outgrown = False
    steps = 0
    pressure = pressure_at(response, prescribed, model.device)
    none_held = np.zeros(gaps.size, dtype=np.bool_)
    now = no_motion(gaps.shape[0])
    while True:
        steps += 1
        if not move_references(response, gaps, none_held, pressure, prescribed, law, model):
            is_outgrown = True
            break
        now = solve_response(response, prescribed, law, model.device)
        pressure = now.pressure
        step = now.motion - motion_to(response, gaps)
        size = np.abs(step).max()
        if not np.isfinite(pressure):
            break
        if strict and not now.stable:
            if judged_again or not outdated_references(response, map_gaps(gaps), law)[0].any():
                break
            judged_again = True  # the first time the tangent was that of an outdated reference
            continue
        travelled += step
        # as in ``newton.equilibrium``
        stalled = size <= law.field_error and size > STALLED_SHARE * last
        # not written as > : a size that is no number is a failure, too
        most = max(HIERARCHICAL_NEWTON_GROWTH * last, law.rest_step)
        within = size <= min(reach, most)
        moved = move_edges(response.nodes.table[:, :2], now.motion)
        if not (within and np.abs(travelled).max() <= reach and shortest_length(moved) > 0):
            break
        gaps = moved
        at_rest = stalled or (not strict and size <= law.rest_step)
        if at_rest or not outdated_references(response, map_gaps(gaps), law)[0].any():
            found = True
            break
        if steps == MOST_CORRECTIONS:
            break
        last = size
    potential = np.empty(response.nodes.theta.shape[0])
    for i in range(potential.shape[0]):
        potential[i] = response.potential[0, i] + pressure * response.potential[1, i]
    return EquilibriumOfMany(
        found, is_outgrown, gaps, potential, now.rate, pressure, now.separation, now.slope, steps
    )
