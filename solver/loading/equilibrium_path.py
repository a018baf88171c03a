"""Base of the results of loops and paths: the states and jumps along an equilibrium path."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from time import process_time
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.checks import counted
from adhesis.solver.loading.ledger import Ledger, estimated_error, states_before_jumps
from adhesis.solver.loading.path_record import Record
from adhesis.solver.loading.zero_range import (
    RANGES,
    SMEARED,
    TOUCH_SHARE,
    InteriorTension,
    interior_tension,
    least_range,
    length_text,
    limit_text,
    narrowest_length,
    outside_text,
    range_warnings,
    stored_at_pull_off,
    stress_text,
    touch_stress,
    turn_range,
)
from adhesis.solver.method import ContactState, Method, MethodReport, PathError
from adhesis.solver.model.jump import Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.values import ByValue, finite
from adhesis.solver.views import ResultViews

STEEP = 0.3
"""Root mean square slope above which linear elasticity is doubtful (docs/theory.md)."""
LARGE_STRAIN = 0.3
"""Largest tension over Young's modulus, and longest neck over the period, above which small strain
is doubtful."""

PathOrLoop = TypeVar("PathOrLoop", bound="EquilibriumPath")

# Relative error above which an audit residual or a numerical error is reported, of methods without
# an accuracy.
_LARGE = 0.02
# Share of the loss below which a negative closing drop changes nothing that is read off.
_FALL_SHARE = 0.01
# Largest A/A0 from which on harder pressing can add a hundredth of the area at most.
_NEARLY_FULL = 0.99
_ROUNDING = 1e-9  # of h_max: a separation that is less below it is at first touch
_ENTERED = (  # in the ledger
    *("separation", "mean_stress", "tangent", "contact_fraction"),
    *("elastic_energy", "adhesion_energy", "edge_friction"),
)
_OF_PROFILE = ("period", "h_max", "h_rms", "m0", "m2", "m4")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EquilibriumPath(ByValue, ResultViews):
    """The states of a path in its order, and the jumps between them; arrays of shape (states,).

    Immutable; two results are equal if all fields except ``seconds``, ``method``,
    ``contact_states`` and ``new_method`` are: one method gives equal results each time for the
    same problem.

    Attributes
    ----------
    problem : Problem
    load_steps : int
        Equal steps from first touch up to the (largest) turning point.
    branch : array of str, shape (states,)
        "loading" or "unloading".
    load_step : bool array
        True at load steps and turning points, False at states that the method added in between
        (before and after jumps, and where the curve bends).
    penetration : array
        Δ/h_max.
    separation : array
        s in m.
    mean_stress : array
        p̄ in Pa, compression positive.
    contact_fraction : array
        A/A0.
    patches : int array
    tangent : array
        dY/dx of the control (:mod:`adhesis.solver.model.control`), Pa/m, or m/Pa under a load; NaN
        where the method does not know it. With it the loss can be computed again from the states.
    elastic_energy, adhesion_energy : array
        In J/m, per period.
    jumps : tuple of Jump
    loss_from_drops : float
        Sum of the energy drops at the jumps, in J/m² of nominal area; with two works of adhesion
        also the friction of the edges between the jumps.
    edge_friction : array or None
        Energy in J/m, per period, that receding edges have dissipated on the way to each state;
        None with one work of adhesion.
    loss_error : float
        Estimated numerical error of the loss or work, in J/m² (docs/methods.md, "Error of the
        loss").
    seconds : float
        CPU time of this process, in s.
    method : MethodReport
        Name, resolution and counters of the method.
    contact_states : tuple of ContactState
        The states themselves, with the edges of every patch; empty for a result from a file.
    new_method : callable or None
        Builds the method anew, whose ``fields`` and ``openings`` take these states.
    interior : InteriorTension or None
        Largest local maximum of tension inside patches, and where it occurred; None if no patch
        has one (docs/zero-range.md).
    narrowest_length : float
        Shortest length in m that decides where edges stand (``zero_range``); infinite where edges
        have zones, of any length.
    turn_range : float
        Range of adhesion in m at which jumps that lie beyond a turning point, and would come before
        it, take a hundredth of the loss. Infinite if it is longer than the other three ranges, 0 if
        such a jump lies nearer than the places of jumps are known.

    References
    ----------
    docs/theory.md, "3. The loop"
    """

    problem: Problem = field(repr=False)
    load_steps: int
    branch: NDArray[np.str_]
    load_step: NDArray[np.bool_]
    penetration: Array
    separation: Array
    mean_stress: Array
    tangent: Array
    contact_fraction: Array
    patches: NDArray[np.int64]
    elastic_energy: Array
    adhesion_energy: Array
    jumps: tuple[Jump, ...]
    loss_from_drops: float
    loss_error: float
    seconds: float = field(compare=False)
    method: MethodReport = field(compare=False)
    contact_states: tuple[ContactState, ...] = field(default=(), compare=False)
    new_method: Callable[[], Method] | None = field(default=None, compare=False)
    edge_friction: Array | None = None
    interior: InteriorTension | None = None
    narrowest_length: float = float("nan")
    turn_range: float = float("nan")

    # Beside those of every path, in the order in which they are listed.
    _result: ClassVar[str] = "loss"  # what is asked for
    _columns: ClassVar[tuple[str, ...]] = ()
    _numbers: ClassVar[tuple[str, ...]] = ()

    @property
    def energy(self) -> Array:
        """U in J/m, per period, shape (states,)."""
        return self.elastic_energy + self.adhesion_energy

    @property
    def ledger(self) -> Ledger:
        """Energies of all intervals between the states, made of the states and jumps."""
        return Ledger.of(self.problem, self.jumps, **{n: getattr(self, n) for n in _ENTERED})

    @property
    def friction(self) -> float:
        """Energy that edges dissipate as they recede, in J/m² of nominal area.

        By so much do the two works of adhesion differ, within jumps and between them; 0 for one.
        Under a load what they dissipate when the solid falls off is not counted.
        """
        return math.fsum(self.ledger.friction)

    @property
    def largest_contact_fraction(self) -> float:
        """Largest A/A0 on the path."""
        return float(self.contact_fraction.max())

    @property
    def largest_interior_tension(self) -> float:
        """Largest local maximum of tension inside patches, in Pa; 0 if there is none."""
        return self.interior.tension if self.interior is not None else 0.0

    @property
    def valid_range(self) -> float:
        """Range of adhesion in m below which no patch opens from inside, γ/σ_in.

        γ is the least one of the profile, as in :attr:`edge_range`.
        Infinite if no patch is in tension inside (docs/zero-range.md).
        """
        if self.interior is None:
            return math.inf
        return self.problem.least_work_of_adhesion / self.interior.tension

    @property
    def edge_range(self) -> float:
        """Range of adhesion in m whose cohesive zone at an edge is ``narrowest_length`` long."""
        gamma, modulus = self.problem.least_work_of_adhesion, self.problem.half_space.modulus
        return math.sqrt(4 * gamma * self.narrowest_length / (math.pi * modulus))

    @property
    def touch_range(self) -> float:
        """Range of adhesion in m that changes the loss by a hundredth by earlier touches.

        Infinite if no jump is a touch, and at a finite range, in which touches come earlier
        (docs/zero-range.md).
        """
        if math.isfinite(self.problem.strength):
            return math.inf
        stress = touch_stress(
            self.jumps, self.states_before_jumps(), self.separation, self.mean_stress,
            self.patches, self.problem.control,
        )  # fmt: skip
        return TOUCH_SHARE * max(self.lost, 0.0) / stress if stress > 0 else math.inf

    @property
    def zone_error(self) -> float:
        """Estimated change of the loss by cohesive zones at edges, which are left out, in J/m².

        0 with zero range (docs/zero-range.md).
        """
        range_ = self.problem.attraction_range
        return SMEARED * (range_ / self.edge_range) ** 4 * abs(self.lost) if range_ > 0 else 0.0

    @property
    def least_range(self) -> float:
        """The least of ``valid_range``, ``edge_range``, ``touch_range``, ``turn_range``, in m.

        The zero-range limit holds for ranges of adhesion well below it (docs/zero-range.md).
        """
        return float(least_range(self.valid_range, *self.outer_ranges))

    @property
    def outer_ranges(self) -> tuple[float, float, float]:
        """``edge_range``, ``touch_range`` and ``turn_range``: all but that inside patches, in m."""
        return self.edge_range, self.touch_range, self.turn_range

    @property
    def lost(self) -> float:
        """Energy that is lost on the path, in J/m² of nominal area."""
        return self.loss_from_drops

    @property
    def races(self) -> int:
        """Number of jumps whose end depends on speeds, order or the field (``Jump.raced``)."""
        return sum(jump.raced for jump in self.jumps)

    @property
    def openings(self) -> int:
        """Number of jumps that begin with a gap that opens inside a patch."""
        return sum(jump.kind == "opening" for jump in self.jumps)

    @property
    def energy_at_stake(self) -> float:
        """Sum over the jumps of the energy that depends on a race, in J/m²."""
        return float(sum(jump.at_stake for jump in self.jumps))

    @property
    def loss_note(self) -> str:
        """Return where the loss of a path under a load is closed; empty for all other paths."""
        if not self.problem.control.is_load:
            return ""
        if self.patches[-1]:
            return "under a weight"
        before = self.loss_from_drops - self.closing_drop
        return (
            f"under a weight; it falls off at {stress_text(0.0 - self.mean_stress.min())}: drops "
            f"before the fall {1e3 * before:.3g} mJ/m², closed at the separation of the fall "
            f"{1e3 * self.loss_from_drops:.3g} mJ/m²"
        )

    @property
    def closing_drop(self) -> float:
        """Drop at which the solid falls off under a load, in J/m² of nominal area; else 0.

        It closes the loop at the separation of the fall, and is U there, of either sign
        (:mod:`adhesis.solver.model.control`).
        """
        falls = self.problem.control.is_load and not self.patches[-1] and self.jumps
        return self.jumps[-1].energy_drop if falls and not self.jumps[-1].patches_after else 0.0

    def drops(self, small_scale: bool) -> float:
        """Sum the energy drops of one scale, in J/m², without ``closing_drop``.

        The closing drop depends on where the loop is closed, and may be negative: it is the loss of
        no mechanism.
        """
        found = sum(jump.energy_drop for jump in self.jumps if jump.small_scale is small_scale)
        return float(found if small_scale else found - self.closing_drop)

    def range_warnings(self) -> list[str]:
        """Return sentences where the range of adhesion may matter more than the model knows."""
        tension = 0.0 if self.patches[-1] else max(0.0, float(-self.mean_stress.min()))
        lost = self.lost - stored_at_pull_off(tension, self.problem.control.stiffness)
        given = self.problem, self.valid_range, lost, self.contact_fraction
        return range_warnings(*given, *self.outer_ranges)

    def strain_warnings(self) -> list[str]:
        """Return sentences where strains are not small."""
        out: list[str] = []
        young, period = self.problem.half_space.young, self.problem.profile.period
        question = "small strain does not hold; is γ in J/m², E in Pa and the profile in m?"
        tension = float(-self.mean_stress.min(initial=0.0))
        if tension > LARGE_STRAIN * young:
            out.append(
                f"the largest mean tension, {tension:.3g} Pa, is {tension / young:.3g} of Young's "
                f"modulus: {question}"
            )
        neck = float(self.separation[self.patches > 0].max(initial=0.0))
        if neck > LARGE_STRAIN * period:
            out.append(
                f"necks are up to {neck:.3g} m long, {neck / period:.2g} of the period: {question}"
            )
        return out

    def fall_warnings(self) -> list[str]:
        """Return a sentence where the closing drop takes more than a hundredth off the loss."""
        if self.closing_drop >= -_FALL_SHARE * abs(self.lost):
            return []
        return [
            f"the drop at which the weight falls off is {1e3 * self.closing_drop:.3g} mJ/m², "
            "negative: the loss is less than that of the drops before; for the loss of a "
            "separation take a machine that turns at a preload, in place of a weight"
        ]

    def states_before_jumps(self) -> list[int]:
        """Return the index of the state before each jump; the next one is that after it."""
        return states_before_jumps(self.jumps, self.separation, self.contact_fraction)

    @property
    def audit_residual(self) -> float:
        """Work less energy that is lost and stored, relative to the work."""
        raise NotImplementedError

    @property
    def scale_of_errors(self) -> float:
        """Energy in J/m² with which audit residual and numerical error are compared."""
        raise NotImplementedError

    @property
    def warnings(self) -> tuple[str, ...]:
        """Reasons to doubt the loss or work, one sentence each; none for most paths."""
        found = self._warnings_of_way()
        slope = float(np.sqrt(self.problem.profile.m2))
        if slope > STEEP:
            found.append(
                f"the rms slope is {slope:.3g}: above {STEEP:g} linear elasticity itself is "
                f"doubtful, and with it the {self._result}"
            )
        if self.problem.work_of_adhesion == 0:
            return tuple(found)  # there is no loss to doubt
        found += self.strain_warnings()
        most, scale = getattr(self.method, "accuracy", _LARGE), self.scale_of_errors
        if abs(self.audit_residual) > most:
            found.append(
                f"the audit residual, {self.audit_residual:.2g}, is larger than {most:g}, the "
                "relative error allowed"
            )
        if self.loss_error > most * scale:
            found.append(
                f"the numerical error of the {self._result}, {self.loss_error:.2g} J/m² of "
                f"{scale:.3g} J/m², is larger than {most:g} of it, the relative error allowed"
            )
        found += self.range_warnings()
        alike = self.problem.equal_parts > 1 or self.problem.mirror_axes.size > 0
        if self.problem.pinning > 0 and alike and self.patches.max() > 1:
            found.append(
                "parts of the profile are alike, and with two works of adhesion it is not settled "
                f"at which separation one of equal patches recedes before the other: the "
                f"{self._result} may be wrong by a per cent; take a profile whose parts differ a "
                "little"
            )
        return tuple(found)

    def _warnings_of_way(self) -> list[str]:
        """Return the sentences on where the path turned and ended."""
        return self.fall_warnings()

    def __str__(self) -> str:
        """Summarise it for a terminal, with its warnings."""
        return "\n".join([self.summary(), *(f"WARNING     {text}" for text in self.warnings)])

    def summary(self) -> str:
        """Return the main numbers in a few lines for a terminal."""
        return "\n".join(f"{name:<12}{text}" for name, text in self.summary_rows())

    def summary_rows(self) -> list[tuple[str, str]]:
        """Return the main numbers, each with its name."""
        problem, profile, half_space = self.problem, self.problem.profile, self.problem.half_space
        present = np.flatnonzero(profile.coefficients)
        counts = Counter(jump.kind for jump in self.jumps)
        measure = "" if problem.measure == "arc" else f"{problem.measure} measure, "
        contact = (
            f"largest contact fraction {self.contact_fraction.max():.4g}, most patches "
            f"{self.patches.max()}"
        )
        energies = problem.full_contact_energy, problem.work_of_adhesion
        raced = f"{counted(self.races, 'jump')} raced, {self.energy_at_stake:.3g} J/m² at stake"
        rows = [
            (
                "profile",
                f"period {profile.period:.6g} m, harmonics {present[0]} to {present[-1]}, "
                f"h_rms {profile.h_rms:.4g} m, h_max {profile.h_max:.4g} m, m2 {profile.m2:.4g}",
            ),
            (
                "contact",
                f"E {half_space.young:.4g} Pa, nu {half_space.poisson:.3g}, "
                f"work of adhesion {problem.adhesion_text}",
            ),
            *self._rows_of_way(contact),
            ("friction", self.friction_summary()),
            ("sticking", sticking_text(*energies, self.largest_contact_fraction)),
            ("range", self.range_summary()),
            ("audit", self._audit_text()),
            ("error", f"{self.loss_error:.2g} J/m² (numerical); {raced}"),
            ("jumps", ", ".join(f"{n} {kind}" for kind, n in counts.most_common()) or "none"),
            *self._rows_of_end(),
            ("method", f"{self.method.name}, {measure}{self.seconds:.1f} s"),
        ]
        return [(name, text) for name, text in rows if text]

    def _rows_of_way(self, contact: str) -> list[tuple[str, str]]:
        """Return the way of a loop or path and what it lost; ``contact`` stands behind the way."""
        raise NotImplementedError

    def _rows_of_end(self) -> list[tuple[str, str]]:
        raise NotImplementedError

    def _audit_text(self) -> str:
        """Return the audit; without adhesion there is no loss that a residual could refer to."""
        friction = " and the friction between them" if self.problem.pinning > 0 else ""
        jumps = f"{counted(len(self.jumps), 'jump')}{friction}"
        drops = f"{self.loss_from_drops:.6g} J/m² in {jumps}"
        if self.problem.work_of_adhesion == 0:
            return f"{drops}; without adhesion nothing is lost"
        return f"{drops}, residual {self.audit_residual:.2e}"

    def _share_and_note(self, lost: float) -> tuple[str, str]:
        """Return the loss or work in works of adhesion, and its note, each to follow it."""
        share = in_works_of_adhesion(lost, self.problem.work_of_adhesion)
        return share, f"; {self.loss_note}" if self.loss_note else ""

    def friction_summary(self) -> str:
        """Return in one line what is friction of edges; empty with one work of adhesion."""
        gamma, pattern = self.problem.work_of_adhesion_open, self.problem.pattern
        if gamma is None:
            return ""
        return friction_text(gamma, self.lost, self.friction, varies=pattern is not None)

    def range_summary(self) -> str:
        """Return one line for a terminal on the ranges for which the zero-range limit holds."""
        interior = self.interior
        strength = self.problem.strength
        if math.isfinite(strength):
            largest = 0.0 if interior is None else interior.tension
            text = (
                f"adhesion of a range of {length_text(self.problem.attraction_range)}: surfaces "
                f"jump together from there on; largest tension inside patches "
                f"{stress_text(largest)}, strength {stress_text(strength)}"
            )
            if math.isinf(self.narrowest_length):
                return f"{text}; {counted(self.openings, 'opening')}, zones at edges are followed"
            zones = 100 * self.zone_error / (abs(self.lost) or 1.0)
            return (
                f"{text}; {outside_text(*self.outer_ranges)}; zones at edges, left out, change the "
                f"loss by about {float(f'{zones:.1g}'):g} %"
            )
        inside = "no tension inside patches"
        if interior is not None:
            inside = (
                f"tension inside patches of {stress_text(interior.tension)} on {interior.branch} "
                f"at Δ/h_max = {interior.penetration:.4g}"
            )
        if self.problem.work_of_adhesion == 0:
            return inside
        return limit_text(inside, self.valid_range, *self.outer_ranges)

    # ------------------------------------------------------------------ for tables and files

    def numbers(self) -> dict[str, Any]:
        """Return the single numbers of the problem and the result by name, in SI units.

        None stands for infinity, and for the stiffness of a fixed separation. With one work of
        adhesion ``work_of_adhesion_open`` is that one, and ``least_work_of_adhesion`` without a
        pattern; ``stripes`` and what belongs to them are None unless the pattern is one wave.
        ``pandas.DataFrame([loop.numbers() for loop in loops])`` compares loops.
        """
        problem, half_space = self.problem, self.problem.half_space
        own = (*self._numbers, "loss_from_drops", "audit_residual", "loss_error", "races")
        own = (*own, "friction", "energy_at_stake", "openings", "zone_error")
        more = ("largest_contact_fraction", "largest_interior_tension")
        values = {name: getattr(self, name) for name in (*own, *more)}
        gamma, pattern = problem.work_of_adhesion, problem.pattern
        waves = pattern.stripes if pattern is not None else (None, None, None)
        return {
            **{name: getattr(problem.profile, name) for name in _OF_PROFILE},
            "young": half_space.young,
            "poisson": half_space.poisson,
            "work_of_adhesion": gamma,
            "least_work_of_adhesion": problem.least_work_of_adhesion,
            "work_of_adhesion_open": problem.gamma_open,
            "stiffness": finite(problem.control.stiffness),
            "strength": finite(problem.strength),
            "adhesion_range": problem.attraction_range,
            **dict(zip(("stripes", "stripe_amplitude", "stripe_phase"), waves, strict=True)),
            "measure": problem.measure,
            "full_contact_energy": problem.full_contact_energy,
            "load_steps": self.load_steps,
            **values,
            "loss_over_work_of_adhesion": values["loss"] / gamma if gamma > 0 else None,
            **{name: finite(getattr(self, name)) for name in RANGES},
            "seconds": self.seconds,
            "method": self.method.name,
        }

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the values of every state by name, arrays of shape (states,) in SI units."""
        names: tuple[str, ...] = (
            *("branch", "load_step", "penetration", "separation", "mean_stress"),
            *("contact_fraction", "patches", "energy", "elastic_energy", "adhesion_energy"),
            *self._columns,
        )
        names += ("edge_friction",) if self.edge_friction is not None else ()
        return {name: getattr(self, name) for name in names}

    def jump_rows(self) -> list[dict[str, Any]]:
        """Return the jumps with their penetration Δ/h_max, a dictionary for each, in SI units."""
        penetration = self.problem.penetration
        return [asdict(jump) | {"penetration": penetration(jump.separation)} for jump in self.jumps]


def friction_text(
    work_of_adhesion_open: float,
    lost: float,
    friction: float,
    *,
    varies: bool = False,
    digits: int = 6,
) -> str:
    """Return in one line which part of a loss is friction of edges; values in J/m².

    ``varies``: whether the works of adhesion vary along the profile; ``digits``: of both parts.
    """
    mean = " in the mean" if varies else ""
    return (
        f"{friction:.{digits}g} J/m² at edges, which recede at {work_of_adhesion_open:.4g} "
        f"J/m²{mean}; {lost - friction:.{digits}g} J/m² lost by instability"
    )


def in_works_of_adhesion(loss: float, work_of_adhesion: float, digits: int = 4) -> str:
    """Return ", 0.31 γ", to follow a loss in J/m²; an empty text without adhesion."""
    return f", {loss / work_of_adhesion:.{digits}g} γ" if work_of_adhesion > 0 else ""


def sticking_text(
    full_contact_energy: float, work_of_adhesion: float, contact_fraction: float
) -> str:
    """Return a clause where adhesion makes the largest contact nearly full; energies in J/m²."""
    if full_contact_energy >= work_of_adhesion or contact_fraction < _NEARLY_FULL:
        return ""
    return (
        f"flat enough to stick: full contact costs {1e3 * full_contact_energy:.3g} mJ/m² of γ = "
        f"{1e3 * work_of_adhesion:.3g} mJ/m²; pressing harder hardly changes the loss"
    )


def path_fields(record: Record, started: float) -> tuple[dict[str, Any], Ledger]:
    """Return the fields of every path from its record, and its ledger.

    ``started`` is its first CPU time, in s.

    Raises
    ------
    PathError
        If a state without contact lies below s = h_max, where surfaces overlap. Not raised
        without adhesion, where methods may leave out patches that they do not resolve.
    """
    method, problem = record.method, record.problem
    report = method.report()  # of the path alone
    interior = interior_tension(method, record)
    separation, h_max = record.column("separation"), problem.profile.h_max
    patches = record.column("patches").astype(np.int64)
    lowest = float(separation[patches == 0].min(initial=math.inf))
    must_touch = not problem.control.is_load and problem.work_of_adhesion > 0
    if must_touch and lowest < h_max * (1 - _ROUNDING):
        raise PathError(
            f"the path is without contact at s = {lowest / h_max:.9g} h_max ({lowest:.9g} m), "
            "where surfaces overlap: there is no such state"
        )
    jumps = tuple(record.jumps)
    columns: dict[str, Any] = {name: record.column(name) for name in _ENTERED}
    # a law of one's own may pin edges, too
    if problem.pinning == 0 and not columns["edge_friction"].any():
        columns["edge_friction"] = None
    ledger = Ledger.of(problem, jumps, **columns)
    fields = columns | {
        "problem": problem,
        "branch": np.array(record.branches),
        "load_step": np.array(record.ends_load_step),
        "penetration": problem.penetration(separation),
        "patches": patches,
        "jumps": jumps,
        "loss_from_drops": ledger.loss,
        "loss_error": estimated_error(record.error, jumps, ledger.residual, problem),
        "seconds": process_time() - started,
        "method": report,
        "contact_states": tuple(record.states),
        "new_method": method.recipe,
        "interior": interior,
        "narrowest_length": math.inf if method.has_zones else narrowest_length(problem, record),
    }
    return fields, ledger


def with_turn_range(result: PathOrLoop, record: Record, started: float) -> PathOrLoop:
    """Return a result with its ``turn_range``, which is sought as far as the other ranges reach.

    It is zero where jumps lie nearer beyond a turn than their places are known: these may come
    before it. ``started`` is the first CPU time of the path, in s.
    """
    problem = result.problem
    step = problem.prescribed(0.0) - problem.prescribed(record.axis.step)
    if record.method.has_zones:
        return replace(result, turn_range=math.inf)
    found = turn_range(record.method, record, step, result.lost, result.least_range)
    # A jump that comes by δ too late changes the loss by δ times its change of the mean stress.
    at_jumps = np.diff(result.separation) == 0
    sizes = float(np.abs(np.diff(result.mean_stress))[at_jumps].sum())
    if problem.control.is_fixed and found * sizes < result.loss_error:
        found = 0.0
    return replace(result, turn_range=found, seconds=process_time() - started)
