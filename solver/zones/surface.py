"""Energy of a gap between an elastic half-space and a profile that attract each other by zones.

The gap g ≥ 0 is that at n equally spaced nodes, and linear between them. Per nominal area

    U = ½ mean(u K u) + mean φ(g),   u = g + h,   φ(g) = σ_th g - γ up to g = δ, 0 beyond it,

with K_q = E*|q|/2, γ = σ_th δ: Dugdale's law. φ is integrated over the intervals between nodes in
closed form. So the end of a zone, where g = δ, may lie anywhere in an interval, and U and its
gradient are smooth in g. With φ taken at the nodes alone zones end at nodes, and are pinned there:
with nine nodes in a zone the loss of a wave is then off by half, with this law by 0.003.

Where γ differs along the profile, δ does not, and σ_th is that of the middle of an interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyfftw
from numpy.typing import NDArray

from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array, Integers

_ASYMMETRY = 3e-5  # of h_max: a wave of the period that is added to a profile with a symmetry


@dataclass(frozen=True, eq=False)
class ZoneEnds:
    """Ends of zones between two nodes, of which one is nearer than δ; arrays of shape (ends,).

    Attributes
    ----------
    near, far : array
        The nodes.
    share : array
        Way of the end from the near node to the far one.
    rate : array
        σ_th over the rise of the gap from node to node, in Pa/m: by this a zone's end that moves
        takes force from its nodes.
    """

    near: Integers
    far: Integers
    share: Array
    rate: Array

    def force_by(self, motion: Array, out: Array) -> None:
        """Subtract from ``out`` what the ends lose in force as the nodes move, in Pa."""
        moved = self.rate * ((1 - self.share) * motion[self.near] + self.share * motion[self.far])
        np.subtract.at(out, self.near, (1 - self.share) * moved)
        np.subtract.at(out, self.far, self.share * moved)


class Surface:
    """Elasticity and law of adhesion of a problem on ``n`` nodes; n is even."""

    def __init__(self, problem: Problem, n: int) -> None:
        profile = problem.profile
        self.n, self.period, self.dx = n, profile.period, profile.period / n
        self.range = problem.attraction_range
        self.height: Array = profile.heights(n)
        if problem.equal_parts > 1 or len(problem.mirror_axes):
            # symmetric states are left as those of a profile that is hardly asymmetric
            phase = 2 * np.pi / n * np.arange(n) + 1
            self.height += _ASYMMETRY * profile.h_max * np.sin(phase)
        at: Array = self.dx * (np.arange(n, dtype=np.float64) + 0.5)
        self.strength = problem.toughness(at, profile.at(at, derivative=1)) / self.range
        wave_number = 2 * np.pi / self.period * np.arange(n // 2 + 1)
        self.stiffness = 0.5 * problem.half_space.modulus * wave_number
        self.compliance = 1 / np.maximum(self.stiffness, self.stiffness[1])
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
        is_near = gap < self.range
        beside = _after(is_near)
        within = np.flatnonzero(is_near & beside)
        after = (within + 1) % self.n
        half = 0.5 * self.strength[within]
        energy = product(half, gap[within] + gap[after] - 2 * self.range)
        tension: Array = np.zeros(self.n)
        tension[within] += half
        tension[after] += half
        across = np.flatnonzero(is_near != beside)
        behind = (across + 1) % self.n
        near = np.where(is_near[across], across, behind)
        far = np.where(is_near[across], behind, across)
        rise = gap[far] - gap[near]
        share = (self.range - gap[near]) / rise
        strength = self.strength[across]
        energy -= 0.5 * product(strength, share * (self.range - gap[near]))
        np.add.at(tension, near, strength * share * (1 - 0.5 * share))
        np.add.at(tension, far, 0.5 * strength * share**2)
        return energy / self.n, tension, ZoneEnds(near, far, share, strength / rise)


def _after(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the flags of the following nodes, as np.roll, ten times as fast."""
    return np.concatenate([flags[1:], flags[:1]])


def product(one: Array, other: Array) -> float:
    """Sum the products without linear algebra, whose threads cost far more than they save here."""
    return float(np.add.reduce(one * other))
