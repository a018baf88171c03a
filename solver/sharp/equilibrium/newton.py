"""Equilibrium of the edges by Newton's iteration, compiled, with its stability and its slope."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import (
    accept_correction,
    edge_tangent,
    imbalance,
    raise_orders,
    symmetrise,
)
from adhesis.solver.sharp.equilibrium.pinning import stop_at_band
from adhesis.solver.sharp.field.cholesky import is_definite
from adhesis.solver.sharp.field.dense_solver import solve
from adhesis.solver.sharp.field.exterior import Exterior
from adhesis.solver.sharp.field.solution import FieldModel, Solution, edge_openings
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers, choose_orders
from adhesis.solver.sharp.tolerances import (
    BAND_RESOLVED,
    KNOWN_TANGENT,
    MOST_CORRECTIONS,
    NEWTON_GROWTH,
    NEWTON_SHARE,
    PINNED_CORRECTIONS,
    STALLED_SHARE,
)


class Equilibrium(NamedTuple):
    """Result of Newton's iteration.

    Attributes
    ----------
    found : bool
        Whether a stable equilibrium was found within reach.
    gaps : array, shape (L, 2)
    solution : Solution
    rate : array, shape (2L,)
        dn/dd of every edge along the branch, d the prescribed quantity; empty if not found.
    slope : float
        dY/dd along it: Y is p, under a load q0 s.
    corrections : int
        Their number.
    """

    found: bool
    gaps: Array
    solution: Solution
    rate: Array
    slope: float
    corrections: int


@compiled
def _is_balanced(state: Solution, residual: Array, law: EdgeLaw) -> bool:
    """Return whether the force on every edge is that of rounding."""
    for e in range(residual.shape[0]):
        if not abs(residual[e] * (2 * state.opening[e] - residual[e])) <= law.force_error:
            return False
    return True


@compiled
def equilibrium(
    gaps: Array,
    prescribed: float,
    reach: float,
    least: Integers,
    strict: bool,
    law: EdgeLaw,
    model: FieldModel,
    exterior: Exterior,
) -> Equilibrium:
    """Find the stable equilibrium C_e = C_c near these gaps, no edge moving further than ``reach``.

    ``least`` are the least orders of the gaps, or empty. Unless ``strict``, edges out
    of equilibrium by no more than ``law.rest_step``, or by forces that are rounding, are taken as
    they are.

    Raises
    ------
    LinAlgError
        If a tangent is singular.
    """
    rules = model.rules
    orders = raise_orders(choose_orders(map_gaps(gaps), model.digits, rules.counts), least)
    travelled = np.zeros(gaps.size)
    last = np.inf
    found = False
    rate: Any = np.empty(0)
    slope = np.nan
    steps = 0
    most = MOST_CORRECTIONS * (1 if law.pinning == 0 else PINNED_CORRECTIONS)
    tolerance = max(law.newton_tolerance, NEWTON_SHARE * law.field_error)
    if law.pinning > 0:
        tolerance = min(tolerance, BAND_RESOLVED * law.band)
    while True:
        steps += 1
        state = solve(gaps, prescribed, orders, 2, model, exterior)
        if not np.isfinite(state.pressure):
            break
        residual, drift = imbalance(state, law, model.panels)
        tangent, by_edge = edge_tangent(state, drift, rules)
        step: Any = np.linalg.solve(tangent, -residual)  # numpy promises some float
        stopped = law.pinning > 0 and stop_at_band(gaps.ravel(), step, law)
        size = np.abs(step).max()
        # The field has steps of the size of its error, where panels or modes change: an iteration
        # to and fro across one of them is at its end.
        stalled = size <= law.field_error and size > STALLED_SHARE * last
        if not stopped and (size <= tolerance or stalled):
            _, matrix = symmetrise(state, tangent, law.overlap_limit)
            found = is_definite(matrix) or not strict
            break
        at_rest = not stopped and size <= law.rest_step
        if not strict and (at_rest or _is_balanced(state, residual, law)):
            found = True
            break
        # an edge that leaves its band, or comes to it, changes what the others do
        longest = reach if law.pinning > 0 else NEWTON_GROWTH * last
        accepted, moved = accept_correction(gaps, step, travelled, reach, longest)
        if not accepted or steps == most:
            break
        gaps = moved
        # The iteration converges quadratically: the next correction, and by what share the tangent
        # changes until then, are known beforehand.
        share = (size / last) ** 2
        known = last < np.inf and size * share <= tolerance and share <= KNOWN_TANGENT
        if known and law.pinning == 0:
            _, matrix = symmetrise(state, tangent, law.overlap_limit)
            if is_definite(matrix) or not strict:
                steps += 1
                state = solve(gaps, prescribed, orders, 2, model, exterior)
                found = np.isfinite(state.pressure)
                break
        last = size
    if found:
        rate, slope = _branch_rates(state, tangent, by_edge, rules)
    return Equilibrium(found, gaps, state, rate, slope, steps)


@compiled
def _branch_rates(
    state: Solution, tangent: Array, by_edge: Array, rules: GaussRules
) -> tuple[Any, float]:
    """Compute dn/dd of every edge and dY/dd along the branch, from ∂Y/∂θ of every edge."""
    by_prescribed, solved = -2 * np.pi / state.mean.resistance, state.solved
    unit = np.empty((solved.shape[0], 1))
    for i in range(solved.shape[0]):
        unit[i, 0] = -by_prescribed * solved[i, 1]
    opening = edge_openings(unit, state.nodes, rules)
    rate = np.linalg.solve(tangent, -opening[:, 0])
    slope = by_prescribed
    if state.mean.separation_weight == 0:
        slope = state.mean.unit_mean / (2 * np.pi)
    for e in range(rate.shape[0]):
        slope += by_edge[e] * (rate[e] if e % 2 == 0 else -rate[e])
    return rate, slope
