"""Hand-out of tasks to ranks: one master, the others work. Knows ranks, not files.

Tasks are numbers; what one means, and where its result goes, is the business of three callables:

``compute(task, check)``   on the worker; returns the result. It calls ``check()`` now and then,
                           which raises :class:`GivenUp` when the run is to stop. What else it
                           raises is the task's failure, and the rest goes on.
``deliver(outcome)``       on the worker, after each task; returns what the master is to get. What
                           it raises ends the run (a disk that fails is not a task that fails).
``collect(outcome)``       on the master, after the worker already has its next task.

A waiting rank looks for a message and sleeps, it never spins: blocking receives burn a core each.
Every task that a worker is sent is answered exactly once, done or given up, so the master knows
at any time what is in flight, and a stop is over when everything is answered.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from adhesis.ensemble.run.attempt import Compute, GivenUp, Outcome, attempt
from adhesis.ensemble.run.schedule import Schedule
from adhesis.ensemble.run.units import Units

Deliver = Callable[[Outcome], Outcome]
Collect = Callable[[Outcome], None]

MASTER = 0
# Sleep between two looks for a message, growing from the first to the second value, in s.
SHORTEST_PAUSE, LONGEST_PAUSE = 1e-3, 5e-3
# A worker holds so much work ahead, by measured times in s, but at most so many tasks: it need not
# wait for the next short one while the master sleeps.
AHEAD, MOST_AHEAD = 0.05, 32


class Overdue(Exception):
    """Workers did not answer a stop in time."""


class Channel(Protocol):
    """Messages between ranks; nothing here waits."""

    rank: int
    size: int

    def send(self, to: int, message: tuple[Any, ...], *, urgent: bool = False) -> None:
        """Send a message; urgent ones are looked for while a task is in progress."""

    def poll(self, *, urgent: bool = False) -> tuple[int, tuple[Any, ...]] | None:
        """Return the next message and who sent it, or None."""


@dataclass
class Limits:
    """What ends a run early.

    Attributes
    ----------
    stop : callable
        Returns why the run is to stop now, or None. Asked on every rank.
    time_left : callable
        Returns the seconds until the deadline, or None: tasks that would not fit stay behind.
    task_seconds : float, optional
        Longest time of one task.
    grace : float
        How long workers may take to answer a stop, in s.
    """

    stop: Callable[[], str | None] = lambda: None
    time_left: Callable[[], float | None] = lambda: None
    task_seconds: float | None = None
    grace: float = 30.0


def work_alone(
    schedule: Schedule,
    group_of: Mapping[int, Hashable],
    compute: Compute,
    deliver: Deliver,
    collect: Collect,
    limits: Limits,
    units: Units | None = None,
) -> str | None:
    """Do every task in this process; returns why it stopped early, or None."""
    units = units or Units()
    while (reason := limits.stop()) is None:
        first = schedule.take(limits.time_left())
        if first is None:
            return "no time left for another task" if schedule.waiting else None
        for task in units.tasks(first):
            if (reason := limits.stop()) is not None:
                return reason
            try:
                outcome = attempt(
                    compute, task, MASTER, lambda: limits.stop() is not None, limits.task_seconds
                )
            except GivenUp:
                return limits.stop()
            outcome = deliver(outcome)
            if done := units.answered(task, _measured(outcome)):
                schedule.measured(group_of[done[0]], done[1])
            collect(outcome)
    return reason if schedule.waiting else None


def _measured(outcome: Outcome) -> float | None:
    """Time of a task that has a result."""
    return outcome.seconds if outcome.error is None else None


class Master:
    """Hands out; see the module.

    Parameters
    ----------
    channel : Channel
        Ranks 1 … size - 1 work.
    schedule : Schedule
    group_of : mapping of int to hashable
        Group of each task, for its measured time.
    collect : callable
    limits : Limits
    tick : callable
        Called often while nothing arrives (progress).
    clock, sleep : callable
        Replaced when the run is simulated.
    units : Units, optional
        Tasks that go to one worker together; the schedule knows the first one of each.
    """

    def __init__(
        self,
        channel: Channel,
        schedule: Schedule,
        group_of: Mapping[int, Hashable],
        collect: Collect,
        limits: Limits,
        tick: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        units: Units | None = None,
    ) -> None:
        self._channel = channel
        self._units = units or Units()
        self._schedule = schedule
        self._group_of = group_of
        self._collect = collect
        self._limits = limits
        self._tick = tick
        self._clock = clock
        self._sleep = sleep
        # Of each worker, the tasks that it was sent and has not answered, with the mean times of
        # their groups: nothing is queued behind a task of a group that was not measured.
        self._sent: dict[int, dict[int, float]] = {r: {} for r in range(1, channel.size)}
        # Workers that may have room, the emptiest first (entries go stale).
        self._room = [(0, rank) for rank in self._sent]
        self._halted: float | None = None
        self._reason: str | None = None

    @property
    def in_flight(self) -> int:
        """Tasks handed out and not answered."""
        return sum(map(len, self._sent.values()))

    def run(self) -> str | None:
        """Hand out until nothing waits and everything is answered.

        Returns
        -------
        str or None
            Why it stopped early.

        Raises
        ------
        Overdue
            If workers did not answer a stop within the grace time.
        """
        pause = SHORTEST_PAUSE
        self._consider_stopping()
        self._hand_out()
        while any(self._sent.values()):
            self._consider_stopping()
            message = self._channel.poll()
            if message is None:
                self._tick()
                self._sleep(pause)
                pause = min(1.5 * pause, LONGEST_PAUSE)
            else:
                pause = SHORTEST_PAUSE
                self._receive(*message)
        self._dismiss()
        if self._reason is None and self._schedule.waiting:
            return "no time left for another task"
        return self._reason

    def _consider_stopping(self) -> None:
        if self._halted is not None:
            if self._clock() - self._halted > self._limits.grace:
                raise Overdue(f"{self.in_flight} tasks did not stop in time ({self._reason})")
        elif (reason := self._limits.stop()) is not None:
            self._halt(reason)

    def _halt(self, reason: str) -> None:
        if self._halted is None:
            self._halted, self._reason = self._clock(), reason
            for rank in self._sent:
                self._channel.send(rank, ("halt",), urgent=True)

    def _receive(self, rank: int, message: tuple[Any, ...]) -> None:
        kind: Literal["outcome", "given up", "stop"] = message[0]
        if kind == "stop":  # a worker was told to stop, by a signal say
            self._halt(message[1])
            return
        if kind == "given up":
            self._units.answered(message[1], None)
            self._answered(rank, message[1])
            self._hand_out()
            return
        outcome: Outcome = message[1]
        self._answered(rank, outcome.task)
        if done := self._units.answered(outcome.task, _measured(outcome)):
            self._schedule.measured(self._group_of[done[0]], done[1])
        self._hand_out()
        self._collect(outcome)
        self._hand_out()  # what was collected may have brought further tasks

    def _answered(self, rank: int, task: int) -> None:
        del self._sent[rank][task]
        heapq.heappush(self._room, (len(self._sent[rank]), rank))

    def _hand_out(self) -> None:
        """Give every worker that has room a task, while there are any; the emptiest goes first."""
        while self._room and self._halted is None and self._schedule.waiting:
            load, rank = self._room[0]
            sent = self._sent[rank]
            if len(sent) != load or not self._has_room(sent):
                heapq.heappop(self._room)
                continue
            first = self._schedule.take(self._limits.time_left())
            if first is None:
                return
            seconds = self._schedule.mean(self._group_of[first])
            tasks = self._units.tasks(first)
            for task in tasks:
                sent[task] = math.inf if seconds is None else seconds / len(tasks)
                self._channel.send(rank, ("task", task))
            heapq.heapreplace(self._room, (len(sent), rank))

    @staticmethod
    def _has_room(sent: Mapping[int, float]) -> bool:
        return not sent or (len(sent) <= MOST_AHEAD and sum(sent.values()) < AHEAD)

    def _dismiss(self) -> None:
        for rank in self._sent:
            self._channel.send(rank, ("dismissed",))
        waiting = set(self._sent)
        while waiting:
            message = self._channel.poll()
            if message is None:
                self._sleep(SHORTEST_PAUSE)
            elif message[1][0] == "goodbye":
                waiting.discard(message[0])
            elif message[1][0] == "stop" and self._schedule.waiting:
                self._reason = self._reason or message[1][1]


class Worker:
    """Computes what it is sent until it is dismissed; see the module."""

    def __init__(
        self, channel: Channel, compute: Compute, deliver: Deliver, limits: Limits
    ) -> None:
        self._channel = channel
        self._compute = compute
        self._deliver = deliver
        self._limits = limits
        self._halted = False
        self._told = False

    def run(self) -> None:
        """Work until dismissed."""
        pause = SHORTEST_PAUSE
        while True:
            stopped = self._stopped()
            message = self._channel.poll()
            if message is None:
                time.sleep(pause)
                pause = min(1.5 * pause, LONGEST_PAUSE)
                continue
            pause = SHORTEST_PAUSE
            kind, *rest = message[1]
            if kind == "dismissed":
                self._channel.send(MASTER, ("goodbye",))
                return
            (task,) = rest
            if stopped:
                self._channel.send(MASTER, ("given up", task))
            else:
                self._do(task)

    def _do(self, task: int) -> None:
        channel = self._channel
        try:
            outcome = attempt(
                self._compute, task, channel.rank, self._stopped, self._limits.task_seconds
            )
        except GivenUp:
            channel.send(MASTER, ("given up", task))
        else:
            channel.send(MASTER, ("outcome", self._deliver(outcome)))

    def _stopped(self) -> bool:
        """Whether the master says stop, or a signal to this rank; the master is told of that."""
        if not self._halted and self._channel.poll(urgent=True) is not None:
            self._halted = True
        if not self._halted and not self._told and (reason := self._limits.stop()) is not None:
            self._told = True
            self._channel.send(MASTER, ("stop", reason))
        return self._halted or self._told
