"""Compress the full-contact stress, the source for gaps, on a tree of panels.

Method ``sharp`` sees the rough profile only through the full-contact stress S(θ) = 2σ_full/E*,
θ = q0 x. It is smooth on the scale of a shortest wave only, while its weights in an integral are
smooth away from the ends of a gap. So S is compressed once, on a binary tree of panels: on each
panel ∫ S f ≈ Σ_i ω_i f(x_i) at the p Gauss-Legendre nodes, exact when f is a polynomial of degree
below p. Its moments over a gap: ``chebyshev_moments``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev, legendre
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array, Profile
from adhesis.solver.runtime.jit import compiled, compiled_for_both, compiled_sums

# Nodes p of a panel, by the tolerance they serve. The finest panel is at most half a shortest wave
# long: interpolation there leaves (π/2)^p/(p! 2^(p-1)) of the shortest wave's amplitude. A panel as
# long as its distance from a singularity leaves 5.8^-p.
_NODES = ((1e-5, 8), (1e-7, 10), (2e-9, 12), (0.0, 14))

# Nodes of h' on a finest panel: interpolation leaves 2e-10 of the shortest wave's slope. The
# length sqrt(1 + h'²) follows from h'; a series of its own would converge the more slowly the
# steeper the profile. Its integral is taken by the rule of as many nodes over pieces of a panel.
_TILT_NODES = 12
_PIECES_BY_SLOPE = 4.0

# Nodes of the opening of a half-plane crack on a finest panel: 7e-6 of the shortest wave's.
_HALF_PLANE_NODES = 8


class Panels(NamedTuple):
    """Panels of a source, for the compiled code; p nodes a panel.

    Attributes
    ----------
    width : float
        Length of a finest panel in θ.
    finest_count : int
        Number of finest panels; the shortest wave covers at least two.
    x, w : array, shape (p,)
        Gauss-Legendre rule of a panel.
    stress, slope : array, shape (finest_count, p)
        Chebyshev coefficients of S and S' on each finest panel.
    tilt : array, shape (finest_count, 12)
        Those of h'.
    half_plane : array, shape (2, finest_count, 8)
        Those of the opening C of a half-plane crack that begins at θ, and of one that ends there.
    weights : array, shape (2, 2·finest_count, p)
        ω for S and for S', of every panel of every level, the finest level first.
    level_start : int array
        Row of ``weights`` at which each level starts.
    end_x, end_w : array
        Gauss-Legendre rule on (0, 1) of an end piece (at most one shortest wave, in sqrt scale).
    short : array, shape (4, 3 p + 6)
        Rule of a short gap, see :func:`short_gap_rule`.
    """

    width: float
    finest_count: int
    x: Array
    w: Array
    stress: Array
    slope: Array
    tilt: Array
    half_plane: Array
    weights: Array
    level_start: NDArray[np.int64]
    end_x: Array
    end_w: Array
    short: Array


@compiled_for_both
def short_gap_rule(count: int) -> Array:
    """Make Gauss-Chebyshev nodes η = cos t: rows 1 - η and 1 + η, to rounding, η, and sin t."""
    rule = np.empty((4, count))
    for i in range(count):
        t = (i + 0.5) * np.pi / count
        rule[0, i], rule[1, i] = 2 * np.sin(t / 2) ** 2, 2 * np.cos(t / 2) ** 2
        rule[2, i], rule[3, i] = np.cos(t), np.sin(t)
    return rule


class StressSource:
    """Full-contact stress S = 2σ_full/E* and its derivative on a tree of panels over [0, 2π).

    Parameters
    ----------
    profile : Profile
    tolerance : float
        Wanted accuracy of moments and values, relative to the stress of the shortest waves.

    Attributes
    ----------
    top : int
        Highest harmonic.
    m2 : float
        Mean square slope.
    sharpest : float
        Largest |h''|, in units of q0.
    highest : float
        θ of the highest crest.
    panels : Panels
    """

    def __init__(self, profile: Profile, tolerance: float = 0.0) -> None:
        self.top = top = profile.highest_harmonic
        p = next(nodes for limit, nodes in _NODES if tolerance >= limit)
        count = 1 << int(np.ceil(np.log2(max(2 * top + 1, 16))))
        width = 2 * np.pi / count
        x, w = legendre.leggauss(p)
        m = np.arange(profile.coefficients.size)
        h = profile.coefficients * profile.q0
        self.m2 = profile.m2
        self.highest = profile.highest_point[0] * profile.q0
        self.sharpest = float(np.abs(profile.curvatures(8 * top)).max()) / profile.q0
        stress = _on_panels(m * h, x, count)  # symbol |q| of the half-space
        slope = _on_panels(1j * m * m * h, x, count)
        y, v = legendre.leggauss(_TILT_NODES)
        tilt = _on_panels(1j * m * h, y, count) @ _to_chebyshev(y)
        t, _ = legendre.leggauss(_HALF_PLANE_NODES)
        half_plane = [a @ _to_chebyshev(t) for a in _half_plane_openings(m * h, t, count)]

        to_chebyshev = _to_chebyshev(x)
        steepest = float(np.abs(profile.slopes(8 * top)).max())
        pieces = int(np.ceil(1 + _PIECES_BY_SLOPE * steepest))
        # rule on a finest panel, composed of equal pieces; nodes and weights from 0 to 1
        start = np.arange(pieces)[:, None]
        self._piece_x = ((start + (y + 1) / 2) / pieces).ravel()
        self._piece_w = np.tile(v / (2 * pieces), pieces)
        # ∫ sqrt(1 + h'²) dθ from 0 to the start of each finest panel
        on_nodes = chebyshev.chebval(2 * self._piece_x - 1, tilt.T)
        whole = np.sqrt(1 + on_nodes**2) @ self._piece_w
        self._measure_before = np.concatenate([[0.0], np.cumsum(whole * width)])

        # ω of the finest level, then each parent from its two children: exact for polynomials.
        to_left, to_right = (_lagrange(x, (x + side) / 2) for side in (-1.0, 1.0))
        level = np.stack([stress, slope]) * (w * width / 2)
        levels = [level]
        while level.shape[1] > 1:
            level = level[:, 0::2] @ to_left + level[:, 1::2] @ to_right
            levels.append(level)
        sizes = [k.shape[1] for k in levels]
        t, end = legendre.leggauss(2 * p - 4)
        self.panels = Panels(
            width=width,
            finest_count=count,
            x=x,
            w=w,
            stress=np.ascontiguousarray(stress @ to_chebyshev),
            slope=np.ascontiguousarray(slope @ to_chebyshev),
            tilt=np.ascontiguousarray(tilt),
            half_plane=np.stack(half_plane),
            weights=np.ascontiguousarray(np.concatenate(levels, axis=1)),
            level_start=np.cumsum([0, *sizes[:-1]]),
            end_x=(t + 1) / 2,
            end_w=end / 2,
            short=short_gap_rule(3 * p + 6),
        )

    def sample(self, theta: Array) -> Array:
        """Evaluate (S, S') at any angles, shape (len(theta), 2)."""
        at = np.ascontiguousarray(theta)
        width, stress, slope = self.panels.width, self.panels.stress, self.panels.slope
        return np.stack([interpolate(at, width, stress), interpolate(at, width, slope)], axis=1)

    def contact_between(self, gaps: Array) -> tuple[Array, float]:
        """Return the patches between gaps, and the sum of ∫ sqrt(1 + h'²) dθ over them.

        Patches have shape (L, 2), by their left edges, which lie in [0, 2π).
        """
        from adhesis.solver.sharp import core, native

        if core.is_native:
            return native.contact_between(
                gaps, self._measure_before, self.panels, self._piece_x, self._piece_w
            )
        patches, measure = _contact_between(
            gaps, self._measure_before, self.panels.tilt, self._piece_x, self._piece_w
        )
        return patches, measure


def _to_chebyshev(nodes: Array) -> Array:
    """Make the matrix that turns rows of values at ``nodes`` into Chebyshev coefficients."""
    return np.asarray(np.linalg.inv(chebyshev.chebvander(nodes, len(nodes) - 1)).T)


def _on_panels(a: NDArray[np.complex128], x: Array, count: int) -> Array:
    """Evaluate Σ a_m e^{imθ} at the nodes of the finest panels, shape (count, len(x))."""
    m = np.arange(a.size)
    out = np.empty((count, x.size))
    for i, node in enumerate(x):
        shifted = np.zeros(count // 2 + 1, dtype=np.complex128)
        size = min(a.size, shifted.size)
        shifted[:size] = (a * np.exp(1j * m * (np.pi / count) * (node + 1)))[:size]
        out[:, i] = np.fft.irfft(shifted, count) * count
    return out


def _half_plane_openings(stress: NDArray[np.complex128], x: Array, count: int) -> list[Array]:
    """Evaluate the opening C of a half-plane crack that begins, and that ends, at panel nodes.

    A stress S on its faces opens the edge of a crack by C = -(2/π) ∫ S(ρ)/sqrt(ρ) dρ, ρ the
    distance from the edge: -2/sqrt(π m) times the wave m, an eighth of it later (Tada, Paris and
    Irwin, The Stress Analysis of Cracks Handbook, 3.6).
    """
    m = np.arange(stress.size)
    scaled = -2 / np.sqrt(np.pi) * stress / np.sqrt(np.maximum(m, 1))
    return [_on_panels(scaled * np.exp(side * 0.25j * np.pi), x, count) for side in (1, -1)]


def _lagrange(nodes: Array, x: Array) -> Array:
    """Evaluate the Lagrange polynomials of ``nodes`` at ``x``, shape (len(x), len(nodes))."""
    degree = len(nodes) - 1
    return np.asarray(
        legendre.legvander(x, degree) @ np.linalg.inv(legendre.legvander(nodes, degree))
    )


@compiled_sums
def _clenshaw(coefficients: Array, x: float) -> float:
    """Sum a Chebyshev series at ``x``."""
    b1 = 0.0
    b2 = 0.0
    twice = 2 * x
    for j in range(coefficients.shape[0] - 1, 0, -1):
        b1, b2 = twice * b1 + (coefficients[j] - b2), b1  # first the sum that need not wait for b1
    total: float = x * b1 - b2 + coefficients[0]
    return total


@compiled_sums
def _clenshaw_both(coefficients: Array, x: float) -> tuple[float, float]:
    """Sum a Chebyshev series at ``x``, and its derivative."""
    b1, b2, d1, d2 = 0.0, 0.0, 0.0, 0.0
    twice = 2 * x
    for j in range(coefficients.shape[0] - 1, 0, -1):
        d1, d2 = twice * d1 + (2 * b1 - d2), d1
        b1, b2 = twice * b1 + (coefficients[j] - b2), b1
    return x * b1 - b2 + coefficients[0], b1 + x * d1 - d2


@compiled_sums
def value_at(coefficients: Array, position: float) -> float:
    """Evaluate the piecewise series at θ = position · panel width."""
    k = int(np.floor(position))
    # the number of panels is a power of two
    return _clenshaw(coefficients[k & (coefficients.shape[0] - 1)], 2 * (position - k) - 1)


@compiled_sums
def interpolate(theta: Array, width: float, coefficients: Array) -> Array:
    """Evaluate a piecewise series at each angle, shape (len(theta),)."""
    count = theta.shape[0]
    out = np.empty(count)
    last = coefficients.shape[0] - 1
    beside = count - count % 4
    for i in range(0, beside, 4):  # four recurrences side by side: each waits for its last term
        position, position_2 = theta[i] / width, theta[i + 1] / width
        position_3, position_4 = theta[i + 2] / width, theta[i + 3] / width
        k, k_2 = np.floor(position), np.floor(position_2)
        k_3, k_4 = np.floor(position_3), np.floor(position_4)
        c, c_2 = coefficients[int(k) & last], coefficients[int(k_2) & last]
        c_3, c_4 = coefficients[int(k_3) & last], coefficients[int(k_4) & last]
        x, x_2 = 2 * (position - k) - 1, 2 * (position_2 - k_2) - 1
        x_3, x_4 = 2 * (position_3 - k_3) - 1, 2 * (position_4 - k_4) - 1
        a = b = a_2 = b_2 = a_3 = b_3 = a_4 = b_4 = 0.0
        for j in range(c.shape[0] - 1, 0, -1):
            a, b = 2 * x * a + (c[j] - b), a
            a_2, b_2 = 2 * x_2 * a_2 + (c_2[j] - b_2), a_2
            a_3, b_3 = 2 * x_3 * a_3 + (c_3[j] - b_3), a_3
            a_4, b_4 = 2 * x_4 * a_4 + (c_4[j] - b_4), a_4
        out[i] = x * a - b + c[0]
        out[i + 1] = x_2 * a_2 - b_2 + c_2[0]
        out[i + 2] = x_3 * a_3 - b_3 + c_3[0]
        out[i + 3] = x_4 * a_4 - b_4 + c_4[0]
    for i in range(beside, count):
        out[i] = value_at(coefficients, theta[i] / width)
    return out


@compiled_sums
def _evaluate_both(coefficients: Array, theta: float, width: float) -> tuple[float, float]:
    """Evaluate a piecewise series at one angle, and its derivative by the argument of the panel."""
    position = theta / width
    k = int(np.floor(position))
    return _clenshaw_both(coefficients[k & (coefficients.shape[0] - 1)], 2 * (position - k) - 1)


@compiled_sums
def measure_at(theta: float, panels: Panels) -> tuple[float, float]:
    """Evaluate sqrt(1 + h'²) and its θ-derivative at one angle."""
    tilt, rate = _evaluate_both(panels.tilt, theta, panels.width)
    measure = np.sqrt(1 + tilt * tilt)
    return measure, tilt / measure * rate * 2 / panels.width


@compiled_sums
def half_plane_opening(theta: float, side: int, panels: Panels) -> tuple[float, float]:
    """Evaluate C and dC/dθ of a half-plane crack that begins (side 0) or ends (1) at θ."""
    value, rate = _evaluate_both(panels.half_plane[side], theta, panels.width)
    return value, rate * 2 / panels.width


@compiled_for_both
def _lengths(panel: NDArray[np.int64], share: Array, tilt: Array, nodes: Array, w: Array) -> Array:
    """Integrate sqrt(1 + h'²) over the first ``share`` of each panel, in panel widths."""
    out = np.empty(panel.shape[0])
    for i in range(panel.shape[0]):
        total = 0.0
        for j in range(nodes.shape[0]):
            value = _clenshaw(tilt[panel[i]], 2 * share[i] * nodes[j] - 1)
            total += w[j] * np.sqrt(1 + value * value)
        out[i] = total * share[i]
    return out


@compiled
def _contact_between(
    gaps: Array, before: Array, tilt: Array, nodes: Array, w: Array
) -> tuple[Array, float]:
    """Measure as :meth:`StressSource.contact_between`; ``before`` is the measure before a panel."""
    count = tilt.shape[0]
    width = 2 * np.pi / count
    panel = np.empty(2, dtype=np.int64)
    share = np.empty(2)
    patches = np.empty_like(gaps)
    total = 0.0
    first = 0
    for i in range(gaps.shape[0]):
        patches[i, 0] = gaps[i - 1, 1] if i > 0 else gaps[-1, 1] - 2 * np.pi
        patches[i, 1] = gaps[i, 0]
        for end in range(2):
            theta = patches[i, end]
            turns = np.floor(theta / (2 * np.pi))
            position = (theta - turns * 2 * np.pi) / width
            panel[end] = min(max(int(position), 0), count - 1)
            share[end] = min(max(position - panel[end], 0.0), 1.0)
            total += (2 * end - 1) * (turns * before[count] + before[panel[end]])
        part = _lengths(panel, share, tilt, nodes, w)
        total += (part[1] - part[0]) * width
        patches[i] -= np.floor(patches[i, 0] / (2 * np.pi)) * 2 * np.pi
        if patches[i, 0] < patches[first, 0]:
            first = i
    return np.concatenate((patches[first:], patches[:first])), total
