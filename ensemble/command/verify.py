"""Check a results file: its head, its tasks and axes, and the checksum of every row.

Exit codes: 0 no damage was found, 1 rows are damaged and named, 2 the file is no results file, or
is damaged beside its rows. The next run computes damaged rows again, as if they were pending.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from adhesis.ensemble.exit_codes import DONE, SOME_FAILED

EXAMPLES = ("adhesis verify paper.h5", "adhesis verify paper.h5 --json")


OPTIONS = (
    ("file FILE.h5", Path, "the results file"),
    ("--json", bool, "counts, and every damaged row with its task, as JSON"),
)


def execute(args: argparse.Namespace) -> int:
    """Print what is damaged; returns 0, or 1 if rows are."""
    from adhesis.ensemble.aggregate.status import damage_lines, read_status

    status = read_status(args.file)
    damaged = status["damaged"]
    if args.json:
        names = ("file", "tasks", "done", "failed", "not_needed", "pending", "damaged")
        print(json.dumps({name: status[name] for name in names}, indent=1, ensure_ascii=False))
        return SOME_FAILED if damaged else DONE
    sound = status["done"] + status["failed"] + status["not_needed"]
    if damaged:
        print(f"{args.file}: {len(damaged)} of {sound + len(damaged)} written rows are damaged")
        print("\n".join(damage_lines(damaged)))
    else:
        spare = f", {status['not_needed']} not needed" if status["not_needed"] else ""
        print(
            f"{args.file} is sound: {sound} rows have their checksum ({status['done']} done, "
            f"{status['failed']} failed{spare}), {status['pending']} are pending"
        )
    return SOME_FAILED if damaged else DONE
