"""One task, tried: its result, or why it has none; given up when the run is to stop."""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

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
        error = f"{type(failure).__name__}: {failure}"
    return Outcome(task, rank, time.perf_counter() - started, error, result)


@contextmanager
def _watched(check: StopCheck) -> Iterator[None]:
    """Call ``check`` from a timer too: a task may hang long before it next calls it itself.

    Where compiled code hands its results to Python, an exception is not expected: it would be lost,
    or end the process. There the check waits until the task's own code goes on.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    over = False

    def look() -> None:
        nonlocal over
        if not over:
            try:
                check()
            except BaseException:
                over = True  # once is enough: not again while the first one unwinds
                raise

    def on_alarm(_: int, frame: FrameType | None) -> None:
        if _handing_over(frame):
            sys.setprofile(later)
        else:
            look()

    def later(frame: FrameType, *_: object) -> None:
        if not _handing_over(frame):
            sys.setprofile(None)
            look()

    before = signal.signal(signal.SIGALRM, on_alarm)
    signal.setitimer(signal.ITIMER_REAL, WATCH_INTERVAL, WATCH_INTERVAL)
    try:
        yield
    finally:
        over = True
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        sys.setprofile(None)


def _handing_over(frame: FrameType | None) -> bool:
    """Whether numba's own code is under way, as it is where compiled code returns."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith("numba."):
            return True
        frame = frame.f_back
    return False
