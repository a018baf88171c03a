"""What is computed from the fields of one state: density of the gap, spectral density.

Beside an edge of contact the gap opens like the square root of the distance r: by Griffith's
K = sqrt(2E*γ'), γ' = γ sqrt(1 + h'²), t = (4K/E*) sqrt(r/(2π)) = 4 sqrt(γ' r/(πE*)). Nodes of a
grid miss it, and with it most of what is narrow. A method hands out the opening of every gap from
edge to edge (:class:`~adhesis.solver.method.Opening`); here the shares of the period are taken from
it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adhesis.solver.method import Fields, Opening
from adhesis.solver.model.profile import Array

# Nodes beside an edge between which the opening is refined, and the points put between two of them.
_NEAR, _POINTS = 4, 16


def gap_shares(openings: Sequence[Opening], period: float, bins: Array) -> Array:
    """Share of the period in which the gap lies in each bin.

    In a gap (l, r) the place is x = (l + r)/2 - (r - l)/2 cos φ. Between the points of an opening t
    is taken as linear in φ, so that it is an exact square root of the distance beside both edges.

    Parameters
    ----------
    openings : sequence of Opening
        One for each gap.
    period : float
        λ in m.
    bins : array, shape (n + 1,)
        Ascending gaps in m. What lies outside counts in the outermost bins.

    Returns
    -------
    array, shape (n,)
        They add up to the share of the period that is out of contact.
    """
    total = np.zeros(bins.size - 1)
    for opening in openings:
        total += _widths(opening, bins)
    return total / period


def _widths(opening: Opening, bins: Array) -> Array:
    """Length in m on which one opening lies in each bin."""
    left, width = opening.x[0], opening.x[-1] - opening.x[0]
    # The nearer end measures φ, so that no digit is lost beside either.
    near = np.sqrt(np.clip((opening.x - left) / width, 0, 1))
    far = np.sqrt(np.clip((opening.x[-1] - opening.x) / width, 0, 1))
    phi = 2 * np.where(near < far, np.arcsin(near), np.arccos(far))
    low, high = opening.gap[:-1], opening.gap[1:]
    inner = bins[1:-1]
    first = np.searchsorted(inner, np.minimum(low, high), side="right")
    last = np.searchsorted(inner, np.maximum(low, high), side="left")
    # One piece for every bin that an interval reaches into, cut where t crosses its bounds.
    pieces = last - first + 1
    interval = np.repeat(np.arange(low.size), pieces)
    place = np.arange(interval.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    number = np.repeat(first, pieces) + place
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
    """Openings of the gaps between contact edges, from values at equally spaced nodes.

    t over sqrt((x - l)(r - x)) is smooth across a gap (l, r) and known at both edges: it is
    interpolated between nodes and edges (monotone cubic), t is that times the root.

    Parameters
    ----------
    edges : array, shape (patches, 2)
        As in :class:`~adhesis.solver.method.ContactState`.
    fields : Fields
    coefficient : array, shape (patches, 2)
        t/sqrt(r) at each edge in sqrt(m).
    period : float
        λ in m.
    """
    out = []
    for k, (_, left) in enumerate(edges):
        after = (k + 1) % len(edges)
        right = edges[after, 0] + (period if after == 0 else 0.0)
        out.append(
            _opening(left, right, (coefficient[k, 1], coefficient[after, 0]), fields, period)
        )
    return out


def _opening(
    left: float, right: float, ends: tuple[float, float], fields: Fields, period: float
) -> Opening:
    first = left + (fields.x - left) % period
    order = np.argsort(first)
    x, t = first[order], fields.gap[order]
    # A node within rounding of an edge says nothing that the edge does not.
    inside = (x > left + 1e-9 * period) & (x < right - 1e-9 * period) & (t > 0)
    x, t = x[inside], t[inside]
    width = right - left
    shape = np.concatenate(
        [[ends[0]], t / np.sqrt((x - left) * (right - x)) * np.sqrt(width), [ends[1]]]
    )
    x = np.concatenate([[left], x, [right]])
    # here: half of the time in which commands that compute nothing start
    from scipy.interpolate import PchipInterpolator

    smooth = PchipInterpolator(x, shape)
    intervals = x.size - 1
    beside = np.minimum(np.arange(intervals), np.arange(intervals)[::-1]) < _NEAR
    share = np.sin(0.5 * np.pi * np.arange(_POINTS) / _POINTS) ** 2  # dense towards both ends
    fine = [
        x[i] + (x[i + 1] - x[i]) * share if beside[i] else x[i : i + 1] for i in range(intervals)
    ]
    points = np.concatenate([*fine, [right]])
    root = np.sqrt(np.maximum(points - left, 0) * np.maximum(right - points, 0) / width)
    return Opening(points, smooth(points) * root)


def spectral_density(values: Array, period: float) -> Array:
    """Two-sided spectral density C(m q0) = |v_m|²/q0 on the harmonics m = 0 … n/2.

    Parameters
    ----------
    values : array, shape (n,)
        v at equally spaced nodes of the period, with any unit u.
    period : float
        λ in m.

    Returns
    -------
    array, shape (n // 2 + 1,)
        In u² m; ∫ C dq over all q, positive and negative, is the mean square.
    """
    return np.asarray(np.abs(np.fft.rfft(values) / values.size) ** 2 * (period / (2 * np.pi)))
