"""The field of given gaps by one dense matrix, and tangents by differences of it."""

from __future__ import annotations

import numpy as np
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.field.solution import FieldModel, MeanResponse, Solution, edge_openings
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, Integers, choose_orders

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.equilibrium.griffith import imbalance
from adhesis.solver.sharp.mechanics import EdgeMechanics

_STEP = 1e-6  # of an edge in θ, to both sides


def solve_densely(
    gaps: Array, prescribed: float, model: FieldModel, orders: Integers | None = None
) -> Solution:
    """Solve (1) of ``gap_field``, the kernel between gaps written as it stands there."""
    if orders is None:
        orders = choose_orders(map_gaps(gaps), model.digits, GAUSS_RULES.counts)
    tree, _ = solve_many(gaps, prescribed, orders, 2, model)
    nodes, equations = tree.nodes, tree.equations  # of each gap by itself
    half = 0.5 * (nodes.theta[:, None] - nodes.theta)
    np.fill_diagonal(half, 1.0)
    matrix = -nodes.weight[:, None] * nodes.weight / (4 * np.pi * np.sin(half) ** 2)
    for k in range(len(gaps)):
        own = slice(nodes.offset[k], nodes.offset[k + 1])
        matrix[own, own] = equations.matrix[own, : own.stop - own.start]
    solved = np.linalg.solve(matrix, equations.load)
    load_mean, unit_mean = equations.load[:, 1] @ solved[:, :2]
    weight, compliance = model.device
    resistance = weight * unit_mean + 2 * np.pi * compliance
    pressure = -(2 * np.pi * prescribed + weight * load_mean) / resistance
    f = -solved[:, 0] - pressure * solved[:, 1]
    opening = edge_openings(f[:, None], nodes, GAUSS_RULES)[:, 0]
    opening -= (np.sqrt(2 * nodes.slope) * equations.end_terms[:, :, 0]).ravel()
    return Solution(
        nodes=nodes,
        equations=equations,
        solved=solved,
        mean=MeanResponse(weight, unit_mean, resistance),
        separation=-(load_mean + pressure * unit_mean) / (2 * np.pi),
        pressure=pressure,
        scaled_opening=f,
        opening=opening,
    )


def dense_residual(
    gaps: Array, prescribed: float, edges: EdgeMechanics, orders: Integers | None = None
) -> Array:
    """Compute C_e - C_c at all edges."""
    of = solve_densely(gaps, prescribed, edges.model, orders)
    residual: Array = imbalance(of, edges.law, edges.model.panels)[0]
    return residual


def dense_tangent(gaps: Array, prescribed: float, edges: EdgeMechanics) -> Array:
    """Compute ∂(C_e - C_c)/∂n_f between all edges, by central differences."""
    columns, orders = [], choose_orders(map_gaps(gaps), edges.model.digits, GAUSS_RULES.counts)
    for f in range(gaps.size):
        way = np.zeros(gaps.size)
        way[f] = _STEP * (1 - 2 * (f % 2))
        way = way.reshape(-1, 2)
        ends = [dense_residual(gaps + s * way, prescribed, edges, orders) for s in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2 * _STEP))
    return np.stack(columns, axis=1)
