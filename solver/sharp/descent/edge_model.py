"""Model of the edge openings about solved edges, compiled: half-plane cracks that interact.

Over a shortest wave the opening C of an edge changes by the roughness under it, which is that of
a half-plane crack and known beforehand (``full_contact_stress.half_plane_opening``). The rest, the
finite length of the gap and the motion of the other edges, changes slowly. With n the outward
motion of the contact,

    dC_e = dR_e + own_e dn_e + Σ_{f≠e} coupling_ef C_f dn_f,

R the opening of the half-plane crack, and ``coupling`` symmetric: both follow from the tangent.
Between neighbours, across a gap or patch of length l, the coupling K goes as 1/l: it is -1/(2l)
across a narrow gap, and less across a patch, which bears less load when it shrinks. As derivatives
of C_e by n_e and by n_f may be exchanged,

    ∂own_e/∂n_f = ∂(K C_f)/∂n_e = K' (∂l/∂n_e) C_f + K² C_e,

and beside a patch own_e changes likewise by the motion of e itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.equilibrium.edge_law import (
    EdgeLaw,
    Flags,
    critical_of,
    critical_opening,
)
from adhesis.solver.sharp.gap.full_contact_stress import Panels, half_plane_opening
from adhesis.solver.sharp.gap.quadrature import Integers


class EdgeModel(NamedTuple):
    """Edges on their way from where they were solved, changed in place.

    Attributes
    ----------
    edges, after : int array, shape (n,)
        Which edges of all, rising; and the index of the edge after each, -1 if it is none of them.
    theta, motion : array, shape (n,)
        Position in θ, and outward motion of the contact so far.
    opening, rate : array, shape (n,)
        C, and ∂C_e/∂n_e.
    half_plane : array, shape (n,)
        R.
    critical, critical_rate : array, shape (n,)
        C_c, and its derivative by n.
    pinned : bool array, shape (n,)
        Edges that do not move, as C lies between both critical openings.
    own : array, shape (n,)
        ∂C_e/∂n_e, less that of a half-plane crack.
    coupling : array, shape (n, n)
        ∂C_e/∂n_f over C_f; zero on the diagonal.
    """

    edges: Integers
    after: Integers
    theta: Array
    motion: Array
    opening: Array
    rate: Array
    half_plane: Array
    critical: Array
    critical_rate: Array
    pinned: Flags
    own: Array
    coupling: Array


@compiled
def model_about(
    edges: Integers, gaps: Array, residual: Array, tangent: Array, law: EdgeLaw, panels: Panels
) -> EdgeModel:
    """Make the model of some edges from C_e - C_c and ``tangent`` = ∂(C_e - C_c)/∂n_f there.

    Of ``tangent[e, f]`` over C_f and its transpose, which are equal, that with the larger opening
    is taken.
    """
    count = edges.shape[0]
    opening, own, theta = np.empty(count), np.empty(count), np.empty(count)
    after = np.full(count, -1)
    for e in range(count):
        outwards = 1 - 2 * (edges[e] % 2)
        theta[e] = gaps[edges[e] // 2, edges[e] % 2]
        critical, drift = critical_opening(theta[e], law, panels)
        opening[e] = residual[e] + critical
        _, slope = half_plane_opening(theta[e], edges[e] % 2, panels)
        own[e] = tangent[e, e] + outwards * (drift - slope)
        following = (e + 1) % count
        if edges[following] == (edges[e] + 1) % gaps.size:
            after[e] = following
    coupling = np.zeros((count, count))
    for e in range(count):
        for f in range(e):
            value = 0.0
            if abs(opening[f]) > abs(opening[e]):
                value = tangent[e, f] / opening[f]
            elif opening[e] != 0:
                value = tangent[f, e] / opening[e]
            coupling[e, f] = value
            coupling[f, e] = value
    model = EdgeModel(
        edges, after, theta, np.zeros(count), np.zeros(count), np.empty(count), np.empty(count),
        np.empty(count), np.empty(count), np.zeros(count, dtype=np.bool_), own, coupling,
    )  # fmt: skip
    evaluate(model, law, panels)
    model.opening[:] = opening
    apply_law(model, law, panels)
    return model


@compiled
def evaluate(model: EdgeModel, law: EdgeLaw, panels: Panels) -> None:
    """Evaluate R, C_c and the rates at the present edges, and add R to the openings."""
    theta, rate, half_plane, opening = model.theta, model.rate, model.half_plane, model.opening
    own = model.own
    for e in range(theta.shape[0]):
        side = model.edges[e] % 2
        outwards = 1 - 2 * side
        half_plane[e], slope = half_plane_opening(theta[e], side, panels)
        opening[e] += half_plane[e]
        rate[e] = own[e] + outwards * slope
    apply_law(model, law, panels)


@compiled
def apply_law(model: EdgeModel, law: EdgeLaw, panels: Panels) -> None:
    """Evaluate C_c and its rates at the present edges and openings."""
    theta, opening, edges = model.theta, model.opening, model.edges
    critical, critical_rate, pinned = model.critical, model.critical_rate, model.pinned
    for e in range(theta.shape[0]):
        critical[e], drift, pinned[e] = critical_of(edges[e], theta[e], opening[e], law, panels)
        critical_rate[e] = (1 - 2 * (edges[e] % 2)) * drift


@compiled_sums
def advance(model: EdgeModel, step: Array) -> None:
    """Move the edges outwards by ``step``; :func:`evaluate` is to follow."""
    motion, opening, half_plane = model.motion, model.opening, model.half_plane
    own, coupling = model.own, model.coupling
    edges = step.shape[0]
    half, by_motion = 0.5 * step, opening * step
    follow_lengths(model, half)
    for e in range(edges):
        total = own[e] * step[e] - half_plane[e]
        for f in range(edges):
            total += coupling[e, f] * by_motion[f]
        opening[e] += total
        motion[e] += step[e]
    follow_lengths(model, half)


@compiled
def follow_lengths(model: EdgeModel, step: Array) -> None:
    """Move the edges by ``step``; coupling and rates of neighbours follow the length between."""
    theta, opening, own, coupling = model.theta, model.opening, model.own, model.coupling
    edges, after = model.edges, model.after
    for e in range(theta.shape[0]):
        f = after[e]
        if f < 0:
            continue
        is_patch = edges[e] % 2 == 1
        length = theta[f] - theta[e] + (2 * np.pi if f <= e else 0.0)
        both = step[e] + step[f]
        later = length + (both if is_patch else -both)
        first = coupling[e, f]
        last = first * length / later
        coupling[e, f] = last
        coupling[f, e] = last
        by_length = (-first if is_patch else first) / later
        by_e = both if is_patch else step[e]
        by_f = both if is_patch else step[f]
        own[e] += (by_length * opening[f] + first * last * opening[e]) * by_f
        own[f] += (by_length * opening[e] + first * last * opening[f]) * by_e
    for e in range(theta.shape[0]):
        theta[e] += (1 - 2 * (edges[e] % 2)) * step[e]


@compiled
def model_forces(model: EdgeModel, force: Array) -> None:
    """Evaluate the forces C_c² - C |C| into ``force``."""
    opening, critical = model.opening, model.critical
    for e in range(force.shape[0]):
        force[e] = critical[e] * critical[e] - opening[e] * abs(opening[e])


@compiled
def model_hessian(model: EdgeModel, matrix: Array) -> None:
    """Build H_ef = ∂(C_e |C_e| - C_c²)/∂n_f, symmetric: closing edges act on no others.

    Pinned edges, which have no force, are kept where they are.
    """
    opening, rate, coupling = model.opening, model.rate, model.coupling
    critical, critical_rate = model.critical, model.critical_rate
    edges = opening.shape[0]
    for e in range(edges):
        twice = 2 * max(opening[e], 0.0)
        for f in range(edges):
            matrix[e, f] = twice * max(opening[f], 0.0) * coupling[e, f]
        matrix[e, e] = 2 * (abs(opening[e]) * rate[e] - critical[e] * critical_rate[e])
    for e in range(edges):
        if model.pinned[e]:
            matrix[e, :] = 0.0
            matrix[:, e] = 0.0
            matrix[e, e] = 1.0
