"""Energy of a gap between an elastic half-space and a profile that attract each other by zones.

The gap g ≥ 0 is that at n equally spaced nodes. Per nominal area

    U = ½ mean(u K u) + mean φ(g) + Σ e / λ,   u = g + h,   φ(g) = σ_th g - γ up to g = δ, 0 beyond,

with K_q = E*|q|/2, γ = σ_th δ: Dugdale's law. φ is integrated over the intervals Δx between nodes
in closed form, of a gap that is linear there and whose nodal values are g - Δx² g''/12: by these
integrals are of fourth order. So the end of a zone may lie anywhere in an interval.

At the end of a zone the slope of the gap rises as a logarithm, which neither waves down to 2Δx nor
straight lines follow. What energy they miss depends on the share t of the interval at which the
tension ends. With σ_th as a step, its nodal forces less its own waves give, per end,

    e(t) = κ (σ_th Δx)²/E* t²(1 - t)²,   2πκ = ∫_0^π (1 - cos z)(7 - cos z)²/36 dz/z.

t is that of least U. Without e nodes hold back the ends of zones, and the error of a loss falls
with Δx; with it, with Δx². Where the gap rises too little for one t of least U (ends that are about
to meet), e is made smaller. With φ at the nodes alone the loss of a wave with nine nodes in a zone
is wrong by half.

Where γ differs along the profile, δ does not, and σ_th is that of the middle of an interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import pyfftw
from numpy.typing import NDArray
from scipy import ndimage

from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array, Integers

_ASYMMETRY = 3e-5  # of h_max: a wave of the period that is added to a profile with a symmetry
_HELD = 0.38682513  # κ
_WEIGHTS = np.array([-1, 14, -1, 0]) / 12  # of v - Δx² v''/12, at a node
_Value = TypeVar("_Value", bound=np.generic)


@dataclass(frozen=True, eq=False)
class ZoneEnds:
    """Ends of zones between two nodes, of which one is nearer than δ.

    Attributes
    ----------
    nodes : array, shape (ends, 4)
        Two nodes on the near side, then two on the far one.
    weights : array, shape (ends, 4)
        Share of each node in the gap at the end.
    rate : array, shape (ends,)
        Tension that the nodes lose as the gap at the end grows, in Pa/m.
    """

    nodes: Integers
    weights: Array
    rate: Array

    def force_by(self, motion: Array, out: Array) -> None:
        """Subtract from ``out`` what the ends lose in force as the nodes move, in Pa."""
        moved = self.rate * (self.weights * motion[self.nodes]).sum(axis=1)
        np.subtract.at(out, self.nodes, self.weights * moved[:, None])


class Surface:
    """Elasticity and law of adhesion of a problem on ``n`` nodes; n is even."""

    def __init__(self, problem: Problem, n: int) -> None:
        profile = problem.profile
        self.n, self.period, self.dx = n, profile.period, profile.period / n
        self.range = problem.attraction_range
        self.height: Array = profile.heights(n)
        if problem.equal_parts > 1 or len(problem.mirror_axes):
            # symmetric states are left as those of a profile that is hardly asymmetric; losses are
            # those of the profile itself, as they are even in the wave
            axis = 0.0 if problem.equal_parts > 1 else problem.mirror_axes[0] / self.period
            phase = 2 * np.pi * (np.arange(n) / n - axis) + (problem.equal_parts > 1)
            self.height += _ASYMMETRY * profile.h_max * np.sin(phase)
        at: Array = self.dx * (np.arange(n, dtype=np.float64) + 0.5)
        self.strength = problem.toughness(at, profile.at(at, derivative=1)) / self.range
        wave_number: Array = 2 * np.pi / self.period * np.arange(n // 2 + 1, dtype=np.float64)
        self.stiffness: Array = 0.5 * problem.half_space.modulus * wave_number
        self.sharpness: Array = (7 - np.cos(wave_number * self.dx)) / 6  # of v - Δx² v''/12
        self.held_back = _HELD * self.dx / problem.half_space.modulus
        self._values = pyfftw.zeros_aligned(n, dtype=np.float64)
        self._waves = pyfftw.zeros_aligned(n // 2 + 1, dtype=np.complex128)
        options = {"flags": ("FFTW_ESTIMATE",), "threads": 1}
        self._forward = pyfftw.FFTW(self._values, self._waves, **options)
        self._backward = pyfftw.FFTW(
            self._waves, self._values, direction="FFTW_BACKWARD", **options
        )
        self.transforms = 0

    def filter(self, symbol: NDArray[np.floating], values: Array) -> Array:
        """Multiply the waves of nodal values by a symbol."""
        self._values[:] = values
        self._forward.execute()
        self._waves *= symbol
        self._backward.execute()
        self.transforms += 2
        return np.asarray(self._values / self.n, dtype=np.float64)

    def attract(self, gap: Array) -> tuple[float, Array, ZoneEnds]:
        """Compute the energy of adhesion, its gradient and the ends of zones.

        In J/m² of nominal area, and in Pa: the tension that a node takes from both its intervals.
        """
        gap = sharpened(gap)
        is_near = gap < self.range
        beside = _after(is_near)
        half: Array = (is_near & beside) * (0.5 * self.strength)
        energy = product(half, gap + _after(gap) - 2 * self.range)
        tension = half + np.concatenate([half[-1:], half[:-1]])
        across = np.flatnonzero(is_near != beside)
        outward = np.where(is_near[across], 1, -1)
        first = across + (outward < 0)
        nodes: Integers = first[:, None] + np.outer(outward, np.arange(-1, 3))
        nodes %= self.n
        near, far = nodes[:, 1], nodes[:, 2]
        missing, rise = self.range - gap[near], gap[far] - gap[near]
        strength = self.strength[across]
        held = np.minimum(self.held_back * strength, 0.5 * rise)
        # rise t + 2 held (t - 3t² + 2t³) = missing, a cubic in t - ½ with one real root
        p, q = (rise - held) / (4 * held), (0.5 * rise - missing) / (4 * held)
        root = np.sqrt(p / 3)
        share = 0.5 - 2 * root * np.sinh(np.arcsinh(0.5 * q / root**3) / 3)
        slope = rise + 2 * held * (1 - 6 * share * (1 - share))
        even = 0.5 * (share * (1 - share)) ** 2
        energy += product(strength, share * (0.5 * rise * share - missing) + 2 * held * even)
        meets = held == 0.5 * rise
        by_rise = strength * (0.5 * share**2 + meets * even)
        np.add.at(tension, near, strength * share - by_rise)
        np.add.at(tension, far, by_rise)
        place = np.where(meets, missing / rise, share)
        weights = np.outer(1 - place, _WEIGHTS) + np.outer(place, _WEIGHTS[::-1])
        ends = ZoneEnds(nodes, weights, strength / slope)
        return energy / self.n, sharpened(tension), ends


def sharpened(values: Array) -> Array:
    """Return v - Δx² v''/12 of nodal values."""
    return np.asarray(ndimage.correlate1d(values, _WEIGHTS[:3], mode="wrap"), dtype=np.float64)


def _after(values: NDArray[_Value]) -> NDArray[_Value]:
    """Return the values of the following nodes, as np.roll, ten times as fast."""
    return np.concatenate([values[1:], values[:1]])


def product(one: Array, other: Array) -> float:
    """Sum the products without linear algebra, whose threads cost far more than they save here."""
    return float(np.add.reduce(one * other))
