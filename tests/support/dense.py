"""The field of given gaps by one dense matrix, and tangents by differences of it."""

from typing import NamedTuple

import numpy as np

from adhesis.solver._kernels import FieldModel, solve_field
from adhesis.solver.model.profile import Array, Integers
from adhesis.solver.sharp.mechanics import EdgeMechanics

_STEP = 1e-6  # of an edge in θ, to both sides


class DenseSolution(NamedTuple):
    """p, q0 s, Xᵀ (B + G)⁻¹ X, and C at each edge."""

    pressure: float
    separation: float
    unit_mean: float
    edge_opening: Array


def solve_densely(
    gaps: Array, prescribed: float, model: FieldModel, orders: Integers | None = None
) -> DenseSolution:
    """Solve (1) of ``gap_field``, the kernel between gaps written as it stands there."""
    tree = solve_field(gaps, prescribed, model, orders)
    theta, width, offset = tree.theta, tree.weight, tree.offset  # of each gap by itself
    half = 0.5 * (theta[:, None] - theta)
    np.fill_diagonal(half, 1.0)
    matrix = -width[:, None] * width / (4 * np.pi * np.sin(half) ** 2)
    for k in range(len(gaps)):
        own = slice(offset[k], offset[k + 1])
        matrix[own, own] = tree.block(k)
    solved = np.linalg.solve(matrix, np.stack([tree.load, width], axis=1))
    load_mean, unit_mean = (float(mean) for mean in width @ solved)
    weight, compliance = model.device.separation_weight, model.device.compliance
    resistance = weight * unit_mean + 2 * np.pi * compliance
    pressure = -(2 * np.pi * prescribed + weight * load_mean) / resistance
    opening = tree.edge_openings(-solved[:, 0] - pressure * solved[:, 1])
    separation = -(load_mean + pressure * unit_mean) / (2 * np.pi)
    return DenseSolution(pressure, separation, unit_mean, opening)


def dense_residual(
    gaps: Array, prescribed: float, edges: EdgeMechanics, orders: Integers | None = None
) -> Array:
    """Compute C_e - C_c at all edges."""
    opening = solve_densely(gaps, prescribed, edges.model, orders).edge_opening
    return np.asarray(opening - edges.law.critical_of(gaps, opening))


def dense_tangent(gaps: Array, prescribed: float, edges: EdgeMechanics) -> Array:
    """Compute ∂(C_e - C_c)/∂n_f between all edges, by central differences."""
    columns, orders = [], solve_field(gaps, prescribed, edges.model).orders
    for f in range(gaps.size):
        way = np.zeros(gaps.size)
        way[f] = _STEP * (1 - 2 * (f % 2))
        way = way.reshape(-1, 2)
        ends = [dense_residual(gaps + s * way, prescribed, edges, orders) for s in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2 * _STEP))
    return np.stack(columns, axis=1)
