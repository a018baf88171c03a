"""The answer: loss, pull-off and contact of a trace, and how far each is in doubt."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from adhesis.ensemble.errors import parameter
from adhesis.ensemble.files import check_output_folder, staged_folder, write_json
from adhesis.ensemble.quantities import length_text, with_error, with_units
from adhesis.ensemble.reporter import bar
from adhesis.ensemble.run.dispatch import Unresponsive
from adhesis.ensemble.trace.loops import MAX_PENETRATION, Cycle, Loops, Result, Run, Watch
from adhesis.ensemble.trace.prepare import Prepared
from adhesis.ensemble.trace.variants import TABLES, Plan, make_plan
from adhesis.solver import checks
from adhesis.solver.loading.cycle import check_cycle, check_preload, turning_of
from adhesis.solver.loading.zero_range import RANGES, range_warnings
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.pattern import AdhesionPattern
from adhesis.solver.model.problem import Measure
from adhesis.solver.registry import METHOD_NAMES, MethodName, make_method
from adhesis.solver.values import ByValue

FIGURES = {
    "trace": "The trace, as measured and as used",
    "spectrum": "Its power spectrum",
    "loop": "The loop",
    "cut-off": "Loss against the shortest wave kept",
    "tables": "Against work of adhesion and turning point",
}
"""Title of each figure of the page by the stem of its files."""
FIGURE_FILES = tuple(f"{name}.{suffix}" for name in FIGURES for suffix in ("png", "pdf"))
FILES = ("trace.json", "trace.html", "trace.md", *FIGURE_FILES)

QUANTITIES = ("loss", "pull_off_stress", "contact_fraction")
"""Numbers of the answer that have doubts, in J/m², in Pa, and dimensionless."""

# A doubt counts with the root mean square change of its variants; the interval is so many times
# the root of their sum of squares. Measured on profiles of known loss: docs/measured-profile.md.
COVERAGE = 2.0
# Never more certain than this: scatter between traces of one surface is not even looked at.
LEAST = 0.02

_NOT_CONVERGED = 0.10
_PROCESSES = checks.Bounds(0, 4096, whole=True)
DOUBTS = {
    "cut-off": "the shortest wave kept",
    "continuation": "how the period is closed",
    "form": "what is form and what roughness",
    "noise": "noise of the instrument",
}
OF_MODEL = {"numerics": "of the loop itself", "zones": "cohesive zones at edges, left out"}

_REMEDIES = {
    "cut-off": "resolve shorter waves",
    "continuation": "measure a longer trace, or several",
    "form": "measure a longer trace, or give the degree of the form",
    "noise": "average several scans",
    "numerics": "ask for a better accuracy",
    "zones": "no method follows zones at edges, so take a shorter range if that may be",
}
# What makes shorter waves known, by what limits the cut-off.
_SHORTER_WAVES = {
    "noise": "the noise of the instrument hides shorter waves: average several scans",
    "step": "a finer step would resolve shorter waves",
    "tip": "a sharper tip would resolve shorter waves",
    "given": "the trace holds shorter waves than the cut-off that was given",
}
# One patch that carries all contact is that of a single crest up to this share of the period.
_ONE_PATCH = 0.25
# Numbers of the document by their names: of the trace, of the answer's loop, of all loops alike.
_READ = ("points", "step", "length", "height_range", "drop_outs", "tip_radius")
_CONTACT = (
    *("young", "poisson", "work_of_adhesion", "work_of_adhesion_open", "measure"),
    *("stiffness", "strength", "adhesion_range", "zone_error"),
    *("least_work_of_adhesion", "stripes", "stripe_amplitude", "stripe_phase"),
)
_OF_ALL_LOOPS = (*RANGES, "largest_interior_tension")
# The longest cut-offs are drawn, and no doubts.
_FOR_THE_FIGURE = ("cut-off × 16", "cut-off × 8", "cut-off × 4", "cut-off × 2")

Several = float | Sequence[float]


class NoAnswer(RuntimeError):
    """The loop of the answer itself could not be run to its end."""


@dataclass(frozen=True)
class Uncertain:
    """A number of the answer.

    Attributes
    ----------
    value : float
        In the unit of :data:`QUANTITIES`.
    uncertainty : float
        Half-width of the interval, in the same unit.
    doubts : dict
        Standard uncertainty by doubt, relative.
    """

    value: float
    uncertainty: float
    doubts: dict[str, float]

    @property
    def relative(self) -> float:
        """Half-width of the interval over the value."""
        return self.uncertainty / abs(self.value) if self.value else 0.0


def _least(name: str, none: str = "") -> Any:
    """Return a property of an answer: the least of a range of adhesion in m."""

    def least(answer: Answer) -> float | None:
        found = (one[name] for one in answer._alike())
        return min((value for value in found if value is not None), default=None)

    none = f"; None{none}" if none else ""
    return property(least, doc=f"Least ``{name}`` in m of the answer's loop and variants{none}.")


def _views() -> Any:
    """Return the module that shows answers: it imports this one, and loads matplotlib."""
    return import_module("adhesis.ensemble.trace.trace_page")


@dataclass(frozen=True, eq=False, repr=False)
class Answer(ByValue):
    """Loss, pull-off stress and contact fraction of a trace, with their doubts.

    Attributes
    ----------
    loss, pull_off_stress, contact_fraction : Uncertain
    results : dict
        Numbers of each loop by name (:func:`adhesis.ensemble.trace.loops.compute`); a text if it
        failed.
    warnings : tuple of str
    seconds : float
        Wall time.
    """

    prepared: Prepared
    cycle: Cycle
    plan: Plan
    results: dict[str, Result | str]
    loss: Uncertain
    pull_off_stress: Uncertain
    contact_fraction: Uncertain
    warnings: tuple[str, ...]
    seconds: float = field(compare=False)

    def __repr__(self) -> str:
        """One line: the loss with its uncertainty, and the warnings counted."""
        return (
            f"Answer(loss={with_error(self.loss.value, self.loss.uncertainty)} J/m², "
            f"{checks.counted(len(self.plan.runs), 'loop')}, "
            f"{checks.counted(len(self.warnings), 'warning')})"
        )

    def __str__(self) -> str:
        """Summarise the answer for a terminal: loss, pull-off, contact, doubts, warnings."""
        return str(_views().summary(self))

    def _repr_html_(self) -> str:
        """Return the main numbers and the figure of the loop, for notebooks."""
        return str(_views().notebook_page(self))

    def page(self, folder: str | os.PathLike[str]) -> Path:
        """Write what ``adhesis trace --to`` writes: the page, its figures, and every number.

        Parameters
        ----------
        folder : path
            For ``trace.html`` (which needs no other file), ``trace.md``, ``trace.json`` and the
            figures; it is made if it is not there.

        Returns
        -------
        path
            That of ``trace.html``.

        Raises
        ------
        OSError
            If a file cannot be written.
        TypeError
            If ``folder`` is no path.
        """
        path = checks.path("folder", folder)
        check_output_folder("folder", path, (), {})
        with staged_folder(path, FIGURE_FILES) as staged:
            _views().write_page(self, staged)
            write_json(staged / "trace.json", document(self))
        return path / "trace.html"

    def to_dataframe(self) -> Any:
        """Return the numbers of every loop, that of the answer and the others.

        Returns
        -------
        pandas.DataFrame
            A row for each loop; ``group`` is the doubt or the table that it belongs to.
            ``attrs["units"]`` holds the unit of every column.
        """
        import pandas as pd

        rows = pd.DataFrame(run_rows(self)).rename(columns={"said": "description"})
        rows = rows.drop(columns=["preload_warnings", "warnings", "failed"], errors="ignore")
        return with_units(rows, self.cycle.control.is_load)

    def result(self, name: str) -> Result | None:
        """Numbers of a loop, or None if it failed or was not run."""
        found = self.results.get(name)
        return found if isinstance(found, dict) else None

    @property
    def main(self) -> Result:
        """Numbers of the answer's own loop."""
        found = self.result("answer")
        assert found is not None
        return found

    valid_range = _least("valid_range", " without tension inside patches (docs/zero-range.md)")
    edge_range = _least("edge_range")
    touch_range = _least("touch_range", " without touch")
    turn_range = _least("turn_range", ", too, if it is longer than the other three")

    @property
    def largest_interior_tension(self) -> float:
        """Largest tension inside patches, of the answer's loop and its variants, in Pa."""
        return float(max(one["largest_interior_tension"] for one in self._alike()))

    def _alike(self) -> list[Result]:
        """Numbers of the loops whose material and turning point are the answer's."""
        found = (self.result(run.name) for run in self.plan.runs if run.group not in TABLES)
        return [one for one in found if one is not None]

    @property
    def largest_changes(self) -> list[tuple[Run, float]]:
        """The decision about the trace that changes the loss most, as its loop and a factor.

        That is its loss over that of the loop with which it is compared; 0 if it loses nothing. If
        it is a longer cut-off, the one of the other decisions that changes most follows.
        """
        changes = [
            (run, max(1 + change, 0.0))
            for run in self.plan.runs
            if run.group not in ("answer", *TABLES)
            if (change := self.change(run.name)) is not None
        ]
        changes.sort(key=lambda change: min(change[1], 1 / (change[1] or math.inf)))
        others = [change for change in changes[1:] if change[0].group != "cut-off"]
        is_cut_off = bool(changes) and changes[0][0].group == "cut-off"
        return changes[:1] + (others[:1] if is_cut_off else [])

    def group(self, name: str) -> list[tuple[Run, Result]]:
        """Loops of one doubt or table that came to their end, and their numbers."""
        found = ((run, self.result(run.name)) for run in self.plan.runs if run.group == name)
        return [(run, numbers) for run, numbers in found if numbers is not None]

    @property
    def works_of_adhesion(self) -> list[tuple[float, Result]]:
        """Works of adhesion in J/m², ascending, and the numbers of their loops."""
        runs = self.group("answer") + self.group("work of adhesion")
        return sorted(((run.work_of_adhesion, r) for run, r in runs), key=itemgetter(0))

    @property
    def turning_points(self) -> list[tuple[float, Result]]:
        """Turning points, ascending, and the numbers of their loops."""
        runs = self.group("answer") + self.group("turning point")
        return sorted(((run.turning_point, r) for run, r in runs), key=itemgetter(0))

    def change(self, name: str, quantity: str = "loss") -> float | None:
        """Relative change of a quantity in one loop against the loop that it is compared with."""
        run = next((run for run in self.plan.runs if run.name == name), None)
        found, reference = self.result(name), self.result(run.reference) if run else None
        if found is None or reference is None or reference[quantity] == 0:
            return None
        return float(found[quantity] / reference[quantity] - 1)


