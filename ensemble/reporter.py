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

_EVERY = 10.0  # s
_LIVE = 0.1  # s between two states of a line on a terminal
_CELLS = 24  # of a full bar
_REWRITE = "\r\x1b[K"


def log(text: str) -> None:
    """Write one line to stderr, in one piece, so that lines of several processes do not mix."""
    clear = _REWRITE if sys.stderr.isatty() else ""  # a progress line may stand there
    sys.stderr.write(f"{clear}{printable(' '.join(text.splitlines()))}\n")
    sys.stderr.flush()


class Display:
    """One line, shown while something goes on: rewritten on a terminal, elsewhere written anew.

    It is shown by another thread, so that there is no silence. ``text`` takes the time so far in s;
    ``every`` is the time between lines where there is no terminal, in s, or a function of the time
    so far. ``at_once`` shows the first line at once, not after the first interval; with ``last``
    there is a last one. On a terminal there always are both.
    """

    def __init__(
        self,
        text: Callable[[float], str],
        every: float | Callable[[float], float] = _EVERY,
        stream: TextIO | None = None,
        *,
        at_once: bool = False,
        last: bool = False,
    ) -> None:
        self._text, self._every, self._stream = text, every, stream or sys.stderr
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
        while not self._over.wait(self._interval()):
            self._show()

    def _interval(self) -> float:
        seconds = time.monotonic() - self._started
        every = self._every(seconds) if callable(self._every) else self._every
        return min(_LIVE, every) if self._live else every

    def _show(self, end: str = "") -> None:
        line = printable(self._text(time.monotonic() - self._started))
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
def bar(what: str, *, every: float = _EVERY, last: bool = True) -> Iterator[Bar]:
    """Show a bar on a terminal; elsewhere, as in a notebook, lines; see :class:`Display`."""
    shown = what

    def show(done: float | None, total: float | None, text: str = "") -> None:
        nonlocal shown
        parts = [text or what]
        if done is not None and total:
            parts.append(f"[{'#' * round(_CELLS * done / total):.<{_CELLS}}]")
        shown = "  ".join(parts)

    with Display(lambda seconds: f"{shown}  {duration(seconds)}", every, last=last):
        yield show
