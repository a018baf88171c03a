"""Run the loops of a trace side by side, by the hand-out that campaigns have."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from adhesis.ensemble.run.dispatch import Channel, Limits, Master, Outcome, OwnWorker, StopCheck
from adhesis.ensemble.run.processes import Processes
from adhesis.ensemble.run.schedule import Schedule
from adhesis.ensemble.trace.job import Job, run

Result = dict[str, Any]
Watch = Callable[["Loops"], None]

_REPORT_INTERVAL = 1.0  # s


@dataclass(frozen=True)
class _Computing:
    """``compute`` of :mod:`adhesis.ensemble.run.dispatch`, for jobs."""

    jobs: tuple[Job, ...]

    def __call__(self, task: int, check: StopCheck) -> Result:
        started = time.monotonic()
        return run(
            self.jobs[task],
            lambda branch, drive, _: check((time.monotonic() - started, branch, drive)),
        )


class Loops:
    """Loops of a plan in processes, the longest first; 0 processes run them in this one.

    ``seconds`` are expected, by job name. ``done`` holds the result by job name, the error text of
    a failed loop; ``pids`` the ids of the processes.
    """

    def __init__(
        self, jobs: Sequence[Job], processes: int, seconds: Mapping[str, float] | None = None
    ) -> None:
        self._jobs = tuple(jobs)
        self.count = len(self._jobs)
        self.processes = min(processes, self.count)
        self.done: dict[str, Result | str] = {}
        self.pids: list[int] = []
        expected = seconds or {}
        tasks = range(self.count)
        priors: dict[Hashable, float] = {
            task: expected.get(self._jobs[task].name, 1.0) for task in tasks
        }
        self._schedule = Schedule(tasks, dict(enumerate(tasks)), priors, dict.fromkeys(tasks, 0))
        self._master: Master | None = None

    @property
    def seconds_left(self) -> float | None:
        """Estimated time to the end, in s; None if nothing is known yet."""
        in_flight = [] if self._master is None else list(self._master.notes)
        return self._schedule.seconds_left(in_flight, max(self.processes, 1))

    @property
    def running(self) -> dict[str, tuple[float, str, float]]:
        """By job name: seconds so far, and the branch and prescribed value reached."""
        if self._master is None:
            return {}
        notes = dict(self._master.notes)  # another thread may ask
        return {self._jobs[k].name: note or (0.0, "loading", 0.0) for k, note in notes.items()}

    def run(
        self, watch: Watch | None = None, every: float = _REPORT_INTERVAL
    ) -> dict[str, Result | str]:
        """Run all jobs; ``watch`` is called at this interval (s), and when a loop is done."""
        computing, last = _Computing(self._jobs), -math.inf

        def tick() -> None:
            nonlocal last
            if watch is not None and time.monotonic() - last >= every:
                last = time.monotonic()
                watch(self)

        def collect(outcome: Outcome) -> None:
            nonlocal last
            name = self._jobs[outcome.task].name
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
                channel = started = Processes(self.processes, computing, limits)
                stack.enter_context(started)
                self.pids = started.pids
            self._master = Master(channel, self._schedule, collect, limits, tick)
            self._master.run()
        return self.done
