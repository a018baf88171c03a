"""What a window of gaps feels of all other gaps: a linear response about a known state.

Gaps outside a window act on it through the charges q of their run at its nodes ξ
(``cluster_tree``),

    q = q0 - p q1 - R g,      g = -Kᵀ w f   (the potentials of the window's gaps at ξ),

so equation (1) of ``dense_solver`` holds for the window with the
matrix less w K R Kᵀ w, S~ less w K q0, X plus w K q1, and a mean opening to which the outside adds
m0 - p m1 + q1ᵀ Kᵀ w f. With edges held outside this is exact; where they follow by their tangent it
is so to second order of their motion. For the window the outside is one more gap, the last one,
whose ends do not move.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled


class Outside(NamedTuple):
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
        C at the ends of the outside, which keep their balance.
    """

    theta: Array
    stretch: Array
    response: Array
    charge: Array
    mean: Array
    opening: Array


NOTHING = Outside(
    np.empty(0), np.empty(0), np.empty((0, 0)), np.empty((0, 2)), np.zeros(2), np.zeros(2)
)


class Felt(NamedTuple):
    """What the outside adds to the derivatives of a window's field.

    Attributes
    ----------
    load : array, shape (N, 2L)
        To the loads of the singular openings; empty without an outside.
    area : array, shape (2L,)
        To their areas.
    shift : float
        To the mean opening when the window's edges move together.
    """

    load: Array
    area: Array
    shift: float


@compiled
def reach(theta: Array, weight: Array, outside: Outside) -> tuple[Array, Array]:
    """Rows w K of nodes, shape (nodes, r), and their derivative by θ."""
    value = np.empty((theta.shape[0], outside.theta.shape[0]))
    slope = np.empty((theta.shape[0], outside.theta.shape[0]))
    for i in range(theta.shape[0]):
        for a in range(outside.theta.shape[0]):
            x = 0.5 * (theta[i] - outside.theta[a])
            sine = np.sin(x)
            value[i, a] = weight[i] * outside.stretch[a] / (4 * np.pi * sine * sine)
            slope[i, a] = -value[i, a] * np.cos(x) / sine
    return value, slope


@compiled
def add_outside(rows: Array, outside: Outside, matrix: Array, rhs: Array) -> Array:
    """Put the outside into matrix and loads (S~, X) of a window; returns w K R."""
    drawn = rows @ outside.response
    matrix -= drawn @ np.ascontiguousarray(rows.T)
    pulled = rows @ outside.charge
    for i in range(rows.shape[0]):
        rhs[i, 0] -= pulled[i, 0]
        rhs[i, 1] += pulled[i, 1]
    return drawn


@compiled
def moving_load(
    rows: Array, slopes: Array, drawn: Array, outside: Outside, f: Array, pressure: float
) -> tuple[Array, float]:
    """Load and mean opening that the outside adds when all edges of the window move together."""
    potential = np.zeros(rows.shape[1])
    changed = np.zeros(rows.shape[1])
    for i in range(rows.shape[0]):
        for a in range(rows.shape[1]):
            potential[a] += rows[i, a] * f[i]
            changed[a] += slopes[i, a] * f[i]
    charge = outside.response @ potential
    for a in range(charge.shape[0]):
        charge[a] += outside.charge[a, 0] - pressure * outside.charge[a, 1]
    load = np.zeros(rows.shape[0])
    for i in range(rows.shape[0]):
        for a in range(rows.shape[1]):
            load[i] -= slopes[i, a] * charge[a] + drawn[i, a] * changed[a]
    mean = 0.0
    for a in range(changed.shape[0]):
        mean += changed[a] * outside.charge[a, 1]
    return load, mean
