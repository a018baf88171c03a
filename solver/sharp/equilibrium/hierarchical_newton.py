"""Equilibrium of the edges by Newton's iteration on their linear response, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.condensed import closing_by_pressure, residual_of
from adhesis.solver.sharp.equilibrium.edge_law import (
    EdgeLaw,
    Flags,
    at_memory,
    critical_opening,
    way_from_memory,
)
from adhesis.solver.sharp.equilibrium.griffith import (
    move_edges,
    rest_within,
    shortest_length,
)
from adhesis.solver.sharp.equilibrium.linear_response import (
    LinearResponse,
    ResponseSolution,
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
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.tolerances import (
    HIERARCHICAL_NEWTON_GROWTH,
    MOST_CORRECTIONS,
    PINNED_CORRECTIONS,
    PINNED_SLACK,
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
    pinned_share, pinned_rate : array, shape (2L,)
        Place of C between both critical openings, 0 where an edge begins to advance and 1 where it
        begins to recede, and its derivative by d; NaN for edges that are not pinned. Empty with one
        work of adhesion.
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
    pinned_share: Array
    pinned_rate: Array


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
    pinned = at_memory(gaps, law)
    most = MOST_CORRECTIONS * (PINNED_CORRECTIONS if law.pinning > 0 else 1)
    now = no_motion(gaps.shape[0])
    while True:
        steps += 1
        if not move_references(response, gaps, pinned, pressure, prescribed, law, model):
            is_outgrown = True
            break
        now = solve_response(response, prescribed, law, model.device)
        pressure = now.pressure
        if law.pinning > 0 and np.isfinite(pressure):
            before, gaps = gaps, pin_edges(response, gaps, pinned, now, law, model.panels)
            if (gaps != before).any() and steps < most:
                last = np.inf
                continue
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
        # to and fro across a step of the field, where panels or modes change
        stalled = size <= law.field_error and size > STALLED_SHARE * last
        # not written as > : a size that is no number is a failure, too
        longest = max(HIERARCHICAL_NEWTON_GROWTH * last, law.rest_step)
        within = size <= min(reach, longest)
        moved = move_edges(response.nodes.table[:, :2], now.motion)
        if not (within and np.abs(travelled).max() <= reach and shortest_length(moved) > 0):
            break
        gaps = moved
        at_rest = stalled or (not strict and size <= rest_within(gaps, law))
        if at_rest or not outdated_references(response, map_gaps(gaps), law)[0].any():
            found = True
            break
        if steps >= most:
            break
        last = size
    potential = np.empty(response.nodes.theta.shape[0])
    for i in range(potential.shape[0]):
        potential[i] = response.potential[0, i] + pressure * response.potential[1, i]
    share, share_rate = np.empty(0), np.empty(0)
    if found and law.pinning > 0:
        share, share_rate = pinned_shares(response, gaps, pinned, now, law, model)
    return EquilibriumOfMany(
        found, is_outgrown, gaps, potential, now.rate, pressure, now.separation, now.slope, steps,
        share, share_rate,
    )  # fmt: skip


@compiled
def pin_edges(
    response: LinearResponse, gaps: Array, pinned: Flags, now: ResponseSolution, law: EdgeLaw,
    panels: Panels,
) -> Array:  # fmt: skip
    """Pin edges that come to their memory, and release those whose opening no longer holds them.

    Returns the gaps with these at their memory, or a little to the side to which they are released;
    ``pinned`` is changed likewise.
    """
    edges = np.flatnonzero(pinned)
    residual = residual_of(response, edges, now)
    step = now.motion - motion_to(response, gaps)
    out = gaps.copy()
    for e in range(pinned.shape[0]):
        way = way_from_memory(e, gaps[e // 2, e % 2], law)
        if not pinned[e] and way * (way + step[e]) < 0:
            out[e // 2, e % 2], pinned[e] = law.memory[e // 2, e % 2], True
    slack = PINNED_SLACK * law.force_error / law.critical
    for c in range(edges.shape[0]):
        k, side = edges[c] // 2, edges[c] % 2
        critical, _ = critical_opening(gaps[k, side], law, panels)
        outwards = (1 - 2 * side) * law.newton_tolerance
        if residual[c] < -slack:
            out[k, side], pinned[edges[c]] = gaps[k, side] + outwards, False
        elif residual[c] > law.pinning * critical + slack:
            out[k, side], pinned[edges[c]] = gaps[k, side] - outwards, False
    return out


@compiled
def pinned_shares(
    response: LinearResponse, gaps: Array, pinned: Flags, now: ResponseSolution, law: EdgeLaw,
    model: FieldModel,
) -> tuple[Array, Array]:  # fmt: skip
    """Compute where the openings of pinned edges lie between both critical ones, and the rates."""
    edges, device = np.flatnonzero(pinned), model.device
    residual = residual_of(response, edges, now)
    closing = closing_by_pressure(response, edges, now)
    by_pressure = device.separation_weight * response.mean[1] - 2 * np.pi * device.compliance
    share, rate = np.full(gaps.size, np.nan), np.full(gaps.size, np.nan)
    for c in range(edges.shape[0]):
        critical, _ = critical_opening(gaps[edges[c] // 2, edges[c] % 2], law, model.panels)
        share[edges[c]] = residual[c] / (law.pinning * critical)
        rate[edges[c]] = -closing[c] * 2 * np.pi / by_pressure / (law.pinning * critical)
    return share, rate
