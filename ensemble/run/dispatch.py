"""Hand-out of tasks to workers by one master. Knows ranks, not files.

Tasks are numbers; what one means, and where its result goes, is the business of three callables:

``compute(task, check)``   on the worker; returns the result. It calls ``check()`` now and then,
                           which raises :class:`GivenUp` when the run is to stop. What else it
                           raises is the task's failure, and the rest goes on.
``deliver(outcome)``       on the worker, after each task; returns what the master is to get. What
                           it raises ends the run (a disk that fails is not a task that fails).
``collect(outcome)``       on the master, after the worker already has its next task.

Messages go through a :class:`Channel`: MPI between ranks, sockets between processes of one machine,
or :class:`OwnWorker`, where the master's process works itself. A waiting rank looks for a message
and sleeps, it never spins: blocking receives burn a core each. Every task that a worker is sent is
answered exactly once, done or given up, so the master knows at any time what is in flight, and a
stop is over when everything is answered.

========================  ==========  ======================================================
message                   from        meaning
========================  ==========  ======================================================
``("task", task)``        master      compute it
``("halt",)``             master      give up what was sent; looked for during a task
``("dismissed",)``        master      nothing more will come
``("alive", task, note)`` worker      it still computes; ``note`` is what ``check`` was given
``("outcome", outcome)``  worker      of one task
``("given up", task)``    worker      not computed, as the run stops
``("stop", reason)``      worker      asked to stop the run, such as by a signal
``("ended", why)``        channel     the worker's process has ended; another one takes over
``("goodbye",)``          worker      answers its dismissal
========================  ==========  ======================================================

The hand-out is crash-only: a worker that was not heard from for :attr:`Limits.silence` ends the
run with :class:`Unresponsive`. What was delivered is kept, so the same run can simply be started
again; nobody has to decide which of two workers has a task.
"""

from __future__ import annotations

import heapq
import math
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Any, Protocol

from adhesis.ensemble.run.interrupt import in_main_thread, raised_by_handler
from adhesis.ensemble.run.schedule import Schedule
from adhesis.solver.checks import counted

# Called by a task now and then, perhaps with a note on how far it is; it raises to end the task.
StopCheck = Callable[..., None]
Compute = Callable[[int, StopCheck], Any]
Message = tuple[Any, ...]

MASTER = 0
# Sleep between two looks for a message, growing from the first to the second value, in s.
SHORTEST_PAUSE, LONGEST_PAUSE = 1e-3, 5e-3
# A worker holds so much work ahead, by measured times in s, but at most so many tasks: it need not
# wait for the next short one while the master sleeps.
AHEAD, MOST_AHEAD = 0.05, 32
# A worker that was not heard from for so long (s) ends the run; it reports at this interval (s).
SILENCE, REPORT_INTERVAL = 120.0, 10.0
# Interval at which a task in progress checks whether to stop, in s.
WATCH_INTERVAL = 0.5
# A look of the master counts as at most so much silence (s): messages wait while it is held up.
_LONGEST_LOOK = 1.0


class GivenUp(BaseException):
    """Raised in a task when the run stops; not an Exception, so that no task handles it."""


class TimeLimit(BaseException):
    """Raised in a task that exceeds its time limit."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a task."""

    task: int
    rank: int  # rank that computed it
    seconds: float  # wall time
    error: str | None = None  # reason of a failure
    result: Any = None  # return value of ``compute``, until ``deliver`` has stored it


Deliver = Callable[[Outcome], Outcome]
Collect = Callable[[Outcome], None]


class Unresponsive(RuntimeError):
    """Error for workers that did not answer in time: what was delivered is kept."""


class Channel(Protocol):
    """Messages between a master and its workers; nothing here waits."""

    rank: int  # the own one
    workers: Sequence[int]  # ranks that work

    def send(self, to: int, message: Message, *, urgent: bool = False) -> None:
        """Send a message; urgent ones are looked for while a task is in progress."""

    def poll(self, *, urgent: bool = False) -> tuple[int, Message] | None:
        """Return the next message and who sent it, or None."""


@dataclass
class Limits:
    """Reasons that end a run early."""

    # Returns why the run is to stop now, or None. Asked on every rank.
    stop: Callable[[], str | None] = lambda: None
    # Returns the seconds until the deadline: tasks that would not fit stay behind
    time_left: Callable[[], float] = lambda: math.inf
    task_seconds: float | None = None  # longest time of one task
    grace: float = 30.0  # how long workers may take to answer a stop or their dismissal, in s
    silence: float = SILENCE  # how long a worker may not be heard from until the run ends, in s
    # Time between two signs of life of a worker, in s; several fit into ``silence``
    report_interval: float = REPORT_INTERVAL


