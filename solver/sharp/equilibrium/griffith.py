"""Balance at the edges, compiled: how far each is from Griffith's condition, and its derivative."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.edge_derivatives import derivatives
from adhesis.solver.sharp.field.solution import Hold, Solution
from adhesis.solver.sharp.gap.conformal_map import LEFT, LEFT_PATCH, RIGHT, RIGHT_PATCH, map_gaps
from adhesis.solver.sharp.gap.full_contact_stress import Panels, measure_at
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules


class Law(NamedTuple):
    """What moves the edges; lengths in θ.

    Attributes
    ----------
    critical : float
        Critical opening on a flat piece.
    digits : float
        -ln of the relative accuracy of the field.
    settled : float
        A correction this small ends Newton's iteration.
    coarse : float
        So far an equilibrium may move with the error of the field; no smaller than ``settled``.
    near : float
        Descent steps shorter than this are left to Newton's iteration.
    longest : float
        Longest step of a running edge.
    smallest : float
        Narrower patches and gaps are gone.
    overlapping : float
        An opening this far below zero is an overlap that descent cannot weigh.
    hold : Hold
        What is prescribed.
    faint : float
        A force C_c² - C² this small is that of rounding.
    origin : float
        θ of the highest crest.
    """

    critical: float
    digits: float
    settled: float
    coarse: float
    near: float
    longest: float
    smallest: float
    overlapping: float
    hold: Hold
    faint: float
    origin: float


@compiled
def narrowest(gaps: Array) -> float:
    """Length of the shortest gap or patch."""
    table = map_gaps(gaps)
    least = 2 * np.pi
    for k in range(table.shape[0]):
        least = min(least, table[k, RIGHT] - table[k, LEFT], table[k, RIGHT_PATCH])
    return least


@compiled
def imbalance(of: Solution, law: Law, panels: Panels) -> tuple[Array, Array]:
    """C_e - C_c at every edge; positive where contact recedes. And the derivative of C_c by θ."""
    edges = of.opening.shape[0]
    residual = np.empty(edges)
    drift = np.empty(edges)
    for e in range(edges):
        measure, slope = measure_at(of.table[e // 2, LEFT + e % 2], panels)
        root = np.sqrt(measure)
        residual[e] = of.opening[e] - law.critical * root
        drift[e] = law.critical * slope / (2 * root)
    return residual, drift


@compiled
def tangent_of(of: Solution, drift: Array, rules: Rules) -> tuple[Array, Array]:
    """∂(C_e - C_c)/∂n_f, n the outward motion of the contact, and ∂Y/∂θ_f."""
    matrix, pressure = derivatives(of, rules)
    for e in range(matrix.shape[0]):
        matrix[e, e] -= drift[e]
        for f in range(1, matrix.shape[0], 2):
            matrix[e, f] = -matrix[e, f]
    return matrix, pressure


@compiled
def symmetric(of: Solution, tangent: Array, overlapping: float) -> tuple[Array, Array]:
    """Scale factors d and the symmetric matrix d_e tangent_ef / d_f."""
    n = tangent.shape[0]
    d = np.sqrt(np.maximum(of.opening, overlapping))
    matrix = np.empty((n, n))
    for e in range(n):
        for f in range(e + 1):
            value = 0.5 * (tangent[e, f] * d[e] / d[f] + tangent[f, e] * d[f] / d[e])
            matrix[e, f] = value
            matrix[f, e] = value
    return d, matrix


@compiled
def moved_gaps(gaps: Array, step: Array) -> Array:
    """Gaps after an outward motion ``step`` of the contact at every edge."""
    out = np.empty_like(gaps)
    for k in range(gaps.shape[0]):
        out[k, 0] = gaps[k, 0] + step[2 * k]
        out[k, 1] = gaps[k, 1] - step[2 * k + 1]
    return out


@compiled
def at_least(kinds: Kinds, least: Kinds) -> Kinds:
    """``kinds``, none below ``least`` (which is empty for no bound).

    While edges move towards one state, a gap must not lose modes again, or the field's error would
    drive them to and fro.
    """
    if least.shape[0] == kinds.shape[0]:
        return np.maximum(kinds, least)
    return kinds


@compiled
def step_limits(table: Array, longest: float) -> Array:
    """Longest step of each edge: ``longest``, or a quarter of the gap or patch it may close."""
    limit = np.empty(2 * table.shape[0])
    for k in range(table.shape[0]):
        length = table[k, RIGHT] - table[k, LEFT]
        for side in range(2):
            limit[2 * k + side] = min(longest, 0.25 * min(length, table[k, LEFT_PATCH + side]))
    return limit
