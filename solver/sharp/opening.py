"""Energy of a gap field, and the opening of its gaps at fine nodes: all modes, by sine transforms.

A gap's opening is T = Σ_n b_n sin((n+1)t), cos t = η. Below the M modes of (1) in
:mod:`solver.sharp.field` b_n come from f; above them the straight crack gives b_n = -s_n/(n+1),
with s_n the Chebyshev moments of S_full over the gap. With p = 2p̄/E* the elastic energy of one
period is

    U = (E*/(2 q0²)) · ½ [∫ S_full h~ dθ + ∫_gaps S_full T dθ - 2π q0 s p],      h~ = q0 h,

which follows from Betti's theorem; the first term is the energy of full contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import dst, next_fast_len

from solver.compiled import compiled
from solver.profile import Array
from solver.sharp.coordinate import one_minus_plus, theta_at
from solver.sharp.field import RULES, GapField
from solver.sharp.source import interpolate

ENERGY_NODES = 3.0  # sine nodes per shortest wave: two resolve it, the rest is margin
SHAPE_NODES = 6.0  # nodes per shortest wave that bracket every local minimum of the opening
_LEAST = 64


@dataclass(frozen=True)
class Opening:
    """Opening of one gap at its fine sine nodes, θ increasing.

    ``opening`` is T, ``weight`` the Gauss-Chebyshev weight of ∫ T g dθ divided by T, ``modes`` b_n.
    """

    theta: Array
    opening: Array
    weight: Array
    modes: Array


@compiled
def _fewest_nodes(gap: Array, top: int, per_wave: float) -> int:
    """Number of sine nodes so close that the shortest wave holds ``per_wave`` of them."""
    widest = 0.0
    for i in range(1, 24):
        t = np.pi * i / 24
        widest = max(widest, theta_at(gap, np.cos(t))[1] * np.sin(t))
    return int(np.ceil(0.5 * per_wave * widest * top)) + _LEAST


@compiled
def _fine_nodes(gap: Array, count: int) -> tuple[Array, Array, Array]:
    """``count`` sine nodes: θ, dθ/dη, sin t."""
    theta = np.empty(count)
    stretch = np.empty(count)
    sine = np.empty(count)
    for i in range(count):
        t = np.pi * (count - i) / (count + 1)
        sine[i] = np.sin(t)
        theta[i], stretch[i] = theta_at(gap, np.cos(t))
    return theta, stretch, sine


def _sine_modes(field: GapField, k: int, per_wave: float) -> tuple[Array, Array, Array]:
    """θ and dθ of the fine nodes of gap k, and s_n for every mode that they carry."""
    source = field.source
    gap = field.solution.table[k]
    # the transform is fast where one more than the number of nodes has small factors
    count = next_fast_len(_fewest_nodes(gap, source.top, per_wave) + 1, real=True) - 1
    theta, stretch, sine = _fine_nodes(gap, count)
    s = interpolate(theta, source.panels.width, source.panels.stress)
    span = stretch * sine
    # the transform counts t upwards, the nodes run downwards in t
    modes = dst((s * span)[::-1], type=1) / (len(theta) + 1)
    return theta, span * np.pi / (len(theta) + 1), modes


def work_of_gaps(field: GapField) -> float:
    """∫_gaps S_full T dθ."""
    total = float(field.solution.rhs[:, 0] @ field.solution.f)
    for k in range(len(field.gaps)):
        s = _sine_modes(field, k, ENERGY_NODES)[2]
        m = int(RULES.counts[field.solution.kinds[k]])
        high = s[m:]
        total -= np.pi / 2 * float(np.sum(high * high / np.arange(m + 1, len(s) + 1)))
    return total


def fine_opening(field: GapField, k: int, per_wave: float = SHAPE_NODES) -> Opening:
    """Opening T of gap k at fine nodes."""
    of = field.solution
    theta, span, s = _sine_modes(field, k, per_wave)
    m = int(RULES.counts[field.solution.kinds[k]])
    start, square = RULES.start[of.kinds[k]], RULES.square[of.kinds[k]]
    f = of.f[of.offset[k] : of.offset[k + 1]]
    u = RULES.modes[square : square + m * m].reshape(m, m)
    b = -s / np.arange(1, len(s) + 1)
    b[:m] = (2 / np.pi) * (RULES.w[start : start + m] * f) @ u
    return Opening(theta, dst(b, type=1)[::-1] / 2, span, b)


def finer_opening(gap: Array, modes: Array, factor: int) -> tuple[Array, Array]:
    """θ, increasing, and T at about ``factor`` times as many sine nodes as there are modes b_n."""
    count = next_fast_len(factor * (len(modes) + 1), real=True) - 1
    more = np.zeros(count)
    more[: len(modes)] = modes
    return _fine_nodes(gap, count)[0], dst(more, type=1)[::-1] / 2


@compiled
def sum_modes(gap: Array, theta: Array, modes: Array) -> Array:
    """Σ_n b_n sin((n+1)t), cos t = η(θ), by Clenshaw's recurrence."""
    out = np.empty(theta.shape[0])
    left, right = gap[0], gap[1]
    for i in range(theta.shape[0]):
        if theta[i] - left < right - theta[i]:
            minus, plus = one_minus_plus(gap, theta[i] - left, 0)
        else:
            minus, plus = one_minus_plus(gap, right - theta[i], 1)
        twice = 2 * (plus - 1 if plus < minus else 1 - minus)
        b1 = 0.0
        b2 = 0.0
        for n in range(modes.shape[0] - 1, -1, -1):
            b1, b2 = twice * b1 - b2 + modes[n], b1
        out[i] = b1 * np.sqrt(minus * plus)
    return out
