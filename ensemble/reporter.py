"""Report progress on stderr: lines, a line that is rewritten on a terminal, a bar."""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Self, TextIO

from adhesis.ensemble.escape import printable
from adhesis.ensemble.quantities import duration

_LINE_INTERVALS = (5.0, 15.0)  # s: at first, and at most
_LINES_AT_LEAST = 40  # the time between lines is this part of the time so far: 15 s from 10 min on
_LIVE = 0.1  # s between two states of a line on a terminal
_CELLS = 24  # of a full bar
_REWRITE = "\r\x1b[K"


def log(text: str) -> None:
    """Write one line to stderr, in one piece, so that lines of several processes do not mix."""
    clear = _REWRITE if sys.stderr.isatty() else ""  # a progress line may stand there
    sys.stderr.write(f"{clear}{printable(' '.join(text.splitlines()))}\n")
    sys.stderr.flush()


def interval(elapsed: float) -> float:
    """Return the time between two lines, in s, after so many."""
    first, most = _LINE_INTERVALS
    return min(max(first, elapsed / _LINES_AT_LEAST), most)


class Display:
    """One line, shown while something goes on: rewritten on a terminal, elsewhere written anew.

    It is shown by another thread, so that there is no silence. ``text`` takes the time so far in s.
    ``at_once`` shows the first line at once, not after the first interval; with ``last`` there is a
    last one. On a terminal there always are both.
    """

    def __init__(
        self,
        text: Callable[[float], str],
        stream: TextIO | None = None,
        *,
        at_once: bool = False,
        last: bool = False,
    ) -> None:
        self._text, self._stream = text, stream or sys.stderr
        self._live = self._stream.isatty()
        self._at_once, self._last = at_once or self._live, last or self._live
        self._over, self._writing = threading.Event(), threading.Lock()
        self._begun = False  # whether a line on the terminal has no end yet

    def __enter__(self) -> Self:
        self._started = time.monotonic()
        self._thread = threading.Thread(target=self._keep_on, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        if self._last:
            self._show("\n")

    def say(self, text: str) -> None:
        """Write a line of its own."""
        with self._writing:
            print((_REWRITE if self._begun else "") + text, file=self._stream, flush=True)
            self._begun = False

    def _keep_on(self) -> None:
        if self._at_once:
            self._show()
        while not self._over.wait(_LIVE if self._live else interval(self._seconds)):
            self._show()

    @property
    def _seconds(self) -> float:
        return time.monotonic() - self._started

    def _show(self, end: str = "") -> None:
        line = printable(self._text(self._seconds))
        with self._writing:
            if not self._live:
                print(line, file=self._stream, flush=True)
                return
            line = line[: shutil.get_terminal_size().columns - 1]  # one that wraps stays
            print(_REWRITE + line, end=end, file=self._stream, flush=True)
            self._begun = not end


# Takes how much is done, of how much in all, None where that is unknown, and perhaps a text.
Bar = Callable[..., None]


@contextmanager
def bar(what: str, *, last: bool = True) -> Iterator[Bar]:
    """Show a bar on a terminal; elsewhere, as in a notebook, lines; see :class:`Display`."""
    shown = what

    def show(done: float | None, total: float | None, text: str = "") -> None:
        nonlocal shown
        parts = [text or what]
        if done is not None and total:
            parts.append(f"[{'#' * round(_CELLS * done / total):.<{_CELLS}}]")
        shown = "  ".join(parts)

    with Display(lambda seconds: f"{shown}  {duration(seconds)}", last=last):
        yield show
