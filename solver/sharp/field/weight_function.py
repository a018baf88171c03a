"""Compute the weight functions of the edges: changes of the field when an edge moves.

The derivative of the field with respect to an edge is the homogeneous solution with an opening
∝ 1/sqrt(r) there (Bueckner's and Rice's weight function). It is split into the opening
sqrt((1∓η)/(1±η)) of the edge's own gap and a regular part. The density of the former at the nodes
is 1/(1±η) and, as the rule is exact for polynomials only, a further weight π/(M+1) at the edge
itself. Its load on all nodes is the right-hand side of the regular part.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.field.assembly import mapped_kernel, periodic_images
from adhesis.solver.sharp.field.exterior import Exterior, ExteriorCoupling, exterior_kernel
from adhesis.solver.sharp.field.solution import (
    Nodes,
    Solution,
    edge_openings,
    subtract_end_terms,
)
from adhesis.solver.sharp.gap.conformal_map import ALPHA, LEFT
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers


@compiled
def end_singularity(nodes: Nodes, e: int, rules: GaussRules, density: Array) -> tuple[float, float]:
    """Compute the singular opening of edge e: weight at the edge, and area.

    ``density`` is filled with that at the nodes of its gap.
    """
    k, side = e // 2, e % 2
    offset, weight, eta = nodes.offset, nodes.weight, rules.eta
    base, m = offset[k], offset[k + 1] - offset[k]
    start = rules.vector_start[nodes.orders[k]]
    singular_weight = np.pi / (m + 1) / nodes.slope[k, side]
    area = singular_weight
    for j in range(m):
        x = eta[start + j]
        density[j] = 1 / (1 + x) if side == 0 else 1 / (1 - x)
        area += weight[base + j] * density[j]
    return singular_weight, area


@compiled
def own_singular_load(
    nodes: Nodes, e: int, block: Array, density: Array, singular_weight: float, rules: GaussRules,
    out: Array,
) -> None:  # fmt: skip
    """Load the gap of edge e by the edge's singular opening, into ``out``.

    ``block`` is the gap's diagonal block.
    """
    k, side = e // 2, e % 2
    order = nodes.orders[k]
    base, m = nodes.offset[k], density.shape[0]
    square = rules.matrix_start[order]
    crack = rules.crack[square : square + m * m].reshape(m, m)
    point = np.pi / (m + 1)
    alpha, edge = nodes.table[k, ALPHA], nodes.table[k, LEFT + side]
    theta, weight, eta, weights = nodes.theta, nodes.weight, rules.eta, rules.weights
    start = rules.vector_start[order]
    for i in range(m):
        total = 0.0
        for j in range(m):
            total -= (block[i, j] - crack[i, j]) * density[j]
        mapped = mapped_kernel(alpha, eta[start + i] - (2 * side - 1))
        images = periodic_images(theta[base + i] - edge)
        near = weights[start + i] * point * mapped
        far = weight[base + i] * singular_weight * images
        out[i] = total + (near + far) / (4 * np.pi)


@compiled
def singular_loads(
    solution: Solution, edges: Integers, columns: int, rules: GaussRules
) -> tuple[Array, Array]:
    """Load all nodes by the singular openings of some edges, one a column; with their areas.

    Columns beyond the edges, for ``cholesky``, are zero, as are those of the exterior of a window,
    a gap without nodes.
    """
    nodes, matrix = solution.nodes, solution.equations.matrix
    offset, table, weight = nodes.offset, nodes.table, nodes.weight
    n = nodes.theta.shape[0]
    load = np.zeros((n, columns))
    area = np.zeros(edges.shape[0])
    sine, cosine = nodes.sine, nodes.cosine
    column, work = np.empty(n), np.empty(n)
    for c in range(edges.shape[0]):
        e = edges[c]
        k = e // 2
        first, behind = offset[k], offset[k + 1]
        if first == behind:
            continue
        density = work[: behind - first]
        singular_weight, area[c] = end_singularity(nodes, e, rules, density)
        rows = matrix[first:behind]
        edge = table[k, LEFT + e % 2]
        _load_by_edge(rows, density, singular_weight, edge, sine, cosine, weight, column)
        own_singular_load(
            nodes, e, rows[:, first:behind], density, singular_weight, rules, column[first:behind]
        )
        load[:, c] = column
    return load, area


@compiled_sums
def _load_by_edge(
    rows: Array,
    density: Array,
    singular_weight: float,
    edge: float,
    sine: Array,
    cosine: Array,
    weight: Array,
    out: Array,
) -> None:
    """Load other gaps, into ``out``, by a density of a gap's ``rows`` and a weight at an edge."""
    scale = singular_weight / (4 * np.pi)
    edge_sine = np.sin(0.5 * edge)
    edge_cosine = np.cos(0.5 * edge)
    for i in range(out.shape[0]):
        half = sine[i] * edge_cosine - cosine[i] * edge_sine
        out[i] = scale * weight[i] / (half * half)
    for j in range(density.shape[0]):
        row = rows[j]
        value = density[j]
        for i in range(out.shape[0]):
            out[i] -= value * row[i]


