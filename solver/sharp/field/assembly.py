"""Assemble equation (1) of ``gap_field``: nodes, matrix and loads of given gaps.

A gap's own part, its diagonal block and its loads, depends on its row of the table of gaps alone.
Between gaps acts the half-space kernel at their nodes (``cluster_tree``).
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.solution import Equations, FieldModel, Nodes
from adhesis.solver.sharp.gap.chebyshev_moments import gap_moments
from adhesis.solver.sharp.gap.conformal_map import ALPHA, LEFT, RIGHT, theta_at
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers

# Below these arguments the own gap's kernels are taken as series.
_PERIODIC_SERIES = 0.2
_MAPPED_SERIES = 0.3


@compiled
def node_offsets(orders: Integers, rules: GaussRules) -> Integers:
    """Number the first node of each gap, and all."""
    offset = np.zeros(orders.shape[0] + 1, dtype=np.int64)
    for k in range(orders.shape[0]):
        offset[k + 1] = offset[k] + rules.counts[orders[k]]
    return offset


@compiled
def assemble_blocks(
    table: Array, orders: Integers, fields: int, model: FieldModel
) -> tuple[Nodes, Equations]:
    """Assemble the diagonal blocks of (1) alone, with nodes and loads.

    The block of gap k is ``matrix[offset[k] : offset[k + 1], :m]``, m its number of nodes.
    """
    count = table.shape[0]
    nodes, equations = _allocate_blocks(table, orders, fields, model.rules)
    fill_gaps(np.arange(count), nodes, equations, model)
    return nodes, equations


@compiled
def assemble_some(
    table: Array,
    orders: Integers,
    source: Integers,
    known: Nodes,
    before: Equations,
    model: FieldModel,
) -> tuple[Nodes, Equations]:
    """Assemble diagonal blocks with S and S', copying those of unchanged gaps.

    ``source[k]`` is the index of gap k in ``known``, or -1.
    """
    nodes, equations = _allocate_blocks(table, orders, 2, model.rules)
    offset = nodes.offset
    for k in range(source.shape[0]):
        j = source[k]
        if j >= 0:
            own = slice(offset[k], offset[k + 1])
            theirs = slice(known.offset[j], known.offset[j + 1])
            m = offset[k + 1] - offset[k]
            nodes.theta[own] = known.theta[theirs]
            nodes.weight[own] = known.weight[theirs]
            nodes.sine[own] = known.sine[theirs]
            nodes.cosine[own] = known.cosine[theirs]
            nodes.slope[k] = known.slope[j]
            equations.matrix[own, :m] = before.matrix[theirs, :m]
            equations.load[own] = before.load[theirs]
            equations.end_terms[k] = before.end_terms[j]
    fill_gaps(np.flatnonzero(source < 0), nodes, equations, model)
    return nodes, equations


@compiled
def _allocate(
    table: Array, orders: Integers, offset: Integers, columns: int, fields: int
) -> tuple[Nodes, Equations]:
    """Allocate nodes and equations."""
    count, n = table.shape[0], offset[-1]
    nodes = Nodes(
        table, orders, offset, np.empty(n), np.empty(n), np.empty(n), np.empty(n),
        np.empty((count, 2)),
    )  # fmt: skip
    equations = Equations(
        matrix=np.empty((n, columns)),
        load=np.empty((n, fields + 1)),
        end_terms=np.empty((count, 2, fields)),
    )
    return nodes, equations


@compiled
def _allocate_blocks(
    table: Array, orders: Integers, fields: int, rules: GaussRules
) -> tuple[Nodes, Equations]:
    """Allocate nodes, and equations whose matrix holds the diagonal blocks alone, zeros."""
    widest = 0
    for k in range(orders.shape[0]):
        widest = max(widest, rules.counts[orders[k]])
    nodes, equations = _allocate(table, orders, node_offsets(orders, rules), widest, fields)
    equations.matrix[:] = 0.0
    return nodes, equations


@compiled
def fill_gaps(indices: Integers, nodes: Nodes, equations: Equations, model: FieldModel) -> None:
    """Fill in the own parts of some gaps."""
    rules, panels = model.rules, model.panels
    counts, orders, offset, table = rules.counts, nodes.orders, nodes.offset, nodes.table
    matrix, load, end_terms = equations.matrix, equations.load, equations.end_terms
    fields = end_terms.shape[2]
    for k in indices:
        m = counts[orders[k]]
        s = np.empty((m, fields))
        ends = np.empty((2, fields))
        gap_moments(table[k], panels, s, ends)
        _fill_end_terms(s, ends, end_terms[k])
        own = slice(offset[k], offset[k + 1])
        _fill_nodes(k, s, nodes, load[own], rules)
        block = matrix[own, :m]
        _fill_block(k, nodes, block, rules)


@compiled
def _fill_end_terms(s: Array, ends: Array, end_terms: Array) -> None:
    """Subtract the first modes of a gap from the loads of its ends."""
    for field in range(s.shape[1]):
        low = 0.0
        high = 0.0
        sign = 1.0
        for j in range(s.shape[0]):
            high += s[j, field]
            low += sign * s[j, field]
            sign = -sign
        end_terms[0, field] = ends[0, field] - low
        end_terms[1, field] = ends[1, field] - high


@compiled
def _fill_nodes(k: int, s: Array, nodes: Nodes, load: Array, rules: GaussRules) -> None:
    """Fill in the nodes of gap k, and their load from its moments."""
    gap, order, m = nodes.table[k], nodes.orders[k], s.shape[0]
    start, square = rules.vector_start[order], rules.matrix_start[order]
    modes = rules.modes[square : square + m * m].reshape(m, m)
    slope, theta, weight, base = nodes.slope, nodes.theta, nodes.weight, nodes.offset[k]
    sine, cosine = nodes.sine, nodes.cosine
    eta, weights = rules.eta, rules.weights
    slope[k, 0] = 1 / theta_at(gap, -1.0)[1]
    slope[k, 1] = 1 / theta_at(gap, 1.0)[1]
    for i in range(m):
        node = base + i
        theta[node], stretch = theta_at(gap, eta[start + i])
        weight[node] = weights[start + i] * stretch
        sine[node], cosine[node] = np.sin(0.5 * theta[node]), np.cos(0.5 * theta[node])
        load[i, 1] = weight[node]
        for field in range(s.shape[1]):
            total = 0.0
            for j in range(m):
                total += modes[i, j] * s[j, field]
            load[i, 2 * field] = weights[start + i] * total


@compiled
def _fill_block(k: int, nodes: Nodes, block: Array, rules: GaussRules) -> None:
    """Fill in the diagonal block of gap k."""
    gap, order, m = nodes.table[k], nodes.orders[k], block.shape[0]
    start, square = rules.vector_start[order], rules.matrix_start[order]
    own = slice(nodes.offset[k], nodes.offset[k + 1])
    theta, weight = nodes.theta[own], nodes.weight[own]
    eta, w = rules.eta[start : start + m], rules.weights[start : start + m]
    crack = rules.crack[square : square + m * m].reshape(m, m)
    # sines of differences from those of the nodes: of small ones the kernels are series
    sine = np.empty(m)
    cosine = np.empty(m)
    power = np.empty(m)
    middle = 0.5 * (gap[LEFT] + gap[RIGHT])
    alpha = gap[ALPHA]
    is_short = gap[RIGHT] - gap[LEFT] < _PERIODIC_SERIES
    for i in range(m):
        power[i] = np.exp(alpha * eta[i])
        if not is_short:
            sine[i] = np.sin(0.5 * (theta[i] - middle))
            cosine[i] = np.cos(0.5 * (theta[i] - middle))
    for i in range(m):
        for j in range(i + 1):
            x = theta[i] - theta[j]
            if is_short or abs(x) < _PERIODIC_SERIES:
                far = periodic_images(x)
            else:
                half = sine[i] * cosine[j] - cosine[i] * sine[j]
                far = 1 / (half * half) - 4 / (x * x)
            y = eta[i] - eta[j]
            if abs(alpha * y) < _MAPPED_SERIES:
                near = mapped_kernel(alpha, y)
            else:
                ratio = power[i] / power[j]
                twice = ratio - 1 / ratio  # twice the hyperbolic sine
                near = 4 * (4 * alpha * alpha / (twice * twice) - 1 / (y * y))
            both = weight[i] * weight[j] * far + w[i] * w[j] * near
            block[i, j] = crack[i, j] - both / (4 * np.pi)
            block[j, i] = block[i, j]


@compiled
def periodic_images(x: float) -> float:
    """Compute 1/sin²(x/2) - 4/x², x = Δθ: the kernel of a gap's own periodic images."""
    if abs(x) < _PERIODIC_SERIES:
        y = x * x
        return 1 / 3 + y * (1 / 60 + y * (1 / 1512 + y * (1 / 43200 + y / 1330560)))
    half: float = np.sin(0.5 * x)
    return 1 / (half * half) - 4 / (x * x)


@compiled
def mapped_kernel(alpha: float, x: float) -> float:
    """Compute 4 [α²/sinh²(αx) - 1/x²], x = Δη: the own kernel but for a straight crack in η."""
    y = alpha * x
    if abs(y) < _MAPPED_SERIES:
        y *= y
        series = -1 / 3 + y * (1 / 15 + y * (-2 / 189 + y * (1 / 675 - y * 2 / 10395)))
        return 4 * alpha * alpha * series
    grown = np.exp(y)
    twice = grown - 1 / grown  # twice the hyperbolic sine
    images: float = 4 * (4 * alpha * alpha / (twice * twice) - 1 / (x * x))
    return images