def loss_of_trace(
    prepared: Prepared,
    *,
    half_space: HalfSpace,
    work_of_adhesion: Several,
    max_penetration: Several | None = None,
    max_stress: Several | None = None,
    preload: Several | None = None,
    control: Control | None = None,
    load_steps: int = 40,
    method: MethodName = "auto",
    accuracy: float = 1e-3,
    adhesion_range: float | None = None,
    strength: float | None = None,
    work_of_adhesion_open: float | None = None,
    measure: Measure = "arc",
    pattern: AdhesionPattern | None = None,
    quick: bool = False,
    processes: int | None = None,
    progress: bool = False,
    watch: Watch | None = None,
) -> Answer:
    """Run the loop of a prepared trace and its variants on the cores at hand.

    Parameters
    ----------
    prepared : Prepared
    half_space : HalfSpace
    work_of_adhesion : float or several
        γ in J/m²; the first is the answer's, the others fill its table (without others, half and
        twice as much).
    max_penetration : float or several, optional
        Turning points Δ/h_max in the same way (without others, one and two thirds); u_tot/h_max
        if the control is a stiffness. 0.9 by default.
    max_stress : float or several, optional
        Instead, under a load: turning points p̄ in Pa.
    preload : float or several, optional
        Instead, of a machine: p̄ in Pa at which loops turn (:func:`adhesis.run_loop`).
        ``max_penetration`` is then one number, where they turn at the latest.
    control : Control, optional
        What is prescribed along the path; without it the separation.
    load_steps : int
        Of the loading branch of each loop.
    method : {"auto", "sharp", "grid", "zones"}
    accuracy : float
        Wanted relative error of the loss of each loop.
    adhesion_range, strength : float, optional
        Range δ of adhesion in m, or instead the strength γ/δ in Pa (:class:`~adhesis.Problem`).
    work_of_adhesion_open : float, optional
        Work of adhesion in J/m² where an edge recedes, beside a single γ; in the table of works of
        adhesion both keep their ratio.
    measure : {"arc", "flat"}
        Whether adhesion acts on the length of the profile or on its projection.
    pattern : AdhesionPattern, optional
        Variation of γ over the period of the trace, from its first point on
        (:func:`adhesis.stripes`); where a variant has another period, its waves keep their lengths.
    quick : bool
        Without the two tables.
    processes : int, optional
        Side by side; without it one for each core, 0 for none beside this one.
    progress : bool
        Whether a line on stderr, anew from time to time, shows how many of the loops are done,
        which run, and how long the others will take.
    watch : callable, optional
        Called with the :class:`~adhesis.ensemble.trace.loops.Loops` about once a second.

    Raises
    ------
    ValueError
        If a value breaks the solver's rules.
    TypeError
        If ``prepared`` is no Prepared, or a value of the wrong type.
    NoAnswer
        If the loop itself failed; a failed variant is a warning.

    References
    ----------
    docs/measured-profile.md, "The answer and its doubts"

    Examples
    --------
    >>> from adhesis import HalfSpace, Trace, loss_of_trace, prepare_trace, single_wave
    >>> prepared = prepare_trace(Trace(single_wave(1e-6, 1e-3).heights(200), 5e-6), cut_off=4e-4)
    >>> given = {"half_space": HalfSpace(1e6, 0.5), "work_of_adhesion": 0.02, "load_steps": 3}
    >>> answer = loss_of_trace(prepared, **given, quick=True, processes=0)
    >>> round(answer.main["loss_from_drops"] / answer.loss.value, 3)  # jumps lose all of it
    1.0
    """
    control = Control() if control is None else control
    checks.instance("control", control, Control, "Control(stiffness), for a load Control(0)")
    turns: Any = preload
    latest = None
    if preload is None:
        if max_penetration is None and max_stress is None and not control.is_load:
            max_penetration = MAX_PENETRATION
        turns = turning_of(control, max_penetration, max_stress)
    elif max_stress is not None:
        raise ValueError(
            "preload and max_stress are given: a machine turns at a preload, a weight "
            "(control=Control(0)) at max_stress"
        )
    elif max_penetration is not None:
        latest = checks.real("max_penetration", max_penetration)
    cycle = make_cycle(
        half_space, work_of_adhesion, turns, load_steps, method, accuracy, control,
        adhesion_range, strength, preload is not None, latest, work_of_adhesion_open, measure,
        pattern,
    )  # fmt: skip
    check(prepared, cycle)
    checks.flag("quick", quick)
    checks.function("watch", watch)
    if processes is not None:
        processes = checks.whole("processes", processes, _PROCESSES)
    plan = make_plan(prepared, cycle, quick=quick, processes=processes)
    return run_plan(prepared, cycle, plan, watch, checks.flag("progress", progress))


