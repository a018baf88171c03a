"""Plan the loops of an answer, estimate their cost, and suggest cheaper settings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adhesis.ensemble.errors import parameter
from adhesis.ensemble.quantities import duration, length_text
from adhesis.ensemble.run.launch import cores
from adhesis.ensemble.trace.loops import MAX_PENETRATION, Cycle, Run
from adhesis.ensemble.trace.prepare import Prepared
from adhesis.ensemble.trace.single_features import single_features_text
from adhesis.solver.checks import counted
from adhesis.solver.values import ByValue

# Longer profiles are compared at a coarser cut-off when a doubt is measured.
_MAX_WAVES_OF_VARIANTS, _LONGEST_CUT_OFF = 8000, 16
# A plan of more seconds gets hints, down to this number of waves.
_SECONDS_TO_HINT, _MIN_WAVES = 120.0, 50

# CPU seconds of a loop by `sharp`, 40 load steps: at least, for each wave, and for the patches by
# powers of their number and of that of the waves. Fitted to the 122 loops of eight traces, of 12 to
# 27,000 waves and 1 to 61 patches: right within a factor of 1.3 (rms), 3.3 at worst.
_LEAST_SECONDS, _SECONDS_OF_WAVE, _SECONDS_OF_PATCH = 0.05, 1.5e-4, 1.7e-3
_WAVES_POWER, _PATCHES_POWER = 0.24, 1.7
_LEVELS = 18  # penetrations at which crests are counted
TABLES = ("work of adhesion", "turning point")
"""Groups of the loops that fill the tables, and measure no doubt."""

_START = 2.0  # seconds for a process to start


@dataclass(frozen=True, eq=False, repr=False)
class Plan(ByValue):
    """Runs and expected cost."""

    runs: tuple[Run, ...]  # that of the answer first
    seconds: dict[str, float]  # expected CPU seconds by run
    # waves, patches: number of waves of the answer's loop, and expected number of patches
    waves: int
    patches: int
    processes: int
    wall: float  # expected wall seconds on this machine's cores
    hints: tuple[str, ...]

    @property
    def cores(self) -> str:
        """Number of cores in use, as a text: without processes, that of this one."""
        return counted(max(self.processes, 1), "core")

    @property
    def text(self) -> str:
        """Description of the plan in two or three lines."""
        lines = [
            f"plan        {self.waves} waves, about {counted(self.patches, 'patch')} at a time: "
            f"{len(self.runs)} loops, about {duration(sum(self.seconds.values()))} of CPU time, "
            f"{duration(self.wall)} on {self.cores} of a quiet machine"
        ]
        return "\n".join(lines + [f"hint        {hint}" for hint in self.hints])


def make_plan(
    prepared: Prepared, cycle: Cycle, *, quick: bool = False, processes: int | None = None
) -> Plan:
    """List the loops of an answer and estimate their cost; none is run.

    ``quick`` leaves out the tables against γ and turning point; without ``processes`` one a core, 0
    for this one alone.
    """
    processes = cores() if processes is None else processes
    profile, gamma, point = prepared.profile(), cycle.works_of_adhesion[0], cycle.turning_points[0]
    answer = Run("answer", profile, cycle, gamma, point)
    runs = (answer, *_doubts(prepared, answer), *([] if quick else _tables(answer)))
    seconds = {run.name: expected_seconds(run) for run in runs}
    wall = max(sum(seconds.values()) / max(processes, 1), max(seconds.values()))
    plan = Plan(
        runs=runs,
        seconds=seconds,
        waves=profile.highest_harmonic,
        patches=round(expected_patches(answer)),
        processes=processes,
        wall=wall + 2 * _START,
        hints=(),
    )
    return replace(plan, hints=_hints(prepared, plan, quick))


def _doubts(prepared: Prepared, answer: Run) -> list[Run]:
    """List a loop for each decision that could have been made otherwise."""
    cut, step = prepared.cut_off, prepared.step
    length = prepared.filled.size * step
    runs = []
    # On long traces the other doubts are measured with fewer waves, all else being equal.
    factor = 1.0
    while length / (factor * cut) > _MAX_WAVES_OF_VARIANTS and factor < _LONGEST_CUT_OFF:
        factor *= 2
    coarser: dict[str, Any] = {}
    if factor > 1:
        coarser = {"cut_off": factor * cut, "reference": f"cut-off × {factor:.3g}"}

    def add(
        name: str, group: str, description: str, *, reference: str = "answer", **changes: Any
    ) -> None:
        profile, cycle = prepared.profile(**changes), answer.cycle
        if cycle.pattern is not None:  # stripes keep their width where the period is another
            longer = profile.period / answer.profile.period
            cycle = replace(cycle, pattern=cycle.pattern.on_period(longer))
        run = replace(answer, name=name, group=group, description=description, changes=changes)
        runs.append(replace(run, profile=profile, cycle=cycle, reference=reference))

    for longer in (16.0, 8.0, 4.0, 2.0, math.sqrt(2.0), 1 / math.sqrt(2.0)):
        if longer * cut <= length / 4 if longer > 1 else longer * cut >= 2.5 * step:
            described = f"waves down to {length_text(longer * cut)}"
            add(f"cut-off × {longer:.3g}", "cut-off", described, cut_off=longer * cut)
    add("blend 10 %", "continuation", "end and beginning blended over a tenth", part=0.1, **coarser)
    for part in (0.05, 0.1):
        faded = f"both ends faded to the mean over {100 * part:.0f} %"
        name = f"taper {100 * part:.0f} %"
        add(name, "continuation", faded, continuation="taper", part=part, **coarser)
    degree = prepared.degree
    add(f"degree {degree + 1}", "form", "one degree more off", degree=degree + 1, **coarser)
    if degree > 1 and not prepared.form_is_sure:
        add(f"degree {degree - 1}", "form", "one degree less off", degree=degree - 1, **coarser)
    if prepared.features:
        bridged = f"{single_features_text(prepared.features)} bridged by straight lines"
        name = "without single features"
        add(name, "single features", bridged, without_features=True, **coarser)
    if prepared.spectrum.noise > 0:
        described = "white noise of the instrument's size added"
        for seed in (1, 2) if factor == 1 else (1,):
            add(f"noise {seed}", "noise", described, noise_seed=seed)
    return runs


def _tables(answer: Run) -> list[Run]:
    cycle = answer.cycle
    of_gamma = replace(answer, group="work of adhesion")
    of_turn = replace(answer, group="turning point")
    runs = []
    for gamma in cycle.works_of_adhesion[1:]:
        name, described = f"γ {gamma:g}", f"γ = {gamma:g} J/m²"
        runs.append(replace(of_gamma, name=name, description=described, work_of_adhesion=gamma))
    for point in cycle.turning_points[1:]:
        name, described = f"{cycle.turning.short} {point:g}", f"turning at {cycle.turn(point)}"
        runs.append(replace(of_turn, name=name, description=described, turning_point=point))
    return runs


# ---------------------------------------------------------------------- cost


def expected_patches(run: Run) -> float:
    """Estimate the largest number of patches at a time of one loop.

    By adhesion alone, waves up to the mean one stay apart as far as the energy of full contact,
    E*/2 Σ q|a|² per area, exceeds the work of adhesion; the exponent is fitted to loops of
    self-affine profiles. There are no more than crests that a plane cuts at a time on its way to
    the turning point; where its separation is not known, those of the usual one count.
    """
    profile, cycle = run.profile, run.cycle
    a = np.abs(profile.coefficients) ** 2
    m = np.arange(a.size)
    full = 0.5 * cycle.half_space.modulus * float(np.sum(m * profile.q0 * a))
    longest = float(np.sum(m * a) / np.sum(a))
    ratio = max(run.work_of_adhesion / full, 1e-3)
    by_adhesion = np.clip(1.2 * longest * ratio**-0.7, 1.0, 4 * profile.highest_harmonic)
    is_known = cycle.control.is_fixed and not cycle.at_preload
    penetration = run.turning_point if is_known else MAX_PENETRATION
    heights = profile.heights(max(4 * profile.highest_harmonic, 64))
    crests = 1
    for share in np.linspace(0.0, 1.0, _LEVELS + 1)[1:]:
        above = heights > float(heights.max()) * (1 - share * penetration)
        crests = max(crests, int(np.count_nonzero(above & ~np.roll(above, 1))))
    return min(float(by_adhesion), float(crests))


def expected_seconds(run: Run) -> float:
    """Estimate the CPU seconds of one loop."""
    waves, patches = float(run.profile.highest_harmonic), expected_patches(run)
    of_patches = _SECONDS_OF_PATCH * waves**_WAVES_POWER * patches**_PATCHES_POWER
    steps = max(run.cycle.load_steps / 40, 0.5)
    return float(_LEAST_SECONDS + _SECONDS_OF_WAVE * waves + of_patches) * steps


def _hints(prepared: Prepared, plan: Plan, quick: bool) -> tuple[str, ...]:
    if plan.wall < _SECONDS_TO_HINT:
        return ()
    answer, hints = plan.runs[0], []
    factor = 2.0
    while plan.waves / factor >= _MIN_WAVES:
        coarser = replace(answer, profile=prepared.profile(cut_off=factor * prepared.cut_off))
        wall = plan.wall * expected_seconds(coarser) / plan.seconds["answer"]
        if wall < _SECONDS_TO_HINT / 2 or plan.waves / factor < 2 * _MIN_WAVES:
            hints.append(
                f"{parameter('cut_off')} {factor * prepared.cut_off * 1e6:.2g}um "
                f"({plan.waves / factor:.0f} waves) would take about {duration(wall)}"
            )
            break
        factor *= 2
    if not quick:
        tables = (plan.seconds[run.name] for run in plan.runs if run.group in TABLES)
        saved = sum(tables) / max(plan.processes, 1)
        hints.append(
            f"{parameter('quick')} leaves the tables out and saves about {duration(saved)}"
        )
    return tuple(hints)
