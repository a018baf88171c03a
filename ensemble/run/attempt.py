"""One task, tried: its result, or why it has none; given up when the run is to stop."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

from adhesis.ensemble.run.interrupt import raised_by_handler

StopCheck = Callable[[], None]
"""Called by a task now and then; raises what ends the task."""
Compute = Callable[[int, StopCheck], Any]

# How often a task in progress looks whether it is to stop, in s.
WATCH_INTERVAL = 0.5


class GivenUp(BaseException):
    """The run is to stop: the task in progress is given up. Not an Exception: nobody handles it."""


class TimeLimit(BaseException):
    """The task took longer than it may."""


@dataclass(frozen=True)
class Outcome:
    """What became of a task.

    Attributes
    ----------
    task : int
    rank : int
        Who computed it.
    seconds : float
        Wall time.
    error : str or None
        Why it failed.
    result : object
        What ``compute`` returned, until ``deliver`` has taken care of it.
    """

    task: int
    rank: int
    seconds: float
    error: str | None = None
    result: Any = None


def attempt(
    compute: Compute, task: int, rank: int, stop: Callable[[], bool], limit: float | None
) -> Outcome:
    """Compute one task; failures become part of the outcome.

    Raises
    ------
    GivenUp
        If ``stop()`` was true while it ran.
    Exception
        What the handler of a signal raised meanwhile.
    """
    started = time.perf_counter()
    over = started + (math.inf if limit is None else limit)

    def check() -> None:
        if stop():
            raise GivenUp
        if time.perf_counter() > over:
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
    """Call ``check`` from a timer too: a task may hang long before it next calls it itself.

    A timer that the caller has set goes on, and its handler is called when its time has come.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    over = False

    def on_alarm(number: int, frame: FrameType | None) -> None:
        nonlocal over
        try:
            callers.pass_on(number, frame)
            if not over:
                check()
        except BaseException:
            over = True  # once is enough: not again while the first one unwinds
            raise

    callers = _CallersTimer()
    try:
        signal.signal(signal.SIGALRM, on_alarm)
        signal.setitimer(signal.ITIMER_REAL, min(WATCH_INTERVAL, callers.left), WATCH_INTERVAL)
        yield
    finally:
        over = True
        callers.restore()


class _CallersTimer:
    """The timer and the handler of SIGALRM that were set before a task began."""

    def __init__(self) -> None:
        self._handler = signal.getsignal(signal.SIGALRM)
        delay, self._interval = signal.getitimer(signal.ITIMER_REAL)
        self._due = time.monotonic() + delay if delay > 0 else math.inf

    @property
    def left(self) -> float:
        """Time until it goes off, in s; infinite if it was not set."""
        return max(self._due - time.monotonic(), 1e-6)

    def pass_on(self, number: int, frame: FrameType | None) -> None:
        """Call the caller's handler if its time has come."""
        if time.monotonic() < self._due:
            return
        self._due = self._due + self._interval if self._interval > 0 else math.inf
        if callable(self._handler):
            self._handler(number, frame)

    def restore(self) -> None:
        """Set handler and timer again, as they would be by now."""
        signal.setitimer(signal.ITIMER_REAL, 0)
        if self._handler is not None:  # None: it was not set from Python
            signal.signal(signal.SIGALRM, self._handler)
        if self._due < math.inf:
            signal.setitimer(signal.ITIMER_REAL, self.left, self._interval)
