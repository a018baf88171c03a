"""Progress of a run: one line on a terminal, lines at a bounded rate elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TextIO

from adhesis.ensemble.campaign.precision import Precision
from adhesis.ensemble.quantities import duration
from adhesis.ensemble.reporter import Display
from adhesis.solver.checks import counted

_MOST_FAILURES_SHOWN = 5


@dataclass
class Summary:
    """Numbers of tasks of a run, kept up to date, and at the end how it ended."""

    # total, done, failed: in the results file, or the part of it that is asked for
    total: int
    done: int = 0
    failed: int = 0
    # computed, failed_now: of these, by this run
    computed: int = 0
    failed_now: int = 0
    # At the end, of all tasks in the file, as in :mod:`adhesis.ensemble.task.doubt`
    doubtful: int = 0
    beyond_limit: int = 0
    short_of_preload: int = 0  # loops that turned before their preload was reached
    seconds: float = 0.0
    stopped: str | None = None  # why it stopped before the last task
    # With ``[stop]``: name of every cell, and how well the mean of its quantity is known
    precisions: Sequence[tuple[str, Precision]] = ()

    @property
    def pending(self) -> int:
        """Tasks still to do."""
        return self.total - self.done - self.failed

    def __str__(self) -> str:
        failed = f", {self.failed} failed" if self.failed else ""
        now = f"{self.computed} computed in {duration(self.seconds)}"
        return f"{self.done} of {counted(self.total, 'task')} done{failed}; {now}"


class ProgressLine(Display):
    """Progress of a run, on rank 0, from counts that the run keeps up to date.

    ``time_left`` returns the estimated seconds until the end, or None while nothing is known.
    """

    def __init__(
        self, counts: Summary, time_left: Callable[[], float | None], stream: TextIO | None = None
    ) -> None:
        super().__init__(self._line, stream, at_once=True)
        self._counts = counts
        self._time_left = time_left
        self._doubtful = 0

    def failure(self, what: str, error: str) -> None:
        """Report a failed task that is counted: the first ones each, then only their number."""
        if self._counts.failed_now <= _MOST_FAILURES_SHOWN:
            self.say(f"failed: {what}: {error}")
        elif self._counts.failed_now == _MOST_FAILURES_SHOWN + 1:
            self.say("further failures are counted here and listed by `adhesis status`")

    def doubt(self, what: str) -> None:
        """Report a doubtful loss: the first ones each."""
        self._doubtful += 1
        if self._doubtful <= _MOST_FAILURES_SHOWN:
            self.say(f"doubtful loss: {what}")

    def _line(self, seconds: float) -> str:
        c, left = self._counts, self._time_left()
        parts = [f"{c.done} of {counted(c.total, 'task')} done"]
        if c.failed_now:
            parts.append(f"{c.failed_now} failed")
        if c.computed:
            parts.append(f"{duration(seconds)} so far")
        if left is not None and c.pending:
            parts.append(f"about {duration(left)} left")
        return ", ".join(parts)
