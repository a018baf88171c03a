"""Model of the edge openings about solved edges, compiled: half-plane cracks that interact.

Over a shortest wave the opening C of an edge changes by the roughness under it, which is that of
a half-plane crack and known beforehand (``full_contact_stress.half_plane_opening``). The rest, the
finite length of the gap and the motion of the other edges, changes slowly. With n the outward
motion of the contact,

    dC_e = dR_e + own_e dn_e + Σ_{f≠e} coupling_ef C_f dn_f,

R the opening of the half-plane crack, and ``coupling`` symmetric: both follow from the tangent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.descent.edge_forces import Forces
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw, critical_opening
from adhesis.solver.sharp.gap.full_contact_stress import Panels, half_plane_opening


class EdgeModel(NamedTuple):
    """Openings about solved edges.

    Attributes
    ----------
    own : array, shape (2L,)
        ∂C_e/∂n_e, less that of a half-plane crack.
    coupling : array, shape (2L, 2L)
        ∂C_e/∂n_f over C_f; zero on the diagonal.
    """

    own: Array
    coupling: Array


class ModelState(NamedTuple):
    """Edges on their way through the model, changed in place; arrays have shape (2L,).

    Attributes
    ----------
    theta, motion : array
        Position in θ, and outward motion of the contact so far.
    opening, rate : array
        C, and ∂C_e/∂n_e.
    half_plane : array
        R.
    critical, critical_rate : array
        C_c, and its derivative by n.
    """

    theta: Array
    motion: Array
    opening: Array
    rate: Array
    half_plane: Array
    critical: Array
    critical_rate: Array


@compiled
def model_about(gaps: Array, now: Forces, tangent: Array, panels: Panels) -> EdgeModel:
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
    return EdgeModel(own, coupling)


@compiled
def initial_state(
    gaps: Array, opening: Array, model: EdgeModel, law: EdgeLaw, panels: Panels
) -> ModelState:
    """Put the edges where the model is made."""
    edges = opening.shape[0]
    state = ModelState(
        gaps.ravel().copy(), np.zeros(edges), np.zeros(edges), np.empty(edges), np.empty(edges),
        np.empty(edges), np.empty(edges),
    )  # fmt: skip
    evaluate(state, model, law, panels)
    state.opening[:] = opening
    return state


@compiled
def evaluate(state: ModelState, model: EdgeModel, law: EdgeLaw, panels: Panels) -> None:
    """Evaluate R, C_c and the rates at the present edges, and add R to the openings."""
    theta, rate, half_plane, opening = state.theta, state.rate, state.half_plane, state.opening
    critical, critical_rate, own = state.critical, state.critical_rate, model.own
    for e in range(theta.shape[0]):
        outwards = 1 - 2 * (e % 2)
        half_plane[e], slope = half_plane_opening(theta[e], e % 2, panels)
        opening[e] += half_plane[e]
        rate[e] = own[e] + outwards * slope
        critical[e], drift = critical_opening(theta[e], law, panels)
        critical_rate[e] = outwards * drift


@compiled_sums
def advance(state: ModelState, step: Array, model: EdgeModel) -> None:
    """Move the edges outwards by ``step``; :func:`evaluate` is to follow."""
    theta, motion, opening, half_plane = state.theta, state.motion, state.opening, state.half_plane
    own, coupling = model.own, model.coupling
    edges = step.shape[0]
    by_motion = np.empty(edges)
    for f in range(edges):
        by_motion[f] = opening[f] * step[f]
    for e in range(edges):
        total = own[e] * step[e] - half_plane[e]
        for f in range(edges):
            total += coupling[e, f] * by_motion[f]
        opening[e] += total
        motion[e] += step[e]
        theta[e] += (1 - 2 * (e % 2)) * step[e]


@compiled
def model_forces(state: ModelState, force: Array) -> None:
    """Evaluate the forces C_c² - C |C| into ``force``."""
    opening, critical = state.opening, state.critical
    for e in range(force.shape[0]):
        force[e] = critical[e] * critical[e] - opening[e] * abs(opening[e])


@compiled
def model_hessian(state: ModelState, model: EdgeModel, matrix: Array) -> None:
    """Build H_ef = ∂(C_e |C_e| - C_c²)/∂n_f, symmetric: closing edges act on no others."""
    opening, rate, coupling = state.opening, state.rate, model.coupling
    critical, critical_rate = state.critical, state.critical_rate
    edges = opening.shape[0]
    for e in range(edges):
        twice = 2 * max(opening[e], 0.0)
        for f in range(edges):
            matrix[e, f] = twice * max(opening[f], 0.0) * coupling[e, f]
        matrix[e, e] = 2 * (abs(opening[e]) * rate[e] - critical[e] * critical_rate[e])
