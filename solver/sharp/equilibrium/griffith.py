"""Griffith's condition at the edges, compiled: imbalance, tangent, and motion of the edges."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.pinning import pinned_opening, rise, turned_back
from adhesis.solver.sharp.field.edge_derivatives import derivatives
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.gap.conformal_map import LEFT, LEFT_PATCH, RIGHT
from adhesis.solver.sharp.gap.full_contact_stress import Panels, measure_at
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers
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
def total_length(gaps: Array) -> float:
    """Add up the lengths of all gaps."""
    total = 0.0
    for k in range(gaps.shape[0]):
        total += gaps[k, 1] - gaps[k, 0]
    return total


@compiled
def total_motion(before: Array, after: Array) -> float:
    """Add up the motion of all edges between two states of the same gaps."""
    total = 0.0
    for k in range(before.shape[0]):
        total += abs(after[k, 0] - before[k, 0]) + abs(after[k, 1] - before[k, 1])
    return total


@compiled
def critical_opening(theta: float, law: EdgeLaw, panels: Panels) -> tuple[float, float]:
    """Compute C_c at θ of an edge that advances, and its derivative."""
    measure, slope = measure_at(theta, panels)
    root = np.sqrt(measure)
    return law.critical * root, law.critical * slope / (2 * root)


@compiled
def critical_of(
    edge: int, theta: float, opening: float, law: EdgeLaw, panels: Panels
) -> tuple[float, float]:
    """Compute C_c of an edge at θ with the opening C, and its derivative by θ."""
    critical, drift = critical_opening(theta, law, panels)
    if law.pinning == 0:
        return critical, drift
    advancing = critical
    critical, drift = pinned_opening(theta, edge, advancing, drift, law)
    if turned_back(theta, edge, opening - critical, law):
        drift += rise(edge, advancing, law)
    return critical, drift


@compiled
def imbalance(state: Solution, law: EdgeLaw, panels: Panels) -> tuple[Array, Array]:
    """Compute C_e - C_c at every edge, positive where contact recedes, and dC_c/dθ."""
    opening, table = state.opening, state.nodes.table  # each access counts a reference
    edges = opening.shape[0]
    residual = np.empty(edges)
    drift = np.empty(edges)
    for e in range(edges):
        theta = table[e // 2, LEFT + e % 2]
        critical, drift[e] = critical_of(e, theta, opening[e], law, panels)
        residual[e] = opening[e] - critical
    return residual, drift


@compiled
def edge_tangent(state: Solution, drift: Array, rules: GaussRules) -> tuple[Array, Array]:
    """Compute ∂(C_e - C_c)/∂n_f, n the outward motion of the contact, and ∂Y/∂θ_f."""
    matrix, conjugate = derivatives(state, rules)
    for e in range(matrix.shape[0]):
        matrix[e, e] -= drift[e]
        for f in range(1, matrix.shape[0], 2):
            matrix[e, f] = -matrix[e, f]
    return matrix, conjugate


@compiled
def symmetrise(state: Solution, tangent: Array, overlap_limit: float) -> tuple[Array, Array]:
    """Scale the tangent: factors d, and the symmetric matrix d_e tangent_ef / d_f."""
    n = tangent.shape[0]
    d = np.sqrt(np.maximum(state.opening, overlap_limit))
    matrix = np.empty((n, n))
    for e in range(n):
        for f in range(e + 1):
            value = 0.5 * (tangent[e, f] * d[e] / d[f] + tangent[f, e] * d[f] / d[e])
            matrix[e, f] = value
            matrix[f, e] = value
    return d, matrix


@compiled
def move_edges(gaps: Array, step: Array) -> Array:
    """Move the contact outwards by ``step`` at every edge."""
    out = np.empty_like(gaps)
    for k in range(gaps.shape[0]):
        out[k, 0] = gaps[k, 0] + step[2 * k]
        out[k, 1] = gaps[k, 1] - step[2 * k + 1]
    return out


@compiled
def accept_correction(
    gaps: Array, step: Array, travelled: Array, reach: float, longest: float
) -> tuple[bool, Array]:
    """Correct gaps in Newton's iteration; returns whether that is accepted, and the gaps then.

    It is where no edge goes further than ``longest``, nor all corrections together, which are added
    up in ``travelled``, further than ``reach``, and every gap and patch keeps a length.
    """
    travelled += step
    size = np.abs(step).max()
    # written so that NaN is a failure
    within = size <= reach and size <= longest and np.abs(travelled).max() <= reach
    moved = move_edges(gaps, step)
    return within and shortest_length(moved) > 0, moved


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
