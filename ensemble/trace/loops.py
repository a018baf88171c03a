"""The loops of a trace: what each is, and how they run side by side, by campaigns' hand-out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from adhesis.ensemble.quantities import drive_text, duration, stress_text
from adhesis.ensemble.run.dispatch import Channel, Limits, Master, Outcome, OwnWorker, StopCheck
from adhesis.ensemble.run.processes import Processes
from adhesis.ensemble.run.schedule import Schedule
from adhesis.solver.loading.cycle import turn_arguments
from adhesis.solver.loading.loop import run_loop
from adhesis.solver.loading.path_record import Progress
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.pattern import AdhesionPattern
from adhesis.solver.model.problem import Measure, Problem
from adhesis.solver.model.profile import Profile
from adhesis.solver.registry import MethodName, make_method

Result = dict[str, Any]
Watch = Callable[["Loops"], None]

MAX_PENETRATION = 0.9
"""Turning point Δ/h_max where none is given."""
_REPORT_INTERVAL = 1.0  # s


@dataclass(frozen=True)
class Turning:
    """What the turning points of a cycle are."""

    parameter: str
    sign: str  # with a unit if they have one
    short: str
    symbol: str  # in figures
    has_unit: bool = False  # whether they are stresses in Pa


_PRELOAD = Turning("preload", "preload, Pa", "preload", "preload", has_unit=True)
_LOAD = Turning("max_stress", "p̄, Pa", "p̄", r"$\bar p$", has_unit=True)
_FIXED = Turning("max_penetration", "Δ/h_max", "Δ", r"$\Delta/h_{\max}$")
_FAR_SIDE = Turning("max_penetration", "u_tot/h_max", "u", r"$u_\mathrm{tot}/h_{\max}$")


@dataclass(frozen=True)
class Cycle:
    """Contact and cycle of loops in SI units; an answer has the first value of each tuple.

    Turning points are Δ/h_max, u_tot/h_max of a stiffness, or p̄ in Pa under a load; preloads in Pa
    if ``at_preload``, and ``latest`` is where a loop turns that does not reach its preload.
    The waves of the pattern are counted in the answer's period.
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
    pattern: AdhesionPattern | None = None

    @property
    def turning(self) -> Turning:
        """Return what the turning points are."""
        if self.at_preload:
            return _PRELOAD
        if self.control.is_load:
            return _LOAD
        return _FIXED if self.control.is_fixed else _FAR_SIDE

    def turn(self, point: float) -> str:
        """Describe a turning point: "Δ/h_max = 0.9"."""
        is_fixed = self.control.is_fixed
        held = f"a stiffness of {self.control.stiffness:.4g} Pa/m"
        if self.at_preload:
            held = "a fixed separation" if is_fixed else held
            return f"a preload of {stress_text(point, 4)} at {held}"
        if self.control.is_load:
            return f"p̄ = {stress_text(point, 4)}"
        return f"{self.turning.sign} = {point:g}" + ("" if is_fixed else f" of {held}")

    def arguments(self, turns: object) -> dict[str, Any]:
        """Return the arguments of ``run_loop`` or ``run_loops`` for some of the turning points."""
        return turn_arguments(self.control, turns, self.at_preload, self.latest)

    def problem(self, profile: Profile, work_of_adhesion: float) -> Problem:
        """Make the problem of a profile and a work of adhesion in J/m² (TypeError, ValueError).

        The work of adhesion of receding edges is given for the answer; elsewhere both keep their
        ratio.
        """
        first, opening = self.works_of_adhesion[0], self.work_of_adhesion_open
        if opening is not None and work_of_adhesion != first:
            opening = opening / first * work_of_adhesion
        return Problem(
            *(profile, self.half_space, work_of_adhesion, self.control),
            strength=math.inf if self.strength is None else self.strength,
            adhesion_range=self.adhesion_range,
            work_of_adhesion_open=opening,
            measure=self.measure,
            pattern=self.pattern,
        )


@dataclass(frozen=True)
class Run:
    """Loop of the answer, or one that differs from that of ``reference`` in one decision.

    ``group`` is the doubt or the table to which it belongs; ``changes`` are those of its profile,
    as :meth:`adhesis.ensemble.trace.prepare.Prepared.profile` takes them. Of the cycle it has its
    own work of adhesion and turning point.
    """

    name: str
    profile: Profile
    cycle: Cycle
    work_of_adhesion: float
    turning_point: float
    group: str = "answer"
    description: str = "the loop"
    changes: dict[str, Any] = field(default_factory=dict)
    reference: str = "answer"


