"""Compute the probability density of the gap and the spectral density of one state.

Beside an edge of contact the gap opens like the square root of the distance r: by Griffith's
K = sqrt(2E*γ'), γ' = γ sqrt(1 + h'²), t = (4K/E*) sqrt(r/(2π)) = 4 sqrt(γ' r/(πE*)). Nodes of a
grid do not resolve it, nor most narrow gaps. The density is therefore computed from the opening of
every gap from edge to edge, which methods return (:class:`~adhesis.solver.method.Opening`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adhesis.solver.method import Fields, Opening
from adhesis.solver.model.profile import Array

# Number of nodes beside an edge where the opening is refined, and of points between two of them.
_NEAR, _POINTS = 4, 16


def gap_shares(openings: Sequence[Opening], period: float, bins: Array) -> Array:
    """Compute the share of the period on which the gap lies in each bin.

    In a gap (l, r) the position is x = (l + r)/2 - (r - l)/2 cos φ. Between the points of an
    opening t is linear in φ, an exact square root of the distance beside both edges.

    ``openings`` has one for each gap, ``bins`` n + 1 ascending gaps in m; gaps outside count in the
    outermost of the n bins. The sum is the share of the period that is out of contact.
    """
    total = np.zeros(bins.size - 1)
    for opening in openings:
        total += _widths(opening, bins)
    return total / period


def _widths(opening: Opening, bins: Array) -> Array:
    """Compute the length in m on which one opening lies in each bin."""
    left, width = opening.x[0], opening.x[-1] - opening.x[0]
    # φ is computed from the nearer end, to avoid cancellation.
    near = np.sqrt((opening.x - left) / width)
    far = np.sqrt((opening.x[-1] - opening.x) / width)
    phi = 2 * np.where(near < far, np.arcsin(near), np.arccos(far))
    low, high = opening.gap[:-1], opening.gap[1:]
    inner = bins[1:-1]
    first = np.searchsorted(inner, np.minimum(low, high), side="right")
    last = np.searchsorted(inner, np.maximum(low, high), side="left")
    # Each interval is cut into one piece per bin, where t crosses the bin's bounds.
    pieces = np.maximum(last - first, 0) + 1  # one of a constant gap on a bound
    interval = np.repeat(np.arange(low.size), pieces)
    offset = np.arange(interval.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    number = np.repeat(first, pieces) + offset
    bounds = np.concatenate([[-np.inf], inner, [np.inf]])
    bottom, top = np.minimum(low, high)[interval], np.maximum(low, high)[interval]
    rise = np.where(top > bottom, top - bottom, 1.0)
    begin = (np.maximum(bounds[number], bottom) - bottom) / rise
    end = (np.minimum(bounds[number + 1], top) - bottom) / rise
    end = np.where(top > bottom, end, 1.0)
    rising = (high >= low)[interval]
    step = np.diff(phi)[interval]
    one = phi[:-1][interval] + step * np.where(rising, begin, 1 - end)
    two = phi[:-1][interval] + step * np.where(rising, end, 1 - begin)
    length = width * np.sin((one + two) / 2) * np.sin((two - one) / 2)
    return np.asarray(np.bincount(number, length, minlength=bins.size - 1), dtype=np.float64)


def openings_between(
    edges: Array, fields: Fields, coefficient: Array, period: float
) -> list[Opening]:
    """Interpolate the openings of the gaps between contact edges from equally spaced nodes.

    The interpolant (monotone cubic) is that of t/sqrt((x - l)(r - x)), which is smooth across a gap
    (l, r) and known at both edges: ``coefficient`` is t/sqrt(r) at each edge in sqrt(m).
    """
    # imported here: it takes half of the start-up time of commands that compute nothing
    from scipy.interpolate import PchipInterpolator

    out = []
    for k, (_, left) in enumerate(edges):
        after = (k + 1) % len(edges)
        right = edges[after, 0] + (period if after == 0 else 0.0)
        first = left + (fields.x - left) % period
        order = np.argsort(first)
        x, t = first[order], fields.gap[order]
        # A node within rounding of an edge adds no information.
        inside = (x > left + 1e-9 * period) & (x < right - 1e-9 * period) & (t > 0)
        x, t = x[inside], t[inside]
        width = right - left
        shape = t / np.sqrt((x - left) * (right - x)) * np.sqrt(width)
        shape = np.concatenate([coefficient[k, 1:], shape, coefficient[after, :1]])
        x = np.concatenate([[left], x, [right]])
        smooth = PchipInterpolator(x, shape)
        intervals = x.size - 1
        beside = np.minimum(np.arange(intervals), np.arange(intervals)[::-1]) < _NEAR
        share = np.sin(0.5 * np.pi * np.arange(_POINTS) / _POINTS) ** 2  # dense towards both ends
        fine = [
            x[i] + (x[i + 1] - x[i]) * share if beside[i] else x[i : i + 1]
            for i in range(intervals)
        ]
        points = np.concatenate([*fine, [right]])
        root = np.sqrt((points - left) * (right - points) / width)
        out.append(Opening(points, smooth(points) * root))
    return out


def spectral_density(values: Array, period: float) -> Array:
    """Compute the two-sided spectral density C(m q0) = |v_m|²/q0 of the harmonics m = 0 … n/2.

    In u² m for n values v at equally spaced nodes, in any unit u; ∫ C dq over positive and negative
    q is the mean square.
    """
    return np.asarray(np.abs(np.fft.rfft(values) / values.size) ** 2 * (period / (2 * np.pi)))
