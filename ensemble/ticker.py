"""Log a line now and then while a long call reports no progress itself."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_EVERY = 10.0  # s


def log(text: str) -> None:
    """Write a line to stderr, unbuffered."""
    print(text, file=sys.stderr, flush=True)


@contextmanager
def ticking(
    task: Callable[[], str] | str, write: Callable[[str], None] = log, every: float = _EVERY
) -> Iterator[None]:
    """Log at intervals which task is under way, and for how long.

    A task that ends within the first interval is not logged.

    Parameters
    ----------
    task : str or callable
        Description of the task, or a callable that returns it; it is called by another thread.
    write : callable
        Takes a line.
    every : float
        Time between lines, in s.
    """
    started = time.monotonic()
    over = threading.Event()

    def lines() -> None:
        while not over.wait(every):
            text = task if isinstance(task, str) else task()
            write(f"{text} ({time.monotonic() - started:.0f} s)")

    thread = threading.Thread(target=lines, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
