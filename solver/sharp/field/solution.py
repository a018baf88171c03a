"""Prescribed quantity, and solution of (1) in ``dense_solver`` for given gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules


class Hold(NamedTuple):
    """Prescribed quantity d = share·q0 s - give·p.

    It is x of ``control`` in the units used here.

    (1, 0) is a fixed separation, (1, E* q0/(2k)) a stiffness k, (0, 1) a load.
    """

    share: float
    give: float


FIXED = Hold(1.0, 0.0)


class Solution(NamedTuple):
    """Solution of (1), as the compiled code hands it on; N nodes of all gaps together.

    Attributes
    ----------
    table : array
        Of ``conformal_map.map_gaps``.
    kinds, offset : int array
        Kind and first node of each gap.
    theta, weight : array, shape (N,)
        θ and X of the nodes.
    slope : array, shape (L, 2)
        dη/dθ at the gap ends.
    matrix, factor : array, shape (N, N)
        B + G and its factor (``cholesky.cholesky``).
    rhs, solved : array, shape (N, 2 or 3)
        Loads S~, X and, if asked for, S~', and (B + G)⁻¹ of them.
    beyond : array, shape (L, 2, 1 or 2)
        What the modes of S and S' above M add at the ends.
    share : float
        Of the :class:`Hold`.
    unit_mean, resistance : float
        Xᵀ (B + G)⁻¹ X, and share·that + 2π give: -2π/resistance is ∂p/∂d at fixed edges.
    separation, pressure : float
        q0 s and p = 2p̄/E*.
    f : array, shape (N,)
        The openings over sqrt(1-η²).
    opening : array, shape (2L,)
        C at each gap end.
    felt_load, felt_area, felt_shift : array, array, float
        Of the derivatives, what comes from outside a window
        (``exterior``): loads, shape (N, 2L), and areas, shape (2L,),
        of the singular openings, both empty without an outside, and the mean opening when all edges
        move together.
    """

    table: Array
    kinds: NDArray[np.int64]
    offset: NDArray[np.int64]
    theta: Array
    weight: Array
    slope: Array
    matrix: Array
    factor: Array
    rhs: Array
    solved: Array
    beyond: Array
    share: float
    unit_mean: float
    resistance: float
    separation: float
    pressure: float
    f: Array
    opening: Array
    felt_load: Array
    felt_area: Array
    felt_shift: float


PlainSolution = tuple[
    Array, Kinds, Kinds, Array, Array, Array, Array, Array, Array, Array, Array, float, float,
    float, float, float, Array, Array, Array, Array, float,
]  # fmt: skip
"""The fields of :class:`Solution` in order."""


@compiled
def plain(of: Solution) -> PlainSolution:
    """Give a solution as a plain tuple, for the way back to Python.

    To make a named one, compiled code calls Python, where a signal's handler may run and raise: an
    exception that is not expected there.
    """
    return (
        of.table, of.kinds, of.offset, of.theta, of.weight, of.slope, of.matrix, of.factor, of.rhs,
        of.solved, of.beyond, of.share, of.unit_mean, of.resistance, of.separation, of.pressure,
        of.f, of.opening, of.felt_load, of.felt_area, of.felt_shift,
    )  # fmt: skip


@compiled
def without_field(table: Array, kinds: Kinds, hold: Hold) -> Solution:
    """What is told of edges that are no numbers or cross."""
    nothing, none = np.empty(0), np.empty((0, 0))
    return Solution(
        table, kinds, np.zeros(table.shape[0] + 1, dtype=np.int64), nothing, nothing,
        np.empty((table.shape[0], 2)), none, none, none, none, np.empty((0, 0, 0)), hold.share,
        np.nan, np.nan, np.nan, np.nan, nothing, np.full(2 * table.shape[0], np.nan), none, nothing,
        np.nan,
    )  # fmt: skip


@compiled
def edge_openings(
    f: Array, slope: Array, kinds: Kinds, offset: Kinds, start: Kinds, ends: Array
) -> Array:
    """sqrt(2 dη/dθ) f(±1) at every gap end for each column of f, shape (2L, columns)."""
    out = np.zeros((2 * slope.shape[0], f.shape[1]))
    for k in range(slope.shape[0]):
        for side in range(2):
            scale = np.sqrt(2 * slope[k, side])
            for i in range(offset[k + 1] - offset[k]):
                factor = scale * ends[side, start[kinds[k]] + i]
                for j in range(f.shape[1]):
                    out[2 * k + side, j] += factor * f[offset[k] + i, j]
    return out


@compiled
def balanced(
    load_mean: float, unit_mean: float, prescribed: float, hold: Hold
) -> tuple[float, float, float]:
    """Resistance, p and q0 s at which what is prescribed holds.

    ``load_mean`` and ``unit_mean`` are Xᵀ (B + G)⁻¹ of S~ and of X.
    """
    resistance = hold.share * unit_mean + 2 * np.pi * hold.give
    pressure = -(2 * np.pi * prescribed + hold.share * load_mean) / resistance
    separation = prescribed
    if hold.give != 0:
        separation = -(load_mean + pressure * unit_mean) / (2 * np.pi)
    return resistance, pressure, separation


@compiled
def openings_at(
    pressure: float,
    solved: Array,
    slope: Array,
    beyond: Array,
    kinds: Kinds,
    offset: Kinds,
    rules: Rules,
) -> tuple[Array, Array]:
    """The openings over sqrt(1-η²) at a mean stress p, and C at each gap end, of all modes."""
    f = np.empty(solved.shape[0])
    for i in range(solved.shape[0]):
        f[i] = -solved[i, 0] - pressure * solved[i, 1]
    opening = edge_openings(f.reshape(-1, 1), slope, kinds, offset, rules.start, rules.ends)[
        :, 0
    ].copy()
    for k in range(slope.shape[0]):
        for side in range(2):
            opening[2 * k + side] -= np.sqrt(2 * slope[k, side]) * beyond[k, side, 0]
    return f, opening
