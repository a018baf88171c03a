"""Work of the fuzzing programs in a process of its own, which may crash or hang."""

import faulthandler
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any

_PATIENCE = 20  # times as many seconds of the clock, should a process only sleep


def _limited(work: Callable[..., Any], limit: float, given: tuple[Any, ...]) -> Any:
    """Work; the process ends where that takes too long."""
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time() + limit) + 1, most))
    faulthandler.dump_traceback_later(_PATIENCE * limit, exit=True)
    done = work(*given)
    faulthandler.cancel_dump_traceback_later()
    return done


class Isolated:
    """A function whose calls run in another process, one after the other.

    A process that dies or takes too long is replaced at the next call. ``work`` is a function of
    the top level of a module, ``limit`` the CPU time of a call, in s.
    """

    def __init__(self, work: Callable[..., Any], limit: float) -> None:
        self._work, self._limit = work, limit
        self._pool: ProcessPoolExecutor | None = None

    def __call__(self, *given: Any) -> tuple[Any, str]:
        """Return what the work returns and an empty text, or None and how the process ended."""
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, get_context("spawn"))
        try:
            return self._pool.submit(_limited, self._work, self._limit, given).result(), ""
        except BrokenProcessPool:
            self.close()
            return None, f"the process died, or took more than {self._limit:g} s of CPU time"

    def close(self) -> None:
        """End the process."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None
