"""The full-contact stress as a source for gaps: compressed panels, and its moments over a gap.

Method ``sharp`` sees the rough profile only through the full-contact stress S(θ) = 2σ_full/E*,
θ = q0 x. In the coordinate η of a gap (:mod:`solver.sharp_map`; the ends are η = ∓1) it needs

    s_n  = (2/π) ∫ S U_n(η) sqrt(1 - η²) dθ,        n = 0 … M-1   (second-kind Chebyshev moments)
    s^±  = (1/π) ∫ S sqrt((1 ± η)/(1 ∓ η)) dθ = Σ_n (±1)^n s_n    (what drives each end)

The weights are smooth away from the ends of the gap, S is not. So S is compressed once, on a binary
tree of panels: on each panel ∫ S f ≈ Σ_i ω_i f(x_i) at the p Gauss-Legendre nodes, exact when f is
a polynomial of degree below p. A gap is tiled with panels no longer than their distance from its
ends; the cost of a moment grows with log(gap/λ_min), not with the number of wave numbers. The two
end pieces, with their square-root weight, are integrated with S interpolated on the finest panels.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev, legendre
from numpy.typing import NDArray

from solver.compiled import compiled
from solver.profile import Array, Profile
from solver.sharp_map import LEFT, LEFT_PATCH, RIGHT, RIGHT_PATCH, one_minus_plus, theta_at

NODES = 14
"""Nodes p of a panel. The finest is at most half a shortest wave long, where interpolation with
p = 14 leaves 1e-12; a panel as long as its distance from a singularity leaves 5.8^-14 = 2e-11."""

_END_NODES = 24  # Gauss-Legendre nodes of an end piece (at most one shortest wave, in sqrt scale)
_SHORT_GAP = 4  # gaps shorter than so many finest panels are integrated directly …
_SHORT_NODES = 48  # … with so many Gauss-Chebyshev nodes
_PHASE = 3.0  # radians of the highest Chebyshev mode that one panel may span


class StressSource:
    """Full-contact stress S = 2σ_full/E* and its derivative on a tree of panels over [0, 2π).

    Parameters
    ----------
    profile : Profile

    Attributes
    ----------
    panels : int
        Number of finest panels; the shortest wave covers at least two.
    coefficients : array, shape (panels, NODES, 2)
        Chebyshev coefficients of (S, S') on each finest panel.
    measure : array, shape (panels, NODES)
        Chebyshev coefficients of sqrt(1 + h'²).
    measure_before : array, shape (panels + 1,)
        ∫ sqrt(1 + h'²) dθ from 0 to the start of each finest panel.
    weights : array, shape (2·panels, NODES, 2)
        ω of every panel of every level, the finest level first.
    level_start : int array
        Row of ``weights`` at which each level starts.
    """

    def __init__(self, profile: Profile) -> None:
        self.top = top = profile.highest_harmonic
        self.panels = 1 << int(np.ceil(np.log2(max(2 * top + 1, 16))))
        self.width = 2 * np.pi / self.panels
        x, w = legendre.leggauss(NODES)
        self.x, self.w = x, w
        m = np.arange(profile.coefficients.size)
        h = profile.coefficients * profile.q0
        self.m2 = profile.m2
        self.sharpest = float(np.abs(profile.curvatures(8 * top)).max()) / profile.q0
        stress = self._on_panels(m * h)  # symbol |q| of the half-space
        slope = self._on_panels(1j * m * m * h)
        measure = np.sqrt(1 + self._on_panels(1j * m * h) ** 2)

        to_chebyshev = np.linalg.inv(chebyshev.chebvander(x, NODES - 1))
        values = np.stack([stress, slope], axis=-1)
        self.coefficients = np.ascontiguousarray(np.einsum("ij,kjf->kif", to_chebyshev, values))
        self.measure = np.ascontiguousarray(measure @ to_chebyshev.T)
        self._primitive = chebyshev.chebint(np.eye(NODES), lbnd=-1, axis=0)
        panel_measure = (measure @ w) * self.width / 2
        self.measure_before = np.concatenate([[0.0], np.cumsum(panel_measure)])

        # ω of the finest level, then each parent from its two children: exact for polynomials.
        to_left, to_right = (_lagrange(x, (x + side) / 2) for side in (-1.0, 1.0))
        level = values * (w * self.width / 2)[None, :, None]
        levels = [level]
        while len(level) > 1:
            level = np.einsum("ji,kjf->kif", to_left, level[0::2]) + np.einsum(
                "ji,kjf->kif", to_right, level[1::2]
            )
            levels.append(level)
        self.weights = np.ascontiguousarray(np.concatenate(levels))
        self.level_start = np.cumsum([0] + [len(k) for k in levels[:-1]])

        t, v = legendre.leggauss(_END_NODES)
        self.end_x, self.end_w = (t + 1) / 2, v / 2

    def _on_panels(self, a: NDArray[np.complex128]) -> Array:
        """Values of Σ a_m e^{imθ} at the nodes of the finest panels, shape (panels, NODES)."""
        m = np.arange(a.size)
        out = np.empty((self.panels, NODES))
        for i, x in enumerate(self.x):
            shifted = np.zeros(self.panels // 2 + 1, dtype=np.complex128)
            size = min(a.size, shifted.size)
            shifted[:size] = (a * np.exp(1j * m * self.width * (x + 1) / 2))[:size]
            out[:, i] = np.fft.irfft(shifted, self.panels) * self.panels
        return out

    def sample(self, theta: Array) -> Array:
        """(S, S') at any angles, shape (len(theta), 2)."""
        values: Array = interpolate(
            np.ascontiguousarray(theta), self.width, self.panels, self.coefficients
        )
        return values

    def measure_at(self, theta: Array) -> tuple[Array, Array]:
        """sqrt(1 + h'²) and its derivative in θ at any angles."""
        value, slope = measure_at(
            np.ascontiguousarray(theta), self.width, self.panels, self.measure
        )
        return value, slope

    def measure_between(self, left: Array, right: Array) -> float:
        """Sum over the intervals of ∫ sqrt(1 + h'²) dθ from ``left`` to ``right``."""
        return float((self._measure_to(right) - self._measure_to(left)).sum())

    def _measure_to(self, theta: Array) -> Array:
        turns, rest = np.divmod(theta, 2 * np.pi)
        k = np.minimum((rest / self.width).astype(int), self.panels - 1)
        x = np.clip(2 * (rest / self.width - k) - 1, -1, 1)
        basis = np.cos(np.multiply.outer(np.arccos(x), np.arange(NODES + 1)))
        part = np.sum(basis * (self.measure[k] @ self._primitive.T), axis=1) * self.width / 2
        return np.asarray(turns * self.measure_before[-1] + self.measure_before[k] + part)


def _lagrange(nodes: Array, x: Array) -> Array:
    """Lagrange polynomials of ``nodes`` at ``x``, shape (len(x), len(nodes))."""
    degree = len(nodes) - 1
    return np.asarray(
        legendre.legvander(x, degree) @ np.linalg.inv(legendre.legvander(nodes, degree))
    )


@compiled
def _clenshaw(coefficients, x):  # type: ignore[no-untyped-def]  # compiled
    b1 = 0.0
    b2 = 0.0
    for j in range(coefficients.shape[0] - 1, 0, -1):
        b1, b2 = 2 * x * b1 - b2 + coefficients[j], b1
    return x * b1 - b2 + coefficients[0]


@compiled
def interpolate(theta, width, panels, coefficients):  # type: ignore[no-untyped-def]  # compiled
    """(S, S') at each angle, shape (len(theta), 2)."""
    out = np.empty((theta.shape[0], 2))
    for i in range(theta.shape[0]):
        place = theta[i] / width
        k = int(np.floor(place))
        x = 2 * (place - k) - 1
        k %= panels
        out[i, 0] = _clenshaw(coefficients[k, :, 0], x)
        out[i, 1] = _clenshaw(coefficients[k, :, 1], x)
    return out


@compiled
def measure_at(theta, width, panels, measure):  # type: ignore[no-untyped-def]  # compiled
    """Value and θ-derivative of sqrt(1 + h'²) at each angle."""
    value = np.empty(theta.shape[0])
    slope = np.empty(theta.shape[0])
    for i in range(theta.shape[0]):
        place = theta[i] / width
        k = int(np.floor(place))
        x = 2 * (place - k) - 1
        k %= panels
        value[i] = _clenshaw(measure[k], x)
        # d/dx of Σ c_j T_j = Σ j c_j U_{j-1}
        u_prev = 0.0
        u = 1.0
        total = 0.0
        for j in range(1, measure.shape[1]):
            total += j * measure[k, j] * u
            u, u_prev = 2 * x * u - u_prev, u
        slope[i] = total * 2 / width
    return value, slope


@compiled
def _add(one_minus, one_plus, weight0, weight1, s, ends):  # type: ignore[no-untyped-def]
    """Add one source of strength ∫S dθ at η, given by 1 - η and 1 + η, to the moments."""
    root = np.sqrt(one_minus * one_plus)
    twice = 2 * (one_plus - 1 if one_plus < one_minus else 1 - one_minus)
    # sin((n+1)t) with cos t = η: U_n sqrt(1-η²), by recurrence.
    a0 = weight0 * 2 / np.pi
    previous = 0.0
    current = root
    low = one_minus / (root * np.pi)
    high = one_plus / (root * np.pi)
    ends[0, 0] += weight0 * low
    ends[1, 0] += weight0 * high
    if s.shape[1] == 1:
        for n in range(s.shape[0]):
            s[n, 0] += a0 * current
            current, previous = twice * current - previous, current
        return
    a1 = weight1 * 2 / np.pi
    for n in range(s.shape[0]):
        s[n, 0] += a0 * current
        s[n, 1] += a1 * current
        current, previous = twice * current - previous, current
    ends[0, 1] += weight1 * low
    ends[1, 1] += weight1 * high


@compiled
def _value(coefficients, place, panels, both):  # type: ignore[no-untyped-def]  # compiled
    """S and, if wanted, S' (else 0) at θ = place · panel width."""
    k = int(np.floor(place))
    x = 2 * (place - k) - 1
    k %= panels
    second = _clenshaw(coefficients[k, :, 1], x) if both else 0.0
    return _clenshaw(coefficients[k, :, 0], x), second


@compiled
def _end_piece(  # type: ignore[no-untyped-def]  # compiled
    gap, side, length, width, panels, node_x, node_w, coefficients, end_x, end_w, s, ends
):
    """Integrate from the end of a gap inwards, in cells graded to the patch beyond that end."""
    beyond = gap[LEFT_PATCH] if side == 0 else gap[RIGHT_PATCH]
    cell = min(length, beyond)
    for i in range(end_x.shape[0]):
        y = end_x[i]
        r = y * y * cell  # distance from the end; the square root becomes smooth in y
        theta = gap[LEFT] + r if side == 0 else gap[RIGHT] - r
        v0, v1 = _value(coefficients, theta / width, panels, s.shape[1] > 1)
        weight = 2 * y * end_w[i] * cell
        minus, plus = one_minus_plus(gap, r, side)
        _add(minus, plus, weight * v0, weight * v1, s, ends)
    at = cell
    while at < length:
        stop = min(2 * at, length)
        if length - stop < 0.25 * at:
            stop = length
        for i in range(node_x.shape[0]):
            r = at + (stop - at) * (node_x[i] + 1) / 2
            theta = gap[LEFT] + r if side == 0 else gap[RIGHT] - r
            v0, v1 = _value(coefficients, theta / width, panels, s.shape[1] > 1)
            weight = node_w[i] * (stop - at) / 2
            minus, plus = one_minus_plus(gap, r, side)
            _add(minus, plus, weight * v0, weight * v1, s, ends)
        at = stop


@compiled
def gap_moments(  # type: ignore[no-untyped-def]  # compiled
    gap, width, panels, node_x, node_w, coefficients, weights, level_start, end_x, end_w, s, ends
):
    """Moments of (S, S') over a gap, added to ``s``, shape (modes, 2), and ``ends``, (2, 2).

    With ``s`` of shape (modes, 1) those of S alone.

    ``gap`` is a row of :func:`solver.sharp_map.map_gaps`.
    """
    left = gap[LEFT]
    right = gap[RIGHT]
    modes = s.shape[0]
    if right - left <= _SHORT_GAP * width:
        # Gauss-Chebyshev nodes of the first kind in η serve s_n and s^± alike.
        count = max(_SHORT_NODES, 2 * modes)
        for i in range(count):
            t = (i + 0.5) * np.pi / count
            theta, stretch = theta_at(gap, np.cos(t))
            v0, v1 = _value(coefficients, theta / width, panels, s.shape[1] > 1)
            weight = np.pi / count * np.sin(t) * stretch
            _add(
                2 * np.sin(t / 2) ** 2,
                2 * np.cos(t / 2) ** 2,
                weight * v0,
                weight * v1,
                s,
                ends,
            )
        return
    first = int(np.floor(left / width)) + 2  # an end piece is one to two finest panels long
    last = int(np.ceil(right / width)) - 2
    for side in range(2):
        length = first * width - left if side == 0 else right - last * width
        _end_piece(
            gap, side, length, width, panels, node_x, node_w, coefficients, end_x, end_w, s, ends
        )
    at = first
    while at < last:
        level = 0
        size = 1
        while level + 1 < level_start.shape[0]:
            twice = 2 * size
            if at % twice != 0 or at + twice > last:
                break
            start = at * width - left
            stop = right - (at + twice) * width
            if start < twice * width or stop < twice * width:
                break
            # the highest mode turns by modes·Δη/sqrt(1-η²) over the panel
            a_minus, a_plus = one_minus_plus(gap, start, 0)
            b_minus, b_plus = one_minus_plus(gap, stop, 1)
            nearest = min(a_minus * a_plus, b_minus * b_plus)
            if modes * (b_plus - a_plus) > _PHASE * np.sqrt(nearest):
                break
            level += 1
            size = twice
        row = level_start[level] + (at >> level) % (panels >> level)
        for i in range(node_x.shape[0]):
            theta = (at + size * (node_x[i] + 1) / 2) * width
            if theta - left < right - theta:
                minus, plus = one_minus_plus(gap, theta - left, 0)
            else:
                minus, plus = one_minus_plus(gap, right - theta, 1)
            _add(minus, plus, weights[row, i, 0], weights[row, i, 1], s, ends)
        at += size