def compute(run: Run, progress: Progress | None = None) -> Result:
    """Run one loop and return its numbers, and its states as lists."""
    cycle = run.cycle
    problem = cycle.problem(run.profile, run.work_of_adhesion)
    method = make_method(cycle.method, problem, accuracy=cycle.accuracy)
    turn = cycle.arguments(run.turning_point)
    loop = run_loop(method, load_steps=cycle.load_steps, progress=progress, **turn)
    small, large = loop.drops(small_scale=True), loop.drops(small_scale=False)
    return loop.numbers() | {
        "loss": loop.loss if run.work_of_adhesion > 0 else 0.0,  # but for rounding
        "preload_warnings": loop.preload_warnings,
        "warnings": list(loop.warnings),
        "loss_note": loop.loss_note,
        "range_summary": loop.range_summary(),
        "contact_fraction": loop.largest_contact_fraction,
        "patches": int(loop.patches.max()),
        "jumps": len(loop.jumps),
        "small_scale_share": small / (small + large) if small + large > 0 else 0.0,
        "waves": run.profile.highest_harmonic,
        "states": {name: values.tolist() for name, values in loop.columns().items()},
    }


def _compute(runs: Sequence[Run], task: int, check: StopCheck) -> Result:
    return compute(runs[task], lambda branch, drive, _: check((branch, drive)))


class Loops:
    """Loops of a plan in processes, the longest first; 0 processes run them in this one.

    ``seconds`` are expected, by name. ``done`` holds the result by name, the error text of a failed
    loop.
    """

    def __init__(
        self, runs: Sequence[Run], processes: int, seconds: Mapping[str, float] | None = None
    ) -> None:
        self._runs = tuple(runs)
        self.count = len(self._runs)
        self.processes = min(processes, self.count)
        self.done: dict[str, Result | str] = {}
        expected = [(seconds or {}).get(run.name, 1.0) for run in self._runs]
        priors: dict[Hashable, float] = dict(enumerate(expected))
        tasks = range(self.count)
        self._schedule = Schedule(tasks, dict(enumerate(tasks)), priors, dict.fromkeys(tasks, 0))
        self._notes: Mapping[int, Any] = {}  # of the loops that run, as the master has them

    @property
    def seconds_left(self) -> float | None:
        """Estimated time to the end, in s; None if nothing is known yet."""
        return self._schedule.seconds_left(list(self._notes), max(self.processes, 1))

    @property
    def running(self) -> dict[str, tuple[str, float]]:
        """By name: the branch and prescribed value reached."""
        return {self._runs[k].name: note or ("loading", 0.0) for k, note in self._notes.items()}

    def __str__(self) -> str:
        """Return how far they are, as a line."""
        load = any(run.cycle.control.is_load for run in self._runs)
        running = ", ".join(
            f"{name} ({branch}, {drive_text(drive, load)})"
            for name, (branch, drive) in self.running.items()
        )
        parts = [f"{len(self.done)} of {self.count} loops"]
        parts += [f"running {running}"] if running else []
        left = self.seconds_left if len(self.done) < self.count else None
        parts += [] if left is None else [f"about {duration(left)} left"]
        return "; ".join(parts)

    def run(
        self, watch: Watch | None = None, every: float = _REPORT_INTERVAL
    ) -> dict[str, Result | str]:
        """Run all loops; ``watch`` is called at this interval (s), and when a loop is done."""
        computing, last = partial(_compute, self._runs), -math.inf

        def tick() -> None:
            nonlocal last
            if watch is not None and time.monotonic() - last >= every:
                last = time.monotonic()
                watch(self)

        def collect(outcome: Outcome) -> None:
            nonlocal last
            name = self._runs[outcome.task].name
            # the solver's own errors are written for users, without their class
            failure = (outcome.error or "").removeprefix("PathError: ")
            self.done[name] = failure or outcome.result
            last = -math.inf
            tick()

        limits = Limits(report_interval=every)
        with ExitStack() as stack:
            channel: Channel
            if self.processes == 0:
                channel = OwnWorker(computing, limits)
            else:
                channel = stack.enter_context(Processes(self.processes, computing, limits))
            master = Master(channel, self._schedule, collect, limits, tick)
            self._notes = master.notes
            master.run()
        return self.done
