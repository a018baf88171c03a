"""Estimate the cost of a campaign from a few pilot loops, or from the times measured so far."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, replace
from html import escape
from itertools import groupby
from operator import attrgetter
from pathlib import Path

import numpy as np

from adhesis.ensemble.campaign.precision import fewest, looks
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import WHOLE, Part, Task, Tasks
from adhesis.ensemble.quantities import bytes_text, duration, percent
from adhesis.ensemble.results.layout import rows_in
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DAMAGED, DONE, NOT_NEEDED, PENDING, file_size
from adhesis.ensemble.run.launch import peak_bytes
from adhesis.ensemble.run.plan import grown_by, prior, tasks_of
from adhesis.ensemble.task.compute import Runner
from adhesis.ensemble.task.doubt import INSTEAD, highest_stress, most_reached
from adhesis.ensemble.task.row import Row
from adhesis.solver.checks import counted
from adhesis.solver.method import PathError

# Loops are tried out for so long (s), one realisation of every cell after the other.
PILOT_SECONDS = 60.0
_MOST_CELLS_SHOWN = 60
# Ranks are worth having as long as they are busy for this share of the time.
_BUSY = 0.8
# With [stop]: loops beyond the first of their cells before their spread says anything.
_FEWEST_FOR_SPREAD = 6
# Of the power law through the cells that were tried: fewest cells, least range of the logarithm of
# their priors, and bounds of its power.
_FEWEST_FOR_POWER, _NARROW, _POWERS = 3, 0.1, (0.5, 3.0)

Cell = tuple[float, ...]
Known = dict[Cell, list[tuple[float, float]]]
"""Of loops that are done or were tried out, by cell: CPU time in s, and the quantity of ``[stop]``,
NaN where it is not known."""


@dataclass(frozen=True)
class CellPrice:
    """Cost of the tasks of one cell."""

    task: Task  # one of them
    tasks: int  # number still to do
    seconds: float  # mean CPU time of one, in s
    measured: int  # loops that the mean is over; 0 where it is scaled from other cells


@dataclass(frozen=True, repr=False)
class Price:
    """Cost of a campaign."""

    tasks: int  # of the campaign or part
    done: int  # those of them that have a result
    cells: tuple[CellPrice, ...]
    longest: float  # CPU time in s of the longest task, or set of tasks that share a loading branch
    file_bytes: int  # of the results file
    rank_bytes: int  # of one rank's memory, as this process has had it
    pilots: int  # loops that were computed to find out
    pilot_seconds: float  # their CPU time
    # With ``[stop]`` for how many realisations a cell the price is; pilots short of their preload
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return the lines of ``adhesis run --dry-run``."""
        tried = "the loops that are done"
        if self.pilots:
            spent = duration(self.pilot_seconds)
            tried = f"{counted(self.pilots, 'pilot loop')} of {spent} in all"
        memory = f", about {bytes_text(self.rank_bytes)} of memory a rank" if self.left else ""
        lines = [
            f"{counted(self.left, 'task')} to do in {counted(len(self.cells), 'cell')}, "
            f"{self.done} done; nothing was written",
            *self.notes,
            f"{self.seconds / 3600:.3g} core hours, by {tried}; "
            f"the longest task takes about {duration(self.longest)}",
            f"results file {bytes_text(self.file_bytes)}{memory}",
        ]
        if self.left:
            lines.append(f"one process takes {duration(self.makespan(1))}")
            for workers in sorted({2, 8, 32, 128, self.most_workers}):
                if 1 < workers <= self.most_workers:
                    lines.append(f"{workers + 1} ranks take {duration(self.makespan(workers))}")
            lines.append("of more ranks some would wait for the longest task")
        if len(self.cells) <= _MOST_CELLS_SHOWN:
            lines += ["", "s a loop  tasks  core hours  cell"]
            for cell in self.cells:
                mark, hours = " " if cell.measured else "~", cell.tasks * cell.seconds / 3600
                numbers = f"{cell.seconds:7.3g} {cell.tasks:6d} {hours:11.3g}"
                lines.append(f"{mark}{numbers}  {cell.task.cell_name}")
            if not all(cell.measured for cell in self.cells):
                lines.append("~ extrapolated from other cells")
        return "\n".join(lines)

    def __repr__(self) -> str:
        left = f"{self.left} of {counted(self.tasks, 'task')} to do"
        return f"<Price: {left}, {duration(self.seconds)} of CPU>"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"

    @property
    def left(self) -> int:
        """Tasks still to do; with ``[stop]`` an estimate."""
        return sum(cell.tasks for cell in self.cells)

    @property
    def seconds(self) -> float:
        """CPU time of all tasks still to do."""
        return sum(cell.tasks * cell.seconds for cell in self.cells)

    def makespan(self, workers: int) -> float:
        """Estimated wall time of the rest on so many workers: no shorter than its longest task."""
        return max(self.seconds / workers, self.longest)

    @property
    def most_workers(self) -> int:
        """Workers that are still busy for most of the time."""
        busy = math.floor(self.seconds / (_BUSY * self.longest)) if self.longest else self.left
        return max(1, min(self.left, busy))


