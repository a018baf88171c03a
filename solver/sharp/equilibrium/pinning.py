"""Two works of adhesion: an edge advances at one, recedes at a larger one, and is pinned between.

Each edge has a memory, the place where it would begin to advance: there its critical opening is
C_c, and it rises over a short band inside the contact to C_c sqrt(γ_open/γ), at which the edge
recedes. The band takes the place of a jump, so that Newton's iteration and the flow see a stiff
edge where it is pinned. An edge that advances takes its memory along, and one that recedes, too, at
the distance of the band; within the band the memory stays. So a state depends on the one before it.

The memory is that of the last point of a branch, and within a jump that of its beginning. So an
iteration or a flow that goes too far comes back; with a memory that followed it would be pinned.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.tolerances import BAND_END


@compiled
def depth_in_band(theta: float, edge: int, law: EdgeLaw) -> float:
    """Measure how far an edge at θ has receded from its memory, in lengths of the band."""
    held: float = law.held[edge // 2, edge % 2]
    return (held - theta if edge % 2 == 0 else theta - held) / law.band


@compiled
def pinned_opening(
    theta: float, edge: int, critical: float, drift: float, law: EdgeLaw
) -> tuple[float, float]:
    """Compute C_c of an edge with memory, and its derivative by θ, from those of one that advances.

    At an end of the band the derivative is that outside.
    """
    depth = depth_in_band(theta, edge, law)
    share = min(max(depth, 0.0), 1.0)
    factor = 1 + law.pinning * share
    slope = drift * factor
    if BAND_END < depth < 1 - BAND_END:
        slope += rise(edge, critical, law)
    return critical * factor, slope


@compiled
def rise(edge: int, critical: float, law: EdgeLaw) -> float:
    """Derivative by θ that the band adds to C_c."""
    return (2 * (edge % 2) - 1) * critical * law.pinning / law.band


@compiled
def turned_back(theta: float, edge: int, residual: float, law: EdgeLaw) -> bool:
    """Whether an edge at an end of its band is drawn into the band (``residual`` is C - C_c)."""
    depth = depth_in_band(theta, edge, law)
    return (abs(depth) <= BAND_END and residual > 0) or (
        abs(depth - 1) <= BAND_END and residual < 0
    )


@compiled
def stop_at_band(theta: Array, step: Array, law: EdgeLaw) -> bool:
    """Shorten steps (outward motions) that lead into the band or across it: edges stop at its end.

    Steps that begin inside end where they end. Returns whether a step was shortened.
    """
    stopped = False
    for edge in range(step.shape[0]):
        depth = depth_in_band(theta[edge], edge, law)
        after = depth - step[edge] / law.band
        if depth < -BAND_END and after > 0:
            step[edge] = depth * law.band
            stopped = True
        elif depth > 1 + BAND_END and after < 1:
            step[edge] = (depth - 1) * law.band
            stopped = True
    return stopped


@compiled_for_both
def remember(held: Array, gaps: Array, band: float) -> Array:
    """Return the memory of edges at ``gaps``, which had the memory ``held`` before they moved."""
    out = held.copy()
    for k in range(gaps.shape[0]):
        for side in range(2):
            inwards = 1.0 - 2 * side  # from the edge into the gap, where contact grows
            depth = inwards * (held[k, side] - gaps[k, side])
            if depth < 0:
                out[k, side] = gaps[k, side]
            elif depth > band:
                out[k, side] = gaps[k, side] + inwards * band
    return out


def way_to_motion(gaps: Array, held: Array, rate: Array, law: EdgeLaw, step: float) -> float:
    """Return the way in d, along ``step``, after which the first pinned edge begins to move.

    ``rate`` is the outward motion of every edge by d; infinite if none does.
    """
    depth = np.ravel((held - gaps) * (1.0, -1.0)) / law.band
    inwards = -rate * np.sign(step) / law.band
    left = np.where(inwards > 0, 1 - depth, depth)
    pinned = (inwards != 0) & (left > BAND_END) & (left < 1 + BAND_END)
    return float((left[pinned] / np.abs(inwards[pinned])).min(initial=np.inf))


def into_band(held: Array, gaps: Array, band: float) -> Array:
    """Return the memory with which edges at an end of their bands are just inside."""
    depth = np.clip((held - gaps) * (1.0, -1.0) / band, 10 * BAND_END, 1 - 10 * BAND_END)
    return np.asarray(gaps + depth * (1.0, -1.0) * band)


def memory_of(held: Array, gaps: Array, band: float) -> Array:
    """Return the memory of the edges of ``gaps`` among that of others, which are there or gone.

    New edges have that of one which advances.
    """
    if held.shape == gaps.shape:
        return held
    out = np.array(gaps)
    for side in range(2):
        for k in range(len(gaps) if len(held) else 0):
            apart = (held[:, side] - gaps[k, side] + np.pi) % (2 * np.pi) - np.pi
            nearest = int(np.abs(apart).argmin())
            if abs(apart[nearest]) <= 2 * band:
                out[k, side] = gaps[k, side] + apart[nearest]
    return out
