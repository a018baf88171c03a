"""Handle what ends a run from outside: signals, and the walltime of the batch system."""

from __future__ import annotations

import math
import os
import re
import signal
import threading
from collections.abc import Mapping
from contextlib import suppress
from traceback import walk_tb
from types import FrameType
from typing import Any, Self

from adhesis.ensemble.errors import InputError, parameter

# Tasks in progress are given up, and the file is closed, this long (s) before the walltime ends, or
# this share of it if that is shorter.
RESERVE, RESERVE_SHARE = 30.0, 0.1
# Time for workers to answer a stop (s); with a walltime at most this share of the reserve. The rest
# is for closing the file and ending the ranks.
GRACE, GRACE_SHARE = 30.0, 0.5
NEVER = (math.inf, GRACE)

_CLOCK = re.compile(r"(?:(\d+)-)?(?:(\d+):)?(\d+):(\d+)")
_UNITS = re.compile(r"(?:(\d+)d)?(?:(\d+)h)?(?:(\d+)m)?(?:(\d+(?:\.\d*)?)s?)?")


def in_main_thread() -> bool:
    """Check whether this is the main thread, the only one that may have handlers of signals."""
    return threading.current_thread() is threading.main_thread()


class StopSignals:
    """Context manager that records the first signal that stops a run in order, and goes on.

    SIGHUP, of a terminal that closes, is one unless it is ignored, as under ``nohup``. A second
    SIGINT (Ctrl-C) interrupts at once. Outside the main thread none is recorded.
    """

    _SIGNALS = (signal.SIGTERM, signal.SIGUSR1, signal.SIGINT, signal.SIGHUP)

    def __init__(self) -> None:
        self.received: str | None = None
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        for number in self._SIGNALS if in_main_thread() else ():
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, _: FrameType | None) -> None:
        if self.received == "SIGINT" and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.received = signal.Signals(number).name


def raised_by_handler(error: BaseException) -> bool:
    """Check whether the handler of a signal raised an exception.

    Such an exception is an interrupt, whatever its class, and no failure of the task in progress.
    """
    handlers = [signal.getsignal(number) for number in signal.valid_signals()]
    codes = {code for each in handlers if (code := getattr(each, "__code__", None)) is not None}
    return any(frame.f_code in codes for frame, _ in walk_tb(error.__traceback__))


def parse_duration(text: str) -> float:
    """Return the seconds of "90", "1h30m", "45:00", "12:00:00" or "2-00:00:00" (InputError)."""
    word = text.strip()
    seconds = 0.0
    match = _CLOCK.fullmatch(word) or _UNITS.fullmatch(word)
    if match:
        days, hours, minutes, rest = (float(part or 0) for part in match.groups())
        seconds = ((24 * days + hours) * 60 + minutes) * 60 + rest
    if not 0 < seconds < 1e9:
        raise InputError(
            f"{parameter('walltime')} is {text!r}: it must be a positive time as 3600 (s), 1h30m "
            "or 12:00:00"
        )
    return seconds


def deadline(
    walltime: float | None, started: float, environ: Mapping[str, str] = os.environ
) -> tuple[float, float]:
    """Return when to give up the tasks in progress, and how long workers may take then, in s.

    The first is a time as ``time.time()`` counts, infinite for never. ``walltime`` is in s from
    ``started``. Without it that of the batch system counts: Slurm sets the end of the job, Torque
    its length.
    """
    if walltime is not None:
        return _before(started + walltime, started)
    for name, begin in (("SLURM_JOB_END_TIME", 0.0), ("PBS_WALLTIME", started)):
        with suppress(KeyError, ValueError):
            return _before(begin + float(environ[name]), started)
    return NEVER


def _before(end: float, started: float) -> tuple[float, float]:
    reserve = min(RESERVE, RESERVE_SHARE * max(0.0, end - started))
    return end - reserve, min(GRACE, GRACE_SHARE * reserve)
