"""Griffith's condition at the edges, compiled: imbalance, tangent, and motion of the edges."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw, critical_of
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.gap.conformal_map import LEFT, LEFT_PATCH, RIGHT
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import CLOSING_SHARE


@compiled_for_both
def shortest_length(gaps: Array) -> float:
    """Find the length of the shortest gap or patch."""
    count = gaps.shape[0]
    least = 2 * np.pi
    for k in range(count):
        after = gaps[k + 1, 0] if k + 1 < count else gaps[0, 0] + 2 * np.pi
        least = min(least, gaps[k, 1] - gaps[k, 0], after - gaps[k, 1])
    return least


@compiled
def rest_within(gaps: Array, law: EdgeLaw) -> float:
    """Longest step that counts as rest: less where gaps or patches are short."""
    share: float = CLOSING_SHARE * shortest_length(gaps) / law.longest_step
    return law.rest_step * min(1.0, share)


@compiled
def total_length(gaps: Array) -> float:
    """Add up the lengths of all gaps."""
    total = 0.0
    for k in range(gaps.shape[0]):
        total += gaps[k, 1] - gaps[k, 0]
    return total


@compiled
def imbalance(state: Solution, law: EdgeLaw, panels: Panels) -> tuple[Array, Array]:
    """Compute C_e - C_c at every edge, positive where contact recedes, and dC_c/dθ."""
    opening, table = state.opening, state.nodes.table
    edges = opening.shape[0]
    residual = np.empty(edges)
    drift = np.empty(edges)
    for e in range(edges):
        theta = table[e // 2, LEFT + e % 2]
        critical, drift[e], _ = critical_of(e, theta, opening[e], law, panels)
        residual[e] = opening[e] - critical
    return residual, drift


@compiled
def move_edges(gaps: Array, step: Array) -> Array:
    """Move the contact outwards by ``step`` at every edge."""
    out = np.empty_like(gaps)
    for k in range(gaps.shape[0]):
        out[k, 0] = gaps[k, 0] + step[2 * k]
        out[k, 1] = gaps[k, 1] - step[2 * k + 1]
    return out


@compiled
def raise_orders(orders: Integers, least: Integers) -> Integers:
    """Raise orders to ``least`` (which is empty for no bound) where they are below.

    While edges move towards one state, a gap must not lose modes again, or the field's error would
    drive them to and fro.
    """
    if least.shape[0] == orders.shape[0]:
        return np.maximum(orders, least)
    return orders


@compiled
def step_limits(table: Array, longest: float, share: float = CLOSING_SHARE) -> Array:
    """Limit the step of each edge: ``longest``, or a share of the gap or patch it may close."""
    limit = np.empty(2 * table.shape[0])
    for k in range(table.shape[0]):
        length = table[k, RIGHT] - table[k, LEFT]
        for side in range(2):
            closing = share * min(length, table[k, LEFT_PATCH + side])
            limit[2 * k + side] = min(longest, closing)
    return limit
