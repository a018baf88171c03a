"""Progress of a run: a live line on a terminal, plain lines at a bounded rate elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TextIO

_LIVE_INTERVAL = 0.5  # s
_LINE_INTERVALS = (5.0, 60.0)  # s: at first, and at most
_LINES_AT_LEAST = 40  # the time between lines is this part of the time so far: 15 s after 10 min
_MOST_FAILURES_SHOWN = 5
_BAR_WIDTH = 16  # with the text, most lines fit into 80 columns


def duration(seconds: float) -> str:
    """Return a time as people read it: "4.2 s", "3 min 20 s", "2 h 05 min"."""
    if seconds < 60:
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    hours, minutes = divmod(minutes, 60)
    if hours < 48:
        return f"{hours} h {minutes:02d} min"
    return f"{hours // 24} d {hours % 24} h"


@dataclass
class Counts:
    """What a run has to do and has done."""

    total: int
    done_before: int
    done: int = 0
    failed: int = 0
    doubtful: int = 0
    beyond_limit: int = 0


class ProgressLine:
    """Report the progress of a run, on rank 0.

    Parameters
    ----------
    counts : Counts
        Kept up to date by the run.
    time_left : callable
        Estimated seconds until the end, or None while nothing is known.
    stream : text stream
    """

    def __init__(
        self,
        counts: Counts,
        time_left: Callable[[], float | None],
        stream: TextIO | None = None,
    ) -> None:
        self._counts = counts
        self._time_left = time_left
        self._stream = stream or sys.stderr
        self._live: Any = None
        self._started = time.monotonic()
        self._interval = _LINE_INTERVALS[0]
        self._next = self._started
        self._failures_shown = 0
        self._doubts_shown = 0
        if self._stream.isatty():
            from rich.console import Console
            from rich.live import Live

            self._live = Live(
                console=Console(file=self._stream), auto_refresh=False, transient=False
            )
            self._live.start()
            self._interval = _LIVE_INTERVAL

    def tick(self) -> None:
        """Tell, if it is time to."""
        now = time.monotonic()
        if now >= self._next:
            self._show()
            if self._live is None:
                first, most = _LINE_INTERVALS
                self._interval = min(max(first, (now - self._started) / _LINES_AT_LEAST), most)
            self._next = now + self._interval

    def failure(self, what: str, error: str) -> None:
        """Tell of a failed task: the first ones each, then only the count goes on."""
        if self._failures_shown < _MOST_FAILURES_SHOWN:
            self.say(f"failed: {what}: {error}")
        elif self._failures_shown == _MOST_FAILURES_SHOWN:
            self.say("further failures are counted here and listed by `adhesis status`")
        self._failures_shown += 1

    def doubt(self, what: str) -> None:
        """Tell of a loss whose own checks say that it is wrong: the first ones each."""
        if self._doubts_shown < _MOST_FAILURES_SHOWN:
            self.say(f"doubtful loss: {what}")
        self._doubts_shown += 1

    def say(self, text: str) -> None:
        """Write a line of its own."""
        if self._live is not None:
            self._live.console.print(text, markup=False, highlight=False)
        else:
            print(text, file=self._stream, flush=True)

    def close(self) -> None:
        """Show the last state and end the live line."""
        if self._live is not None:
            self._show()
            self._live.stop()
            self._live = None

    def _show(self) -> None:
        text = self._line()
        if self._live is None:
            print(text, file=self._stream, flush=True)
            return
        from rich.progress_bar import ProgressBar
        from rich.table import Table

        c = self._counts
        grid = Table.grid(padding=(0, 1))
        grid.add_column()
        grid.add_column(no_wrap=True, overflow="ellipsis")
        bar = ProgressBar(
            total=max(1, c.total), completed=c.done_before + c.done + c.failed, width=_BAR_WIDTH
        )
        grid.add_row(bar, text)
        self._live.update(grid, refresh=True)

    def _line(self) -> str:
        c = self._counts
        parts = [f"{c.done_before + c.done} of {c.total} tasks done"]
        if c.failed:
            parts.append(f"{c.failed} failed")
        elapsed = time.monotonic() - self._started
        if c.done:
            parts.append(f"{duration(elapsed)} so far")
        left = self._time_left()
        if left is not None and c.done_before + c.done + c.failed < c.total:
            parts.append(f"about {duration(left)} left")
        return ", ".join(parts)
