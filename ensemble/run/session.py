"""A campaign from its file to its results: joins plan, results file, hand-out and progress."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TextIO

import h5py
import numpy as np

from adhesis.ensemble.aggregate.cells import precisions, read_cells
from adhesis.ensemble.campaign.precision import Precision
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import Task, Tasks
from adhesis.ensemble.errors import WriteError, parameter
from adhesis.ensemble.files import target_of
from adhesis.ensemble.quantities import duration
from adhesis.ensemble.reporter import Display
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import CHECKSUM, DONE, FAILED, NOT_NEEDED, origin_of
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.run import dispatch
from adhesis.ensemble.run.interrupt import StopSignals
from adhesis.ensemble.run.lock import RunLock
from adhesis.ensemble.run.plan import Options, Plan, prepare, prior
from adhesis.ensemble.run.processes import Processes
from adhesis.ensemble.run.ranks import MpiChannel, OneRank, together
from adhesis.ensemble.run.schedule import Schedule
from adhesis.ensemble.task.compute import Runner, check_task
from adhesis.ensemble.task.doubt import OF_DOUBT, doubtful, errors_text
from adhesis.ensemble.task.row import Row
from adhesis.ensemble.versions import processor, versions
from adhesis.solver.checks import counted
from adhesis.solver.loading.path_record import Progress

ComputeLoop = Callable[[Campaign, Task, Progress | None], Row]
_MOST_FAILURES_SHOWN = 5


@dataclass
class Summary:
    """Numbers of tasks of a run, kept up to date, and at the end how it ended."""

    # total, done, failed: in the results file, or the part of it that is asked for
    total: int
    done: int = 0
    failed: int = 0
    # computed, failed_now: of these, by this run
    computed: int = 0
    failed_now: int = 0
    # At the end, of all tasks in the file, as in :mod:`adhesis.ensemble.task.doubt`
    doubtful: int = 0
    beyond_limit: int = 0
    short_of_preload: int = 0  # loops that turned before their preload was reached
    seconds: float = 0.0
    stopped: str | None = None  # why it stopped before the last task
    # With ``[stop]``: name of every cell, and how well the mean of its quantity is known
    precisions: Sequence[tuple[str, Precision]] = ()

    @property
    def pending(self) -> int:
        """Tasks still to do."""
        return self.total - self.done - self.failed

    def __str__(self) -> str:
        failed = f", {self.failed} failed" if self.failed else ""
        now = f"{self.computed} computed in {duration(self.seconds)}"
        return f"{self.done} of {counted(self.total, 'task')} done{failed}; {now}"


class ProgressLine(Display):
    """Progress of a run, on rank 0, from counts that the run keeps up to date.

    ``time_left`` returns the estimated seconds until the end, or None while nothing is known.
    """

    def __init__(
        self, counts: Summary, time_left: Callable[[], float | None], stream: TextIO | None = None
    ) -> None:
        super().__init__(self._line, stream, at_once=True)
        self._counts = counts
        self._time_left = time_left
        self._doubtful = 0

    def failure(self, what: str, error: str) -> None:
        """Report a failed task that is counted: the first ones each, then only their number."""
        if self._counts.failed_now <= _MOST_FAILURES_SHOWN:
            self.say(f"failed: {what}: {error}")
        elif self._counts.failed_now == _MOST_FAILURES_SHOWN + 1:
            self.say("further failures are counted here and listed by `adhesis status`")

    def doubt(self, what: str) -> None:
        """Report a doubtful loss: the first ones each."""
        self._doubtful += 1
        if self._doubtful <= _MOST_FAILURES_SHOWN:
            self.say(f"doubtful loss: {what}")

    def _line(self, seconds: float) -> str:
        c, left = self._counts, self._time_left()
        parts = [f"{c.done} of {counted(c.total, 'task')} done"]
        if c.failed_now:
            parts.append(f"{c.failed_now} failed")
        if c.computed:
            parts.append(f"{duration(seconds)} so far")
        if left is not None and c.pending:
            parts.append(f"about {duration(left)} left")
        return ", ".join(parts)


@dataclass(frozen=True)
class Engine:
    """Functions that a run works with; tests and benchmarks pass in their own."""

    compute: ComputeLoop = field(default_factory=Runner)  # calls its third argument now and then
    check: Callable[[Campaign, Task], None] = check_task  # InputError for a task not to be set up
    # Opens the results file for writing: path, the communicator if all ranks write, and what
    # returns the versions and the processor of a rank
    writer: Callable[[Path, Any, Callable[[int], str]], Writer] = Writer
    # Whether each rank writes the rows that it computed, as parallel HDF5 allows
    all_write: bool = bool(h5py.get_config().mpi)
    silence: float = dispatch.SILENCE  # of :class:`Limits`, in s


def run_campaign(
    campaign: Campaign,
    path: Path | str,
    comm: Any = None,
    options: Options | None = None,
    say: Callable[[str], None] = lambda text: None,
    engine: Engine | None = None,
    stream: TextIO | None = None,
) -> Summary:
    """Compute what is missing of a campaign in its results file.

    The file is made, resumed or extended. Called on every rank of ``comm``: rank 0 hands out, the
    others compute. Without it, or with one rank, this process computes, or hands out to processes
    that it starts. ``say`` gets a line about what was found and what will be done, on rank 0;
    progress goes to ``stream``, or stderr.

    InputError on every rank, before any work, if the campaign cannot be computed or the file is
    foreign, damaged, of another campaign, in use or not writable; at the end, if it was damaged
    meanwhile. Unresponsive on rank 0, if a worker does not answer; the results file is sound. The
    other ranks wait: the caller has to end the job.
    """
    options, engine = options or Options(), engine or Engine()
    path = target_of(path)
    comm = comm or OneRank()
    size, check = max(comm.size, 1 + options.processes), engine.check
    with RunLock(path) as lock, StopSignals() as signals:
        try:
            plan = together(comm, lambda: prepare(campaign, path, lock, size, options, say, check))
        except WriteError:
            lock.release()  # no other rank writes yet
            raise
        origins = [""] * size
        if plan.rows:
            # The last bits of a rank's rows depend on versions and processor. All ranks run one
            # installation, on nodes that may differ; processes that this one starts have its own.
            known = together(comm, versions)
            names = comm.allgather(processor()) if comm.size > 1 else size * [processor()]
            origins = [origin_of(known | {"processor": name}) for name in names]
        own_rows = comm.size > 1 and engine.all_write
        if own_rows and comm.rank > 0:
            lock.join()
        with ExitStack() as stack:
            writer = None
            if own_rows or comm.rank == 0:
                opened = engine.writer(path, comm if own_rows else None, origins.__getitem__)
                writer = stack.enter_context(opened)
            session = _Session(campaign, plan, writer, options, signals, engine, stream)
            stopped = session.run(comm, own_rows)
        # The file is closed: a rank that ends by an error with it open would wait for the others.
        return together(comm, lambda: session.summary(stopped, path))


def _compute(
    loop: ComputeLoop, campaign: Campaign, tasks: Tasks, row: int, check: dispatch.StopCheck
) -> Row:
    """Compute a task of a campaign as the hand-out asks for it."""
    return loop(campaign, tasks[row], lambda *_: check())


@dataclass(eq=False)
class _Session:
    """One rank's part of a run."""

    campaign: Campaign
    plan: Plan
    writer: Writer | None
    options: Options
    signals: StopSignals
    engine: Engine
    stream: TextIO | None = None

    def __post_init__(self) -> None:
        campaign, plan, options, engine = self.campaign, self.plan, self.options, self.engine
        self._started = time.monotonic()
        at, grace = options.deadline
        self._ends = at - time.time() + self._started  # by the clock that nobody sets
        total = plan.done + plan.failed + len(plan.rows)
        self._counts = Summary(total, plan.done, plan.failed)
        self._compute = partial(_compute, engine.compute, campaign, plan.tasks)
        self._limits = dispatch.Limits(
            stop=self._stop,
            time_left=self._time_left,
            task_seconds=campaign.solver.time_limit,
            grace=grace,
            silence=engine.silence,
            report_interval=min(dispatch.REPORT_INTERVAL, engine.silence / 12),
        )

    def run(self, comm: Any, own_rows: bool) -> str | None:
        """Hand out, work, or both; returns on rank 0 why the run stopped early, or None."""
        if comm.rank > 0:
            deliver = self._write if own_rows else lambda outcome: outcome
            dispatch.Worker(MpiChannel(comm), self._compute, self._limits, deliver).run()
            return None
        limits = self._limits
        if comm.size > 1:
            return self._hand_out(MpiChannel(comm), own_rows)
        if self.options.processes and self.plan.rows:
            with Processes(self.options.processes, self._compute, limits) as channel:
                return self._hand_out(channel, own_rows)
        return self._hand_out(dispatch.OwnWorker(self._compute, limits), own_rows)

    def _hand_out(self, channel: dispatch.Channel, own_rows: bool) -> str | None:
        schedule = self._schedule()

        def collect(outcome: dispatch.Outcome) -> None:
            self._count(outcome if own_rows else self._write(outcome), progress, schedule)

        progress = ProgressLine(
            self._counts,
            lambda: schedule.seconds_left(list(master.notes), len(channel.workers)),
            self.stream,
        )

        def halted(reason: str) -> None:
            if master.notes and not isinstance(channel, dispatch.OwnWorker):
                progress.say(
                    f"{reason}: tasks in progress have up to {self._limits.grace:g} s to stop"
                    + ("; Ctrl-C again ends at once" if self.signals.received == "SIGINT" else "")
                )

        master = dispatch.Master(channel, schedule, collect, self._limits, halted=halted)
        with progress:
            return master.run()

    def summary(self, stopped: str | None, path: Path) -> Summary:
        """Return the counts, what is doubtful in the file, and how the run has ended.

        What is finished is read once more: another program may have written to the file
        (InputError, WriteError), or have copied another one over it.
        """
        summary, known = self._counts, self.plan.known
        with Results(path) as results:
            finished = np.isin(results.status(), (DONE, FAILED))
            held = np.sum(finished & (results.column(CHECKSUM.name) == known))
            cells = read_cells(results)
        if held < (count := np.sum(known >= 0)):
            raise WriteError(
                f"{path} holds {held} of {count} finished tasks: another program has "
                "changed it while a run wrote to it"
            )
        summary.precisions = precisions(cells)
        summary.doubtful = sum(int(cell.doubtful.sum()) for cell in cells)
        summary.beyond_limit = sum(int(cell.beyond_zero_range.sum()) for cell in cells)
        summary.short_of_preload = sum(cell.short_of_preload for cell in cells)
        summary.seconds = time.monotonic() - self._started
        summary.stopped = stopped if summary.pending else None
        return summary

    def _write(self, outcome: dispatch.Outcome) -> dispatch.Outcome:
        """Write a row; of its numbers the master gets those by which it is judged."""
        assert self.writer is not None
        task, rank = outcome.task, outcome.rank
        if outcome.error is not None:
            known = self.writer.write_failure(task, outcome.error, outcome.seconds, rank)
            return replace(outcome, result={CHECKSUM.name: known})
        known = self.writer.write_result(task, outcome.result, rank)
        gamma = self.plan.tasks[task].work_of_adhesion
        row = {**outcome.result, "work_of_adhesion": gamma, CHECKSUM.name: known}
        judged = (*OF_DOUBT, self.campaign.stop.quantity, CHECKSUM.name)
        return replace(outcome, result={name: row[name] for name in judged})

    def _count(self, outcome: dispatch.Outcome, progress: ProgressLine, schedule: Schedule) -> None:
        counts, what, row = self._counts, str(self.plan.tasks[outcome.task]), outcome.result
        self.plan.known[outcome.task] = row[CHECKSUM.name]
        if outcome.error is not None:
            counts.failed += 1
            counts.failed_now += 1
            progress.failure(what, outcome.error)
        else:
            counts.done += 1
            counts.computed += 1
            if doubtful(row, self.campaign.solver.accuracy):
                progress.doubt(f"{what}: {errors_text(row)}")
        if self.plan.batches is not None:
            steered = self.campaign.stop.quantity
            value = math.nan if outcome.error is not None else float(row[steered])
            further, spare = self.plan.batches.finished(outcome.task, value)
            assert self.writer is not None
            self.writer.mark(spare, NOT_NEEDED)
            self._counts.total += len(further)
            schedule.add(further)

    def _schedule(self) -> Schedule:
        # Of each task the cell without its turning point, if its loading branch is shared: such
        # tasks take about the same time.
        groups: list[tuple[float, ...]] = []
        priors: dict[Hashable, float] = {}
        for task, rows in self.plan.tasks.by_cell():
            group = self.campaign.branch_of(task).cell
            groups += [group] * rows.size
            priors[group] = prior(task)
        rounds = self.plan.tasks.column("realisation").tolist()
        schedule = Schedule(self.plan.rows, groups, priors, rounds)
        for group, seconds in zip(groups, self.plan.seconds.tolist(), strict=True):
            if not math.isnan(seconds):
                schedule.measured(group, seconds)
        return schedule

    def _stop(self) -> str | None:
        if self.signals.received is not None:
            name = self.signals.received
            return f"{'Ctrl-C (SIGINT)' if name == 'SIGINT' else name} received"
        if self._time_left() <= 0:
            return "the walltime ends"
        most = self.options.max_failures
        if self._counts.failed_now >= most:
            limit = f"{parameter('max_failures', 'adhesis run')} {most}"
            return f"{counted(self._counts.failed_now, 'task')} failed (the limit is {limit})"
        return None

    def _time_left(self) -> float:
        return self._ends - time.monotonic()