def make_cycle(*settings: Any, **named: Any) -> Cycle:
    """Make contact and cycle, with the values of both tables (TypeError, ValueError).

    The settings are the fields of a Cycle; works of adhesion and turning points may be numbers. A
    single γ is completed by half and twice of it, a single turning point by one and two thirds.
    """
    cycle = Cycle(*settings, **named)
    given = _several("work_of_adhesion", cycle.works_of_adhesion)
    checks.choice("method", cycle.method, METHOD_NAMES)
    checks.real("accuracy", cycle.accuracy, checks.ACCURACY)
    if cycle.work_of_adhesion_open is not None and len(given) > 1:
        raise ValueError(
            f"work_of_adhesion_open is {cycle.work_of_adhesion_open!r} beside {len(given)} works "
            "of adhesion: give one of each (in the table both keep their ratio)"
        )
    control, turning = cycle.control, cycle.turning.parameter
    gammas, turns = given, _several(turning, cycle.turning_points)
    if len(gammas) == 1 and 0 < gammas[0] < np.inf:
        gammas = (gammas[0], gammas[0] / 2, gammas[0] * 2)
    if len(turns) == 1:
        turns = (turns[0], *(float(f"{share * turns[0]:.6g}") for share in (1 / 3, 2 / 3)))
    for point in turns:
        if cycle.at_preload:
            check_preload(point, control)
            point = checks.FULL_PENETRATION if cycle.latest is None else cycle.latest
        check_cycle(point, cycle.load_steps, control)
    for name, values in (("work_of_adhesion", gammas), (turning, turns)):
        if not values:
            raise ValueError(f"{name} is empty: it must hold one number at least")
        if len(set(values)) < len(values):
            raise ValueError(f"{name} is {list(values)}: its values must differ")
    return replace(cycle, works_of_adhesion=gammas, turning_points=turns)


