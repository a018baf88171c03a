"""Compute one task within its limits: a result, an error, or an interruption."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any, Protocol

from adhesis.ensemble.run.interrupt import in_main_thread, raised_by_handler


class StopCheck(Protocol):
    """Called by a task now and then, with a note on how far it is; it raises to end the task."""

    def __call__(self, note: Any = None) -> None:
        """Return if the task is to go on."""


Compute = Callable[[int, StopCheck], Any]

# Interval at which a task in progress checks whether to stop, in s.
WATCH_INTERVAL = 0.5


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


def attempt(
    compute: Compute, task: int, rank: int, stop: Callable[[Any], bool], limit: float | None
) -> Outcome:
    """Compute one task; failures become part of the outcome.

    ``stop`` takes the note of the task's last check, or None, and returns whether to give it up:
    GivenUp is then raised. ``limit`` is in s. What the handler of a signal raises meanwhile passes.
    """
    started = time.perf_counter()
    end = started + (math.inf if limit is None else limit)

    def check(note: Any = None) -> None:
        if stop(note):
            raise GivenUp
        if time.perf_counter() > end:
            raise TimeLimit(f"longer than the time limit of {limit:g} s")

    result, error = None, None
    try:
        with _watched(check):
            result = compute(task, check)
    except TimeLimit as failure:
        error = str(failure)
    except Exception as failure:
        if raised_by_handler(failure):
            raise
        error = f"{type(failure).__name__}: {failure}"
    return Outcome(task, rank, time.perf_counter() - started, error, result)


@contextmanager
def _watched(check: StopCheck) -> Iterator[None]:
    """Call ``check`` from a timer too: a task may hang before it calls it itself.

    A timer of the caller keeps running, and its handler is called when it expires.
    """
    if not in_main_thread():
        yield
        return
    finished = False

    def on_alarm(number: int, frame: FrameType | None) -> None:
        nonlocal finished
        try:
            callers.pass_on(number, frame)
            if not finished:
                check()
        except BaseException:
            finished = True  # a second exception would interrupt the unwinding of this one
            raise

    callers = _CallersTimer()
    try:
        signal.signal(signal.SIGALRM, on_alarm)
        signal.setitimer(signal.ITIMER_REAL, min(WATCH_INTERVAL, callers.left), WATCH_INTERVAL)
        yield
    finally:
        finished = True
        callers.restore()


class _CallersTimer:
    """Timer and handler of SIGALRM as they were before a task began."""

    def __init__(self) -> None:
        self._handler = signal.getsignal(signal.SIGALRM)
        delay, self._interval = signal.getitimer(signal.ITIMER_REAL)
        self._due = time.monotonic() + delay if delay > 0 else math.inf

    @property
    def left(self) -> float:
        """Time until it expires, in s; infinite if it was not set."""
        return max(self._due - time.monotonic(), 1e-6)

    def pass_on(self, number: int, frame: FrameType | None) -> None:
        """Call the caller's handler if its timer has expired."""
        if time.monotonic() < self._due:
            return
        self._due = self._due + self._interval if self._interval > 0 else math.inf
        if callable(self._handler):
            self._handler(number, frame)

    def restore(self) -> None:
        """Restore handler and timer, less the time that has passed."""
        signal.setitimer(signal.ITIMER_REAL, 0)
        if self._handler is not None:  # None: it was not set from Python
            signal.signal(signal.SIGALRM, self._handler)
        if self._due < math.inf:
            signal.setitimer(signal.ITIMER_REAL, self.left, self._interval)
