"""A campaign from its file to its results: joins campaign, results file and hand-out."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np

from ensemble.campaign.compare import compare
from ensemble.campaign.tables import Campaign
from ensemble.campaign.tasks import Task
from ensemble.errors import InputError
from ensemble.results.schema import DONE, FAILED, PENDING
from ensemble.results.store import Results, Writer, create
from ensemble.run.dispatch import (
    Check,
    Compute,
    Limits,
    Master,
    Outcome,
    Worker,
    work_alone,
)
from ensemble.run.interrupt import StopSignals
from ensemble.run.lock import RunLock
from ensemble.run.progress import Counts, Progress
from ensemble.run.ranks import MpiChannel, together
from ensemble.run.schedule import Schedule
from ensemble.task.compute import TaskResult, check_task, run_task
from ensemble.versions import versions

Group = tuple[float, float]


@dataclass(frozen=True)
class Selection:
    """Rows to compute again.

    Attributes
    ----------
    status : {"failed", "all"}
    hurst, work_of_adhesion, realisation : tuple
        If not empty, only tasks with one of these values.
    """

    status: Literal["failed", "all"]
    hurst: tuple[float, ...] = ()
    work_of_adhesion: tuple[float, ...] = ()
    realisation: tuple[int, ...] = ()

    def takes(self, task: Task, status: int) -> bool:
        """Whether a row is selected."""
        return (
            (status == FAILED or (self.status == "all" and status == DONE))
            and (not self.hurst or task.hurst in self.hurst)
            and (not self.work_of_adhesion or task.work_of_adhesion in self.work_of_adhesion)
            and (not self.realisation or task.realisation in self.realisation)
        )


@dataclass(frozen=True)
class Options:
    """How a run goes.

    Attributes
    ----------
    redo : Selection, optional
        Rows to compute again.
    max_failures : int, optional
        So many failed tasks stop the run.
    deadline : float, optional
        When to give up what is in flight, as ``time.time()`` counts.
    patience : float
        How long to wait for another run to let go of the results file, in s.
    """

    redo: Selection | None = None
    max_failures: int | None = 20
    deadline: float | None = None
    patience: float = 10.0


@dataclass(frozen=True)
class Summary:
    """What a run has left: tasks by status in the file, and what it did itself.

    Attributes
    ----------
    stopped : str or None
        Why it stopped before the last task.
    """

    total: int
    done: int
    failed: int
    computed: int
    failed_now: int
    seconds: float
    stopped: str | None

    @property
    def pending(self) -> int:
        """Tasks still to do."""
        return self.total - self.done - self.failed


@dataclass(frozen=True)
class _Plan:
    """What there is to do, found by rank 0 and told to all."""

    tasks: list[Task]
    rows: list[int]
    done: int
    failed: int
    times: dict[Group, tuple[float, int]] = field(default_factory=dict)


def run_campaign(
    campaign: Campaign,
    path: Path | str,
    comm: Any = None,
    options: Options | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Summary:
    """Compute what is missing of a campaign in its results file.

    Parameters
    ----------
    campaign : Campaign
    path : path
        The results file; made, resumed or extended as it is found.
    comm : MPI communicator, optional
        Called on every rank of it: rank 0 hands out, the others compute. Without it, or with one
        rank, this process computes.
    options : Options, optional
    say : callable
        Gets a line about what was found and what will be done, on rank 0.

    Raises
    ------
    InputError
        On every rank, before any work, if the campaign cannot be computed or the file is foreign,
        damaged, of another campaign, in use or not writable.
    ensemble.run.dispatch.Overdue
        If workers did not stop in time when told to; the results file is sound.
    """
    options = options or Options()
    path = Path(path)
    if comm is not None and comm.size == 1:
        comm = None
    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)
    lock = RunLock(path)
    with ExitStack() as stack, StopSignals() as signals:
        stack.push(lock)
        plan = together(comm, lambda: _prepare(campaign, path, lock, size, options, say))
        own_rows = comm is not None and bool(h5py.get_config().mpi)
        if own_rows and rank > 0:
            lock.join()
        writer = None
        if own_rows or rank == 0:
            writer = stack.enter_context(Writer(path, comm if own_rows else None))
        session = _Session(campaign, plan, writer, options, signals)
        if comm is None:
            stopped = session.alone()
        elif rank == 0:
            stopped = session.master(MpiChannel(comm), own_rows)
        else:
            session.worker(MpiChannel(comm), own_rows)
            stopped = None
    return together(comm, lambda: session.summary(stopped))


class _Session:
    """One rank's part of a run."""

    def __init__(
        self,
        campaign: Campaign,
        plan: _Plan,
        writer: Writer | None,
        options: Options,
        signals: StopSignals,
    ) -> None:
        self._campaign = campaign
        self._plan = plan
        self._writer = writer
        self._options = options
        self._signals = signals
        self._started = time.monotonic()
        self._counts = Counts(total=len(plan.tasks), done_before=plan.done)
        self._groups: Mapping[int, Group] = {
            row: (plan.tasks[row].hurst, plan.tasks[row].work_of_adhesion) for row in plan.rows
        }
        self._limits = Limits(
            stop=self._stop,
            time_left=self._time_left,
            task_seconds=campaign.solver.time_limit,
        )

    def alone(self) -> str | None:
        schedule = self._schedule()
        progress = Progress(self._counts, lambda: self._estimate(schedule, 0, 1))
        try:
            return work_alone(
                schedule,
                self._groups,
                self._computing(progress.tick),
                self._write,
                lambda outcome: self._count(outcome, progress),
                self._limits,
            )
        finally:
            progress.close()

    def master(self, channel: MpiChannel, own_rows: bool) -> str | None:
        schedule = self._schedule()
        workers = channel.size - 1

        def collect(outcome: Outcome) -> None:
            if not own_rows:
                self._write(outcome)
            self._count(outcome, progress)

        progress = Progress(
            self._counts, lambda: self._estimate(schedule, master.in_flight, workers)
        )
        master = Master(channel, schedule, self._groups, collect, self._limits, tick=progress.tick)
        try:
            return master.run()
        finally:
            progress.close()

    def worker(self, channel: MpiChannel, own_rows: bool) -> None:
        deliver = self._write if own_rows else lambda outcome: outcome
        Worker(channel, self._computing(lambda: None), deliver, self._limits).run()

    def summary(self, stopped: str | None) -> Summary:
        done = self._plan.done + self._counts.done
        failed = self._plan.failed + self._counts.failed
        return Summary(
            total=len(self._plan.tasks),
            done=done,
            failed=failed,
            computed=self._counts.done,
            failed_now=self._counts.failed,
            seconds=time.monotonic() - self._started,
            stopped=stopped if done + failed < len(self._plan.tasks) else None,
        )

    def _computing(self, tick: Callable[[], None]) -> Compute:
        def compute(row: int, check: Check) -> TaskResult:
            def progress(*_: object) -> None:
                check()
                tick()

            return run_task(self._campaign, self._plan.tasks[row], progress)

        return compute

    def _write(self, outcome: Outcome) -> Outcome:
        assert self._writer is not None
        if outcome.error is None:
            self._writer.write_result(outcome.task, outcome.result, outcome.rank)
        else:
            self._writer.write_failure(outcome.task, outcome.error, outcome.seconds, outcome.rank)
        return replace(outcome, result=None)

    def _count(self, outcome: Outcome, progress: Progress) -> None:
        if outcome.error is None:
            self._counts.done += 1
        else:
            self._counts.failed += 1
            progress.failure(str(self._plan.tasks[outcome.task]), outcome.error)
        progress.tick()

    def _schedule(self) -> Schedule:
        groups = sorted({*self._groups.values(), *self._plan.times})
        schedule = Schedule(self._plan.rows, self._groups, {g: _prior(*g) for g in groups})
        for group, (seconds, count) in self._plan.times.items():
            schedule.measured(group, seconds, count)
        return schedule

    def _stop(self) -> str | None:
        if self._signals.received is not None:
            return f"{self._signals.received} received"
        left = self._time_left()
        if left is not None and left <= 0:
            return "the walltime ends"
        most = self._options.max_failures
        if most is not None and self._counts.failed >= most:
            return f"{self._counts.failed} tasks failed (the limit is --max-failures {most})"
        return None

    def _time_left(self) -> float | None:
        deadline = self._options.deadline
        return None if deadline is None else deadline - time.time()

    @staticmethod
    def _estimate(schedule: Schedule, in_flight: int, workers: int) -> float | None:
        waiting, mean = schedule.seconds_waiting, schedule.mean_estimate
        if waiting is None or mean is None:
            return None
        return (waiting + 0.5 * mean * in_flight) / workers