def price(
    campaign: Campaign,
    path: Path | None = None,
    part: Part = WHOLE,
    *,
    seconds: float = PILOT_SECONDS,
    compute: Callable[[Campaign, Task], Row] | None = None,
    check: Callable[[Campaign, Task], None] = lambda campaign, task: None,
    on_pilot: Callable[[Task, float], None] = lambda task, seconds: None,
) -> Price:
    """Estimate what a campaign costs; writes nothing.

    Cells of which loops are done in the results file cost what those did. Of the others loops are
    tried out for ``seconds``, the first realisation of each, then the second …; what was not
    reached is extrapolated by how the tasks of such cells usually compare. Loops that share a
    loading branch are tried out together. ``check`` is called with the first task still to do of
    each cell before one is tried out, ``on_pilot`` after each loop with its CPU time in s.
    InputError if the results file is damaged, or holds another campaign, or there is no such part.
    """
    compute = compute or Runner()
    tasks = tasks_of(campaign, part)
    known: Known = {task.cell: [] for task in tasks.of_cells()}
    left, done = tasks, 0
    if path is not None and os.path.exists(path):
        left, done = _left(campaign, path, part, tasks, known)
    for task in left.of_cells():
        check(campaign, task)
    # Of the cells that are not known yet, realisation by realisation
    unknown = np.array([not known.get(cell) for cell in left.cells])
    rows = left.rows[unknown[left.cell_of()]]
    to_try = replace(left, rows=rows[np.argsort(rows % left.realisations, kind="stable")])
    pilots, spent, end, longest = 0, 0.0, time.monotonic() + seconds, 0.0
    short: list[float] = []
    for unit in _units(campaign, to_try):
        if time.monotonic() > end:
            break
        together = 0.0
        for task in unit:
            begun = time.process_time()
            try:
                row = compute(campaign, task)
            except PathError:  # a run records the task as failed; it costs what it took
                row = {"cpu_time": time.process_time() - begun}
            took = float(row["cpu_time"])
            if row.get("preload_reached") == 0:
                short.append(highest_stress(row["loading_mean_stress"]))
            known[task.cell].append((took, float(row.get(campaign.stop.quantity, math.nan))))
            pilots, together = pilots + 1, together + took
            on_pilot(task, took)
        spent, longest = spent + together, max(longest, together)
    cells, stop = _cells(campaign, tasks, left, known)
    warning = ""
    if short:
        does, turns = ("does", "turns") if len(short) == 1 else ("do", "turn")
        warning = (
            f"WARNING: {len(short)} of {counted(pilots, 'pilot loop')} {does} not reach the "
            f"preload, and {turns} at the latest turning point: {most_reached(max(short))}. "
            f"{INSTEAD}."
        )
    return Price(
        *(len(tasks), done, cells),
        longest=max(longest, _longest(campaign, cells)) if left else 0.0,
        file_bytes=file_size(campaign, part),
        rank_bytes=peak_bytes(),
        pilots=pilots,
        pilot_seconds=spent,
        notes=tuple(filter(None, (stop, warning))),
    )


def _left(
    campaign: Campaign, path: Path, part: Part, tasks: Tasks, known: Known
) -> tuple[Tasks, int]:
    """Tasks that a run would compute, and the number of those with a result."""
    left = np.zeros(campaign.task_count, bool)
    left[tasks.rows] = True
    with Results(path) as results:
        grown_by(path, results, campaign, part)
        rows, status = rows_in(campaign, results), results.status()
        done = (status == DONE) & left[rows]
        quantities = ("cpu_time", campaign.stop.quantity)
        seconds, values = (results.column(name)[done].tolist() for name in quantities)
        more = (NOT_NEEDED,) if campaign.stop != results.campaign.stop else ()
        left[rows[~np.isin(status, (PENDING, DAMAGED, *more))]] = False
    for task, took, value in zip(replace(tasks, rows=rows[done]), seconds, values, strict=True):
        known[task.cell].append((took, value))
    return replace(tasks, rows=np.flatnonzero(left)), int(done.sum())