def check(prepared: Prepared, cycle: Cycle) -> None:
    """Refuse a prepared trace that the solver would refuse, before any work."""
    checks.instance("prepared", prepared, Prepared, "prepare_trace(read_trace(source))")
    profile = prepared.profile()
    for gamma in cycle.works_of_adhesion:
        make_method(cycle.method, cycle.problem(profile, gamma), accuracy=cycle.accuracy)


def run_plan(
    prepared: Prepared,
    cycle: Cycle,
    plan: Plan,
    watch: Watch | None = None,
    progress: bool = False,
) -> Answer:
    """Run a plan; see :func:`loss_of_trace`."""
    started = time.monotonic()
    try:
        with bar("loops") if progress else nullcontext() as show:

            def look(loops: Loops) -> None:
                if show is not None:
                    show(None, None, f"{loops}")
                if watch is not None:
                    watch(loops)

            results = Loops(plan.runs, plan.processes, plan.seconds).run(look)
    except Unresponsive as error:  # a process of a loop hangs
        raise NoAnswer(f"the loops could not be run to their end: {error}") from error
    main = results.get("answer")
    if not isinstance(main, dict):
        raise NoAnswer(f"the loop could not be run to its end: {main}")
    bare = {name: Uncertain(float(main[name]), 0.0, {}) for name in QUANTITIES}
    draft = Answer(prepared, cycle, plan, results, warnings=(), seconds=0.0, **bare)
    found: dict[str, Any] = {name: _quantity(draft, name) for name in QUANTITIES}
    warnings = (*prepared.warnings, *_warnings(draft, found["loss"]))
    return replace(draft, warnings=warnings, seconds=time.monotonic() - started, **found)


