"""Prescribed value, model and solution of (1) in ``gap_field`` for given gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers


class LoadingDevice(NamedTuple):
    """Device that prescribes the value d = separation_weight·q0 s - compliance·p.

    It is x of ``control`` in the units used here: (1, 0) is a fixed separation, (1, E* q0/(2k)) a
    device of stiffness k, (0, 1) a load.
    """

    separation_weight: float
    compliance: float


FIXED_SEPARATION = LoadingDevice(1.0, 0.0)


class FieldModel(NamedTuple):
    """Inputs of a field besides its gaps and the prescribed value.

    Attributes
    ----------
    device : LoadingDevice
    digits : float
        -ln of the relative accuracy of the field.
    rules : GaussRules
    panels : Panels
        Of the full-contact stress.
    """

    device: LoadingDevice
    digits: float
    rules: GaussRules
    panels: Panels


class Nodes(NamedTuple):
    """Gaps and their Gauss-Chebyshev nodes, N of all L gaps together.

    Attributes
    ----------
    table : array, shape (L, 5)
        Of ``conformal_map.map_gaps``.
    orders, offset : int array, shape (L,) and (L + 1,)
        Order of each gap's rule, and first node of each gap.
    theta, weight : array, shape (N,)
        θ and X of the nodes.
    sine, cosine : array, shape (N,)
        Of θ/2.
    slope : array, shape (L, 2)
        dη/dθ at the gap ends.
    """

    table: Array
    orders: Integers
    offset: Integers
    theta: Array
    weight: Array
    sine: Array
    cosine: Array
    slope: Array


class Equations(NamedTuple):
    """Equations (1) at the nodes of given gaps.

    Attributes
    ----------
    matrix : array
        Diagonal blocks of B + G, one below the other.
    load : array, shape (N, 2 or 3)
        S~, X and, if asked for, S~'.
    end_terms : array, shape (L, 2, 1 or 2)
        Terms that the modes of S and S' above M add at the ends.
    """

    matrix: Array
    load: Array
    end_terms: Array


class MeanResponse(NamedTuple):
    """Response of the mean opening to the mean stress.

    Attributes
    ----------
    separation_weight : float
        Of the :class:`LoadingDevice`.
    unit_mean : float
        Xᵀ (B + G)⁻¹ X.
    resistance : float
        separation_weight·unit_mean + 2π compliance: -2π/resistance is ∂p/∂d at fixed edges.
    """

    separation_weight: float
    unit_mean: float
    resistance: float


class Solution(NamedTuple):
    """Solution of (1).

    Attributes
    ----------
    nodes : Nodes
    equations : Equations
    solved : array, shape (N, 2 or 3)
        (B + G)⁻¹ of the loads.
    mean : MeanResponse
    separation, pressure : float
        q0 s and p = 2p̄/E*; the pressure is NaN if there is no solution.
    scaled_opening : array, shape (N,)
        f: the openings over sqrt(1-η²).
    opening : array, shape (2L,)
        C at each gap end.
    """

    nodes: Nodes
    equations: Equations
    solved: Array
    mean: MeanResponse
    separation: float
    pressure: float
    scaled_opening: Array
    opening: Array


@compiled_for_both
def edge_openings(f: Array, nodes: Nodes, rules: GaussRules) -> Array:
    """Evaluate sqrt(2 dη/dθ) f(±1) at every gap end for each column of f, shape (2L, columns)."""
    slope, offset, orders = nodes.slope, nodes.offset, nodes.orders
    starts, end_values = rules.vector_start, rules.end_values
    out = np.zeros((2 * slope.shape[0], f.shape[1]))
    for k in range(slope.shape[0]):
        start = starts[orders[k]]
        for side in range(2):
            scale = np.sqrt(2 * slope[k, side])
            for i in range(offset[k + 1] - offset[k]):
                factor = scale * end_values[side, start + i]
                for j in range(f.shape[1]):
                    out[2 * k + side, j] += factor * f[offset[k] + i, j]
    return out


@compiled
def subtract_end_terms(opening: Array, slope: Array, end_terms: Array, field: int) -> None:
    """Subtract the terms of a field's higher modes (0: S, 1: S') from its edge openings."""
    for k in range(slope.shape[0]):
        for side in range(2):
            opening[2 * k + side] -= np.sqrt(2 * slope[k, side]) * end_terms[k, side, field]


@compiled
def mean_openings(load: Array, solved: Array) -> tuple[float, float]:
    """Sum Xᵀ (B + G)⁻¹ of S~ and of X."""
    load_mean = 0.0
    unit_mean = 0.0
    for i in range(load.shape[0]):
        load_mean += load[i, 1] * solved[i, 0]
        unit_mean += load[i, 1] * solved[i, 1]
    return load_mean, unit_mean


@compiled
def balance_means(
    load_mean: float, unit_mean: float, prescribed: float, device: LoadingDevice
) -> tuple[MeanResponse, float, float]:
    """Find the mean response, p and q0 s at the prescribed value, from :func:`mean_openings`."""
    weight, compliance = device.separation_weight, device.compliance
    resistance = weight * unit_mean + 2 * np.pi * compliance
    pressure = -(2 * np.pi * prescribed + weight * load_mean) / resistance
    separation = prescribed
    if compliance != 0:
        separation = -(load_mean + pressure * unit_mean) / (2 * np.pi)
    return MeanResponse(weight, unit_mean, resistance), pressure, separation


@compiled
def combine_openings(
    pressure: float, solved: Array, nodes: Nodes, end_terms: Array, rules: GaussRules
) -> tuple[Array, Array]:
    """Combine f at a mean stress p, and C at each gap end, of all modes."""
    f = np.empty(solved.shape[0])
    for i in range(solved.shape[0]):
        f[i] = -solved[i, 0] - pressure * solved[i, 1]
    opening = edge_openings(f.reshape(-1, 1), nodes, rules)[:, 0].copy()
    subtract_end_terms(opening, nodes.slope, end_terms, 0)
    return f, opening
