"""The law by which edges move, and the lengths of one problem; compiled where it is asked.

With one work of adhesion every edge has C_e = C_c in equilibrium. With two of them an edge advances
at C_c and recedes at C_c sqrt(γ_open/γ); between both it is pinned. Its memory is the place where
it was at the last state: ahead of it the edge advances, behind it the edge recedes, and there it is
held while C lies between both openings. A path of states therefore depends on its past, and within
a jump an edge that ran too far comes back as it went.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.gap.full_contact_stress import Panels, measure_at
from adhesis.solver.sharp.gap.quadrature import Integers

Flags = NDArray[np.bool_]


class EdgeLaw(NamedTuple):
    """Law by which the edges move, with the tolerances of one problem; lengths in θ.

    Attributes
    ----------
    critical : float
        Critical opening on a flat piece.
    newton_tolerance : float
        A correction this small ends Newton's iteration.
    field_error : float
        Largest displacement of an equilibrium by the error of the field; no less than
        ``newton_tolerance``.
    rest_step : float
        A descent whose steps are shorter than this is left to Newton's iteration.
    longest_step : float
        Longest short step of an edge in a descent.
    smallest : float
        Narrower patches and gaps are removed.
    overlap_limit : float
        An opening this far below zero is an overlap that descent cannot weigh.
    force_error : float
        A force C_c² - C² this small is that of rounding.
    origin : float
        θ of the highest crest.
    pinning : float
        sqrt(γ_open/γ) - 1, by which the critical opening of an edge that recedes is larger; 0 for
        one work of adhesion.
    memory : array, shape (L, 2)
        Where the edges were at the last state; empty for one work of adhesion.
    """

    critical: float
    newton_tolerance: float
    field_error: float
    rest_step: float
    longest_step: float
    smallest: float
    overlap_limit: float
    force_error: float
    origin: float
    pinning: float
    memory: Array


@compiled
def critical_opening(theta: float, law: EdgeLaw, panels: Panels) -> tuple[float, float]:
    """Compute C_c at θ of an edge that advances, and its derivative."""
    measure, slope = measure_at(theta, panels)
    root = np.sqrt(measure)
    return law.critical * root, law.critical * slope / (2 * root)


@compiled
def way_from_memory(edge: int, theta: float, law: EdgeLaw) -> float:
    """Compute how far an edge has advanced from its memory; exactly 0 where it may be pinned."""
    way: float = (1 - 2 * (edge % 2)) * (theta - law.memory[edge // 2, edge % 2])
    return way if abs(way) > 0.5 * law.newton_tolerance else 0.0


@compiled
def critical_of(
    edge: int, theta: float, opening: float, law: EdgeLaw, panels: Panels
) -> tuple[float, float, bool]:
    """Compute C_c of an edge at θ with the opening C, and its derivative by θ.

    Returns also whether it is pinned; its C_c is then C.
    """
    critical, drift = critical_opening(theta, law, panels)
    if law.pinning == 0:
        return critical, drift, False
    way, receding = way_from_memory(edge, theta, law), critical * (1 + law.pinning)
    if way == 0 and critical <= opening <= receding:
        return opening, 0.0, True
    if way < 0 or (way == 0 and opening > receding):
        return receding, drift * (1 + law.pinning), False
    return critical, drift, False


@compiled_for_both
def at_memory(gaps: Array, law: EdgeLaw) -> Flags:
    """Mark the edges at their memory; none with one work of adhesion."""
    out = np.zeros(gaps.size, dtype=np.bool_)
    if law.pinning > 0:
        for e in range(gaps.size):
            out[e] = way_from_memory(e, gaps[e // 2, e % 2], law) == 0
    return out


@compiled
def stop_at_memory(edges: Integers, theta: Array, force: Array, step: Array, law: EdgeLaw) -> bool:
    """Shorten steps (outward motions) that lead across the memory: there an edge may be pinned.

    From there it moves with its ``force`` only. Returns whether a step was shortened.
    """
    stopped = False
    for c in range(step.shape[0]):
        way = way_from_memory(edges[c], theta[c], law)
        if way == 0:
            if step[c] * force[c] <= 0:
                step[c] = 0.0
        elif way * (way + step[c]) < 0:
            step[c], stopped = -way, True
    return stopped
