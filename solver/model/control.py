"""What holds the half-space from afar: a fixed separation, a stiffness, or a load.

The far side of the solid is displaced by u_tot = Δ + p̄/k (the paper's u_tot = Δ + u_m), k the
stiffness per nominal area of all that lies between: the machine, the layer. k → ∞ fixes the
penetration Δ = h_max - s, k = 0 the mean stress p̄. An equilibrium state is a local minimum, over
the edges and Δ, of the potential W, and a path is one of the prescribed quantity x, which falls
while the solid is loaded:

=============  =====================  ==============  ======================
control        prescribed x           conjugate Y     potential W
=============  =====================  ==============  ======================
separation     s                      p̄               U
stiffness k    s - p̄/k = h_max-u_tot  p̄               U + λ p̄²/(2k)
load           -p̄                     s - h_max = -Δ  U - λ p̄ Δ
=============  =====================  ==============  ======================

At equilibrium dW/dx = -λ Y, so over a closed loop the loss is -∮ Y dx (which is ∮ p̄ dΔ), and it is
the sum of the drops of W at the jumps, which happen at fixed x. Under a load the solid falls off
once contact is lost, and its work from there on has no bound; the loop is closed at the separation
of the loss, where the drop is U. That may be negative: it is what the load has still to bring up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

from adhesis.solver.checks import STIFFNESS, real
from adhesis.solver.model.profile import Array

Value = TypeVar("Value", float, Array)


@dataclass(frozen=True)
class Control:
    """What is prescribed on a path.

    Parameters
    ----------
    stiffness : float
        k in Pa/m of nominal area: infinite for a fixed separation, 0 for a load.

    Raises
    ------
    ValueError
        If the stiffness is negative or NaN.
    TypeError
        If it is no number.

    References
    ----------
    docs/theory.md, "8. Paths and controls"
    """

    stiffness: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "stiffness", real("stiffness", self.stiffness, STIFFNESS))

    @property
    def is_fixed(self) -> bool:
        """Whether the separation itself is prescribed."""
        return math.isinf(self.stiffness)

    @property
    def is_load(self) -> bool:
        """Whether the mean stress is prescribed."""
        return self.stiffness == 0

    def prescribed(self, separation: Value, mean_stress: Value) -> Value:
        """Return x of states at s (m) with p̄ (Pa): in m, for a load in Pa."""
        if self.is_fixed:
            return separation
        if self.is_load:
            return -mean_stress
        return separation - mean_stress / self.stiffness

    def conjugate(self, separation: Value, mean_stress: Value, h_max: float) -> Value:
        """Return Y of states at s (m) with p̄ (Pa): in Pa, for a load in m."""
        return separation - h_max if self.is_load else mean_stress

    def potential(
        self, energy: float, separation: float, mean_stress: float, h_max: float, period: float
    ) -> float:
        """Return W in J/m, per period, of a state with the energy U in J/m."""
        if self.is_fixed:
            return energy
        if self.is_load:
            return energy - period * mean_stress * (h_max - separation)
        return energy + period * mean_stress**2 / (2 * self.stiffness)

    def displacement(self, separation: Value, mean_stress: Value, h_max: float) -> Value:
        """Return u_tot = Δ + p̄/k in m; for a load, which has no far side, Δ."""
        if self.is_fixed or self.is_load:
            return h_max - separation
        return h_max - separation + mean_stress / self.stiffness
