"""Report progress on stderr: lines, a line that is rewritten on a terminal, a bar."""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol, TextIO

from adhesis.ensemble.escape import printable
from adhesis.ensemble.quantities import duration

_EVERY = 10.0  # s
_LIVE = 0.1  # s between two states of a line on a terminal
_CELLS = 24  # of a full bar
_REWRITE = "\r\x1b[K"


def log(text: str) -> None:
    """Write a line to stderr, unbuffered, its control characters spelled out."""
    print(printable(text), file=sys.stderr, flush=True)


class StatusLine:
    """One line: rewritten on a terminal, elsewhere written anew at intervals.

    ``every`` is the time between lines where there is no terminal, in s, or a function of the time
    since the start. ``at_once`` shows the first text when it is given, not after the first
    interval.
    """

    def __init__(
        self,
        every: float | Callable[[float], float],
        stream: TextIO | None = None,
        *,
        at_once: bool = False,
    ) -> None:
        self._stream = stream or sys.stderr
        self.is_live = self._stream.isatty()
        self._every = every
        self._started = time.monotonic()
        self._next = self._started + (0.0 if at_once or self.is_live else self._interval())
        self._begun = False  # whether a line on the terminal has no end yet

    @property
    def seconds(self) -> float:
        """Time since the start, in s."""
        return time.monotonic() - self._started

    def show(self, text: Callable[[], str], *, last: bool = False) -> None:
        """Show a text if it is time to; ``last`` shows it anyway and ends the line."""
        now = time.monotonic()
        if now < self._next and not last:
            return
        self._next = now + self._interval()
        if not self.is_live:
            print(text(), file=self._stream, flush=True)
            return
        # A line that wraps cannot be rewritten.
        line = text()[: shutil.get_terminal_size().columns - 1]
        print(_REWRITE + line, end="\n" if last else "", file=self._stream, flush=True)
        self._begun = not last

    def say(self, text: str) -> None:
        """Write a line of its own."""
        print((_REWRITE if self._begun else "") + text, file=self._stream, flush=True)
        self._begun = False

    def close(self, text: Callable[[], str]) -> None:
        """Show a last text where a line on the terminal has no end yet."""
        if self._begun:
            self.show(text, last=True)

    def _interval(self) -> float:
        if self.is_live:
            return _LIVE
        return self._every(self.seconds) if callable(self._every) else self._every


class Bar(Protocol):
    """Takes what is shown by :func:`bar`."""

    def __call__(self, done: float | None, total: float | None, text: str = "") -> None:
        """Show a text, and how much is done; unknown if ``total`` is None."""


@contextmanager
def bar(what: str, *, every: float = _EVERY, last: bool = True) -> Iterator[Bar]:
    """Show a bar on a terminal; elsewhere, as in a notebook, lines at intervals (s) and a last one.

    They come from another thread, so that there is no silence. Without ``last`` what ends within
    the first interval has no line.
    """
    line, over, shown = StatusLine(every), threading.Event(), what

    def show(done: float | None, total: float | None, text: str = "") -> None:
        nonlocal shown
        parts = [text or what]
        if done is not None and total:
            parts.append(f"[{'#' * round(_CELLS * done / total):.<{_CELLS}}]")
        shown = "  ".join(parts)

    def text() -> str:
        return f"{printable(shown)}  {duration(line.seconds)}"

    def keep_on() -> None:
        while not over.wait(min(_LIVE, every)):
            line.show(text)

    thread = threading.Thread(target=keep_on, daemon=True)
    thread.start()
    try:
        yield show
    finally:
        over.set()
        thread.join()
        if last or line.is_live:
            line.show(text, last=True)
