"""Edges that are held, all others following on the tree of the linear response; compiled.

How the openings at these edges change when one of them moves is their condensed tangent: a Schur
complement of the tangent of all edges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw, Flags, at_memory
from adhesis.solver.sharp.equilibrium.linear_response import (
    LinearResponse,
    ResponseSolution,
    solve_response,
)
from adhesis.solver.sharp.equilibrium.renewal import condense_gaps, hold_edges
from adhesis.solver.sharp.field.solution import FieldModel, LoadingDevice
from adhesis.solver.sharp.field.tree_factor import Charges, charge_run, downward_pass
from adhesis.solver.sharp.gap.quadrature import Integers


class HeldEdges(NamedTuple):
    """Some edges that are held, all others following.

    Attributes
    ----------
    edges : int array, shape (n,)
    residual : array, shape (n,)
        C - C_c, of edges that advance.
    tangent : array, shape (n, n)
        ∂(C_e - C_c)/∂n_f.
    """

    edges: Integers
    residual: Array
    tangent: Array


@compiled
def push_edges(
    response: LinearResponse, edges: Integers, motion: Array, wanted: Flags
) -> tuple[Array, Array]:
    """Compute the motions of all edges at fixed p by those of some that are held; and potentials.

    Of the gaps that are not ``wanted`` they are not computed.
    """
    tree, factor, count = response.tree, response.factor, response.softness.shape[0]
    runs = tree.rank.shape[0]
    size = tree.node_start[runs]
    charges = Charges(np.zeros((1, size)), np.zeros((1, size)))
    potential = np.zeros((1, size))
    isolated, by_edge, offset = charges.isolated, response.charge_by_edge, response.nodes.offset
    out = np.zeros(2 * count)
    inside, loaded = np.zeros(runs, dtype=np.bool_), np.zeros(runs, dtype=np.bool_)
    inside[:count] = wanted
    for c in range(edges.shape[0]):
        e = edges[c]
        loaded[e // 2] = True
        out[e] += motion[c]
        beside = e + 1 - 2 * (e % 2)  # zero compliance where it is held, too
        opened = response.tangent[beside, e % 2] * motion[c]
        out[beside] -= response.compliance[beside, beside % 2] * opened
    for k in range(count):
        if loaded[k]:
            for i in range(offset[k], offset[k + 1]):
                isolated[0, i] = by_edge[i, 0] * out[2 * k] + by_edge[i, 1] * out[2 * k + 1]
    work = np.empty((3, tree.rank.max()))
    for run in range(count, runs):
        one, two = tree.children[run, 0], tree.children[run, 1]
        inside[run] = inside[one] or inside[two]
        if loaded[one] or loaded[two]:
            loaded[run] = True
            charge_run(tree, factor, run, charges, work)
    downward_pass(tree, factor, inside, charges, potential)
    follows = response.motion_by_potential
    for k in range(count):
        if wanted[k]:
            for i in range(offset[k], offset[k + 1]):
                g = potential[0, i]
                out[2 * k] += follows[i, 0] * g
                out[2 * k + 1] += follows[i, 1] * g
    return out, potential[0]


@compiled
def opening_change(response: LinearResponse, e: int, motion: Array, potential: Array) -> float:
    """Compute the change of C_e - C_c by motions of the gap's edges and potentials there."""
    k, side = e // 2, e % 2
    offset, by_potential = response.nodes.offset, response.opening_by_potential
    change = response.tangent[e, 0] * motion[2 * k] + response.tangent[e, 1] * motion[2 * k + 1]
    for i in range(offset[k], offset[k + 1]):
        change -= by_potential[i, side] * potential[i]
    return float(change)