def _prior(hurst: float, work_of_adhesion: float) -> float:
    """Relative time of a loop before any is measured: weak adhesion and roughness take more."""
    return (2.0 - hurst) / math.sqrt(work_of_adhesion + 1e-3)


def _prepare(
    campaign: Campaign,
    path: Path,
    lock: RunLock,
    size: int,
    options: Options,
    say: Callable[[str], None],
) -> _Plan:
    """Check everything, lock, make or extend the file, and find what is to be done; by rank 0."""
    tasks = campaign.tasks()
    for task in {t.hurst: t for t in reversed(tasks)}.values():
        check_task(campaign, task)
    _check_path(path)
    lock.acquire(size, options.patience)
    if not path.exists():
        create(path, campaign, versions=versions())
        say(f"{path}: {len(tasks)} tasks to do")
        return _Plan(tasks, list(range(len(tasks))), 0, 0)
    with Results(path) as old:
        difference = compare(old.campaign, campaign)
        if difference.other:
            raise InputError(
                f"{path} holds another campaign: {'; '.join(difference.other)} "
                "(here: this campaign, there: the file)"
            )
        before = len(old)
        if difference.grown:
            create(path, campaign, versions=versions(), grown_from=old)
    with Results(path) as results:
        tasks, status = results.tasks(), results.status()
    if options.redo is not None:
        again = [
            row
            for row, (task, state) in enumerate(zip(tasks, status.tolist(), strict=True))
            if options.redo.takes(task, state)
        ]
        with Writer(path) as writer:
            writer.reset(again)
        say(f"{path}: {len(again)} tasks will be computed again")
    with Results(path) as results:
        plan = _plan(results)
    grown = f", {len(tasks) - before} of them new" if difference.grown else ""
    say(
        f"{path}: {plan.done} of {len(tasks)} tasks done, {len(plan.rows)} to do{grown}"
        + (f", {plan.failed} failed before (see --redo failed)" if plan.failed else "")
    )
    return plan


def _check_path(path: Path) -> None:
    folder = path.parent
    if not folder.is_dir():
        raise InputError(f"{path} cannot be written: there is no folder {folder}")
    if path.is_dir():
        raise InputError(f"{path} is a directory, not a results file")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written: the folder {folder} is read-only")
    if path.exists() and not os.access(path, os.R_OK | os.W_OK):
        raise InputError(f"{path} cannot be written: permission denied")


def _plan(results: Results) -> _Plan:
    status = results.status()
    tasks = results.tasks()
    times: dict[Group, tuple[float, int]] = {}
    seconds = results.column("wall_time").tolist()
    for row in np.flatnonzero(status == DONE).tolist():
        group = (tasks[row].hurst, tasks[row].work_of_adhesion)
        sum_before, count = times.get(group, (0.0, 0))
        times[group] = (sum_before + seconds[row], count + 1)
    return _Plan(
        tasks=tasks,
        rows=np.flatnonzero(status == PENDING).tolist(),
        done=int(np.sum(status == DONE)),
        failed=int(np.sum(status == FAILED)),
        times=times,
    )
