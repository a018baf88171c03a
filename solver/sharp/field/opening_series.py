"""Energy of a gap field, and the opening of its gaps at fine nodes: all modes, by sine transforms.

A gap's opening is T = Σ_n b_n sin((n+1)t), cos t = η. Below the M modes of (1) in
``dense_solver`` b_n come from f; above them the straight crack gives
b_n = -s_n/(n+1), with s_n the Chebyshev moments of S_full over the gap. With p = 2p̄/E* the elastic
energy of one period is

    U = (E*/(2 q0²)) · ½ [∫ S_full h~ dθ + ∫_gaps S_full T dθ - 2π q0 s p],      h~ = q0 h,

which follows from Betti's theorem; the first term is the energy of full contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.gap.conformal_map import (
    ALPHA,
    LEFT,
    LEFT_PATCH,
    RIGHT,
    RIGHT_PATCH,
    one_minus_plus,
    theta_at,
)
from adhesis.solver.sharp.gap.full_contact_stress import interpolate
from adhesis.solver.sharp.gap.quadrature import RULES, Kinds, Rules
from adhesis.solver.sharp.gap.sine_transform import circle, sine_sums

ENERGY_NODES = 3.0  # sine nodes per shortest wave: two resolve it, the rest is margin
SHAPE_NODES = 6.0  # nodes per shortest wave that bracket every local minimum of the opening
_LEAST = 64
_MANY_NODES = 500

_PER_UNIT = 32  # entries of the table of exp(y) - 1 for a unit of y
_EXPM1 = np.expm1(np.arange(20 * _PER_UNIT) / _PER_UNIT)


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
def fine_nodes_of(gap: Array, top: int, per_wave: float) -> int:
    """Number of sine nodes of a gap, so that the shortest wave holds ``per_wave`` of them."""
    widest = 0.0
    for i in range(1, 24):
        t = np.pi * i / 24
        widest = max(widest, theta_at(gap, np.cos(t))[1] * np.sin(t))
    return fast_size(int(np.ceil(0.5 * per_wave * widest * top)) + _LEAST)


@compiled
def fast_size(fewest: int) -> int:
    """Number of nodes, no fewer, for which the transform is fast and which many gaps share.

    That is so where one more than the number of nodes has small factors.
    """
    eighth = 1
    while 16 * eighth <= fewest + 1:
        eighth *= 2
    # wide gaps are few, and it is their nodes that cost
    steps = (9, 10, 12, 15, 16) if fewest > _MANY_NODES else (12, 12, 12, 16, 16)
    for step in steps:
        if step * eighth - 1 >= fewest:
            return step * eighth - 1
    return 32 * eighth - 1


@compiled
def _fine_nodes(gap: Array, cosine: Array, sine: Array, theta: Array, span: Array) -> None:
    """Sine nodes of a gap, as many as ``theta`` holds: θ, falling, and dθ/dt.

    As :func:`theta_at`, many at a time, with exp(y) - 1 from a table.
    """
    left, right = gap[LEFT], gap[RIGHT]
    alpha = 2 * gap[ALPHA]
    for i in range(theta.shape[0]):
        c = cosine[i + 1]
        from_left = c < 0
        own = gap[LEFT_PATCH] if from_left else gap[RIGHT_PATCH]
        other = gap[RIGHT_PATCH] if from_left else gap[LEFT_PATCH]
        far = right - left + other
        y = alpha * (1 + c if from_left else 1 - c)
        place = int(y * _PER_UNIT)
        if place < _EXPM1.shape[0]:
            x = y - place / _PER_UNIT
            grown = 1 / 24 + x * (1 / 120 + x * (1 / 720 + x / 5040))
            grown = x * (1 + x * (0.5 + x * (1 / 6 + x * grown)))
            grown = _EXPM1[place] + grown * (1 + _EXPM1[place])
        else:
            grown = np.expm1(y)
        r = grown * own * far / (far + (1 + grown) * own)
        span[i] = alpha * (own + r) * (far - r) / (own + far) * sine[i + 1]
        theta[i] = left + r if from_left else right - r


@compiled
def _moments(
    gap: Array,
    width: float,
    stress: Array,
    cosine: Array,
    sine: Array,
    theta: Array,
    span: Array,
    modes: Array,
) -> None:
    """Fine nodes of a gap (:func:`_fine_nodes`), and s_n of every mode that they carry."""
    _fine_nodes(gap, cosine, sine, theta, span)
    load = interpolate(theta, width, stress)
    count = theta.shape[0]
    for i in range(count):
        load[i] *= span[i]
    sine_sums(load, cosine, sine, modes)
    for n in range(count):
        modes[n] *= 2 / (count + 1)


@compiled
def _high_work(
    table: Array, kinds: Kinds, counts: Kinds, top: int, width: float, stress: Array
) -> float:
    """π/2 Σ s_n²/(n+1) over the modes of all gaps above those of f."""
    total = 0.0
    last = 0
    cosine, sine = circle(4)
    for k in range(table.shape[0]):
        count = fine_nodes_of(table[k], top, ENERGY_NODES)
        if count != last:
            cosine, sine = circle(count + 1)
            last = count
        theta, span, modes = np.empty(count), np.empty(count), np.empty(count)
        _moments(table[k], width, stress, cosine, sine, theta, span, modes)
        for n in range(counts[kinds[k]], count):
            total += modes[n] * modes[n] / (n + 1)
    return np.pi / 2 * total


def work_of_gaps(field: GapField) -> float:
    """∫_gaps S_full T dθ."""
    of, source = field.solution, field.source
    high = _high_work(
        of.table, of.kinds, RULES.counts, source.top, source.panels.width, source.panels.stress
    )
    return float(of.rhs[:, 0] @ of.f) - high


@compiled
def opened(
    gap: Array,
    count: int,
    kind: int,
    f: Array,
    rules: Rules,
    width: float,
    stress: Array,
    cosine: Array,
    sine: Array,
) -> tuple[Array, Array, Array, Array]:
    """θ, falling, dθ/dt and T of a gap at ``count`` fine nodes, and its b_n, from its f."""
    theta, span, modes = np.empty(count), np.empty(count), np.empty(count)
    _moments(gap, width, stress, cosine, sine, theta, span, modes)
    m = rules.counts[kind]
    for n in range(m, count):
        modes[n] = -modes[n] / (n + 1)
    for n in range(m):
        total = 0.0
        for j in range(m):
            w = rules.w[rules.start[kind] + j]
            total += w * f[j] * rules.modes[rules.square[kind] + j * m + n]
        modes[n] = 2 / np.pi * total
    opening = np.empty(count)
    sine_sums(modes, cosine, sine, opening)
    return theta, span, opening, modes


def fine_opening(field: GapField, k: int, per_wave: float = SHAPE_NODES) -> Opening:
    """Opening T of gap k at fine nodes."""
    of, panels = field.solution, field.source.panels
    count = fine_nodes_of(of.table[k], field.source.top, per_wave)
    theta, span, opening, modes = opened(
        of.table[k], count, of.kinds[k], of.f[of.offset[k] : of.offset[k + 1]], RULES,
        panels.width, panels.stress, *circle(count + 1),
    )  # fmt: skip
    weight = span * np.pi / (count + 1)
    return Opening(theta[::-1], opening[::-1], weight[::-1], modes)


def finer_opening(gap: Array, modes: Array, factor: int) -> tuple[Array, Array]:
    """θ, increasing, and T at about ``factor`` times as many sine nodes as there are modes b_n."""
    count = fast_size(factor * (len(modes) + 1) - 1)
    cosine, sine = circle(count + 1)
    more, theta, span, opening = np.zeros(count), np.empty(count), np.empty(count), np.empty(count)
    more[: len(modes)] = modes
    _fine_nodes(gap, cosine, sine, theta, span)
    sine_sums(more, cosine, sine, opening)
    return theta[::-1], opening[::-1]


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
