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
from adhesis.solver.sharp.descent.edge_forces import Forces
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import critical_of
from adhesis.solver.sharp.gap.full_contact_stress import Panels, half_plane_opening


class EdgeModel(NamedTuple):
    """Edges on their way from where they were solved, changed in place.

    Attributes
    ----------
    theta, motion : array, shape (2L,)
        Position in θ, and outward motion of the contact so far.
    opening, rate : array, shape (2L,)
        C, and ∂C_e/∂n_e.
    half_plane : array, shape (2L,)
        R.
    critical, critical_rate : array, shape (2L,)
        C_c, and its derivative by n.
    own : array, shape (2L,)
        ∂C_e/∂n_e, less that of a half-plane crack.
    coupling : array, shape (2L, 2L)
        ∂C_e/∂n_f over C_f; zero on the diagonal.
    """

    theta: Array
    motion: Array
    opening: Array
    rate: Array
    half_plane: Array
    critical: Array
    critical_rate: Array
    own: Array
    coupling: Array


@compiled
def model_about(
    gaps: Array, now: Forces, tangent: Array, law: EdgeLaw, panels: Panels
) -> EdgeModel:
    """Make the model about solved edges from ``tangent`` = ∂(C_e - C_c)/∂n_f.

    Of ``tangent[e, f]`` over C_f and its transpose, which are equal, that with the larger opening
    is taken. The edges outside a window have none, and do not interact.
    """
    opening, drift = now.solution.opening, now.drift
    edges = opening.shape[0]
    own = np.empty(edges)
    coupling = np.zeros((edges, edges))
    for e in range(edges):
        outwards = 1 - 2 * (e % 2)
        _, slope = half_plane_opening(gaps[e // 2, e % 2], e % 2, panels)
        own[e] = tangent[e, e] + outwards * (drift[e] - slope)
        for f in range(e):
            value = 0.0
            if abs(opening[f]) > abs(opening[e]):
                value = tangent[e, f] / opening[f]
            elif opening[e] != 0:
                value = tangent[f, e] / opening[e]
            coupling[e, f] = value
            coupling[f, e] = value
    model = EdgeModel(
        gaps.ravel().copy(), np.zeros(edges), np.zeros(edges), np.empty(edges), np.empty(edges),
        np.empty(edges), np.empty(edges), own, coupling,
    )  # fmt: skip
    evaluate(model, law, panels)
    model.opening[:] = opening
    evaluate_law(model, law, panels)
    return model


@compiled
def evaluate(model: EdgeModel, law: EdgeLaw, panels: Panels) -> None:
    """Evaluate R, C_c and the rates at the present edges, and add R to the openings."""
    theta, rate, half_plane, opening = model.theta, model.rate, model.half_plane, model.opening
    own = model.own
    for e in range(theta.shape[0]):
        outwards = 1 - 2 * (e % 2)
        half_plane[e], slope = half_plane_opening(theta[e], e % 2, panels)
        opening[e] += half_plane[e]
        rate[e] = own[e] + outwards * slope
    evaluate_law(model, law, panels)


@compiled
def evaluate_law(model: EdgeModel, law: EdgeLaw, panels: Panels) -> None:
    """Evaluate C_c and its rates at the present edges."""
    theta, opening = model.theta, model.opening
    critical, critical_rate = model.critical, model.critical_rate
    for e in range(theta.shape[0]):
        critical[e], drift = critical_of(e, theta[e], opening[e], law, panels)
        critical_rate[e] = (1 - 2 * (e % 2)) * drift


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
    edges = theta.shape[0]
    for e in range(edges):
        f = (e + 1) % edges
        is_patch = e % 2 == 1
        length = theta[f] - theta[e] + (2 * np.pi if f == 0 else 0.0)
        both = step[e] + step[f]
        after = length + (both if is_patch else -both)
        first = coupling[e, f]
        last = first * length / after
        coupling[e, f] = last
        coupling[f, e] = last
        by_length = (-first if is_patch else first) / after
        by_e = both if is_patch else step[e]
        by_f = both if is_patch else step[f]
        own[e] += (by_length * opening[f] + first * last * opening[e]) * by_f
        own[f] += (by_length * opening[e] + first * last * opening[f]) * by_e
    for e in range(edges):
        theta[e] += (1 - 2 * (e % 2)) * step[e]


@compiled
def model_forces(model: EdgeModel, force: Array) -> None:
    """Evaluate the forces C_c² - C |C| into ``force``."""
    opening, critical = model.opening, model.critical
    for e in range(force.shape[0]):
        force[e] = critical[e] * critical[e] - opening[e] * abs(opening[e])


@compiled
def model_hessian(model: EdgeModel, matrix: Array) -> None:
    """Build H_ef = ∂(C_e |C_e| - C_c²)/∂n_f, symmetric: closing edges act on no others."""
    opening, rate, coupling = model.opening, model.rate, model.coupling
    critical, critical_rate = model.critical, model.critical_rate
    edges = opening.shape[0]
    for e in range(edges):
        twice = 2 * max(opening[e], 0.0)
        for f in range(edges):
            matrix[e, f] = twice * max(opening[f], 0.0) * coupling[e, f]
        matrix[e, e] = 2 * (abs(opening[e]) * rate[e] - critical[e] * critical_rate[e])
