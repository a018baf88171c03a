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

A worker sends heartbeats from its main thread, wherever it looks whether it is to stop: no further
thread uses MPI. One that was not heard from for :attr:`Limits.silence` is out of reach, and its
tasks are handed out again. It may come back, so each task has one owner, who alone delivers it:

- before it delivers, a worker claims the task, and what is claimed is not handed out again;
- it waits for the answer, and the first claim is granted, unless nobody else can have the task: it
  was handed out for the first time, the master has never handed the worker's tasks to others, and
  cannot have done so since, as it has answered a heartbeat of less than half that time ago.

A worker that is out of reach at the end is not waited for: :attr:`Master.out_of_reach`.
"""

from __future__ import annotations

import heapq
import math
import time
from collections import deque
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
# A worker that was not heard from for so long (s) is out of reach. Its heartbeats come at the first
# share of that; after the second share without an answer it asks before it delivers a task.
SILENCE, BEAT_SHARE, LEASE_SHARE = 120.0, 1 / 12, 0.5
# A look of the master counts as at most so much silence (s): messages wait while it is held up.
_LONGEST_LOOK = 1.0


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
    """Reasons that end a run early.

    Attributes
    ----------
    stop : callable
        Returns why the run is to stop now, or None. Asked on every rank.
    time_left : callable
        Returns the seconds until the deadline, or None: tasks that would not fit stay behind.
    task_seconds : float, optional
        Longest time of one task.
    grace : float
        How long workers may take to answer a stop or their dismissal, in s.
    silence : float
        How long a worker may not be heard from until its tasks are handed to others, in s.
    """

    stop: Callable[[], str | None] = lambda: None
    time_left: Callable[[], float | None] = lambda: None
    task_seconds: float | None = None
    grace: float = 30.0
    silence: float = SILENCE


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
    report : callable
        Gets a line about a worker that is out of reach, or back.
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
        report: Callable[[str], None] = lambda text: None,
    ) -> None:
        self._channel = channel
        self._report = report
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
        self._dismissed = False
        # Time that the master was awake, when each worker was last heard from by that clock, and
        # the workers that are out of reach.
        self._awake, self._looked, self._next_count = 0.0, clock(), 0.0
        self._heard = dict.fromkeys(self._sent, 0.0)
        self._silent: set[int] = set()
        self._recalled: set[int] = set()  # that ever were
        # Who delivers a task that was claimed; tasks that were handed out again, and those of them
        # that are done.
        self._owner: dict[int, int] = {}
        self._shared: set[int] = set()
        self._finished: set[int] = set()

    @property
    def in_flight(self) -> int:
        """Tasks handed out and not answered."""
        return sum(len(tasks) for rank, tasks in self._sent.items() if rank not in self._silent)

    @property
    def out_of_reach(self) -> tuple[int, ...]:
        """Workers that have not answered their dismissal, once the run is over."""
        return tuple(sorted(self._silent))

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
        while self._waits():
            self._consider_stopping()
            message = self._look()
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

    def _waits(self) -> bool:
        """Whether a worker within reach has a task, or could have one if any were within reach."""
        if not self._silent:
            return any(self._sent.values())
        if any(tasks for rank, tasks in self._sent.items() if rank not in self._silent):
            return True
        if self._halted is not None or len(self._silent) < len(self._sent):
            return False
        return bool(self._schedule.waiting) or any(self._sent.values())

    def _look(self) -> tuple[int, tuple[Any, ...]] | None:
        """Return the next message; if there is none, look for workers that are out of reach."""
        message = self._channel.poll()
        now = self._clock()
        self._awake += min(now - self._looked, _LONGEST_LOOK)
        self._looked = now
        if message is not None:
            self._heard[message[0]] = self._awake
            if message[0] in self._silent:
                self._silent.discard(message[0])
                self._report(f"rank {message[0]} answers again")
                heapq.heappush(self._room, (len(self._sent[message[0]]), message[0]))
        elif self._awake > self._next_count:
            self._next_count = self._awake + self._limits.silence * BEAT_SHARE
            for rank, heard in self._heard.items():
                if rank not in self._silent and self._awake - heard > self._limits.silence:
                    self._recall(rank)
        return message

    def _recall(self, rank: int) -> None:
        """Let others do the tasks of a worker that is out of reach."""
        self._silent.add(rank)
        self._recalled.add(rank)
        within_reach = (tasks for r, tasks in self._sent.items() if r not in self._silent)
        kept = {task for tasks in within_reach for task in tasks} | self._finished
        tasks = [t for t in self._sent[rank] if t not in kept and t not in self._owner]
        for task in tasks:
            self._units.answered(task, None)
        self._shared.update(tasks)
        self._schedule.add(self._units.form(tasks))
        text = f"rank {rank} does not answer for {self._limits.silence:g} s"
        if self._sent[rank]:
            text += f": {len(tasks)} of its {len(self._sent[rank])} tasks are handed to others"
        self._report(text)
        self._hand_out()

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
        kind: Literal["alive", "claim", "outcome", "given up", "stop"] = message[0]
        if kind == "alive":
            answer = ("heard", message[1], rank in self._recalled)
            self._channel.send(rank, answer, urgent=True)
            self._hand_out()  # it may have come back
            return
        if kind == "stop":  # a worker received a request to stop, such as a signal
            self._halt(message[1])
            return
        if kind == "claim":
            _, task, waits = message
            granted = task not in self._finished and self._owner.setdefault(task, rank) == rank
            if waits:
                self._channel.send(rank, ("answer", granted))
            return
        if kind == "given up":
            if message[1] not in self._shared:
                self._units.answered(message[1], None)
            self._answered(rank, message[1])
            self._hand_out()
            return
        outcome: Outcome = message[1]
        self._answered(rank, outcome.task)
        self._owner.pop(outcome.task, None)
        if outcome.task in self._shared:
            self._finished.add(outcome.task)
        elif done := self._units.answered(outcome.task, _measured(outcome)):
            self._schedule.measured(self._group_of[done[0]], done[1])
        self._hand_out()
        self._collect(outcome)
        self._hand_out()  # what was collected may have brought further tasks

    def _answered(self, rank: int, task: int) -> None:
        del self._sent[rank][task]
        heapq.heappush(self._room, (len(self._sent[rank]), rank))

    def _hand_out(self) -> None:
        """Give every worker that has room a task, while there are any; the emptiest goes first."""
        if self._dismissed:
            return
        while self._room and self._halted is None and self._schedule.waiting:
            load, rank = self._room[0]
            sent = self._sent[rank]
            if rank in self._silent or len(sent) != load or not self._has_room(sent):
                heapq.heappop(self._room)
                continue
            first = self._schedule.take(self._limits.time_left())
            if first is None:
                return
            seconds = self._schedule.mean(self._group_of[first])
            tasks = self._units.tasks(first)
            for task in tasks:
                sent[task] = math.inf if seconds is None else seconds / len(tasks)
                self._channel.send(rank, ("task", task, task in self._shared))
            heapq.heapreplace(self._room, (len(sent), rank))

    @staticmethod
    def _has_room(sent: Mapping[int, float]) -> bool:
        return not sent or (len(sent) <= MOST_AHEAD and sum(sent.values()) < AHEAD)

    def _dismiss(self) -> None:
        self._dismissed = True
        for rank in self._sent:
            if rank in self._silent:  # nobody needs what it may still compute
                self._channel.send(rank, ("halt",), urgent=True)
            self._channel.send(rank, ("dismissed",))
        waiting, end = set(self._sent), self._clock() + self._limits.grace
        while waiting - self._silent:
            message = self._look()
            if message is None:
                if self._clock() > end:  # what has no task answers at once, or hangs
                    self._silent |= waiting
                self._sleep(SHORTEST_PAUSE)
            elif message[1][0] == "goodbye":
                waiting.discard(message[0])
                del self._heard[message[0]]
            elif message[1][0] != "stop":
                self._receive(*message)
            elif self._schedule.waiting:
                self._reason = self._reason or message[1][1]


class Worker:
    """Computes what it is sent until it is dismissed; see the module.

    Parameters
    ----------
    channel : Channel
    compute, deliver : callable
    limits : Limits
    clock : callable
        Replaced in tests.
    """

    def __init__(
        self,
        channel: Channel,
        compute: Compute,
        deliver: Deliver,
        limits: Limits,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._channel = channel
        self._compute = compute
        self._deliver = deliver
        self._limits = limits
        self._clock = clock
        self._halted = False
        self._reported = False
        self._looking = False
        # When it last sent a heartbeat, when the last one was that the master has answered, and
        # whether the master ever handed its tasks to others: they may lie among its messages yet.
        self._beat_at = self._answered_at = -math.inf
        self._recalled = False
        self._inbox: deque[tuple[Any, ...]] = deque()

    def run(self) -> None:
        """Work until dismissed."""
        while True:
            kind, *rest = self._inbox.popleft() if self._inbox else self._received()
            if kind == "dismissed":
                self._channel.send(MASTER, ("goodbye",))
                return
            task, shared = rest
            if self._stopped():
                self._channel.send(MASTER, ("given up", task))
            else:
                self._do(task, shared)

    def _received(self) -> tuple[Any, ...]:
        """Wait for the next message."""
        pause = SHORTEST_PAUSE
        while (message := self._channel.poll()) is None:
            self._stopped()
            time.sleep(pause)
            pause = min(1.5 * pause, LONGEST_PAUSE)
        return message[1]

    def _do(self, task: int, shared: bool) -> None:
        try:
            outcome = attempt(
                self._compute, task, self._channel.rank, self._stopped, self._limits.task_seconds
            )
            given_up = not self._may_deliver(task, shared)
        except GivenUp:
            given_up = True
        answer = ("given up", task) if given_up else ("outcome", self._deliver(outcome))
        self._channel.send(MASTER, answer)

    def _may_deliver(self, task: int, shared: bool) -> bool:
        """Claim a task; wait for the answer if somebody else may have it."""
        if not shared:
            self._channel.send(MASTER, ("claim", task, False))
            self._look()
            lease = self._limits.silence * LEASE_SHARE
            if not self._recalled and self._clock() - self._answered_at < lease:
                return True
        self._channel.send(MASTER, ("claim", task, True))
        while (message := self._received())[0] != "answer":
            self._inbox.append(message)
        granted: bool = message[1]
        return granted

    def _stopped(self) -> bool:
        """Whether the master or a signal to this rank asks to stop; a signal is passed on."""
        if not self._looking:  # the timer of a task may go off within a look
            self._looking = True
            try:
                self._look()
            finally:
                self._looking = False
        return self._halted or self._reported

    def _look(self) -> None:
        """Send a heartbeat if it is time to, and look for urgent messages."""
        now = self._clock()
        if now - self._beat_at > self._limits.silence * BEAT_SHARE:
            self._beat_at = now
            self._channel.send(MASTER, ("alive", now))
        while (message := self._channel.poll(urgent=True)) is not None:
            kind, *rest = message[1]
            if kind == "heard":
                self._answered_at, self._recalled = rest
            else:
                self._halted = True
        if not self._halted and not self._reported and (reason := self._limits.stop()) is not None:
            self._reported = True
            self._channel.send(MASTER, ("stop", reason))
