"""Run the loops of a trace side by side, by the hand-out that campaigns have."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

from adhesis.ensemble.run.attempt import Outcome, StopCheck
from adhesis.ensemble.run.dispatch import Channel, Limits, Master, OwnWorker
from adhesis.ensemble.run.processes import Processes
from adhesis.ensemble.run.schedule import Schedule
from adhesis.ensemble.trace.job import Job, run

Result = dict[str, Any]
Watch = Callable[["Loops"], None]

_REPORT_INTERVAL = 1.0  # s


def _compute(jobs: Sequence[Job], task: int, check: StopCheck) -> Result:
    """Run a job as the hand-out asks for it."""
    return run(jobs[task], lambda branch, drive, _: check((branch, drive)))


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
        expected = [(seconds or {}).get(job.name, 1.0) for job in self._jobs]
        priors: dict[Hashable, float] = dict(enumerate(expected))
        self._groups = {task: task for task in range(self.count)}
        rounds = dict.fromkeys(self._groups, 0)
        self._schedule = Schedule(self._groups, self._groups, priors, rounds)
        self._master: Master | None = None

    @property
    def seconds_left(self) -> float | None:
        """Estimated time to the end, in s; None if nothing is known yet."""
        in_flight = [] if self._master is None else list(self._master.notes)
        return self._schedule.seconds_left(in_flight, max(self.processes, 1))

    @property
    def running(self) -> dict[str, tuple[str, float]]:
        """By job name: the branch and prescribed value reached."""
        notes = {} if self._master is None else dict(self._master.notes)  # another thread may ask
        return {self._jobs[k].name: note or ("loading", 0.0) for k, note in notes.items()}

    def run(
        self, watch: Watch | None = None, every: float = _REPORT_INTERVAL
    ) -> dict[str, Result | str]:
        """Run all jobs; ``watch`` is called at this interval (s), and when a loop is done."""
        computing, last = partial(_compute, self._jobs), -math.inf

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
                channel = OwnWorker(computing, lambda outcome: outcome, limits)
            else:
                channel = started = Processes(self.processes, computing, report_interval=every)
                stack.enter_context(started)
                self.pids = started.pids
            self._master = Master(channel, self._schedule, self._groups, collect, limits, tick)
            self._master.run()
        return self.done
