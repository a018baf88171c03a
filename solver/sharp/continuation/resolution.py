"""Tolerances with which a path is followed."""

from __future__ import annotations

from dataclasses import dataclass

from adhesis.solver.sharp.tolerances import ORDER_RESOLVED


@dataclass(frozen=True)
class Resolution:
    """Tolerances with which a path is followed; separations as q0 s.

    Attributes
    ----------
    jump : float
        Separation to which a jump is located.
    bend : float
        Largest relative error of the trapezoidal rule over one step.
    work : float
        Largest difference in J/m² of the work and the change of energy over one step, where patches
        open from inside; infinite where they do not.
    h_max : float
        q0 h_max.
    finest : float
        No jump is located more finely than this.
    late : float
        Work that a jump may add to the loss by being found late, in units of its drop.
    least_drop : float
        Drop in J/m² below which jumps need not be located more finely.
    field_share : float
        Share of every drop that counts as its error by the error of the field.
    """

    jump: float
    bend: float
    work: float
    h_max: float
    finest: float
    late: float
    least_drop: float
    field_share: float

    @property
    def order(self) -> float:
        """Separation of two events below which either may come first."""
        return ORDER_RESOLVED * self.jump
