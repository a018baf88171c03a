"""Window of few gaps among many: its exterior responds linearly about a known state; compiled.

The exterior is solved on the tree of gaps (``cluster_tree``) with its own edges either held or
following by their tangent (``edge_elimination``); its terms in the equations of the window are an
``Exterior`` (``field/exterior``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_elimination import EliminatedEdges, eliminate_edges
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw, critical_opening, imbalance
from adhesis.solver.sharp.field.cluster_tree import (
    Tree,
    TreeFactor,
    build_tree,
    downward_pass,
    factor_tree,
    upward_pass,
)
from adhesis.solver.sharp.field.dense_solver import solve
from adhesis.solver.sharp.field.exterior import Exterior, exterior_kernel
from adhesis.solver.sharp.field.hierarchical_solver import (
    HierarchicalSystem,
    gap_potentials,
    solve_many,
)
from adhesis.solver.sharp.field.solution import FieldModel, Solution
from adhesis.solver.sharp.gap.conformal_map import LEFT, RIGHT
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Integers


class Linearisation(NamedTuple):
    """Linear response of a solved state, about which windows are opened.

    Attributes
    ----------
    solution : Solution
    inverse, weights : array
        As in ``hierarchical_solver.HierarchicalSystem``.
    edges : EliminatedEdges
        How its edges follow.
    """

    solution: Solution
    inverse: Array
    weights: Array
    edges: EliminatedEdges


class ExteriorGaps(NamedTuple):
    """Gaps outside a window.

    Attributes
    ----------
    indices : int array
        Which they are.
    follow : bool array
        Whether their edges follow.
    offset : int array
        First node of each.
    tree : Tree
    factor : TreeFactor
    charge : array, shape (nodes, 2)
        Charges of each without potentials and p, and by a unit of p.
    potential : array, shape (nodes,)
        Potentials at the nodes in the state about which their response is linear.
    """

    indices: Integers
    follow: NDArray[np.bool_]
    offset: Integers
    tree: Tree
    factor: TreeFactor
    charge: Array
    potential: Array


@compiled
def linearise(
    solution: Solution, system: HierarchicalSystem, edges: EliminatedEdges
) -> Linearisation:
    """Linearise a state whose edges are in equilibrium, but for the rest of an iteration.

    ``edges`` may be those of a state very near.
    """
    edges.charge[:, 0] = 0.0
    edges.motion[:, 0] = 0.0
    return Linearisation(solution, system.inverse, system.weights, edges)


@compiled
def linearise_equilibrium(
    gaps: Array, prescribed: float, orders: Integers, law: EdgeLaw, model: FieldModel
) -> Linearisation:
    """Linearise an equilibrium, for a window that is opened on it."""
    state, system = solve_many(gaps, prescribed, orders, 2, model)
    residual, drift = imbalance(state, law, model.panels)
    return linearise(state, system, eliminate_edges(state, system, residual, drift, model.rules))


@compiled
def rotate_gaps(rows: Array, first: int) -> Array:
    """Rotate rows to begin with ``first``; angles in the columns 0 and 1 rise beyond the period."""
    out = np.empty(rows.shape)
    count = rows.shape[0]
    for i in range(count):
        out[i] = rows[(first + i) % count]
        if first + i >= count:
            out[i, 0] += 2 * np.pi
            out[i, 1] += 2 * np.pi
    return out


@compiled_for_both
def open_window(
    linearisation: Linearisation,
    first: int,
    width: int,
    longest_motion: float,
    law: EdgeLaw,
    model: FieldModel,
) -> tuple[Array, Exterior, ExteriorGaps]:
    """Open a window of ``width`` gaps from ``first`` on: its gaps, the exterior and its gaps.

    The last of the window's gaps stands for the exterior. Edges outside follow if that moves them
    by less than ``longest_motion``.
    """
    state, edges = linearisation.solution, linearisation.edges
    count = state.nodes.orders.shape[0]
    indices = np.arange(first + width, first + count) % count
    follow = np.zeros(indices.shape[0], dtype=np.bool_)
    for i in range(indices.shape[0]):
        k = indices[i]
        left, right = abs(edges.motion[2 * k, 0]), abs(edges.motion[2 * k + 1, 0])
        near = left < longest_motion and right < longest_motion
        follow[i] = near and edges.negative[k] == 0
    rotated = rotate_gaps(state.nodes.table, first)
    table = rotated[width:].copy()
    outside = _solve_exterior(linearisation, indices, follow, table, model)
    window = np.empty((width + 1, 2))
    window[:width] = rotated[:width, :2]
    window[width, 0] = table[0, LEFT]
    window[width, 1] = table[-1, RIGHT]
    return window, _reduce_exterior(outside, window[width], law, model.panels), outside


@compiled
def _solve_exterior(
    linearisation: Linearisation,
    indices: Integers,
    follow: NDArray[np.bool_],
    table: Array,
    model: FieldModel,
) -> ExteriorGaps:
    """Factor the tree of the gaps ``indices`` and compute the charges of each by itself."""
    state, w, edges = linearisation.solution, linearisation.weights, linearisation.edges
    nodes, load = state.nodes, state.equations.load
    potentials = gap_potentials(state, w)
    count = indices.shape[0]
    offset = np.zeros(count + 1, dtype=np.int64)
    squares = 0
    start = np.zeros(nodes.orders.shape[0] + 1, dtype=np.int64)
    for k in range(nodes.orders.shape[0]):
        start[k + 1] = start[k] + (nodes.offset[k + 1] - nodes.offset[k]) ** 2
    for i in range(count):
        m = nodes.offset[indices[i] + 1] - nodes.offset[indices[i]]
        offset[i + 1] = offset[i] + m
        squares += m * m
    n = offset[count]
    response = np.empty(squares)
    charge = np.empty((n, 2))
    potential = np.empty(n)
    theta = np.empty(n)
    stretch = np.empty(n)
    at = 0
    for i in range(count):
        k = indices[i]
        base = nodes.offset[k]
        m = offset[i + 1] - offset[i]
        turn = table[i, LEFT] - nodes.table[k, LEFT]
        for j in range(m):
            theta[offset[i] + j] = nodes.theta[base + j] + turn
            stretch[offset[i] + j] = nodes.weight[base + j] / w[base + j]
            potential[offset[i] + j] = potentials[base + j]
        for j in range(m):
            place = offset[i] + j
            by_mean = 0.0
            for other in range(m):
                inverse = linearisation.inverse[start[k] + j * m + other]
                by_mean -= w[base + j] * inverse * load[base + other, 1]
                if follow[i]:
                    response[at + j * m + other] = edges.response[start[k] + j * m + other]
                else:
                    response[at + j * m + other] = w[base + j] * inverse * w[base + other]
            charge[place, 1] = edges.charge[base + j, 1] if follow[i] else by_mean
            held = w[base + j] * state.scaled_opening[base + j]
            charge[place, 0] = held - state.pressure * charge[place, 1]
            if follow[i]:
                charge[place, 0] += edges.charge[base + j, 0]
            for other in range(m):
                charge[place, 0] += response[at + j * m + other] * potential[offset[i] + other]
        at += m * m
    tree = build_tree(table, offset, theta, stretch, model.digits, False)
    factor = factor_tree(tree, response, np.zeros(count, dtype=np.int64))
    return ExteriorGaps(indices, follow, offset, tree, factor, charge, potential)


@compiled
def _reduce_exterior(
    outside: ExteriorGaps, ends: Array, law: EdgeLaw, panels: Panels
) -> Exterior:
    """Reduce gaps outside a window to the charges of their run; ``ends`` are those of the run."""
    tree, factor = outside.tree, outside.factor
    run = tree.rank.shape[0] - 1
    r = tree.rank[run]
    last = slice(tree.node_start[run], tree.node_start[run + 1])
    charge = upward_pass(tree, factor, outside.charge)
    whole = charge[last].copy()
    whole[:, 1] *= -1.0
    downward_pass(tree, factor, charge, np.zeros((r, 2)))
    mean = np.zeros(2)
    for i in range(outside.charge.shape[0]):
        mean[0] += tree.stretch[i] * charge[i, 0]
        mean[1] -= tree.stretch[i] * charge[i, 1]
    opening = np.empty(2)
    for side in range(2):
        opening[side], _ = critical_opening(ends[side], law, panels)
    square = slice(tree.response_start[run], tree.response_start[run + 1])
    return Exterior(
        theta=tree.theta[last].copy(),
        stretch=tree.stretch[last].copy(),
        response=factor.response[square].copy().reshape(r, r),
        charge=whole,
        mean=mean,
        opening=opening,
    )


@compiled_for_both
def exterior_motion(
    window: Array,
    prescribed: float,
    orders: Integers,
    exterior: Exterior,
    outside: ExteriorGaps,
    linearisation: Linearisation,
    limit: Array,
    model: FieldModel,
) -> Array:
    """Compute the outward motion of the edges outside, for the window's gaps as they are now."""
    state, edges = linearisation.solution, linearisation.edges
    out = np.zeros(2 * outside.indices.shape[0])
    now = solve(window, prescribed, orders, 1, model, exterior)
    kernel, _ = exterior_kernel(now.nodes.theta, now.nodes.weight, exterior)
    potential = np.zeros((kernel.shape[1], 1))
    for i in range(kernel.shape[0]):
        for a in range(kernel.shape[1]):
            potential[a, 0] -= kernel[i, a] * now.scaled_opening[i]
    total = outside.charge[:, :1] + now.pressure * outside.charge[:, 1:]
    charge = upward_pass(outside.tree, outside.factor, total)
    potentials = downward_pass(outside.tree, outside.factor, charge, potential)
    for i in range(outside.indices.shape[0]):
        if not outside.follow[i]:
            continue
        base = state.nodes.offset[outside.indices[i]]
        for side in range(2):
            e = 2 * outside.indices[i] + side
            step = edges.motion[e, 0] + (now.pressure - state.pressure) * edges.motion[e, 1]
            for j in range(outside.offset[i + 1] - outside.offset[i]):
                place = outside.offset[i] + j
                change = potentials[place, 0] - outside.potential[place]
                step += edges.motion_by_potential[base + j, side] * change
            if abs(step) <= limit[e]:
                out[2 * i + side] = step
            else:
                out[2 * i + side] = np.sign(step) * limit[e]
    return out