def _several(name: str, value: Several) -> tuple[float, ...]:
    """Return one number as a row of one; its bounds are checked later."""
    if checks.number_of(value) is not None:
        return (checks.real(name, value),)
    return tuple(checks.row(name, value, entry="value").tolist())


# ---------------------------------------------------------------------- doubts


def _quantity(answer: Answer, name: str) -> Uncertain:
    value = float(answer.main[name])
    doubts = {}
    # Cut-offs next to the answer's count as a doubt; longer ones are for the figure.
    loops = _cut_offs(answer)
    longer = sorted(factor for factor in loops if factor > 1)[:1]
    neighbours = [run for factor, (run, _) in loops.items() if factor < 1 or factor in longer]
    for doubt in DOUBTS:
        changes = [
            change
            for run in answer.plan.runs
            if run.group == doubt and (doubt != "cut-off" or run.name in neighbours)
            if (change := answer.change(run.name, name)) is not None
        ]
        if changes:
            doubts[doubt] = float(np.sqrt(np.mean(np.square(changes))))
    if name == "loss" and value:
        error = answer.main["loss_error"]
        numerics = abs(answer.main["audit_residual"]) if error is None else abs(error) / abs(value)
        doubts["numerics"] = float(numerics)
        if answer.main["zone_error"]:
            doubts["zones"] = answer.main["zone_error"] / abs(value)
    spread = float(np.sqrt(sum(d * d for d in doubts.values())))
    return Uncertain(value, abs(value) * max(LEAST, COVERAGE * spread), doubts)