@dataclass(eq=False)
class Master:
    """Master of a hand-out; see the module."""

    channel: Channel
    schedule: Schedule
    collect: Collect
    limits: Limits
    tick: Callable[[], None] = lambda: None  # called often while nothing arrives (progress)
    halted: Callable[[str], None] = lambda reason: None  # called when a stop begins
    # clock, sleep: replaced when the run is simulated
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep

    def __post_init__(self) -> None:
        # Last note of each task in flight, handed out and not answered; None before the first.
        self.notes: dict[int, Any] = {}
        # Of each worker, the tasks that it was sent and has not answered, with the mean times of
        # their groups: nothing is queued behind a task of a group that was not measured.
        self._sent: dict[int, dict[int, float]] = {rank: {} for rank in self.channel.workers}
        # Workers that may have room, the emptiest first (entries go stale).
        self._room = [(0, rank) for rank in self._sent]
        self._halted: float | None = None
        self._reason: str | None = None
        # Time that the master was awake, and when each worker was last heard from by that clock; a
        # process that starts is heard from when it has loaded what it takes.
        self._awake, self._looked, self._next_count = 0.0, self.clock(), 0.0
        self._heard: dict[int, float] = {}

    def run(self) -> str | None:
        """Hand out until everything is answered; return why it stopped early, or None.

        Unresponsive if a worker was silent for too long, or did not answer a stop within the grace
        time.
        """
        pause = SHORTEST_PAUSE
        self._consider_stopping()
        self._hand_out()
        while self.notes:
            self._consider_stopping()
            message = self._look()
            if message is None:
                self.tick()
                self.sleep(pause)
                pause = min(1.5 * pause, LONGEST_PAUSE)
            else:
                pause = SHORTEST_PAUSE
                self._receive(*message)
        self._dismiss()
        if self._reason is None and self.schedule.waiting:
            return "no time left for another task"
        return self._reason

    def _look(self) -> tuple[int, Message] | None:
        """Return the next message; if there is none, look for workers that are silent."""
        message = self.channel.poll()
        now = self.clock()
        self._awake += min(now - self._looked, _LONGEST_LOOK)
        self._looked = now
        if message is not None:
            self._heard[message[0]] = self._awake
        elif self._awake > self._next_count:
            self._next_count = self._awake + self.limits.silence / 12
            longest = self.limits.silence
            for rank, heard in self._heard.items():
                if self._awake - heard > longest:
                    raise Unresponsive(f"rank {rank} has not answered for {longest:g} s")
        return message

    def _consider_stopping(self) -> None:
        if self._halted is not None:
            if self.clock() - self._halted > self.limits.grace:
                tasks = counted(len(self.notes), "task")
                raise Unresponsive(f"{tasks} did not stop in time ({self._reason})")
        elif (reason := self.limits.stop()) is not None:
            self._halt(reason)

    def _halt(self, reason: str) -> None:
        if self._halted is None:
            self._halted, self._reason = self.clock(), reason
            for rank in self._sent:
                self.channel.send(rank, ("halt",), urgent=True)
            self.halted(reason)

    def _receive(self, rank: int, message: Message) -> None:
        kind, *content = message
        if kind == "alive":
            task, note = content
            if task in self._sent[rank]:
                self.notes[task] = note
        elif kind == "stop":
            self._halt(content[0])
        elif kind == "given up":
            self._answered(rank, content[0])
            self._hand_out()
        elif kind == "ended":
            self._heard.pop(rank, None)
            for task in list(self._sent[rank]):
                self._finish(rank, Outcome(task, rank, 0.0, error=content[0]))
        else:
            self._finish(rank, content[0])

    def _finish(self, rank: int, outcome: Outcome) -> None:
        self._answered(rank, outcome.task)
        if outcome.error is None:
            self.schedule.measured(self.schedule.group_of[outcome.task], outcome.seconds)
        self._hand_out()
        self.collect(outcome)
        self._hand_out()  # what was collected may have brought further tasks

    def _answered(self, rank: int, task: int) -> None:
        del self._sent[rank][task]
        self.notes.pop(task, None)
        heapq.heappush(self._room, (len(self._sent[rank]), rank))

    def _hand_out(self) -> None:
        """Give every worker that has room a task, while there are any; the emptiest goes first."""
        while self._room and self._halted is None and self.schedule.waiting:
            load, rank = self._room[0]
            sent = self._sent[rank]
            has_room = not sent or (load <= MOST_AHEAD and sum(sent.values()) < AHEAD)
            if len(sent) != load or not has_room:
                heapq.heappop(self._room)
                continue
            tasks = self.schedule.take(self.limits.time_left())
            if not tasks:
                return
            seconds = self.schedule.mean(self.schedule.group_of[tasks[0]])
            for task in tasks:
                sent[task] = math.inf if seconds is None else seconds
                self.notes[task] = None
                self.channel.send(rank, ("task", task))
            heapq.heapreplace(self._room, (len(sent), rank))

    def _dismiss(self) -> None:
        for rank in self._sent:
            self.channel.send(rank, ("dismissed",))
        waiting, end = set(self._sent), self.clock() + self.limits.grace
        while waiting:
            message = self._look()
            if message is None:
                if self.clock() > end:  # what has no task answers at once, or hangs
                    names = ", ".join(map(str, sorted(waiting)))
                    raise Unresponsive(f"rank {names} did not answer at the end")
                self.sleep(SHORTEST_PAUSE)
            elif message[1][0] in ("goodbye", "ended"):
                waiting.discard(message[0])
                self._heard.pop(message[0], None)
            elif message[1][0] == "stop" and self.schedule.waiting:
                self._reason = self._reason or message[1][1]


