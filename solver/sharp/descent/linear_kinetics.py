"""Linear kinetics, compiled: one step of the edges' gradient flow.

The edges move in proportion to their excess energy release rates, ṅ = -∂U/∂n, all with the same
mobility: with f = -∂U/∂n = C_c² - C² (in units of π/8) and the Hessian H of the energy,
ṅ = f - H n in the neighbourhood of the present edges. That is followed exactly, in the eigenvectors
of H, until some edge is at the limit of its step: n(τ) = Σ_i v_i (1 - exp(-λ_i τ))/λ_i (v_i·f).
Stiff modes have then come to rest, as they do in the flow, and where no edge reaches its limit the
step is Newton's.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.tolerances import (
    FLOW_AIM,
    FLOW_DECAYED,
    FLOW_REACHED,
    FLOW_TRIES,
    UNSTABLE_FORCE,
)


@compiled
def hessian(opening: Array, residual: Array, drift: Array, tangent: Array) -> Array:
    """Build H_ef = ∂(C_e² - C_c²)/∂n_f, symmetric, from ``tangent`` = ∂(C_e - C_c)/∂n_f.

    ``residual`` is C_e - C_c, ``drift`` the derivative of C_c by θ.
    """
    n = opening.shape[0]
    matrix = np.empty((n, n))
    for e in range(n):
        for f in range(e):
            value = opening[e] * tangent[e, f] + opening[f] * tangent[f, e]
            matrix[e, f] = value
            matrix[f, e] = value
        outwards = 1 - 2 * (e % 2)
        matrix[e, e] = 2 * (opening[e] * tangent[e, e] + outwards * residual[e] * drift[e])
    return matrix


@compiled
def mode_motion(values: Array, parts: Array, time: float) -> Array:
    """Move each mode along the flow for a ``time`` τ: (1 - exp(-λτ))/λ times the force in it."""
    out = np.empty(values.shape[0])
    for i in range(values.shape[0]):
        x = values[i] * time
        if parts[i] == 0:
            out[i] = 0.0
        elif abs(x) < 1e-4:
            out[i] = parts[i] * time * (1 - 0.5 * x)
        elif x > FLOW_DECAYED:
            out[i] = parts[i] / values[i]
        else:
            out[i] = parts[i] * (1 - np.exp(-x)) / values[i]
    return out


@compiled_sums
def _combine(vectors: Array, modes: Array, step: Array) -> None:
    """Add up the motion of every edge from that of the modes."""
    for e in range(step.shape[0]):
        total = 0.0
        for i in range(modes.shape[0]):
            total += vectors[e, i] * modes[i]
        step[e] = total


@compiled
def followed_force(values: Array, vectors: Array, force: Array, noise: float) -> Array:
    """Project the force on the modes, without that on unstable ones which it hardly pulls.

    A pull below ``noise``, or a thousandth of the force, is that of rounding, and following it
    would break a symmetry.
    """
    n = force.shape[0]
    parts = np.zeros(n)
    total = 0.0
    for e in range(n):
        total += force[e] * force[e]
    for e in range(n):
        for i in range(n):
            parts[i] += vectors[e, i] * force[e]
    for i in range(n):
        if values[i] < 0 and abs(parts[i]) < max(noise, UNSTABLE_FORCE * np.sqrt(total)):
            parts[i] = 0.0
    return parts


@compiled
def has_decayed(values: Array, parts: Array, time: float) -> bool:
    """Whether all modes that the force pulls have come to rest after a ``time``."""
    slowest = np.inf
    for i in range(values.shape[0]):
        if parts[i] != 0:
            slowest = min(slowest, values[i])
    return bool(slowest * time > FLOW_DECAYED)


@compiled
def _largest_share(values: Array, limit: Array) -> float:
    """Find the largest of the values over their limits."""
    largest = 0.0
    for e in range(limit.shape[0]):
        largest = max(largest, abs(values[e]) / limit[e])
    return largest


@compiled
def flow_step(values: Array, vectors: Array, force: Array, limit: Array, noise: float) -> Array:
    """Follow the linear flow until one edge is at its limit, or all have come to rest.

    ``values`` (rising) and ``vectors`` are those of the Hessian; for ``noise`` see
    :func:`followed_force`. The time at which the first edge is at its limit is found by
    extrapolation and then bracketing.
    """
    n = force.shape[0]
    parts = followed_force(values, vectors, force, noise)
    fastest = _largest_share(force, limit)
    step = np.zeros(n)
    if not fastest > 0:
        return step
    low = 0.0
    high = np.inf
    below = 0.0  # of the limit, at the time ``low``
    above = np.inf
    time = FLOW_AIM / fastest
    for _ in range(FLOW_TRIES):
        _combine(vectors, mode_motion(values, parts, time), step)
        worst = _largest_share(step, limit)
        if worst > 1 or not np.isfinite(worst):
            high = time
            above = worst
        else:
            low = time
            below = worst
            if worst > FLOW_REACHED or has_decayed(values, parts, time):
                return step
        if np.isinf(high):
            time *= min(4.0, max(1.02, FLOW_AIM / worst))
        elif not above < 4:
            time = 0.5 * (low + high) if high < 2 * low or low == 0 else np.sqrt(low * high)
        else:
            # between the two times, where the line through both would be at the aim
            share = (FLOW_AIM - below) / (above - below)
            time = low + min(max(share, 0.02), 0.98) * (high - low)
    # an edge passes its limit within rounding of the time: a step in the flow's last direction
    for e in range(n):
        step[e] /= worst
    return step
