"""Control of the far side of the half-space: fixed separation, stiffness, or load.

The far side of the solid is displaced by u_tot = Δ + p̄/k (the paper's u_tot = Δ + u_m), with k the
stiffness per nominal area of the machine and the layer in between. k → ∞ fixes the penetration
Δ = h_max - s, k = 0 the mean stress p̄. An equilibrium state is a local minimum, over the edges and
Δ, of the potential W. A path is driven by the prescribed value x, which falls during loading:

=============  =====================  ==============  ======================
control        prescribed x           conjugate Y     potential W
=============  =====================  ==============  ======================
separation     s                      p̄               U
stiffness k    s - p̄/k = h_max-u_tot  p̄               U + λ p̄²/(2k)
load           -p̄                     s - h_max = -Δ  U - λ p̄ Δ
=============  =====================  ==============  ======================

At equilibrium dW/dx = -λ Y, so over a closed loop the loss is -∮ Y dx (which is ∮ p̄ dΔ), and it is
the sum of the drops of W at the jumps, which happen at fixed x. Under a load the solid falls off
once contact is lost, and the work of the load from there on is unbounded; the loop is therefore
closed at the separation at which contact is lost, where the drop is U. U may be negative: it is
then the work that the load has yet to do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

from adhesis.solver.checks import STIFFNESS, real
from adhesis.solver.model.profile import Array
from adhesis.solver.views import NotebookDisplay

Value = TypeVar("Value", float, Array)


@dataclass(frozen=True)
class Control(NotebookDisplay):
    """Choice of the prescribed value of a path.

    Parameters
    ----------
    stiffness : float
        k in Pa/m of nominal area: infinite for a fixed separation, 0 for a load.

    Raises
    ------
    ValueError
        If the stiffness is none of 0, infinity, and 1e-30 to 1e30.
    TypeError
        If it is not a number.

    References
    ----------
    docs/theory.md, "8. Paths and controls"

    Examples
    --------
    >>> from adhesis import Control
    >>> Control().is_fixed, Control(stiffness=0).is_load
    (True, True)
    """

    stiffness: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "stiffness", real("stiffness", self.stiffness, STIFFNESS))

    @property
    def is_fixed(self) -> bool:
        """True if the separation itself is prescribed."""
        return math.isinf(self.stiffness)

    @property
    def is_load(self) -> bool:
        """True if the mean stress is prescribed."""
        return self.stiffness == 0

    def prescribed(self, separation: Value, mean_stress: Value) -> Value:
        """Compute the prescribed value x from s (m) and p̄ (Pa): in m, for a load in Pa."""
        if self.is_fixed:
            return separation
        if self.is_load:
            return -mean_stress
        return separation - mean_stress / self.stiffness

    def conjugate(self, separation: Value, mean_stress: Value, h_max: float) -> Value:
        """Compute the conjugate Y from s (m) and p̄ (Pa): in Pa, for a load in m."""
        return separation - h_max if self.is_load else mean_stress

    def potential(
        self, energy: Value, separation: Value, mean_stress: Value, h_max: float, period: float
    ) -> Value:
        """Compute W of one period, in J/m, from the energy U in J/m."""
        if self.is_fixed:
            return energy
        if self.is_load:
            return energy - period * mean_stress * (h_max - separation)
        return energy + period * mean_stress**2 / (2 * self.stiffness)

    def displacement(self, separation: Value, mean_stress: Value, h_max: float) -> Value:
        """Compute u_tot = Δ + p̄/k in m; Δ for a load, which prescribes no displacement."""
        if self.is_fixed or self.is_load:
            return h_max - separation
        return h_max - separation + mean_stress / self.stiffness
