"""Compress the full-contact stress, the source for gaps, on a tree of panels.

Method ``sharp`` sees the rough profile only through the full-contact stress S(θ) = 2σ_full/E*,
θ = q0 x. It is smooth on the scale of a shortest wave only, while its weights in an integral are
smooth away from the ends of a gap. So S is compressed once, on a binary tree of panels: on each
panel ∫ S f ≈ Σ_i ω_i f(x_i) at the p Gauss-Legendre nodes, exact when f is a polynomial of degree
below p. Its moments over a gap: ``kernels/gap_moments.cpp``.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev, legendre
from numpy.typing import NDArray

from adhesis.solver._kernels import Panels
from adhesis.solver.model.pattern import AdhesionPattern
from adhesis.solver.model.problem import Measure
from adhesis.solver.model.profile import Array, Profile

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


class StressSource:
    """Full-contact stress S = 2σ_full/E* and its derivative on a tree of panels over [0, 2π).

    Moments and values are as accurate as ``tolerance``, relative to the stress of the shortest
    waves.

    Attributes
    ----------
    top : int
        Highest harmonic, of profile and pattern.
    m2 : float
        Mean square slope.
    sharpest : float
        Largest |h''|, in units of q0.
    highest : float
        θ of the highest crest.
    """

    def __init__(
        self,
        profile: Profile,
        tolerance: float = 0.0,
        measure: Measure = "arc",
        pattern: AdhesionPattern | None = None,
    ) -> None:
        top = profile.highest_harmonic
        self.top = max(top, pattern.highest_harmonic) if pattern else top
        p = next(nodes for limit, nodes in _NODES if tolerance >= limit)
        count = 1 << int(np.ceil(np.log2(max(2 * self.top + 1, 16))))
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
        if measure == "flat":
            tilt[:] = 0.0  # sqrt(1 + h'²) is then 1
        shares = np.empty((0, _TILT_NODES))  # γ(θ)/γ
        if pattern is not None:
            shares = (1 + _on_panels(pattern.coefficients, y, count)) @ _to_chebyshev(y)
        t, _ = legendre.leggauss(_HALF_PLANE_NODES)
        half_plane = [a @ _to_chebyshev(t) for a in _half_plane_openings(m * h, t, count)]

        to_chebyshev = _to_chebyshev(x)
        steepest = float(np.abs(profile.slopes(8 * top)).max())
        pieces = int(np.ceil(1 + _PIECES_BY_SLOPE * steepest))
        # rule on a finest panel, composed of equal pieces; nodes and weights from 0 to 1
        start = np.arange(pieces)[:, None]
        piece_x = ((start + (y + 1) / 2) / pieces).ravel()
        piece_w = np.tile(v / (2 * pieces), pieces)
        # ∫ sqrt(1 + h'²) γ(θ)/γ dθ from 0 to the start of each finest panel
        stretch = np.sqrt(1 + chebyshev.chebval(2 * piece_x - 1, tilt.T) ** 2)
        if pattern is not None:
            stretch *= chebyshev.chebval(2 * piece_x - 1, shares.T)
        whole = stretch @ piece_w

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
            stress=stress @ to_chebyshev,
            slope=slope @ to_chebyshev,
            tilt=tilt,
            pattern=shares,
            half_plane=half_plane,
            weights=list(np.concatenate(levels, axis=1)),
            level_start=np.cumsum([0, *sizes[:-1]]),
            end_x=(t + 1) / 2,
            end_w=end / 2,
            length_x=piece_x,
            length_w=piece_w,
            length_before=np.concatenate([[0.0], np.cumsum(whole * width)]),
            highest_harmonic=top,
        )


def patches_between(gaps: Array) -> Array:
    """Return the patches between gaps, shape (L, 2), by their left edges, which are in [0, 2π)."""
    patches = np.empty_like(gaps)
    left, edges, ends = patches[:, 0], patches.ravel(), gaps.ravel()
    edges[0], edges[1:] = ends[-1] - 2 * np.pi, ends[:-1]
    patches -= 2 * np.pi * np.floor(left / (2 * np.pi))[:, None]
    first = int(left.argmin())
    return patches if first == 0 else np.concatenate([patches[first:], patches[:first]])


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
