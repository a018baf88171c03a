"""The elastic half-space under plane strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class HalfSpace:
    """Linear elastic, homogeneous, isotropic half-space in plane strain.

    Parameters
    ----------
    young : float
        Young's modulus E, in Pa, positive.
    poisson : float
        Poisson's ratio ν, -1 < ν ≤ 0.5.

    Raises
    ------
    ValueError
        If a value breaks the rules above.

    References
    ----------
    docs/theory.md, "1. The problem"
    """

    young: float
    poisson: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.young) and self.young > 0):
            raise ValueError(f"young is {self.young!r}: it must be positive and finite, in Pa")
        if not -1 < self.poisson <= 0.5:
            raise ValueError(f"poisson is {self.poisson!r}: it must lie in (-1, 0.5]")

    @property
    def modulus(self) -> float:
        """E* = E/(1 - ν²), in Pa."""
        return self.young / (1 - self.poisson**2)

    def layer_stiffness(self, thickness: float) -> float:
        """Stiffness k = E(1-ν)/((1+ν)(1-2ν)d) in Pa/m of a layer that cannot spread sideways.

        That is what lies between the contact and a rigid backing at the distance d, much larger
        than the waves of the profile (constrained compression; Johnson, Contact Mechanics, 5.8).

        Parameters
        ----------
        thickness : float
            d in m, positive.

        Raises
        ------
        ValueError
            If d is not positive, or ν = 0.5: an incompressible layer that cannot spread is rigid.
        """
        if not (np.isfinite(thickness) and thickness > 0):
            raise ValueError(f"thickness is {thickness!r}: it must be positive and finite, in m")
        nu = self.poisson
        if nu == 0.5:
            raise ValueError(
                "poisson is 0.5: a layer that is incompressible and cannot spread sideways has no "
                "finite stiffness; give the stiffness itself"
            )
        return self.young * (1 - nu) / ((1 + nu) * (1 - 2 * nu) * thickness)
