"""Linear response of many gaps and their edges; compiled.

An edge follows its own opening: C_e = C_c at each. Between given edges and in a given potential of
the others every gap is solved by itself, with the motions of its two edges eliminated (static
condensation): about these edges, its reference, it responds to potentials g and a mean stress p by

    q = q0 + p q1 - R g,        n = n0 + p n1 + M g,

its charges and the motions of its edges (``gap_response``). The tree (``cluster_tree``) solves for
all gaps and all edges together. While edges move little from their reference the response stays;
where they move further it is renewed (``renewal``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw, Flags
from adhesis.solver.sharp.field.cluster_tree import Tree
from adhesis.solver.sharp.field.solution import Equations, LoadingDevice, Nodes
from adhesis.solver.sharp.field.tree_factor import (
    Charges,
    TreeFactor,
    downward_pass,
    whole_tree,
)
from adhesis.solver.sharp.gap.conformal_map import LEFT, RIGHT
from adhesis.solver.sharp.tolerances import SOFT_EDGE


class LinearResponse(NamedTuple):
    """Linear response of all gaps, each about edges of its own; its arrays are changed in place.

    Attributes
    ----------
    nodes : Nodes
        Between the reference edges.
    equations : Equations
        Diagonal blocks, with S and S'.
    inverse : array
        Inverse blocks, flat.
    tree : Tree
    factor : TreeFactor
    charges : Charges
        Without potentials and p, and by a unit of p (two rows).
    held, here : bool array and array, shape (2L,)
        Edges that are held, and their motion from the reference to where they are; 0 for others.
    recedes : bool array, shape (2L,)
        Edges behind their memory, with two works of adhesion.
    about, about_pressure : array, shape (N,) and (L,)
        Potentials and p of the references.
    scaled_opening : array, shape (N,)
        f there.
    opening, residual, opening_by_pressure : array, shape (2L,)
        C_e and C_e - C_c in the reference, C_c that of an edge that advances, and ∂C_e/∂p between
        held edges.
    drift : array, shape (2L,)
        ∂C_c/∂n_e there.
    tangent : array, shape (2L, 2)
        ∂(C_e - C_c)/∂n_f between both edges of a gap, in the potential of the others.
    opening_by_potential, charge_by_edge : array, shape (N, 2)
        ∂C_e/∂g of both edges of a gap by the potential at its nodes, with the other sign; and the
        charges by the motion of each edge.
    held_charge : array, shape (N, 2)
        Charges between held edges in the reference, and by a unit of p.
    compliance : array, shape (2L, 2)
        Inverse of the tangent of the edges that are not held.
    isolated_correction : array, shape (2L,)
        Motion that would balance a gap by itself.
    motion : array, shape (2L, 2)
        Motions of its edges without potentials and p, and by a unit of p.
    motion_by_potential : array, shape (N, 2)
        Motion of both edges of a gap by the potential at each of its nodes.
    mean_by_potential : array, shape (N,)
        Its mean opening, times 2π, likewise, with the other sign.
    potential : array, shape (2, nodes of all runs)
        Of the last solution, without p and by a unit of p.
    mean : array, shape (2,)
        Its mean opening, times 2π, likewise.
    softness : array, shape (L,)
        Compliance of each gap's edges, or their neighbours', over that from which on gaps are soft.
    """

    nodes: Nodes
    equations: Equations
    inverse: Array
    tree: Tree
    factor: TreeFactor
    charges: Charges
    held: Flags
    here: Array
    recedes: Flags
    about: Array
    about_pressure: Array
    scaled_opening: Array
    opening: Array
    residual: Array
    opening_by_pressure: Array
    drift: Array
    tangent: Array
    opening_by_potential: Array
    charge_by_edge: Array
    held_charge: Array
    compliance: Array
    isolated_correction: Array
    motion: Array
    motion_by_potential: Array
    mean_by_potential: Array
    potential: Array
    mean: Array
    softness: Array


class ResponseSolution(NamedTuple):
    """All edges as the linear response has them at a prescribed quantity d.

    Attributes
    ----------
    motion, rate : array, shape (2L,)
        Outward motion n from the reference, and dn/dd along the branch.
    by_pressure : array, shape (2L,)
        ∂n/∂p.
    pressure, separation : float
        p and q0 s.
    slope : float
        dY/dd along the branch: Y is p, under a load q0 s.
    stable : bool
        Whether the edges are stable.
    """

    motion: Array
    rate: Array
    by_pressure: Array
    pressure: float
    separation: float
    slope: float
    stable: bool


@compiled
def no_motion(gaps: int) -> ResponseSolution:
    """Make a solution in which no edge moves."""
    none = np.zeros(2 * gaps)
    return ResponseSolution(none, none, none, np.nan, np.nan, np.nan, False)


@compiled
def allocate_response(
    nodes: Nodes, equations: Equations, tree: Tree, factor: TreeFactor
) -> LinearResponse:
    """Allocate a response; its fields that are not given are zero."""
    count, n = nodes.orders.shape[0], nodes.theta.shape[0]
    size = tree.node_start[tree.rank.shape[0]]
    return LinearResponse(
        nodes=nodes,
        equations=equations,
        inverse=np.zeros(tree.response_start[count]),
        tree=tree,
        factor=factor,
        charges=Charges(np.zeros((2, size)), np.zeros((2, size))),
        held=np.zeros(2 * count, dtype=np.bool_),
        here=np.zeros(2 * count),
        recedes=np.zeros(2 * count, dtype=np.bool_),
        about=np.zeros(n),
        about_pressure=np.zeros(count),
        scaled_opening=np.zeros(n),
        opening=np.zeros(2 * count),
        residual=np.zeros(2 * count),
        opening_by_pressure=np.zeros(2 * count),
        drift=np.zeros(2 * count),
        tangent=np.zeros((2 * count, 2)),
        opening_by_potential=np.zeros((n, 2)),
        charge_by_edge=np.zeros((n, 2)),
        held_charge=np.zeros((n, 2)),
        compliance=np.zeros((2 * count, 2)),
        isolated_correction=np.zeros(2 * count),
        motion=np.zeros((2 * count, 2)),
        motion_by_potential=np.zeros((n, 2)),
        mean_by_potential=np.zeros(n),
        potential=np.zeros((2, size)),
        mean=np.zeros(2),
        softness=np.ones(count),
    )


@compiled
def solve_response(
    response: LinearResponse, prescribed: float, law: EdgeLaw, device: LoadingDevice
) -> ResponseSolution:
    """Solve for all edges, with d prescribed."""
    tree, nodes = response.tree, response.nodes
    count, n = nodes.orders.shape[0], nodes.theta.shape[0]
    charges, potential = response.charges, response.potential
    downward_pass(tree, response.factor, whole_tree(tree), charges, potential)
    mean = response.mean
    mean[:] = 0.0
    for column in range(2):
        for i in range(n):
            mean[column] += tree.stretch[i] * charges.isolated[column, i]
            mean[column] -= response.mean_by_potential[i] * potential[column, i]
    motion = motion_in(response, potential, np.ones(count, dtype=np.bool_))
    # weight·mean - 2π compliance·p = 2π d
    weight = device.separation_weight
    by_pressure = weight * mean[1] - 2 * np.pi * device.compliance
    pressure = pressure_at(response, prescribed, device)
    rate = 2 * np.pi / by_pressure  # dp/dd
    separation = prescribed
    if device.compliance != 0:
        separation = (mean[0] + pressure * mean[1]) / (2 * np.pi)
    negative = response.factor.negative[-1]
    _update_softness(response, motion, by_pressure, law, device)
    return ResponseSolution(
        motion=motion[:, 0] + pressure * motion[:, 1],
        rate=motion[:, 1] * rate,
        by_pressure=motion[:, 1].copy(),
        pressure=pressure,
        separation=separation,
        slope=rate if weight != 0 else rate * mean[1] / (2 * np.pi),
        stable=(negative == 0 and by_pressure < 0) or (negative == 1 and by_pressure > 0),
    )


@compiled
def _update_softness(
    response: LinearResponse, motion: Array, by_pressure: float, law: EdgeLaw, device: LoadingDevice
) -> None:
    """Compute how soft each gap is by its softest edge, or its neighbours'.

    That is the compliance with which edges follow their openings, over that of their gap by itself
    or by roughness of the shortest wave, at the prescribed d: edges by p, times how much more p
    changes than with all edges held (and without the potentials of other gaps). Modes that p does
    not excite, as of symmetric states, show in how near a 2×2 or a pair of runs is to singular.
    """
    count, softness = response.softness.shape[0], response.softness
    held = 0.0
    for i in range(response.held_charge.shape[0]):
        held += response.tree.stretch[i] * response.held_charge[i, 1]
    held = device.separation_weight * held - 2 * np.pi * device.compliance
    more = abs(held / by_pressure) / SOFT_EDGE
    rough, tangent = 0.5 * law.overlap_limit / law.longest_step, response.tangent
    for k in range(count):
        softness[k] = 1.0
    for e in range(2 * count):
        stiff = max(rough, abs(tangent[e, 0]) + abs(tangent[e, 1]))
        soft = more * stiff * abs(motion[e, 1] / response.opening_by_pressure[e])
        for beside in range(-1, 2):
            k = (e // 2 + beside) % count
            softness[k] = max(softness[k], soft)
    nearest, ranges = response.factor.nearest, response.tree.gap_range
    for run in range(nearest.shape[0]):
        soft = 1 / (SOFT_EDGE * nearest[run])
        if soft > 1:
            for k in range(ranges[run, 0], ranges[run, 1] + 1):
                softness[k % count] = max(softness[k % count], soft)


@compiled
def imbalance_of(response: LinearResponse, e: int, pinning: float) -> tuple[float, float]:
    """Compute C_e - C_c and its derivative by n_e in the reference, by the law of where e is now.

    The law is asked at every use, so a response stays valid where an edge begins to recede.
    """
    residual, own = response.residual[e], response.tangent[e, e % 2]
    if response.recedes[e]:
        own -= pinning * response.drift[e]
        residual -= pinning * (response.opening[e] - residual)
    return residual, own


@compiled
def pressure_at(response: LinearResponse, prescribed: float, device: LoadingDevice) -> float:
    """Compute p with d prescribed, by the mean openings of the last solution."""
    weight, mean = device.separation_weight, response.mean
    by_pressure = weight * mean[1] - 2 * np.pi * device.compliance
    pressure: float = (2 * np.pi * prescribed - weight * mean[0]) / by_pressure
    return pressure


@compiled
def motion_in(response: LinearResponse, potential: Array, wanted: Flags) -> Array:
    """Compute the motions of some gaps' edges, shape (2L, 2): in potentials, and by a unit of p.

    The potentials have a row for each.
    """
    offset, follows = response.nodes.offset, response.motion_by_potential
    motion = response.motion.copy()
    for k in range(wanted.shape[0]):
        if wanted[k]:
            for i in range(offset[k], offset[k + 1]):
                for column in range(potential.shape[0]):
                    g = potential[column, i]
                    motion[2 * k, column] += follows[i, 0] * g
                    motion[2 * k + 1, column] += follows[i, 1] * g
    return motion


@compiled
def motion_to(response: LinearResponse, gaps: Array) -> Array:
    """Compute the motion of all edges outwards from their references to these."""
    table = response.nodes.table
    motion = np.empty(gaps.size)
    for k in range(gaps.shape[0]):
        motion[2 * k] = gaps[k, 0] - table[k, LEFT]
        motion[2 * k + 1] = table[k, RIGHT] - gaps[k, 1]
    return motion
