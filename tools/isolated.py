"""Work of the fuzzing programs in a process of its own, which may crash or hang."""

from __future__ import annotations

import multiprocessing as mp
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

_PATIENCE = 20  # times as many seconds of the clock, should a process only sleep


def _serve(work: Callable[..., Any], pipe: Any) -> None:
    with suppress(EOFError):  # the program has ended
        while True:
            pipe.send(work(*pipe.recv()))


class Isolated:
    """A function whose calls run in another process, one after the other.

    A process that dies or takes too long is replaced at the next call.

    Parameters
    ----------
    work : callable
        Of the top level of a module.
    limit : float
        CPU time of a call, in s.
    """

    def __init__(self, work: Callable[..., Any], limit: float) -> None:
        self._work, self._limit = work, limit
        self._process: Any = None
        self._pipe: Any = None

    def __call__(self, *given: Any) -> tuple[Any, str]:
        """Return what the work returns and an empty text, or None and how the process ended."""
        if self._process is None:
            self._start()
        self._pipe.send(given)
        started, begun = self._spent(), time.monotonic()
        while not self._pipe.poll(0.5):
            spent = self._spent() - started
            if spent > self._limit or time.monotonic() - begun > _PATIENCE * self._limit:
                self.end()
                return None, f"not done after {spent:.0f} s of CPU time"
        try:
            return self._pipe.recv(), ""
        except EOFError:
            self._process.join()
            code = self._process.exitcode
            self.end()
            return None, f"the process died: {code}"

    def _start(self) -> None:
        context = mp.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(self._work, other), daemon=True)
        self._process.start()
        other.close()  # so that the end of the process is the end of the pipe

    def _spent(self) -> float:
        """Return the CPU time of the process so far, in s."""
        clock = (~self._process.pid << 3) | 2  # Linux: the CPU clock of another process
        try:
            return time.clock_gettime(clock)
        except OSError:  # it has ended
            return 0.0

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self._process = None
