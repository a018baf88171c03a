"""Report which tasks of a results file are pending, done and failed, also during a run."""

from __future__ import annotations

import argparse
import json
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from adhesis.ensemble.command.parser import within
from adhesis.ensemble.errors import InputError

EXAMPLES = ("adhesis status paper.h5", "adhesis status paper.h5 --watch --interval 10")


_SECONDS = within(0.1, 86_400, "a number of seconds between 0.1 and 86400")
OPTIONS = (
    ("file FILE.h5", Path, "the results file"),
    ("--json", bool, "everything, as JSON"),
    ("--watch", bool, "repeat the status until all is done"),
    ("--interval SECONDS", _SECONDS, "with --watch: how often (default: 2)", {"default": 2.0}),
)


def execute(args: argparse.Namespace) -> int:
    """Print the status; returns 0."""
    if args.watch:
        if args.json:
            raise InputError("--watch and --json cannot be given together")
        return _watch(args.file, args.interval)
    status = _status(args.file)
    print(json.dumps(status, indent=1) if args.json else _text(status))
    return 0


def _watch(path: Path, interval: float) -> int:
    """Show the status again and again: in place on a terminal, else one after the other."""
    from rich.console import Console
    from rich.live import Live

    shown = Live(console=Console(highlight=False, markup=False), auto_refresh=False)
    first: tuple[float, int] | None = None
    with shown if sys.stdout.isatty() else nullcontext() as live:
        while True:
            now = time.monotonic()
            status = _status(path)
            finished = status["done"] + status["failed"]
            # A campaign that grew, or rows that are computed again, begin a new measurement.
            if first is None or finished < first[1]:
                first = (now, finished)
            text = _text(status, now - first[0], finished - first[1])
            if live is None:
                print(text, flush=True)
            else:
                live.update(text, refresh=True)
            if not status["pending"]:
                return 0
            # Every look reads all rows with a result: it takes at most a fifth of the time.
            time.sleep(max(interval, 4 * (time.monotonic() - now)))


def _status(path: Path) -> dict[str, Any]:
    from adhesis.ensemble.aggregate.status import read_status
    from adhesis.ensemble.run.lock import holder

    return read_status(path) | {"run": holder(path)}


def _text(status: dict[str, Any], seconds: float = 0.0, finished: int = 0) -> str:
    """Return the status as text, with a line on the run that writes, and the age of the file.

    Rate and time left are those of the tasks that were ``finished`` in the last ``seconds``.
    """
    from adhesis.ensemble.aggregate.status import as_text
    from adhesis.ensemble.quantities import duration
    from adhesis.ensemble.run.lock import described

    pace, run, last = "", status["run"], status["last_row"]
    if finished and status["pending"]:
        rate = finished / seconds
        pace = f"; {3600 * rate:.3g} an hour, about {duration(status['pending'] / rate)} left"
    text = "no run is writing" if run is None else f"a run is writing ({described(run)})"
    age = "" if last is None else f"; last written {duration(max(0.0, time.time() - last))} ago"
    return as_text(status, f"{pace}\n{text}{age}")
