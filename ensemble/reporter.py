"""Report progress on stderr: lines, a line that is rewritten on a terminal, a bar."""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

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


class StatusLine:
    """One line on stderr: rewritten on a terminal, else written anew at intervals.

    Parameters
    ----------
    every : float
        Time between lines where there is no terminal, in s.
    """

    def __init__(self, every: float) -> None:
        self.live = sys.stderr.isatty()
        self.started = self._last = time.monotonic()
        self._every = every

    @property
    def seconds(self) -> float:
        """Time since the start, in s."""
        return time.monotonic() - self.started

    def show(self, text: Callable[[], str], *, last: bool = False) -> None:
        """Show a text; ``last`` ends the line."""
        now = time.monotonic()
        if not (self.live or last or now - self._last >= self._every):
            return
        self._last = now
        line, end = text(), "\n" if last or not self.live else ""
        if self.live:  # a line that wraps cannot be rewritten
            line = "\r\x1b[K" + line[: shutil.get_terminal_size().columns - 1]
        print(line, end=end, file=sys.stderr, flush=True)


class Bar(Protocol):
    """Takes what is shown by :func:`bar`."""

    def __call__(self, done: float | None, total: float | None, text: str = "") -> None:
        """Show a text, and how much is done; unknown if ``total`` is None."""


@contextmanager
def bar(what: str) -> Iterator[Bar]:
    """Show a bar on stderr, or in the notebook.

    Parameters
    ----------
    what : str
        Description, until another text is given.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task: Any = progress.add_task(what, total=1.0)

        def show(done: float | None, total: float | None, text: str = "") -> None:
            progress.update(task, description=text or what, completed=done, total=total)

        yield show
