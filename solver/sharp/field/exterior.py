"""Represent the exterior of a window of gaps by a Schur complement.

The exterior is a linear response about a known state. Gaps outside a window act on it through the
charges q of their run at its nodes ξ (``cluster_tree``),

    q = q0 - p q1 - R g,      g = -Kᵀ w f   (the potentials of the window's gaps at ξ),

so equation (1) of ``dense_solver`` holds for the window with the matrix less w K R Kᵀ w, S~ less
w K q0, X plus w K q1, and a mean opening to which the exterior adds m0 - p m1 + q1ᵀ Kᵀ w f. With
edges held outside this is exact; where they follow by their tangent it is so to second order of
their motion. For the window the exterior is one more gap, the last one, without nodes, whose ends
do not move.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.solution import Equations, Nodes


class Exterior(NamedTuple):
    """Response of the gaps outside a window, r charges; empty for none.

    Attributes
    ----------
    theta, stretch : array, shape (r,)
        θ and dθ/dη of the nodes.
    response : array, shape (r, r)
        R.
    charge : array, shape (r, 2)
        q0 and q1.
    mean : array, shape (2,)
        m0 and m1.
    opening : array, shape (2,)
        C at the ends of the exterior, which keep their balance.
    """

    theta: Array
    stretch: Array
    response: Array
    charge: Array
    mean: Array
    opening: Array


NO_EXTERIOR = Exterior(
    theta=np.empty(0),
    stretch=np.empty(0),
    response=np.empty((0, 0)),
    charge=np.empty((0, 2)),
    mean=np.zeros(2),
    opening=np.zeros(2),
)
"""For gaps that are all gaps of the period."""


class ExteriorCoupling(NamedTuple):
    """Coupling of a window's nodes to its exterior, shape (N, r).

    Attributes
    ----------
    kernel : array
        w K.
    slope : array
        Its derivative by θ.
    response : array
        w K R.
    """

    kernel: Array
    slope: Array
    response: Array


@compiled
def is_present(exterior: Exterior) -> bool:
    """Return whether the gaps are a window with an exterior."""
    present: bool = exterior.theta.shape[0] > 0
    return present


@compiled
def exterior_kernel(theta: Array, weight: Array, exterior: Exterior) -> tuple[Array, Array]:
    """Evaluate w K at some positions, shape (positions, r), and its derivative by θ."""
    value = np.empty((theta.shape[0], exterior.theta.shape[0]))
    slope = np.empty((theta.shape[0], exterior.theta.shape[0]))
    sine, cosine = np.sin(0.5 * exterior.theta), np.cos(0.5 * exterior.theta)
    for i in range(theta.shape[0]):
        own_sine, own_cosine = np.sin(0.5 * theta[i]), np.cos(0.5 * theta[i])
        for a in range(exterior.theta.shape[0]):
            half = own_sine * cosine[a] - own_cosine * sine[a]
            value[i, a] = weight[i] * exterior.stretch[a] / (4 * np.pi * half * half)
            slope[i, a] = -value[i, a] * (own_cosine * cosine[a] + own_sine * sine[a]) / half
    return value, slope


@compiled
def add_exterior(nodes: Nodes, equations: Equations, exterior: Exterior) -> ExteriorCoupling:
    """Add the exterior to matrix and loads (S~, X) of a window."""
    kernel, slope = exterior_kernel(nodes.theta, nodes.weight, exterior)
    response = kernel @ exterior.response
    matrix, load = equations.matrix, equations.load
    matrix -= response @ np.ascontiguousarray(kernel.T)
    charge = kernel @ exterior.charge
    for i in range(kernel.shape[0]):
        load[i, 0] -= charge[i, 0]
        load[i, 1] += charge[i, 1]
    return ExteriorCoupling(kernel, slope, response)


@compiled
def translation_terms(
    coupling: ExteriorCoupling, exterior: Exterior, f: Array, pressure: float
) -> tuple[Array, float]:
    """Compute load and mean opening by the exterior when all edges of the window move together."""
    kernel, slope = coupling.kernel, coupling.slope
    potential = np.zeros(kernel.shape[1])
    changed = np.zeros(kernel.shape[1])
    for i in range(kernel.shape[0]):
        for a in range(kernel.shape[1]):
            potential[a] += kernel[i, a] * f[i]
            changed[a] += slope[i, a] * f[i]
    charge = exterior.response @ potential
    for a in range(charge.shape[0]):
        charge[a] += exterior.charge[a, 0] - pressure * exterior.charge[a, 1]
    load = np.zeros(kernel.shape[0])
    for i in range(kernel.shape[0]):
        for a in range(kernel.shape[1]):
            load[i] -= slope[i, a] * charge[a] + coupling.response[i, a] * changed[a]
    mean = 0.0
    for a in range(changed.shape[0]):
        mean += changed[a] * exterior.charge[a, 1]
    return load, mean
