"""Compute one loop of a trace: a function of its job, returning its numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from adhesis.ensemble.quantities import stress_text
from adhesis.solver.loading.cycle import turn_arguments
from adhesis.solver.loading.loop import run_loop
from adhesis.solver.method import Branch, ContactState
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Measure, Problem, strength_of
from adhesis.solver.model.profile import Profile
from adhesis.solver.registry import MethodName, make_method


@dataclass(frozen=True)
class Cycle:
    """Contact and cycle in SI units; the answer has the first value of each tuple.

    Turning points are Δ/h_max, u_tot/h_max of a stiffness, or p̄ in Pa under a load; preloads in Pa
    if ``at_preload``, and ``latest`` is where a loop turns that does not reach its preload.
    """

    half_space: HalfSpace
    works_of_adhesion: tuple[float, ...]
    turning_points: tuple[float, ...]
    load_steps: int = 40
    method: MethodName = "auto"
    accuracy: float = 1e-3
    control: Control = field(default_factory=Control)
    adhesion_range: float | None = None
    strength: float | None = None
    at_preload: bool = False
    latest: float | None = None
    work_of_adhesion_open: float | None = None
    measure: Measure = "arc"

    @property
    def turn_sign(self) -> str:
        """Return the sign of the turning points, with their unit if they have one."""
        if self.at_preload:
            return "preload, Pa"
        if self.control.is_load:
            return "p̄, Pa"
        return "Δ/h_max" if self.control.is_fixed else "u_tot/h_max"

    def turn(self, point: float) -> str:
        """Describe a turning point: "Δ/h_max = 0.9"."""
        if self.at_preload:
            held = "a fixed separation"
            if not self.control.is_fixed:
                held = f"a stiffness of {self.control.stiffness:.4g} Pa/m"
            return f"a preload of {stress_text(point, 4)} at {held}"
        if self.control.is_load:
            return f"p̄ = {stress_text(point, 4)}"
        if self.control.is_fixed:
            return f"Δ/h_max = {point:g}"
        return f"u_tot/h_max = {point:g} of a stiffness of {self.control.stiffness:.4g} Pa/m"

    def strength_at(self, work_of_adhesion: float) -> float:
        """Return the strength of the interface in Pa at a work of adhesion in J/m²."""
        return strength_of(work_of_adhesion, self.adhesion_range, self.strength)

    def open_at(self, work_of_adhesion: float) -> float | None:
        """Return the work of adhesion of receding edges at one of advancing edges, in J/m².

        It is given for that of the answer; at others both keep their ratio.
        """
        first, given = self.works_of_adhesion[0], self.work_of_adhesion_open
        if given is None or work_of_adhesion == first:
            return given
        return given / first * work_of_adhesion


@dataclass(frozen=True)
class Job:
    """Arguments of one loop: of the cycle, its own work of adhesion and turning point."""

    name: str
    profile: Profile
    cycle: Cycle
    work_of_adhesion: float
    turning_point: float


def run(job: Job, report: Callable[[tuple[str, float]], None] | None = None) -> dict[str, Any]:
    """Run one loop and return its numbers, and its states as lists.

    ``report`` is called after each load step with the branch and the prescribed value that is
    reached.
    """

    def progress(branch: Branch, penetration: float, state: ContactState) -> None:
        if report is not None:
            report((branch, penetration))

    profile, cycle, gamma = job.profile, job.cycle, job.work_of_adhesion
    problem = Problem(
        profile, cycle.half_space, gamma, cycle.control, strength=cycle.strength_at(gamma),
        work_of_adhesion_open=cycle.open_at(gamma), measure=cycle.measure,
    )  # fmt: skip
    method = make_method(cycle.method, problem, accuracy=cycle.accuracy)
    turn = turn_arguments(cycle.control, job.turning_point, cycle.at_preload, cycle.latest)
    loop = run_loop(method, load_steps=cycle.load_steps, progress=progress, **turn)
    drops = loop.loss_from_drops - loop.closing_drop
    return loop.numbers() | {
        "range_warnings": loop.range_warnings(),
        "strain_warnings": loop.strain_warnings(),
        "preload_warnings": loop.preload_warnings,
        "fall_warnings": loop.fall_warnings(),
        "loss_note": loop.loss_note,
        "contact_fraction": loop.largest_contact_fraction,
        "patches": int(loop.patches.max()),
        "jumps": len(loop.jumps),
        "small_scale_share": loop.drops(small_scale=True) / drops if drops > 0 else 0.0,
        "waves": profile.highest_harmonic,
        "states": {name: values.tolist() for name, values in loop.columns().items()},
    }
