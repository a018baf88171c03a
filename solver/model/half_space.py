"""The elastic half-space under plane strain."""

from __future__ import annotations

from dataclasses import dataclass

from adhesis.solver.checks import LENGTH, POISSON, YOUNG, real
from adhesis.solver.views import NotebookDisplay


@dataclass(frozen=True)
class HalfSpace(NotebookDisplay):
    """Linear elastic, homogeneous, isotropic half-space in plane strain.

    Parameters
    ----------
    young : float
        Young's modulus E, in Pa, from 1e-3 to 1e15.
    poisson : float
        Poisson's ratio ν, -1 < ν ≤ 0.5.

    Raises
    ------
    ValueError
        If a value breaks the rules above.
    TypeError
        If a value is not a number.

    References
    ----------
    docs/theory.md, "1. The problem"

    Examples
    --------
    >>> from adhesis import HalfSpace
    >>> round(HalfSpace(young=3e6, poisson=0.5).modulus)  # E/(1 - ν²), in Pa
    4000000
    """

    young: float
    poisson: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "young", real("young", self.young, YOUNG))
        object.__setattr__(self, "poisson", real("poisson", self.poisson, POISSON))

    @property
    def modulus(self) -> float:
        """E* = E/(1 - ν²), in Pa."""
        return self.young / (1 - self.poisson**2)

    def layer_stiffness(self, thickness: float) -> float:
        """Compute the stiffness k = E(1-ν)/((1+ν)(1-2ν)d) in Pa/m of a layer on a rigid backing.

        The layer cannot spread sideways, and its thickness d is much larger than the waves of the
        profile (constrained compression; Johnson, Contact Mechanics, 5.8).

        Parameters
        ----------
        thickness : float
            d in m, from 1e-12 to 1e6.

        Raises
        ------
        ValueError
            If d is out of its bounds, or ν = 0.5: an incompressible layer that cannot spread is
            rigid.
        TypeError
            If d is not a number.
        """
        thickness = real("thickness", thickness, LENGTH)
        nu = self.poisson
        if nu == 0.5:
            raise ValueError(
                "poisson is 0.5: a layer that is incompressible and cannot spread sideways has no "
                "finite stiffness; give the stiffness itself"
            )
        return self.young * (1 - nu) / ((1 + nu) * (1 - 2 * nu) * thickness)