def _cut_offs(answer: Answer) -> dict[float, tuple[str, Result]]:
    """Return the loops that ended by their shortest wave over the answer's."""
    at = answer.prepared.cut_off
    ended = {run.changes["cut_off"] / at: (run.name, r) for run, r in answer.group("cut-off")}
    return {1.0: ("answer", answer.main)} | ended


def _warnings(answer: Answer, loss: Uncertain) -> list[str]:
    """Return what is doubtful: what changes the answer most first, loops that failed last."""
    preload = answer.main["preload_warnings"]
    found = [*preload, *_one_patch(answer), *_not_converged(answer)]
    if loss.relative > 0.5:
        largest = max(loss.doubts, key=lambda name: loss.doubts[name])
        words = DOUBTS | OF_MODEL | {"numerics": "error of the loop itself"}
        found.append(
            f"the loss is known to {100 * loss.relative:.0f} % only, mostly for the doubt "
            f"“{largest}” ({words[largest]}; standard uncertainty "
            f"{100 * loss.doubts[largest]:.0f} %): {_REMEDIES[largest]}"
        )
    # The line ``range`` has the least ranges of all loops, and a warning goes by them, too.
    least = {name: getattr(answer, name) for name in RANGES}
    known = (*preload, *_of_ranges(answer, answer.main))
    found += [text for text in answer.main["warnings"] if text not in known]
    found += _of_ranges(answer, least)
    races = answer.main["races"]
    if races:
        found.append(
            f"{checks.counted(round(races), 'jump')} might end elsewhere by other speeds, order "
            f"or a finer field ({answer.main['energy_at_stake'] or 0:.2g} J/m² at stake)"
        )
    others = [(r.name, answer.result(r.name)) for r in answer.plan.runs if r.name != "answer"]
    short = [f"“{name}”" for name, of in others if of is not None and of["preload_warnings"]]
    if short:
        found.append(
            f"{len(short)} of {checks.counted(len(others), 'other loop')} did not turn at the "
            f"preload: {', '.join(short)}; their turning points are in trace.json"
        )
    failed = []
    for run in answer.plan.runs:
        text = answer.results.get(run.name)
        if isinstance(text, str):
            counts = run.group in DOUBTS and not run.name.startswith(_FOR_THE_FIGURE)
            lacks = "its doubt is not counted" if counts else "it is missing from table and figure"
            failed.append(f"the loop “{run.name}” did not end ({text}): {lacks}")
    return [*found, "; ".join(failed)] if failed else found


def _of_ranges(answer: Answer, ranges: Mapping[str, Any]) -> list[str]:
    """Return the warning of a range of adhesion below which zero range holds, if it is short."""
    if answer.main["strength"] is not None:
        return []  # its own range is given
    run = answer.plan.runs[0]
    problem = answer.cycle.problem(run.profile, run.work_of_adhesion)
    inside, *outside = (math.inf if ranges[name] is None else ranges[name] for name in RANGES)
    return range_warnings(problem, inside, 0.0, (), *outside)


def _one_patch(answer: Answer) -> list[str]:
    """Return a warning where one crest carries all contact at the turning point."""
    states = answer.main["states"]
    turn = max(i for i, branch in enumerate(states["branch"]) if branch == "loading")
    share = states["contact_fraction"][turn]
    if states["patches"][turn] != 1 or share > _ONE_PATCH:
        return []
    prepared = answer.prepared
    profile = prepared.profile()
    heights = profile.heights(8 * profile.highest_harmonic)
    place = prepared.start + profile.period * int(np.argmax(heights)) / heights.size
    return [
        f"one crest at {length_text(place)} carries all contact at the turning point "
        f"({100 * share:.2g} % of the period): the loss is that of this crest, not of the "
        "roughness; press deeper or measure a longer trace, or leave it out "
        f"({parameter('exclude')}) if it is no part of the surface"
    ]


