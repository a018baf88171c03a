"""Contact problem: a rough rigid profile, an elastic half-space, a work of adhesion, a control."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from adhesis.solver.checks import RMS_SLOPE, WORK_OF_ADHESION, instance, plain, real
from adhesis.solver.model.contact_state import ContactState
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.profile import Array, Profile
from adhesis.solver.values import ByValue

Value = TypeVar("Value", float, Array)

# Rounding of a separation over h_max: smaller penetrations count as 0.
_ROUNDING = 8 * float(np.finfo(float).eps)


def stress_scale(half_space: HalfSpace, period: float, h_max: Any) -> Any:
    """Compute E* q0 h_max / 2 in Pa for h_max in m (a number or an array): p̄ is σ~ times this."""
    return 0.5 * half_space.modulus * (2 * np.pi / period) * h_max


def check_slope(rms_slope: float) -> None:
    """Refuse an rms slope so large or small that heights and period must have different units.

    Raises
    ------
    ValueError
        If the rms slope lies outside :data:`adhesis.solver.checks.RMS_SLOPE`.
    """
    if not RMS_SLOPE.holds(rms_slope):
        shown = f"{rms_slope:,.4g}" if 1 < rms_slope < 1e6 else plain(float(f"{rms_slope:.4g}"))
        raise ValueError(f"rms slope is {shown}: it must be {RMS_SLOPE.text}")


@dataclass(frozen=True, eq=False, repr=False)
class Problem(ByValue):
    """A rigid periodic profile pressed into an elastic half-space with zero-range adhesion.

    Immutable; two problems are equal if all four parts are.

    Parameters
    ----------
    profile : Profile
        With an rms slope of at most 100; the theory is for slopes far below 1.
    half_space : HalfSpace
    work_of_adhesion : float
        γ in J/m², 0 (contact without adhesion) or from 1e-30 to 1e30.
    control : Control
        Prescribed quantity; the separation by default.

    Raises
    ------
    ValueError
        If γ is out of bounds, or the rms slope far beyond small strain, as it is when heights and
        period have different units.
    TypeError
        If a part is of another class, or γ not a number.

    References
    ----------
    docs/theory.md, "1. The problem"
    """

    profile: Profile
    half_space: HalfSpace
    work_of_adhesion: float
    control: Control = field(default_factory=Control)

    def __post_init__(self) -> None:
        instance("profile", self.profile, Profile, "single_wave or profile_from_heights")
        instance("half_space", self.half_space, HalfSpace, "HalfSpace(young, poisson)")
        gamma = real("work_of_adhesion", self.work_of_adhesion, WORK_OF_ADHESION)
        object.__setattr__(self, "work_of_adhesion", gamma)
        instance("control", self.control, Control, "Control(stiffness), for a load Control(0)")
        check_slope(float(np.sqrt(self.profile.m2)))

    @property
    def stress_scale(self) -> float:
        """E* q0 h_max / 2 in Pa: the mean stress is the paper's σ~ times this."""
        return float(stress_scale(self.half_space, self.profile.period, self.profile.h_max))

    @property
    def loss_scale(self) -> float:
        """E* q0 h_max² / 2 in J/m²: a loss per nominal area is W~ times this, W~ = ∮ σ~ dΔ~."""
        return self.stress_scale * self.profile.h_max

    @property
    def full_contact_energy(self) -> float:
        """Elastic energy of full contact, (E*/4) Σ |q||h_q|² in J/m² of nominal area.

        For much larger γ contact runs into full contact spontaneously.
        """
        return 0.25 * self.half_space.modulus * self.profile.moment(1)

    def separation(self, penetration: float) -> float:
        """Compute the separation s = h_max (1 - Δ~) in m at the penetration Δ~ = Δ/h_max."""
        return self.profile.h_max * (1.0 - penetration)

    def prescribed(self, drive: float) -> float:
        """Compute the prescribed value x of the control from its value in the units of a loop.

        Parameters
        ----------
        drive : float
            Δ/h_max at fixed separation, u_tot/h_max for a stiffness, p̄ in Pa for a load.
        """
        return -drive if self.control.is_load else self.separation(drive)

    def prescribed_in(self, state: ContactState) -> float:
        """Compute the prescribed value x of the control in a state: in m, for a load in Pa."""
        return self.control.prescribed(state.separation, state.mean_stress)

    def full_contact(self, prescribed: float) -> str:
        """Return the message for a contact that runs into full contact before x = prescribed."""
        first = self.control.prescribed(self.profile.h_max, 0.0)
        where = f"before {self.place(prescribed)}" if prescribed < first else "at first touch"
        return (
            f"the contact runs into full contact {where}: there is no state with a gap; prescribe "
            "the separation or a larger stiffness, or reduce the turning point or work_of_adhesion"
        )

    def place(self, prescribed: float) -> str:
        """Format x = prescribed for a message, in the units of the turning points and in m."""
        if self.control.is_load:
            return f"a mean stress of {0.0 - prescribed:g} Pa"
        penetration = self.penetration(prescribed)
        if self.control.is_fixed:
            return f"Δ/h_max = {penetration:.6g} (mean gap {prescribed:.6g} m)"
        u_tot = self.profile.h_max - prescribed
        return f"u_tot/h_max = {penetration:.6g} (u_tot = {u_tot:.6g} m)"

    def penetration(self, separation: Value) -> Value:
        """Compute the penetration Δ~ = 1 - s/h_max at separations s in m; 0 within rounding."""
        found = 1.0 - separation / self.profile.h_max
        if isinstance(found, np.ndarray):
            return np.where(np.abs(found) < _ROUNDING, 0.0, found)
        return 0.0 if abs(found) < _ROUNDING else found
