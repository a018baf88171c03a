"""Contact problem: a rough rigid profile, an elastic half-space, a work of adhesion, a control."""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass, field
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from adhesis.solver.checks import (
    ADHESION_RANGE,
    RMS_SLOPE,
    STRENGTH,
    WORK_OF_ADHESION,
    at_least,
    choice,
    instance,
    plain,
    real,
)
from adhesis.solver.model.contact_state import ContactState
from adhesis.solver.model.control import Control, Value
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.jump import Branch
from adhesis.solver.model.pattern import AdhesionPattern
from adhesis.solver.model.profile import Array, Integers, Profile, first_of_equal
from adhesis.solver.values import ByValue

Measure = Literal["arc", "flat"]
"""Length on which adhesion acts: that of the profile, or its projection."""

# Of the shortest wave: places in equal parts of the period that differ by less are copies.
_SAME_PLACE = 1e-3

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
    if not RMS_SLOPE.holds(float(f"{rms_slope:.12g}")):  # the root of m2 is right to some bits
        shown = f"{rms_slope:,.4g}" if 1 < rms_slope < 1e6 else plain(float(f"{rms_slope:.4g}"))
        raise ValueError(f"rms slope is {shown}: it must be {RMS_SLOPE.text}")


@dataclass(frozen=True, eq=False, repr=False)
class Problem(ByValue):
    """A rigid periodic profile pressed into an elastic half-space with adhesion.

    Immutable; two problems are equal if all parts are.

    Parameters
    ----------
    profile : Profile
        With an rms slope of at most 100; the theory is for slopes far below 1.
    half_space : HalfSpace
    work_of_adhesion : float
        γ in J/m², 0 (contact without adhesion) or from 1e-30 to 1e30; with a pattern its mean.
    control : Control
        Prescribed quantity; the separation by default.
    strength : float
        σ_th in Pa, the largest tension that the interface bears: its adhesion has the range
        δ = γ/σ_th. Infinite by default, that of adhesion of zero range (docs/zero-range.md).
    adhesion_range : float, optional
        Instead of the strength, the range δ of adhesion in m.
    work_of_adhesion_open : float, optional
        Work of adhesion in J/m² where an edge recedes, at least γ, which then holds where it
        advances; between both it is pinned. None stands for γ.
    measure : {"arc", "flat"}
        γ counts for each length sqrt(1 + h'²) dx along the profile, or for each projected length
        dx. By keyword only.
    pattern : AdhesionPattern, optional
        Variation of γ, and with it of γ_open, along the profile. By keyword only.

    Raises
    ------
    ValueError
        If γ, γ_open, the strength or the range is out of bounds, or the measure is unknown; γ_open
        is below γ, or positive where γ = 0; both strength and range are given; one of them stands
        beside a larger γ_open or a pattern; a pattern is given where γ = 0; or the rms slope is far
        beyond small strain, as it is when heights and period have different units.
    TypeError
        If a part is of another class, or a value not a number.

    References
    ----------
    docs/theory.md, "1. The problem"

    Examples
    --------
    >>> from adhesis import HalfSpace, Problem, single_wave
    >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), work_of_adhesion=0.01)
    >>> round(problem.separation(penetration=0.25), 12)  # three quarters of h_max
    7.5e-07
    """

    profile: Profile
    half_space: HalfSpace
    work_of_adhesion: float
    control: Control = field(default_factory=Control)
    strength: float = math.inf
    adhesion_range: InitVar[float | None] = None
    work_of_adhesion_open: float | None = None
    measure: Measure = field(default="arc", kw_only=True)
    pattern: AdhesionPattern | None = field(default=None, kw_only=True)

    def __post_init__(self, adhesion_range: float | None) -> None:
        instance("profile", self.profile, Profile, "single_wave or profile_from_heights")
        instance("half_space", self.half_space, HalfSpace, "HalfSpace(young, poisson)")
        gamma = real("work_of_adhesion", self.work_of_adhesion, WORK_OF_ADHESION)
        object.__setattr__(self, "work_of_adhesion", gamma)
        instance("control", self.control, Control, "Control(stiffness), for a load Control(0)")
        choice("measure", self.measure, get_args(Measure))
        check_slope(float(np.sqrt(self.profile.m2)))
        self._set_strength(adhesion_range)
        self._check_open()
        self._check_pattern()

    @property
    def gamma_open(self) -> float:
        """Work of adhesion of an edge that recedes, in J/m²: γ, unless another is given."""
        found = self.work_of_adhesion_open
        return self.work_of_adhesion if found is None else found

    @property
    def pinning(self) -> float:
        """Work of adhesion of an edge that recedes less that of one that advances, in J/m²."""
        return self.gamma_open - self.work_of_adhesion

    @property
    def or_other_method(self) -> str:
        """Return an alternative that ends an advice; empty where ``sharp`` alone knows the law."""
        sharp_alone = self.pinning > 0 or math.isfinite(self.strength)
        return "" if sharp_alone else " or the other method"

    def _set_strength(self, adhesion_range: float | None) -> None:
        """Set the strength, from the range if that is given; without adhesion it is infinite."""
        gamma, given = self.work_of_adhesion, self.strength
        if adhesion_range is None:
            found = math.inf if given is None else real("strength", given, STRENGTH)
        else:
            if given is not None and given != math.inf:
                raise ValueError(
                    f"adhesion_range is {adhesion_range!r} and strength is {given!r}: give one of "
                    "them, strength = work_of_adhesion/adhesion_range"
                )
            found = gamma / real("adhesion_range", adhesion_range, ADHESION_RANGE)
        object.__setattr__(self, "strength", found if gamma > 0 else math.inf)

    def _check_open(self) -> None:
        """Refuse a work of adhesion on opening that is the smaller one, or beside a strength."""
        if self.work_of_adhesion_open is None:
            return
        gamma = self.work_of_adhesion
        found = real("work_of_adhesion_open", self.work_of_adhesion_open, WORK_OF_ADHESION)
        if found < gamma or gamma == 0 < found:
            least = f"at least the work of adhesion, {at_least(gamma, 6)}"
            rule = least if gamma else "left out, as γ is 0"
            raise ValueError(f"work_of_adhesion_open is {found:g} J/m²: it must be {rule}")
        if found > gamma and math.isfinite(self.strength):
            raise ValueError(
                f"work_of_adhesion_open is {found:g} J/m² beside a strength of {self.strength:g} "
                "Pa: give one of them, edges of two works of adhesion have no range"
            )
        object.__setattr__(self, "work_of_adhesion_open", found if found > gamma else None)

    def _check_pattern(self) -> None:
        """Refuse a pattern beside a strength or without adhesion; leave out one without waves."""
        if self.pattern is None:
            return
        instance("pattern", self.pattern, AdhesionPattern, "stripes(count, amplitude)")
        if math.isfinite(self.strength) or self.work_of_adhesion == 0:
            beside = f"a strength of {self.strength:g} Pa" if self.work_of_adhesion else "γ = 0"
            raise ValueError(
                f"a pattern of the work of adhesion is given beside {beside}: give one of them, "
                "the work of adhesion varies at edges of zero range that adhere"
            )
        if not self.pattern.coefficients.any():
            object.__setattr__(self, "pattern", None)

    @property
    def adhesion_text(self) -> str:
        """The work of adhesion in words, with its bounds along the profile where it varies."""
        gamma, pattern = self.work_of_adhesion, self.pattern
        if pattern is None:
            return f"{gamma:.4g} J/m²"
        least, largest = gamma * pattern.least, gamma * pattern.largest
        return f"{gamma:.4g} J/m² ({least:.4g} to {largest:.4g} J/m² along the profile)"

    @property
    def least_work_of_adhesion(self) -> float:
        """Least work of adhesion of a place of the profile, in J/m²."""
        return self.work_of_adhesion * (self.pattern.least if self.pattern else 1.0)

    @property
    def highest_harmonic(self) -> int:
        """Largest number of waves in a period, of heights or of the work of adhesion."""
        own = self.profile.highest_harmonic
        return max(own, self.pattern.highest_harmonic) if self.pattern else own

    @property
    def shortest_wavelength(self) -> float:
        """Wavelength in m of the shortest of these waves."""
        return self.profile.period / self.highest_harmonic

    @property
    def equal_parts(self) -> int:
        """Number of equal parts of the period, in heights and in the work of adhesion."""
        own = self.profile.equal_parts
        return self.pattern.equal_parts(own) if self.pattern else own

    @property
    def mirror_axes(self) -> Array:
        """Places x in m, from 0 to λ/2, about which heights and work of adhesion are mirrored."""
        axes = self.profile.mirror_axes
        return axes[self.pattern.is_mirrored(self.profile.q0 * axes)] if self.pattern else axes

    def toughness(self, x: Array, slope: Array) -> Array:
        """Compute γ for each projected length, in J/m², at x in m where the slopes are h'."""
        stretch: Array = np.sqrt(1 + slope**2) if self.measure == "arc" else np.ones_like(slope)
        if self.pattern is not None:
            stretch = stretch * self.pattern.at(self.profile.q0 * x)
        return np.asarray(self.work_of_adhesion * stretch)

    @property
    def attraction_range(self) -> float:
        """Range of adhesion γ/σ_th in m; 0 where the strength is infinite."""
        return self.work_of_adhesion / self.strength

    @property
    def first_touch(self) -> float:
        """Separation in m at which a solid that approaches is attracted: h_max and the range."""
        return self.profile.h_max + self.attraction_range

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

    @cached_property
    def first_crest(self) -> float:
        """Position in m of the highest crest; of equal ones, of that with the largest γ(x).

        That one attracts first, however short the range of adhesion is.
        """
        if self.pattern is None:
            return self.profile.highest_point[0]
        x = self.profile.crests().position % self.profile.period
        return float(x[np.argmax(self.pattern.at(self.profile.q0 * x))])

    def first_of_equal(self, position: Array, equal_parts: int) -> Integers:
        """Choose, of places in m where contact may begin alike, those where it does begin.

        See :func:`first_of_equal`; of so many equal parts the period consists.
        """
        period, near = self.profile.period, _SAME_PLACE * self.profile.shortest_wavelength
        return first_of_equal(position, self.first_crest, period / equal_parts, period, near)

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

    @property
    def prescribed_range(self) -> float:
        """Range of x that the profile alone sets, in m, for a load in Pa."""
        h_max, stiffness = self.profile.h_max, self.control.stiffness
        return self.stress_scale if self.control.is_load else h_max + self.stress_scale / stiffness

    def prescribed_in(self, state: ContactState) -> float:
        """Compute the prescribed value x of the control in a state: in m, for a load in Pa."""
        return self.control.prescribed(state.separation, state.mean_stress)

    def branch_to(self, state: ContactState, prescribed: float) -> Branch:
        """Return the branch of a path from a state to x = ``prescribed``."""
        return "loading" if prescribed <= self.prescribed_in(state) else "unloading"

    def detached_separation(self, state: ContactState, prescribed: float) -> float:
        """Compute s in m at x = ``prescribed`` of a path that is out of contact in ``state``.

        A load is not carried at any separation, so the state stays where it is.
        """
        return state.separation if self.control.is_load else prescribed

    def full_contact(self, prescribed: float) -> str:
        """Return the message for a contact that runs into full contact before x = prescribed."""
        first = self.control.prescribed(self.profile.h_max, 0.0)
        at_touch = prescribed >= first
        where = "at first touch" if at_touch else f"before {self.describe_prescribed(prescribed)}"
        held = "under a load"
        remedy = "for a machine that turns at a mean stress give a preload in place of max_stress"
        if not self.control.is_load:
            held = f"at a stiffness of {self.control.stiffness:g} Pa/m"
            remedy = "give a larger stiffness"
        return (
            f"{held} this surface is drawn into full contact {where} (γ = "
            f"{self.work_of_adhesion:g} J/m², E = {plain(self.half_space.young)} Pa): {remedy}, or "
            f"prescribe the separation{'' if at_touch else ', or turn earlier'}"
        )

    def describe_prescribed(self, prescribed: float) -> str:
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
