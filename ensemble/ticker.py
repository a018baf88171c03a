"""A line now and then while something takes long that cannot tell of itself."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_EVERY = 10.0  # s


def tell(text: str) -> None:
    """Write a line to stderr, at once."""
    print(text, file=sys.stderr, flush=True)


@contextmanager
def ticking(
    what: Callable[[], str] | str, say: Callable[[str], None] = tell, every: float = _EVERY
) -> Iterator[None]:
    """While this lasts, tell every so often what is under way and for how long.

    Nothing is told of what is over before.

    Parameters
    ----------
    what : str or callable
        What is under way, or what tells it; a callable is called by another thread.
    say : callable
        Gets a line.
    every : float
        Time between lines, in s.
    """
    started = time.monotonic()
    over = threading.Event()

    def lines() -> None:
        while not over.wait(every):
            text = what if isinstance(what, str) else what()
            say(f"{text} ({time.monotonic() - started:.0f} s)")

    thread = threading.Thread(target=lines, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
