"""Join the results files of parts, as ``adhesis run --part`` has made them, into one.

All must be of one campaign; rows that two of them hold must have the same bits. FILE.h5 is a
results file like any other: merge further parts into it, resume it, grow its campaign.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from adhesis.ensemble.errors import WriteError
from adhesis.ensemble.reporter import log

EXAMPLES = ("adhesis merge part1.h5 part2.h5 --out all.h5", "adhesis merge part3.h5 --out all.h5")


OPTIONS = (
    ("parts PART.h5", Path, "results files of one campaign", {"nargs": "+"}),
    ("--out FILE.h5", Path, "made, or merged into", {"required": True}),
)


def execute(args: argparse.Namespace) -> None:
    """Merge."""
    from adhesis.ensemble.results.layout import check_results_file, merge
    from adhesis.ensemble.run.lock import RunLock
    from adhesis.solver.checks import counted

    out = args.out
    check_results_file(out)
    with RunLock(out) as lock:
        lock.acquire(1, 10.0)
        try:
            merged = merge(args.parts, out)
        except WriteError as error:
            lock.release()  # nobody else writes
            raise WriteError(f"{error}; the same command resumes") from error
    for doubt in merged.doubts:
        log(f"adhesis merge: {doubt}")
    total = counted(merged.total, "task")
    failed = f", {merged.failed} failed" if merged.failed else ""
    print(
        f"{out}: {counted(merged.taken, 'row')} taken over from "
        f"{counted(len(args.parts), 'file')}; {merged.done} of {total} done{failed}"
    )
