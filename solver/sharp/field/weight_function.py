"""Compute the singular openings of the edges, which change the field when an edge moves.

The derivative of the field with respect to an edge is the homogeneous solution with an opening
∝ 1/sqrt(r) there (Bueckner's and Rice's weight function). It is split into the opening
sqrt((1∓η)/(1±η)) of the edge's own gap and a regular part. The density of the former at the nodes
is 1/(1±η) and, as the rule is exact for polynomials only, a further weight π/(M+1) at the edge
itself. Its load on the gap is the right-hand side of the regular part.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.assembly import mapped_kernel, periodic_images
from adhesis.solver.sharp.field.solution import Nodes
from adhesis.solver.sharp.gap.conformal_map import ALPHA, LEFT
from adhesis.solver.sharp.gap.quadrature import GaussRules


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
def end_charges(
    nodes: Nodes, block: Array, e: int, rules: GaussRules, work: Array, load: Array, charge: Array
) -> float:
    """Compute load on the own gap, charges and area of the singular opening of edge e.

    ``block`` is the diagonal block of its gap, ``work`` has space for the nodes of a gap.
    """
    k, side = e // 2, e % 2
    m = load.shape[0]
    density = work[:m]
    strength, area = end_singularity(nodes, e, rules, density)
    own_singular_load(nodes, e, block, density, strength, rules, load)
    start = rules.vector_start[nodes.orders[k]]
    point = np.pi / (m + 1)
    for j in range(m):
        ends = point * rules.end_values[side, start + j]
        charge[j] = rules.weights[start + j] * density[j] + ends
    return area
