"""Energy of a gap field, and the opening of its gaps at fine nodes: all modes, by sine transforms.

A gap's opening is T = Σ_n b_n sin((n+1)t), cos t = η. Below the M modes of (1) in
:mod:`solver.sharp.field` b_n come from f; above them the straight crack gives b_n = -s_n/(n+1),
with s_n the Chebyshev moments of S_full over the gap. With p = 2p̄/E* the elastic energy of one
period is

    U = (E*/(2 q0²)) · ½ [∫ S_full h~ dθ + ∫_gaps S_full T dθ - 2π q0 s p],      h~ = q0 h,

which follows from Betti's theorem; the first term is the energy of full contact.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.fft import dst, next_fast_len

from solver.compiled import compiled
from solver.profile import Array
from solver.sharp.coordinate import (
    ALPHA,
    LEFT,
    LEFT_PATCH,
    RIGHT,
    RIGHT_PATCH,
    one_minus_plus,
    theta_at,
)
from solver.sharp.field import RULES, GapField, Kinds, Rules
from solver.sharp.source import interpolate

ENERGY_NODES = 3.0  # sine nodes per shortest wave: two resolve it, the rest is margin
SHAPE_NODES = 6.0  # nodes per shortest wave that bracket every local minimum of the opening
_LEAST = 64
_MANY_NODES = 500

_ANEW = 64  # rotations of a cosine before it is computed anew
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


@dataclass(frozen=True)
class Sines:
    """Some gaps of a field at their fine sine nodes, equally many in each; θ falls along a row.

    Attributes
    ----------
    gaps : int array, shape (G,)
        Which they are.
    theta, span : array, shape (G, nodes)
        Nodes, and dθ/dt there.
    modes : array, shape (G, nodes)
        s_n of every mode that the nodes carry.
    """

    gaps: Kinds
    theta: Array
    span: Array
    modes: Array


@compiled
def _fewest_nodes(table: Array, top: int, per_wave: float) -> Kinds:
    """Numbers of sine nodes so close that the shortest wave holds ``per_wave`` of them."""
    out = np.empty(table.shape[0], dtype=np.int64)
    for k in range(table.shape[0]):
        widest = 0.0
        for i in range(1, 24):
            t = np.pi * i / 24
            widest = max(widest, theta_at(table[k], np.cos(t))[1] * np.sin(t))
        out[k] = int(np.ceil(0.5 * per_wave * widest * top)) + _LEAST
    return out


@compiled
def _sizes(fewest: Kinds) -> Kinds:
    """Numbers of nodes, no fewer, for which the transform is fast and which many gaps share.

    That is so where one more than the number of nodes has small factors.
    """
    out = np.empty(fewest.shape[0], dtype=np.int64)
    for k in range(fewest.shape[0]):
        wanted = fewest[k] + 1
        eighth = 1
        while 16 * eighth <= wanted:
            eighth *= 2
        # wide gaps are few, and it is their nodes that cost
        steps = (9, 10, 12, 15, 16) if fewest[k] > _MANY_NODES else (12, 12, 12, 16, 16)
        for step in steps:
            out[k] = step * eighth - 1
            if out[k] >= fewest[k]:
                break
    return out


@compiled
def _fine_nodes(table: Array, count: int) -> tuple[Array, Array]:
    """``count`` sine nodes of each gap: θ, falling, and dθ/dt, shape (gaps, count).

    As :func:`theta_at`, many at a time: cosines by rotation, computed anew every so many nodes, and
    exp(y) - 1 from a table.
    """
    theta = np.empty((table.shape[0], count))
    span = np.empty((table.shape[0], count))
    turn = np.pi / (count + 1)
    turned = np.cos(turn), np.sin(turn)
    for k in range(table.shape[0]):
        left, right = table[k, LEFT], table[k, RIGHT]
        alpha = 2 * table[k, ALPHA]
        c = 0.0
        s = 0.0
        for i in range(count):
            if i % _ANEW == 0:
                c = np.cos(turn * (i + 1))
                s = np.sin(turn * (i + 1))
            from_left = c < 0
            own = table[k, LEFT_PATCH] if from_left else table[k, RIGHT_PATCH]
            other = table[k, RIGHT_PATCH] if from_left else table[k, LEFT_PATCH]
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
            span[k, i] = alpha * (own + r) * (far - r) / (own + far) * s
            theta[k, i] = left + r if from_left else right - r
            c, s = c * turned[0] - s * turned[1], s * turned[0] + c * turned[1]
    return theta, span


@compiled
def _sampled(theta: Array, span: Array, width: float, stress: Array) -> Array:
    """S dθ/dt at nodes."""
    out = np.empty(theta.shape)
    for k in range(theta.shape[0]):
        values = interpolate(theta[k], width, stress)
        for i in range(theta.shape[1]):
            out[k, i] = values[i] * span[k, i]
    return out


def sines(field: GapField, per_wave: float, gaps: Kinds | None = None) -> Iterator[Sines]:
    """The fine nodes of gaps (all by default), those of equally many together."""
    source, table = field.source, field.solution.table
    gaps = np.arange(len(table)) if gaps is None else gaps
    sizes = _sizes(_fewest_nodes(table[gaps], source.top, per_wave))
    for size in sorted(set(sizes.tolist())):
        some = gaps[sizes == size]
        theta, span = _fine_nodes(table[some], size)
        load = _sampled(theta, span, source.panels.width, source.panels.stress)
        yield Sines(some, theta, span, dst(load, type=1) / (size + 1))


@compiled
def _high_work(gaps: Kinds, modes: Array, kinds: Kinds, counts: Kinds) -> float:
    """Σ s_n²/(n+1) over the modes of gaps above those of f."""
    total = 0.0
    for i in range(gaps.shape[0]):
        for n in range(counts[kinds[gaps[i]]], modes.shape[1]):
            total += modes[i, n] * modes[i, n] / (n + 1)
    return total


def work_of_gaps(field: GapField) -> float:
    """∫_gaps S_full T dθ."""
    of = field.solution
    total = float(of.rhs[:, 0] @ of.f)
    for part in sines(field, ENERGY_NODES):
        total -= np.pi / 2 * _high_work(part.gaps, part.modes, of.kinds, RULES.counts)
    return total


@compiled
def _modes_of(
    gaps: Kinds, modes: Array, kinds: Kinds, offset: Kinds, f: Array, rules: Rules
) -> Array:
    """b_n of gaps from their s_n and from f."""
    out = np.empty(modes.shape)
    for i in range(gaps.shape[0]):
        kind = kinds[gaps[i]]
        m = rules.counts[kind]
        for n in range(m, modes.shape[1]):
            out[i, n] = -modes[i, n] / (n + 1)
        for n in range(m):
            total = 0.0
            for j in range(m):
                w = rules.w[rules.start[kind] + j]
                total += w * f[offset[gaps[i]] + j] * rules.modes[rules.square[kind] + j * m + n]
            out[i, n] = 2 / np.pi * total
    return out


def opened(field: GapField, part: Sines) -> tuple[Array, Array]:
    """Openings T of gaps at their fine nodes, and their b_n, both of shape (G, nodes)."""
    of = field.solution
    modes = _modes_of(part.gaps, part.modes, of.kinds, of.offset, of.f, RULES)
    return dst(modes, type=1) / 2, modes


def fine_opening(field: GapField, k: int, per_wave: float = SHAPE_NODES) -> Opening:
    """Opening T of gap k at fine nodes."""
    (part,) = sines(field, per_wave, np.array([k]))
    opening, modes = opened(field, part)
    count = part.theta.shape[1]
    weight = part.span[0] * np.pi / (count + 1)
    return Opening(part.theta[0, ::-1], opening[0, ::-1], weight[::-1], modes[0])


def finer_opening(gap: Array, modes: Array, factor: int) -> tuple[Array, Array]:
    """θ, increasing, and T at about ``factor`` times as many sine nodes as there are modes b_n."""
    count = next_fast_len(factor * (len(modes) + 1), real=True) - 1
    more = np.zeros(count)
    more[: len(modes)] = modes
    return _fine_nodes(gap[None], count)[0][0, ::-1], dst(more, type=1)[::-1] / 2


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