@compiled
def residual_of(response: LinearResponse, edges: Integers, now: ResponseSolution) -> Array:
    """Compute C_e - C_c at held edges in a solution, C_c that of edges that advance."""
    out = np.empty(edges.shape[0])
    potential = response.potential[0] + now.pressure * response.potential[1]
    for c in range(edges.shape[0]):
        e = edges[c]
        k, offset = e // 2, response.nodes.offset
        for i in range(offset[k], offset[k + 1]):
            potential[i] -= response.about[i]
        out[c] = response.residual[e] + opening_change(response, e, now.motion, potential)
        out[c] -= response.opening_by_pressure[e] * (now.pressure - response.about_pressure[k])
        for i in range(offset[k], offset[k + 1]):
            potential[i] += response.about[i]
    return out


@compiled
def closing_by_pressure(response: LinearResponse, edges: Integers, now: ResponseSolution) -> Array:
    """Compute -∂C_e/∂p at held edges, all others following."""
    out = np.empty(edges.shape[0])
    for c in range(edges.shape[0]):
        change = opening_change(response, edges[c], now.by_pressure, response.potential[1])
        out[c] = response.opening_by_pressure[edges[c]] - change
    return out


@compiled
def pressure_by_motion(
    response: LinearResponse, edges: Integers, now: ResponseSolution, device: LoadingDevice
) -> Array:
    """Compute ∂p/∂n_e by held edges at the prescribed d, all others following.

    By reciprocity the mean opening, times 2π, follows n_e as C_e follows p, times C_e π/4.
    """
    by_pressure = device.separation_weight * response.mean[1] - 2 * np.pi * device.compliance
    out = closing_by_pressure(response, edges, now)
    for c in range(edges.shape[0]):
        weight = 0.25 * np.pi * device.separation_weight * response.opening[edges[c]]
        out[c] *= weight / by_pressure
    return out


@compiled
def tangent_of(
    response: LinearResponse, edges: Integers, now: ResponseSolution, device: LoadingDevice
) -> Array:
    """Compute ∂(C_e - C_c)/∂n_f between held edges at the prescribed d, all others following."""
    count = edges.shape[0]
    wanted = np.zeros(response.softness.shape[0], dtype=np.bool_)
    for c in range(count):
        wanted[edges[c] // 2] = True
    closing = closing_by_pressure(response, edges, now)
    more = pressure_by_motion(response, edges, now, device)
    out = np.empty((count, count))
    one, unit = np.empty(1, dtype=np.int64), np.ones(1)
    for c in range(count):
        one[0] = edges[c]
        motion, potential = push_edges(response, one, unit, wanted)
        for f in range(count):
            out[f, c] = opening_change(response, edges[f], motion, potential)
            out[f, c] -= closing[f] * more[c]
    return out


@compiled
def follow_edges(
    response: LinearResponse,
    edges: Integers,
    motion: Array,
    now: ResponseSolution,
    device: LoadingDevice,
) -> tuple[Array, float]:
    """Compute the motions of all edges from their references when held ones move on by ``motion``.

    Also returns p. The potentials of the response are those with these motions from now on.
    """
    more = 0.0
    by_motion = pressure_by_motion(response, edges, now, device)
    for c in range(edges.shape[0]):
        more += by_motion[c] * motion[c]
    everywhere = np.ones(response.softness.shape[0], dtype=np.bool_)
    out, potential = push_edges(response, edges, motion, everywhere)
    for e in range(out.shape[0]):
        out[e] += now.motion[e] + now.by_pressure[e] * more
    for i in range(potential.shape[0]):
        response.potential[0, i] += potential[i]
    return out, now.pressure + more


@compiled_for_both
def tangent_between(
    response: LinearResponse,
    gaps: Array,
    edges: Integers,
    prescribed: float,
    law: EdgeLaw,
    model: FieldModel,
) -> Array:
    """Compute ∂(C_e - C_c)/∂n_f between some edges of these gaps.

    All others follow, but those at their memory, which are pinned.
    """
    held = at_memory(gaps, law)
    held[edges] = True
    condense_gaps(response, hold_edges(response, gaps, held, law), law, model)
    now = solve_response(response, prescribed, law, model.device)
    out = tangent_of(response, edges, now, model.device)
    for c in range(edges.shape[0]):
        if response.recedes[edges[c]]:
            out[c, c] -= law.pinning * response.drift[edges[c]]
    return out