def _not_converged(answer: Answer) -> list[str]:
    """Return a warning where the shortest two cut-offs that were computed differ in their loss."""
    loops = _cut_offs(answer)
    finest, coarser = sorted(loops)[:2] if len(loops) > 1 else (1.0, 1.0)
    one, other = (loops[factor][1]["loss"] for factor in (finest, coarser))
    change = one / other - 1 if other else 0.0
    if abs(change) <= _NOT_CONVERGED:
        return []
    cut_off, limits = answer.prepared.cut_off, answer.prepared.limits
    limit = max(limits, key=lambda name: limits[name])
    if cut_off > 1.01 * limits[limit]:
        limit = "given"
    return [
        f"the short-wave end is not converged: a shortest wave of {length_text(finest * cut_off)} "
        f"instead of {length_text(coarser * cut_off)} changes the loss by {100 * change:+.0f} %; "
        f"{_SHORTER_WAVES[limit]}"
    ]


def run_rows(answer: Answer) -> list[dict[str, Any]]:
    """Return the numbers of every loop of the plan, or why it failed."""
    runs = []
    for run in answer.plan.runs:
        found = answer.results.get(run.name)
        entry: dict[str, Any] = {
            **{"name": run.name, "group": run.group, "said": run.description},
            **{"reference": run.reference, "expected_seconds": answer.plan.seconds[run.name]},
        }
        if isinstance(found, dict):
            entry |= {key: value for key, value in found.items() if key != "states"}
            entry["loss_change"] = answer.change(run.name)
        else:
            entry["failed"] = found
        runs.append(entry)
    return runs


def document(answer: Answer) -> dict[str, Any]:
    """Return every number of the answer as one JSON document, in SI units."""
    prepared, trace, cycle, plan = answer.prepared, answer.prepared.trace, answer.cycle, answer.plan
    spectrum = prepared.spectrum
    return {
        "file": trace.source,
        "read": {"said": list(trace.notes), **{name: getattr(trace, name) for name in _READ}},
        "preparation": [
            {"name": step.name, "said": step.description, **step.numbers} for step in prepared.steps
        ],
        "excluded": [{"begin": begin, "end": end} for begin, end in prepared.excluded],
        "single_features": [asdict(feature) for feature in prepared.features],
        "cut_off": prepared.cut_off,
        "cut_off_limits": prepared.limits,
        "degree": prepared.degree,
        "noise": spectrum.noise,
        "spectrum": {
            "wave_number": spectrum.wave_number.tolist(),
            "power": spectrum.power.tolist(),
            "floor": spectrum.floor,
        },
        **{name: answer.main[name] for name in _CONTACT},
        "max_penetration": cycle.latest if cycle.turning.has_unit else cycle.turning_points[0],
        "max_stress": cycle.turning_points[0] if cycle.control.is_load else None,
        "preload": cycle.turning_points[0] if cycle.at_preload else None,
        "load_steps": cycle.load_steps,
        "loss": asdict(answer.loss),
        "loss_over_work_of_adhesion": answer.main["loss_over_work_of_adhesion"],
        "friction": answer.main["friction"],
        "pull_off_stress": asdict(answer.pull_off_stress),
        "contact_fraction": asdict(answer.contact_fraction),
        **{name: getattr(answer, name) for name in _OF_ALL_LOOPS},
        "loop": dict(answer.main),
        "runs": run_rows(answer),
        "plan": {
            **{"waves": plan.waves, "patches": plan.patches},
            **{"seconds": sum(plan.seconds.values()), "wall": plan.wall},
            **{"processes": plan.processes, "hints": list(plan.hints)},
        },
        "largest_changes": [
            {"name": run.name, "factor": factor} for run, factor in answer.largest_changes
        ],
        "warnings": list(answer.warnings),
        "seconds": answer.seconds,
    }
