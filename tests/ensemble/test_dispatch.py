"""Hand-out: order, balance, failures and stops, with workers that are simulated."""

import heapq
import os
import random
import signal
import subprocess
import time

import numpy as np
import pytest

from adhesis.ensemble.run.dispatch import (
    REPORT_INTERVAL,
    Limits,
    Master,
    Outcome,
    OwnWorker,
    Unresponsive,
    Worker,
)
from adhesis.ensemble.run.processes import Processes
from adhesis.ensemble.run.schedule import Schedule
from tools.interrupted import Interrupt


class Scripted:
    """A channel whose messages come at given times of a clock that sleep moves on."""

    def __init__(self, workers, messages=()):
        self.rank, self.workers, self.now = 0, range(1, workers + 1), 0.0
        self.messages = sorted(messages, key=lambda m: m[0])
        self.sent = []

    def clock(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds

    def send(self, to, message, *, urgent=False):
        self.sent.append((to, message))

    def poll(self, *, urgent=False):
        if self.messages and self.messages[0][0] <= self.now:
            return self.messages.pop(0)[1:]
        return None


MESSAGE_TIME = 20e-6  # s


class SimulatedRanks(Scripted):
    """A channel whose workers take simulated time; also the clock and the sleep of the master."""

    def __init__(self, workers, seconds, *, halts=True):
        super().__init__(workers)
        self._seconds = seconds
        self._halts = halts
        self.busy = 0.0
        self._queue = {rank: [] for rank in range(1, workers + 1)}
        self._ends: list[tuple[float, int, tuple]] = []
        for rank in self._queue:
            self._report_later(rank)

    def _report_later(self, rank):
        at = self.now + REPORT_INTERVAL
        heapq.heappush(self._ends, (at, rank, ("alive", None, None)))

    def send(self, to, message, *, urgent=False):
        self.now += MESSAGE_TIME
        if message[0] == "dismissed":
            self._ends = [e for e in self._ends if (e[1], e[2][0]) != (to, "alive")]
            heapq.heapify(self._ends)
            heapq.heappush(self._ends, (self.now, to, ("goodbye",)))
        elif message[0] == "halt":
            if self._halts:  # what is in flight is given up at the next load step
                mine = [e for e in self._ends if e[1] == to and e[2][0] == "outcome"]
                for entry in mine:
                    self._ends.remove(entry)
                    given_up = ("given up", entry[2][1].task)
                    heapq.heappush(self._ends, (self.now + 0.1, to, given_up))
                heapq.heapify(self._ends)
        else:
            task = message[1]
            start = max([self.now, *(t for t, r, _ in self._queue[to])])
            seconds = self._seconds[task]
            self.busy += seconds
            end = start + seconds
            self._queue[to] = [(end, to, task)]
            heapq.heappush(self._ends, (end, to, ("outcome", Outcome(task, to, seconds))))

    def poll(self, *, urgent=False):
        self.now += 1e-6
        if self._ends and self._ends[0][0] <= self.now:
            _, rank, message = heapq.heappop(self._ends)
            self.now += MESSAGE_TIME
            if message[0] == "alive":
                self._report_later(rank)
            return rank, message
        return None


def schedule_of(tasks, group_of=None, key_of=None):
    """Return a schedule in which every group has one task, or those with one key, a round."""
    met: dict[object, list[object]] = {}
    rounds = {}
    group_of = group_of or dict.fromkeys(tasks, 0)
    for task in tasks:
        key, keys = (key_of or {}).get(task, task), met.setdefault(group_of[task], [])
        if key not in keys[-1:]:
            keys.append(key)
        rounds[task] = len(keys)
    return Schedule(tasks, group_of, dict.fromkeys(met, 1.0), rounds)


def hand_out(channel, schedule, limits=None, collected=None):
    """Return the outcomes of the workers of a channel, whose clock counts, and why it ended."""
    collected = [] if collected is None else collected
    is_scripted = isinstance(channel, Scripted)
    clock = {"clock": channel.clock, "sleep": channel.sleep} if is_scripted else {}
    reason = Master(channel, schedule, collected.append, limits or Limits(), **clock).run()
    return collected, reason


def simulate(workers, seconds, groups=None, limits=None, kind=SimulatedRanks, **ranks):
    channel = kind(workers, seconds, **ranks)
    schedule = schedule_of(range(len(seconds)), groups)
    return channel, *hand_out(channel, schedule, limits(channel) if limits else None)


def test_a_thousand_workers_are_kept_busy():
    """Times as a paper-scale campaign has them: groups 30 times apart, scattered by half."""
    random.seed(3)
    groups = {i: i % 9 for i in range(3_000)}
    seconds = [(1 + 4 * groups[i]) * random.uniform(0.5, 1.5) for i in range(3_000)]
    channel, collected, _ = simulate(1000, seconds, groups)
    assert len(collected) == 3_000
    assert channel.now <= 1.05 * channel.busy / 1000 + max(seconds)


@pytest.mark.parametrize(("workers", "seconds"), [(4, 2e-3), (2, 0.3e-3)])
def test_short_tasks_are_queued_ahead_and_do_not_wait_for_the_sleeping_master(workers, seconds):
    channel, collected, _ = simulate(workers, [seconds] * 4000)
    assert sorted(o.task for o in collected) == list(range(4000))
    assert channel.now <= 1.15 * channel.busy / workers


def test_the_longest_tasks_go_first_once_they_are_known():
    group_of = {0: "short", 1: "short", 2: "long", 3: "long", 4: "new"}
    round_of = {0: 0, 1: 1, 2: 0, 3: 1, 4: 0}
    schedule = Schedule(range(5), group_of, {"short": 3.0, "long": 2.0, "new": 1.0}, round_of)
    assert schedule.take() == (0,)  # the priors say so
    schedule.measured("short", 1.0)
    schedule.measured("long", 9.0)
    assert schedule.take() == (2,)
    assert schedule.estimate("new") == pytest.approx(10 / 5)
    assert schedule.take(time_left=5.0) == (4,)
    assert schedule.take(time_left=0.5) == ()
    assert schedule.seconds_left((), 1) == pytest.approx(10.0)
    assert [schedule.take(), schedule.take(), schedule.take()] == [(3,), (1,), ()]


def test_times_of_an_earlier_run_count_as_often_as_they_were_measured():
    """From them the time of a group of which nothing is known is estimated, by its prior."""
    groups = {0: "short", 1: "long"}
    schedule = Schedule([0, 1], groups, {"short": 1.0, "long": 3.0}, {0: 0, 1: 0})
    assert schedule.seconds_left((), 1) is None
    for _ in range(4):
        schedule.measured("short", 10.0)
    assert schedule.estimate("long") == 30.0
    assert schedule.seconds_left((), 1) == 40.0
    schedule.measured("short", 10.0)
    assert schedule.estimate("long") == 30.0


class StopsAtTheDoor(SimulatedRanks):
    """Worker 1 is asked to stop just as it is dismissed."""

    def send(self, to, message, *, urgent=False):
        if message[0] == "dismissed" and to == 1:
            heapq.heappush(self._ends, (self.now, to, ("stop", "SIGUSR1 received")))
        super().send(to, message, urgent=urgent)


def test_a_stop_that_arrives_while_workers_are_dismissed_is_told():
    _, collected, reason = simulate(
        *(2, [10.0] * 20),
        limits=lambda c: Limits(time_left=lambda: 25 - c.now),
        kind=StopsAtTheDoor,
    )
    assert 0 < len(collected) < 20
    assert reason == "SIGUSR1 received"  # and not that no time was left


def test_a_stop_that_arrives_when_all_is_done_stops_nothing():
    _, collected, reason = simulate(2, [10.0] * 20, kind=StopsAtTheDoor)
    assert len(collected) == 20
    assert reason is None


def test_workers_that_do_not_answer_a_stop_are_not_waited_for():
    with pytest.raises(Unresponsive, match="5 tasks did not stop in time"):
        simulate(
            5,
            [1000.0] * 50,
            halts=False,
            limits=lambda c: Limits(stop=lambda: "walltime" if c.now > 3 else None, grace=30.0),
        )


PATIENT = Limits(silence=120)


def done(task, rank):
    return ("outcome", Outcome(task, rank, 1.0))


def alive(rank, until):
    return [(10.0 * k, rank, ("alive", None, None)) for k in range(int(until / 10))]


def test_a_worker_that_is_silent_for_too_long_ends_the_run():
    """What was delivered until then is kept; who reports that it computes may take its time."""
    collected = []
    script = [*alive(1, 1000), *alive(2, 320), (300.0, 1, done(0, 1))]
    channel = Scripted(2, script)
    with pytest.raises(Unresponsive, match="rank 2 has not answered for 120 s"):
        hand_out(channel, schedule_of(range(4)), PATIENT, collected)
    assert [outcome.task for outcome in collected] == [0]
    assert 310 + 120 < channel.now < 310 + 135


def test_a_master_that_was_held_up_takes_nobody_for_lost():
    """Its clock jumps by an hour, and what workers sent meanwhile is not there at first."""
    late = [(3700.0, 1, done(0, 1)), (3700.0, 2, done(1, 2))]
    last = [(3702.0, 1, ("goodbye",)), (3702.0, 2, ("goodbye",))]

    class HeldUp(Scripted):
        def sleep(self, seconds):
            self.now += seconds if not 50 < self.now < 3000 else 3600

    channel = HeldUp(2, alive(1, 50) + alive(2, 50) + late + last)
    collected, reason = hand_out(channel, schedule_of(range(2)), PATIENT)
    assert (len(collected), reason) == (2, None)


def test_a_worker_that_does_not_answer_its_dismissal_ends_the_run():
    """It hangs when it has no task any more: within the grace, and not only after the silence."""
    collected = []
    script = [(1.0, 1, done(0, 1)), (2.0, 2, done(1, 2)), (2.1, 1, ("goodbye",))]
    channel = Scripted(2, script)
    with pytest.raises(Unresponsive, match="rank 2 did not answer at the end"):
        hand_out(channel, schedule_of(range(2)), PATIENT, collected)
    assert len(collected) == 2
    assert channel.now == pytest.approx(2 + Limits().grace, abs=0.1)


def test_a_worker_reports_while_it_computes_with_the_note_of_its_task():
    sent, now = [], 0.0
    script = [("task", 5), ("dismissed",)]

    class OneTask(Scripted):
        def send(self, to, message, *, urgent=False):
            sent.append(message)

        def poll(self, *, urgent=False):
            return None if urgent else (0, script.pop(0))

    def compute(task, check):
        nonlocal now
        for k in range(1, 36):
            now = float(k)
            check(f"step {k}")

    worker = Worker(OneTask(0), compute, Limits(), clock=lambda: now)
    worker.run()
    reports = [message for message in sent if message[0] == "alive"]
    assert reports == [("alive", 5, None), *(("alive", 5, f"step {k}") for k in (11, 22, 33))]
    assert [message[0] for message in sent[-2:]] == ["outcome", "goodbye"]


def half(task, check):
    """Compute in a process: something that is done, fails, or never ends."""
    if task == 3:
        raise ValueError("three")
    while task >= 100:
        check("waiting")
        time.sleep(1e-3)
    return task / 2


def test_processes_are_workers_like_any_other():
    with Processes(2, half, Limits()) as channel:
        outcomes, reason = hand_out(channel, schedule_of(range(20)))
    assert reason is None
    found = {outcome.task: outcome.error or outcome.result for outcome in outcomes}
    assert found == {k: "ValueError: three" if k == 3 else k / 2 for k in range(20)}
    assert {outcome.rank for outcome in outcomes} <= {1, 2}


def never(task, check):
    return half(100, check)


def test_processes_that_do_not_answer_are_not_waited_for(monkeypatch):
    """One that is stopped would not see that it is asked to end."""
    calls = []
    kill, wait = subprocess.Popen.kill, subprocess.Popen.wait
    monkeypatch.setattr(subprocess.Popen, "kill", lambda p: calls.append("kill") or kill(p))
    monkeypatch.setattr(
        subprocess.Popen, "wait", lambda p, timeout=None: calls.append("wait") or wait(p, timeout)
    )
    with Processes(1, never, Limits()) as channel:
        os.kill(channel._processes[1].pid, signal.SIGSTOP)
    assert calls[0] == "kill"


def alone(compute, tasks=3, limits=None):
    limits = limits or Limits()
    return hand_out(OwnWorker(compute, limits), schedule_of(range(tasks)), limits)


def test_a_task_in_a_kernel_meets_its_time_limit():
    """The timer goes off in a kernel; what its handler raises arrives as it is."""
    many = np.linspace(1.0, 2.0, 100_000)

    def compute(task, check):
        while True:
            many.sort()

    outcomes, _ = alone(compute, limits=Limits(task_seconds=0.05))
    assert [o.error for o in outcomes] == ["longer than the time limit of 0.05 s"] * 3


def test_what_the_handler_of_a_signal_raises_is_no_failure_of_a_task(alarm):
    before = signal.signal(signal.SIGUSR2, signal.getsignal(signal.SIGALRM))
    try:
        with pytest.raises(Interrupt):
            alone(lambda task, check: signal.raise_signal(signal.SIGUSR2))
    finally:
        signal.signal(signal.SIGUSR2, before)


def test_the_callers_own_timer_goes_on_while_tasks_are_tried(alarm):
    """It goes off in a task, as it would have without; and when it has not, it is still set."""
    signal.setitimer(signal.ITIMER_REAL, 500, 7)
    assert len(alone(lambda task, check: task)[0]) == 3
    left, interval = signal.getitimer(signal.ITIMER_REAL)
    assert 400 < left <= 500
    assert interval == 7
    signal.setitimer(signal.ITIMER_REAL, 0.02)
    with pytest.raises(Interrupt):
        alone(lambda task, check: time.sleep(60))


def test_a_task_cannot_swallow_the_end_of_its_time():
    def compute(task, check):
        for _ in range(2000):
            try:
                check()
                time.sleep(0.01)
            except Exception:
                pass

    outcomes, _ = alone(compute, tasks=1, limits=Limits(task_seconds=0.2))
    assert outcomes[0].error == "longer than the time limit of 0.2 s"


def test_tasks_of_a_unit_go_to_one_worker_and_count_as_one():
    seconds = [0.2 + 0.01 * task for task in range(30)]
    together = {task: task // 3 for task in range(30)}
    schedule = schedule_of([t for t in range(30) if t != 4], key_of=together)
    collected, reason = hand_out(SimulatedRanks(4, seconds), schedule)
    assert reason is None
    done = sorted(outcome.task for outcome in collected)
    assert done == [task for task in range(30) if task != 4]
    ranks = {(outcome.task // 3, outcome.rank) for outcome in collected}
    assert len(ranks) == 10
    whole = sum(seconds[task] for task in done)
    assert schedule.mean(0) == pytest.approx(whole / 29)
