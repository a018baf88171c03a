"""Tangent of a few edges with all others following, from the tree of the linear response; compiled.

Forces on a few edges move all edges by the compliance Z of the response. Its part among these
edges is the inverse of their tangent, with the others following: a Schur complement.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw
from adhesis.solver.sharp.equilibrium.linear_response import (
    Flags,
    LinearResponse,
    ResponseSolution,
    solve_response,
)
from adhesis.solver.sharp.field.solution import LoadingDevice
from adhesis.solver.sharp.field.tree_factor import Charges, charge_run, downward_pass, eliminate
from adhesis.solver.sharp.gap.quadrature import Integers


@compiled
def push_edges(
    response: LinearResponse, edges: Integers, force: Array, wanted: Flags
) -> tuple[Array, Array]:
    """Compute the motions at fixed p by forces, as -(C_e - C_c), on some edges, and the potentials.

    Of the gaps that are not ``wanted`` they are not computed.
    """
    tree, factor, count = response.tree, response.factor, response.held.shape[0]
    runs = tree.rank.shape[0]
    size = tree.node_start[runs]
    charges = Charges(np.zeros((1, size)), np.zeros((1, size)))
    potential = np.zeros((1, size))
    isolated, by_edge, offset = charges.isolated, response.charge_by_edge, response.nodes.offset
    alone = np.zeros(2 * count)
    loaded = np.zeros(runs, dtype=np.bool_)
    for c in range(edges.shape[0]):
        k = edges[c] // 2
        loaded[k] = True
        for side in range(2):
            alone[2 * k + side] += response.compliance[2 * k + side, edges[c] % 2] * force[c]
    for k in range(count):
        if loaded[k]:
            for i in range(offset[k], offset[k + 1]):
                isolated[0, i] = by_edge[i, 0] * alone[2 * k] + by_edge[i, 1] * alone[2 * k + 1]
    inside = np.zeros(runs, dtype=np.bool_)
    inside[:count] = wanted
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
                alone[2 * k] += follows[i, 0] * g
                alone[2 * k + 1] += follows[i, 1] * g
    return alone, potential[0]


@compiled
def pressure_by_force(
    response: LinearResponse, e: int, now: ResponseSolution, device: LoadingDevice
) -> float:
    """Compute by how much a unit of force on an edge changes p at the prescribed d.

    By reciprocity the mean opening, times 2π, follows a force as C_e follows p, times π/4.
    """
    by_pressure = device.separation_weight * response.mean[1] - 2 * np.pi * device.compliance
    opened = device.separation_weight * response.opening[e] * now.by_pressure[e]
    value: float = 0.25 * np.pi * opened / by_pressure
    return value


@compiled
def compliance_of(
    response: LinearResponse, edges: Integers, now: ResponseSolution, device: LoadingDevice
) -> Array:
    """Compute the motions of some edges by forces on each of them, at the prescribed d."""
    count = edges.shape[0]
    wanted = np.zeros(response.held.shape[0], dtype=np.bool_)
    for c in range(count):
        wanted[edges[c] // 2] = True
    out = np.empty((count, count))
    unit = np.zeros(count)
    for c in range(count):
        unit[:] = 0.0
        unit[c] = 1.0
        motion, _ = push_edges(response, edges, unit, wanted)
        more = pressure_by_force(response, edges[c], now, device)
        for f in range(count):
            out[f, c] = motion[edges[f]] + now.by_pressure[edges[f]] * more
    return out


@compiled
def invert(matrix: Array) -> Array:
    """Invert a matrix."""
    factor, inverse = matrix.copy(), np.eye(matrix.shape[0])
    eliminate(factor, inverse)
    return inverse


@compiled
def stiffness_of(
    response: LinearResponse, edges: Integers, now: ResponseSolution, device: LoadingDevice
) -> Array:
    """Compute ∂(C_e - C_c)/∂n_f between some edges, with their damping, all others following."""
    compliance = compliance_of(response, edges, now, device)
    out = np.eye(edges.shape[0])
    eliminate(compliance, out)
    return out


@compiled
def undamped(stiffness: Array, response: LinearResponse, edges: Integers) -> Array:
    """Return the tangent of some edges without their damping."""
    out = stiffness.copy()
    for e in range(edges.shape[0]):
        out[e, e] -= response.damping[edges[e]]
    return out


@compiled
def condensed_residual(
    stiffness: Array, response: LinearResponse, edges: Integers, now: ResponseSolution
) -> Array:
    """Compute C_e - C_c at some edges where they are, all others following."""
    count = edges.shape[0]
    out = np.zeros(count)
    for e in range(count):
        for f in range(count):
            out[e] -= stiffness[e, f] * (now.motion[edges[f]] - response.here[edges[f]])
    return out


@compiled
def follow_edges(
    stiffness: Array,
    response: LinearResponse,
    edges: Integers,
    motion: Array,
    now: ResponseSolution,
    device: LoadingDevice,
) -> tuple[Array, float]:
    """Compute the motions of all edges from their references when some have a given ``motion``.

    Also returns p. The potentials of the response are those with these motions from now on.
    """
    count = edges.shape[0]
    force = np.zeros(count)
    more = 0.0
    for e in range(count):
        for f in range(count):
            force[e] += stiffness[e, f] * (motion[f] - now.motion[edges[f]])
        more += force[e] * pressure_by_force(response, edges[e], now, device)
    everywhere = np.ones(response.held.shape[0], dtype=np.bool_)
    out, potential = push_edges(response, edges, force, everywhere)
    for e in range(out.shape[0]):
        out[e] += now.motion[e] + now.by_pressure[e] * more
    for i in range(potential.shape[0]):
        response.potential[0, i] += potential[i]
    return out, now.pressure + more


@compiled_for_both
def tangent_between(
    response: LinearResponse,
    edges: Integers,
    prescribed: float,
    law: EdgeLaw,
    device: LoadingDevice,
) -> Array:
    """Compute ∂(C_e - C_c)/∂n_f between some edges, all others following."""
    now = solve_response(response, prescribed, law, device)
    return undamped(stiffness_of(response, edges, now, device), response, edges)
