"""Plan a run: compare the campaign with its results file, which is made or extended."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.precision import Batches
from adhesis.ensemble.campaign.tables import Campaign, growth
from adhesis.ensemble.campaign.tasks import WHOLE, Part, Task, Tasks
from adhesis.ensemble.errors import InputError, parameter
from adhesis.ensemble.quantities import bytes_text
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.layout import Source, check_space, create
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.run.interrupt import NEVER
from adhesis.ensemble.run.lock import RunLock
from adhesis.ensemble.versions import versions
from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array

_MOST_SHOWN = 10
# Bytes of a file that some disks take more than ten seconds for.
_LONG_TO_LAY_OUT = 10**9
_AGAIN = "; this run computes damaged rows again"


@dataclass(frozen=True)
class Selection:
    """Rows to compute again."""

    status: Literal["failed", "all"]
    # By the name of a column of tasks; if there are any, only tasks with one of them
    values: Mapping[str, Collection[float]] = field(default_factory=dict)

    def check(self, tasks: Tasks) -> None:
        """Refuse values that the campaign does not have (InputError)."""
        for name, chosen in self.values.items():
            known = np.unique(tasks.column(name)).tolist()
            for value in chosen:
                if value not in known:
                    is_alike = f"{value:g}" in {f"{v:g}" for v in known}
                    spelt: Callable[[float], str] = repr if is_alike else "{:g}".format
                    values = ", ".join(map(spelt, known[:_MOST_SHOWN]))
                    more = ", …" if len(known) > _MOST_SHOWN else ""
                    raise InputError(
                        f"{parameter(name)} is {spelt(value)}: this campaign has no such task, "
                        f"only {values}{more}"
                    )

    def rows(self, tasks: Tasks, status: NDArray[np.uint8]) -> list[int]:
        """Return the rows that are selected, by the status of each task."""
        codes = (schema.FAILED, schema.DONE) if self.status == "all" else (schema.FAILED,)
        selected = np.isin(status, codes)
        for name, chosen in self.values.items():
            if chosen:
                selected &= np.isin(tasks.column(name), list(chosen))
        return np.flatnonzero(selected).tolist()


@dataclass(frozen=True)
class Options:
    """Options of a run."""

    part: Part = WHOLE  # the share of the tasks to compute
    redo: Selection | None = None  # rows to compute again
    max_failures: float = 20  # so many failed tasks stop the run; infinite: none do
    deadline: tuple[float, float] = NEVER  # of :func:`adhesis.ensemble.run.interrupt.deadline`
    patience: float = 10.0  # how long to wait for another run to let go of the results file, in s
    # Processes that compute beside this one where there are no ranks; 0 computes here
    processes: int = 0


@dataclass(frozen=True)
class Plan:
    """Tasks that are left, determined by rank 0 and broadcast to all."""

    tasks: Tasks  # row by row
    rows: list[int]  # rows to compute
    done: int  # rows that are
    failed: int
    known: NDArray[np.int64]  # checksum of each row that is done or failed; -1 of others
    seconds: Array  # wall time of each row that is done, NaN of others
    batches: Batches | None = None  # where the campaign has ``[stop]``: what comes after ``rows``


def tasks_of(campaign: Campaign, part: Part) -> Tasks:
    """Return the tasks of a part (InputError, if there can be no such part)."""
    tasks = campaign.tasks(part)
    if part != WHOLE and campaign.stop.relative_error is not None:
        rule = "its batches are decided on whole cells"
        raise InputError(f"{parameter('part')} is {part}, but the campaign has [stop]: {rule}")
    if not tasks:
        count = counted(campaign.task_count, "task")
        raise InputError(f"{parameter('part')} is {part}: of {count} in all this part has none")
    return tasks


def prepare(
    campaign: Campaign,
    path: Path,
    lock: RunLock,
    size: int,
    options: Options,
    say: Callable[[str], None],
    check: Callable[[Campaign, Task], None],
) -> Plan:
    """Lock, check everything, make or extend the file, and find what is to be done; by rank 0.

    Only tasks that are to be computed are checked, as that loads the solver. ``size`` is the number
    of ranks; ``say`` gets a line about what was found; ``check`` raises InputError if a task cannot
    be set up.
    """
    part, redo = options.part, options.redo
    tasks = tasks_of(campaign, part)
    if redo is not None:
        redo.check(tasks)
        if not os.path.exists(path):
            raise InputError(
                f"{parameter('redo')} computes again what is in a results file, and {path} does "
                f"not exist: leave it out, or give the file ({parameter('out')})"
            )

    check_cell = cache(partial(check, campaign))

    def lay_out(sources: Sequence[Source] = (), **attributes: Any) -> None:
        check_space(path, campaign, part)
        if (size := schema.file_size(campaign, part)) > _LONG_TO_LAY_OUT:
            say(f"{path}: laying out {bytes_text(size)}")
        for task in tasks.of_cells():
            check_cell(task)
        created = versions() | attributes
        create(path, campaign, part=part, attributes=created, sources=sources)

    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written: the folder {path.parent} is read-only")
    if os.path.exists(path) and not os.access(path, os.R_OK | os.W_OK):
        raise InputError(f"{path} cannot be written: permission denied")
    lock.acquire(size, options.patience)
    new: NDArray[np.intp] | None = None  # rows that came when the file grew
    is_new = not os.path.exists(path)
    if is_new:
        lay_out()
    else:
        with Results(path) as old:
            if grown_by(path, old, campaign, part):  # which rows are not needed is decided anew
                taken = np.isin(old.status(), (schema.DONE, schema.FAILED))
                source = Source(old, campaign, taken)
                lay_out([source], created=old.attributes.get("created"))
                new = np.setdiff1d(np.arange(len(tasks)), source.target)
                if old.damaged().size:
                    say(f"{old.damage()}{_AGAIN}")
    with Results(path) as results:
        status = results.status()
        again = np.flatnonzero(status == schema.DAMAGED).tolist()
        if again:
            say(f"{results.damage()}{_AGAIN}")
        if redo is not None:
            chosen = redo.rows(results.tasks, status)
            say(f"{path}: {counted(len(chosen), 'task')} to be computed again")
            again += chosen
        status[again] = schema.PENDING
        plan = _plan(results, status)
    # where nothing is left, the solver is not loaded
    for task in replace(plan.tasks, rows=plan.tasks.rows[plan.rows]).of_cells():
        check_cell(task)
    if again or plan.batches is not None:
        with Writer(path) as writer:
            writer.mark(again, schema.PENDING)
            if plan.batches is not None:
                spare = np.zeros(status.size, bool)
                spare[plan.batches.not_needed] = True
                is_marked = status == schema.NOT_NEEDED
                writer.mark(np.flatnonzero(spare & ~is_marked), schema.NOT_NEEDED)
                writer.mark(np.flatnonzero(is_marked & ~spare), schema.PENDING)
    left = len(plan.rows)
    if is_new:
        say(f"{path}: {counted(left, 'task')} to do{' at first' if plan.batches else ''}")
        return plan
    grown = "" if new is None else f", {np.isin(plan.rows, new).sum()} of them new"
    see = f"(see {parameter('redo', 'adhesis run')} failed)"
    before = f", {plan.failed} failed before {see}" if plan.failed else ""
    planned = counted(plan.done + plan.failed + left, "task")  # with [stop] more may follow
    say(f"{path}: {plan.done} of {planned} done, {left} to do{grown}{before}")
    return plan


def grown_by(path: Path, old: Results, campaign: Campaign, part: Part) -> tuple[str, ...]:
    """Return the keys by which a file has to grow; InputError where it cannot be the campaign's."""
    grown_keys = growth(path, old.campaign, campaign)
    if old.part != part:
        both = (old.part, part)
        held, wanted = ("the whole campaign" if of == WHOLE else f"part {of} of it" for of in both)
        raise InputError(f"{path} holds {held}, and {wanted} is wanted")
    if grown_keys and part != WHOLE:
        raise InputError(
            f"{path} holds part {part} of a smaller campaign: a part does not grow, what the "
            "parts are merged into does"
        )
    if grown_keys:
        refused = f"{path} cannot grow by {', '.join(grown_keys)}"
        schema.check_same_rows(old.campaign, campaign, refused)
    return grown_keys


def _plan(results: Results, status: NDArray[np.uint8]) -> Plan:
    campaign, tasks = results.campaign, results.tasks
    seconds = np.where(status == schema.DONE, results.column("wall_time"), np.nan)
    rows, batches = np.flatnonzero(status == schema.PENDING).tolist(), None
    is_known = np.isin(status, (schema.DONE, schema.FAILED))
    if campaign.stop.relative_error is not None:
        steered = results.column(campaign.stop.quantity)
        batches = Batches(campaign, np.where(status == schema.FAILED, np.nan, steered), is_known)
        rows = batches.to_do
    done, failed = (int(np.sum(status == code)) for code in (schema.DONE, schema.FAILED))
    known = np.where(is_known, results.column(schema.CHECKSUM.name).astype(np.int64), -1)
    return Plan(tasks, rows, done, failed, known, seconds, batches)


def prior(task: Task) -> float:
    """Relative time of a loop before any is measured: weak adhesion and roughness take more."""
    waves = math.prod(value for name, value in task.others if name in ("n0", "ratio"))
    return waves * (2.0 - task.hurst) / math.sqrt(task.work_of_adhesion + 1e-3)