def _units(campaign: Campaign, tasks: Tasks) -> Iterator[list[Task]]:
    """Tasks that share a loading branch together; the cheapest first, to meet many cells."""
    for _, of_realisation in groupby(tasks, key=attrgetter("realisation")):
        found: dict[Hashable, list[Task]] = {}
        for task in of_realisation:
            found.setdefault(campaign.branch_of(task), []).append(task)
        yield from sorted(found.values(), key=lambda unit: sum(prior(task) for task in unit))


def _cells(
    campaign: Campaign, tasks: Tasks, left: Tasks, known: Known
) -> tuple[tuple[CellPrice, ...], str]:
    firsts = tasks.of_cells()
    first = {task.cell: task for task in firsts}
    mean = {cell: float(np.mean(loops, axis=0)[0]) for cell, loops in known.items() if loops}
    of_prior = _law([prior(first[cell]) for cell in mean], list(mean.values()))
    of_cell = np.bincount(left.cell_of(), minlength=len(tasks.cells))
    count = dict(zip(first, of_cell[firsts.cell_of()].tolist(), strict=True))
    stop = ""
    if campaign.stop.relative_error is not None:
        wanted, stop = _realisations(campaign, known)
        for cell, left_here in count.items():
            have = campaign.realisations - left_here
            count[cell] = min(left_here, max(0, wanted - have))
    time_of = {cell: mean.get(cell, of_prior(prior(task))) for cell, task in first.items()}
    cells = (CellPrice(t, count[c], time_of[c], len(known[c])) for c, t in first.items())
    return tuple(cells), stop


def _law(priors: list[float], seconds: list[float]) -> Callable[[float], float]:
    """Time of a cell that was not reached, by its prior: a power law through those that were.

    The cheapest are tried first, and the others take more than in proportion, by how much the
    methods decide.
    """
    if not seconds:
        return lambda prior: 0.0
    x, y = np.log(priors), np.log(np.maximum(seconds, 1e-6))
    away = x - x.mean()
    power = 1.0
    if x.size >= _FEWEST_FOR_POWER and np.ptp(x) > _NARROW:
        power = float(np.clip(np.sum(away * y) / np.sum(away**2), *_POWERS))
    return lambda prior: float(np.exp(y.mean() + power * (np.log(prior) - x.mean())))


def _realisations(campaign: Campaign, known: Known) -> tuple[int, str]:
    """Realisations that a cell takes with ``[stop]``, and a sentence on it.

    They follow from the standard deviation of a value over the mean of its cell, of those with
    adhesion: in others values are rounding.
    """
    at = looks(campaign.sweep.realisations, campaign.stop.batch, campaign.stop.most)
    few = fewest(at)
    adhesive = (loops for (_, gamma, *_), loops in known.items() if gamma > 0)
    values = [np.array([v for _, v in loops if math.isfinite(v)]) for loops in adhesive]
    values = [of_cell for of_cell in values if of_cell.size > 1]
    freedom = sum(of_cell.size - 1 for of_cell in values)
    if freedom < _FEWEST_FOR_SPREAD:
        return at[-1], f"[stop]: {few} to {at[-1]} realisations a cell; the price is for {at[-1]}"
    square = sum(float(np.sum((x / x.mean() - 1) ** 2)) for x in values)
    spread = math.sqrt(square / freedom)
    assert campaign.stop.relative_error is not None
    count = fewest(at, (1.96 * spread / campaign.stop.relative_error) ** 2)
    return count, (
        f"[stop]: about {count} realisations a cell, as {campaign.stop.quantity} of "
        f"{counted(sum(of_cell.size for of_cell in values), 'loop')} "
        f"scatters by {percent(spread)} so far; at least {few}, at most {at[-1]}"
    )


def _longest(campaign: Campaign, cells: tuple[CellPrice, ...]) -> float:
    """Mean time of the longest task, or set of tasks that share a loading branch."""
    together: dict[Hashable, float] = {}
    for cell in cells:
        if cell.tasks:
            key = campaign.branch_of(cell.task)
            together[key] = together.get(key, 0.0) + cell.seconds
    return max(together.values(), default=0.0)
