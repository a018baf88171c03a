"""Solve the field of the gaps: equation (1) of ``gap_field`` on a tree of gaps.

Gaps interact through ``cluster_tree``, so that the work grows as their number.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.field.assembly import assemble_blocks
from adhesis.solver.sharp.field.cholesky import factor_rows, solve_factored
from adhesis.solver.sharp.field.cluster_tree import Tree, build_tree
from adhesis.solver.sharp.field.solution import (
    FieldModel,
    Nodes,
    Solution,
    balance_means,
    combine_openings,
    mean_openings,
)
from adhesis.solver.sharp.field.tree_factor import (
    TreeFactor,
    downward_pass,
    factor_tree,
    upward_pass,
    whole_tree,
)
from adhesis.solver.sharp.gap.conformal_map import in_order, map_gaps
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers


class FactoredGaps(NamedTuple):
    """Factored equations of many gaps, beyond their :class:`Solution`.

    The matrix of the solution's equations holds the diagonal blocks.

    Attributes
    ----------
    inverse : array
        Inverses of the diagonal blocks, flat.
    weights : array, shape (N,)
        Quadrature weights.
    tree : Tree
    factor : TreeFactor
        Of the gaps with their edges held.
    """

    inverse: Array
    weights: Array
    tree: Tree
    factor: TreeFactor


@compiled
def invert_blocks(nodes: Nodes, blocks: Array, rules: GaussRules) -> tuple[Array, Array, bool]:
    """Invert the diagonal blocks A: A⁻¹ and w A⁻¹ w, flat, and whether all are definite."""
    offset = nodes.offset
    count = offset.shape[0] - 1
    size = 0
    for k in range(count):
        size += (offset[k + 1] - offset[k]) ** 2
    inverse = np.empty(size)
    response = np.empty(size)
    at = 0
    for k in range(count):
        m = offset[k + 1] - offset[k]
        start = rules.vector_start[nodes.orders[k]]
        block = blocks[offset[k] : offset[k + 1], :m]
        if not invert_block(block, inverse[at : at + m * m]):
            return inverse, response, False
        for i in range(m):
            weight = rules.weights[start + i]
            for j in range(m):
                value = inverse[at + i * m + j]
                response[at + i * m + j] = weight * value * rules.weights[start + j]
        at += m * m
    return inverse, response, True


@compiled
def invert_block(block: Array, inverse: Array) -> bool:
    """Invert a diagonal block, flat; returns whether it is definite."""
    m = block.shape[0]
    factor = block.copy()
    if not factor_rows(factor, 0.0):
        return False
    unit = np.zeros((m, m))
    for i in range(m):
        unit[i, i] = 1.0
    solve_factored(factor, unit)
    for i in range(m):
        for j in range(m):
            inverse[i * m + j] = 0.5 * (unit[i, j] + unit[j, i])
    return True


@compiled
def quadrature_weights(nodes: Nodes, rules: GaussRules) -> Array:
    """Collect the quadrature weights w of all nodes."""
    w = np.empty(nodes.theta.shape[0])
    for k in range(nodes.orders.shape[0]):
        start = rules.vector_start[nodes.orders[k]]
        for i in range(nodes.offset[k + 1] - nodes.offset[k]):
            w[nodes.offset[k] + i] = rules.weights[start + i]
    return w


@compiled
def apply_inverse(offset: Integers, inverse: Array, x: Array) -> Array:
    """Multiply the columns of x by the inverse diagonal blocks."""
    out = np.zeros(x.shape)
    at = 0
    for k in range(offset.shape[0] - 1):
        m = offset[k + 1] - offset[k]
        for i in range(m):
            for j in range(m):
                value = inverse[at + i * m + j]
                for c in range(x.shape[1]):
                    out[offset[k] + i, c] += value * x[offset[k] + j, c]
        at += m * m
    return out


@compiled_for_both
def solve_many(
    gaps: Array, prescribed: float, orders: Integers, fields: int, model: FieldModel
) -> tuple[Solution, FactoredGaps]:
    """Solve the field of many gaps, otherwise as one gap after the other.

    Of S' only the load is computed, no solution.
    """
    table = map_gaps(gaps)
    count = table.shape[0]
    ordered = in_order(table)
    if not ordered:  # any edges with a field, whose pressure is then set to NaN
        table = map_gaps(np.arange(2.0 * count).reshape(count, 2) * (np.pi / count))
    nodes, equations = assemble_blocks(table, orders, fields, model)
    offset, load = nodes.offset, equations.load
    inverse, response, definite = invert_blocks(nodes, equations.matrix, model.rules)
    weights = quadrature_weights(nodes, model.rules)
    tree = build_tree(table, offset, nodes.theta, nodes.weight / weights, model.digits, True)
    factor = factor_tree(tree, response, np.zeros(count, dtype=np.int64))
    factored = FactoredGaps(inverse, weights, tree, factor)
    solved = solve_loads(factored, offset, load[:, :2].copy(), np.zeros((load.shape[0], 2)))
    load_mean, unit_mean = mean_openings(load, solved)
    mean, pressure, separation = balance_means(load_mean, unit_mean, prescribed, model.device)
    if not (ordered and definite):
        pressure = np.nan
    f, opening = combine_openings(pressure, solved, nodes, equations.end_terms, model.rules)
    solution = Solution(
        nodes=nodes,
        equations=equations,
        solved=solved,
        mean=mean,
        separation=separation,
        pressure=pressure,
        scaled_opening=f,
        opening=opening,
    )
    return solution, factored


@compiled
def solve_loads(factored: FactoredGaps, offset: Integers, load: Array, charge: Array) -> Array:
    """Apply (B + G)⁻¹ to loads, and to the potentials of further charges of the gaps, as columns.

    The potential of a gap's further charges in that gap itself is part of its load.
    """
    solved = apply_inverse(offset, factored.inverse, load)
    w, own = factored.weights, np.empty(load.shape)
    for i in range(load.shape[0]):
        for c in range(load.shape[1]):
            own[i, c] = w[i] * solved[i, c] + charge[i, c]
    tree = factored.tree
    charges = upward_pass(tree, factored.factor, own)
    potential = np.zeros(charges.potential_of_sibling.shape)
    downward_pass(tree, factored.factor, whole_tree(tree), charges, potential)
    for i in range(load.shape[0]):
        for c in range(load.shape[1]):
            own[i, c] = load[i, c] - w[i] * potential[c, i]
    return apply_inverse(offset, factored.inverse, own)


@compiled
def gap_potentials(solution: Solution, weights: Array) -> Array:
    """Compute the potential of the other gaps at every node, from the balance of its own gap."""
    offset, load, blocks = solution.nodes.offset, solution.equations.load, solution.equations.matrix
    out = np.empty(solution.scaled_opening.shape[0])
    for k in range(offset.shape[0] - 1):
        base = offset[k]
        m = offset[k + 1] - base
        for i in range(base, base + m):
            # A f + w g + S~ + p X = 0
            total = load[i, 0] + solution.pressure * load[i, 1]
            for j in range(m):
                total += blocks[i, j] * solution.scaled_opening[base + j]
            out[i] = -total / weights[i]
    return out