@compiled
def openings_by_edges(
    solution: Solution, edges: Integers, regular: Array, area: Array, rules: GaussRules
) -> tuple[Array, Array]:
    """Compute ∂C_e/∂θ_f, e ≠ f, shape (2L, edges), and ∂Y/∂θ_f for some edges f.

    ``regular`` are the regular parts at fixed p, which are overwritten; ``area`` are the areas of
    the singular openings. Y is p, under a load q0 s.
    """
    count = edges.shape[0]
    load, slope = solution.equations.load, solution.nodes.slope
    solved, opening = solution.solved, solution.opening
    conjugate = area.copy()
    for i in range(regular.shape[0]):
        for c in range(count):
            conjugate[c] += load[i, 1] * regular[i, c]
    if solution.mean.separation_weight == 0:
        conjugate /= 2 * np.pi  # of the separation; the pressure stays
    else:
        conjugate /= solution.mean.resistance
        for i in range(regular.shape[0]):
            for c in range(count):
                regular[i, c] -= solved[i, 1] * conjugate[c]
    by_edge = edge_openings(regular, solution.nodes, rules)[:, :count].copy()
    for c in range(count):
        f = edges[c]
        k, side = f // 2, f % 2
        by_edge[f ^ 1, c] += 0.5 * np.sqrt(2 * slope[k, 1 - side])  # the singular opening's far end
        by_position = (2 * side - 1) * opening[f] * np.sqrt(slope[k, side] / 8)
        conjugate[c] *= by_position
        for e in range(by_edge.shape[0]):
            by_edge[e, c] *= by_position
    return by_edge, conjugate


@compiled
def openings_by_translation(solution: Solution, rules: GaussRules) -> Array:
    """Compute the derivatives of all openings when all edges move together against the profile."""
    load, solved = solution.equations.load, solution.solved
    n = solved.shape[0]
    drift = 0.0
    for i in range(n):
        drift -= load[i, 1] * solved[i, 2]
    drift += solution.exterior.shift
    drift = solution.mean.separation_weight * drift / solution.mean.resistance
    moving = np.empty((n, 1))
    for i in range(n):
        moving[i, 0] = -solved[i, 2] - drift * solved[i, 1]
    opening = edge_openings(moving, solution.nodes, rules)[:, 0].copy()
    subtract_end_terms(opening, solution.nodes.slope, solution.equations.end_terms, 1)
    return opening


@compiled
def exterior_singular_terms(
    nodes: Nodes, rules: GaussRules, coupling: ExteriorCoupling, exterior: Exterior
) -> tuple[Array, Array]:
    """Compute the terms of an exterior in loads and areas of a window's singular openings."""
    count = nodes.table.shape[0]
    position, singular_weight = np.zeros(2 * count), np.zeros(2 * count)
    area = np.zeros(2 * count)
    by_node = coupling.kernel @ np.ascontiguousarray(exterior.charge[:, 1])
    work = np.empty(by_node.shape[0])
    for e in range(2 * count - 2):
        k = e // 2
        first, behind = nodes.offset[k], nodes.offset[k + 1]
        density = work[: behind - first]
        singular_weight[e], _ = end_singularity(nodes, e, rules, density)
        position[e] = nodes.table[k, LEFT + e % 2]
        for j in range(first, behind):
            area[e] += density[j - first] * by_node[j]
    at_edge, _ = exterior_kernel(position, singular_weight, exterior)
    area += at_edge @ np.ascontiguousarray(exterior.charge[:, 1])
    load = coupling.response @ np.ascontiguousarray(at_edge.T)
    return load, area
