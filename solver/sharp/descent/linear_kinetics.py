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

_CLOSE = 0.97  # a step is long enough at this share of the limit
_AIM = 0.99  # the share that is aimed at
_TRIES = 60
_SETTLED = 36.0  # exp(-36) is rounding
_FAINT = 1e-3  # share of the force below which an unstable mode is not pulled
_ALIKE = 1e-3  # modes whose stiffness differs by less than this share of the largest are alike


@compiled
def hessian(opening: Array, residual: Array, drift: Array, tangent: Array) -> Array:
    """H_ef = ∂(C_e² - C_c²)/∂n_f from ``tangent`` = ∂(C_e - C_c)/∂n_f; symmetric.

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
def _progress(values: Array, parts: Array, time: float) -> Array:
    """(1 - exp(-λτ))/λ times the force in each mode."""
    out = np.empty(values.shape[0])
    for i in range(values.shape[0]):
        x = values[i] * time
        if parts[i] == 0:
            out[i] = 0.0
        elif abs(x) < 1e-4:
            out[i] = parts[i] * time * (1 - 0.5 * x)
        elif x > _SETTLED:
            out[i] = parts[i] / values[i]
        else:
            out[i] = parts[i] * (1 - np.exp(-x)) / values[i]
    return out


@compiled_sums
def _combine(vectors: Array, modes: Array, step: Array) -> None:
    """Motion of every edge from that of the modes."""
    for e in range(step.shape[0]):
        total = 0.0
        for i in range(modes.shape[0]):
            total += vectors[e, i] * modes[i]
        step[e] = total


@compiled
def flow_step(values: Array, vectors: Array, force: Array, limit: Array, noise: float) -> Array:
    """Motion of the edges until one is at its limit, or all have come to rest.

    ``values`` (rising) and ``vectors`` are those of the Hessian. An unstable mode that the force
    hardly pulls, by less than ``noise`` or a thousandth of the force, is not followed: its pull is
    that of rounding, and a symmetry would be broken by it.
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
        if values[i] < 0 and abs(parts[i]) < max(noise, _FAINT * np.sqrt(total)):
            parts[i] = 0.0
    fastest = 0.0
    for e in range(n):
        fastest = max(fastest, abs(force[e]) / limit[e])
    step = np.zeros(n)
    if not fastest > 0:
        return step
    low = 0.0
    high = np.inf
    below = 0.0  # of the limit, at the time ``low``
    above = np.inf
    time = _AIM / fastest
    for _ in range(_TRIES):
        _combine(vectors, _progress(values, parts, time), step)
        worst = 0.0
        for e in range(n):
            worst = max(worst, abs(step[e]) / limit[e])
        if worst > 1 or not np.isfinite(worst):
            high = time
            above = worst
        else:
            low = time
            below = worst
            if worst > _CLOSE:
                return step
            slowest = np.inf
            for i in range(n):
                if parts[i] != 0:
                    slowest = min(slowest, values[i])
            if slowest * time > _SETTLED:
                return step
        if np.isinf(high):
            time *= min(4.0, max(1.02, _AIM / worst))
        elif not above < 4:
            time = 0.5 * (low + high) if high < 2 * low or low == 0 else np.sqrt(low * high)
        else:
            # between the two times, where the line through both would be at the aim
            share = (_AIM - below) / (above - below)
            time = low + min(max(share, 0.02), 0.98) * (high - low)
    # an edge passes its limit within rounding of the time: a step in the flow's last direction
    for e in range(n):
        step[e] /= worst
    return step


@compiled
def leaving_step(values: Array, vectors: Array, limit: Array, order: Array) -> Array:
    """Step off a saddle, along its softest modes, up to the limit of an edge.

    One edge leads, outwards; it is the one that moves most freely in these modes, of equal ones the
    first in ``order`` (positions). Where symmetry makes several modes equally soft, the step is the
    leading edge's projection on all of them: which of equivalent edges leads does not matter.
    """
    n = limit.shape[0]
    level = min(values[0] + _ALIKE * np.abs(values).max(), 0.0)
    freedom = np.zeros(n)
    for i in range(n):
        if values[i] <= level:
            for e in range(n):
                freedom[e] += vectors[e, i] ** 2
    most = freedom.max()
    lead = -1
    for e in range(n):
        if freedom[e] > 0.99 * most and (lead < 0 or order[e] < order[lead]):
            lead = e
    step = np.zeros(n)
    for i in range(n):
        if values[i] <= level:
            for e in range(n):
                step[e] += vectors[e, i] * vectors[lead, i]
    worst = 0.0
    for e in range(n):
        worst = max(worst, abs(step[e]) / limit[e])
    return step / worst
