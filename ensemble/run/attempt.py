"""Compute one task within its limits: a result, an error, or an interruption."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

from adhesis.ensemble.run.interrupt import in_main_thread, raised_by_handler

# Called by a task now and then, perhaps with a note on how far it is; it raises to end the task.
StopCheck = Callable[..., None]
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