@contextmanager
def _watched(check: StopCheck) -> Iterator[None]:
    """Call ``check`` from a timer too: a task may hang before it calls it itself.

    A timer of the caller's own stays, and there is none of ours then.
    """
    if not in_main_thread() or signal.getitimer(signal.ITIMER_REAL)[0] > 0:
        yield
        return
    finished = False

    def on_alarm(number: int, frame: FrameType | None) -> None:
        nonlocal finished
        if not finished:
            try:
                check()
            except BaseException:
                finished = True  # a second exception would interrupt the unwinding of this one
                raise

    before = signal.signal(signal.SIGALRM, on_alarm)
    try:
        signal.setitimer(signal.ITIMER_REAL, WATCH_INTERVAL, WATCH_INTERVAL)
        yield
    finally:
        finished = True
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL if before is None else before)


@dataclass(eq=False)
class Worker:
    """Worker of a hand-out: computes what it is sent until it is dismissed; see the module."""

    channel: Channel
    compute: Compute
    limits: Limits
    deliver: Deliver = lambda outcome: outcome
    clock: Callable[[], float] = time.monotonic  # replaced in tests

    def __post_init__(self) -> None:
        self._stops = False  # as the master or a signal to this rank asks
        self._looking = False
        self._reported_at = -math.inf
        self._task: int | None = None
        self._note: Any = None

    def run(self) -> None:
        """Work until dismissed."""
        while self.act(self._received()):
            pass

    def act(self, message: Message) -> bool:
        """Act on a message; returns whether more may come."""
        if message[0] == "dismissed":
            self.channel.send(MASTER, ("goodbye",))
            return False
        task = self._task = message[1]
        self._note = None
        answer: Message = ("given up", task)
        if not self._stopped():
            with suppress(GivenUp):
                answer = ("outcome", self.deliver(self._attempt(task)))
        self._task = None
        self.channel.send(MASTER, answer)
        return True

    def _attempt(self, task: int) -> Outcome:
        """Compute one task; failures become part of the outcome, what a handler raises passes."""
        started, limit = time.perf_counter(), self.limits.task_seconds

        def check(note: Any = None) -> None:
            if self._stopped(note):
                raise GivenUp
            if limit is not None and time.perf_counter() > started + limit:
                raise TimeLimit(f"longer than the time limit of {limit:g} s")

        result, error = None, None
        try:
            with _watched(check):
                result = self.compute(task, check)
        except TimeLimit as failure:
            error = str(failure)
        except Exception as failure:
            if raised_by_handler(failure):
                raise
            error = f"{type(failure).__name__}: {failure}"
        return Outcome(task, self.channel.rank, time.perf_counter() - started, error, result)

    def _received(self) -> Message:
        pause = SHORTEST_PAUSE
        while (message := self.channel.poll()) is None:
            self._stopped()
            time.sleep(pause)
            pause = min(1.5 * pause, LONGEST_PAUSE)
        return message[1]

    def _stopped(self, note: Any = None) -> bool:
        """Whether the master or a signal to this rank asks to stop; a signal is passed on."""
        if note is not None:
            self._note = note
        if not self._looking:  # the timer of a task may go off within a look
            self._looking = True
            try:
                self._look()
            finally:
                self._looking = False
        return self._stops

    def _look(self) -> None:
        """Report if it is time to, and look for urgent messages."""
        now = self.clock()
        if now - self._reported_at > self.limits.report_interval:
            self._reported_at = now
            self.channel.send(MASTER, ("alive", self._task, self._note))
        while self.channel.poll(urgent=True) is not None:
            self._stops = True
        if not self._stops and (reason := self.limits.stop()) is not None:
            self._stops = True
            self.channel.send(MASTER, ("stop", reason))


class OwnWorker:
    """Channel of a master whose own process works: on a task each time it looks for a message.

    Both ends of it are this object: the worker alone looks for urgent messages.
    """

    def __init__(self, compute: Compute, limits: Limits) -> None:
        self.rank = MASTER
        self.workers: Sequence[int] = (MASTER + 1,)
        self._tasks: deque[Message] = deque()
        self._urgent: deque[Message] = deque()
        self._answers: deque[Message] = deque()
        self._worker = Worker(self, compute, limits)

    def send(self, to: int, message: Message, *, urgent: bool = False) -> None:
        """Keep a message for the other end."""
        box = self._urgent if urgent else self._tasks
        (self._answers if to == MASTER else box).append(message)

    def poll(self, *, urgent: bool = False) -> tuple[int, Message] | None:
        """Return what the other end has sent; if there is nothing, let the worker work."""
        if urgent:
            return (MASTER, self._urgent.popleft()) if self._urgent else None
        if not self._answers and self._tasks:
            self._worker.act(self._tasks.popleft())
        return (self.workers[0], self._answers.popleft()) if self._answers else None
