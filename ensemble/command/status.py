"""What of a results file is pending, done and failed; works while the run is writing."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from typing import Any

_MOST_FAILURES_SHOWN = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("file", metavar="FILE.h5", help="the results file")
    parser.add_argument("--json", action="store_true", help="everything, as JSON")


def execute(args: argparse.Namespace) -> int:
    """Print the status; returns 0."""
    status = read_status(args.file)
    print(json.dumps(status, indent=1, ensure_ascii=False) if args.json else as_text(status))
    return 0


def read_status(path: str) -> dict[str, Any]:
    """Return counts, times and failures of a results file.

    Returns
    -------
    dict
        ``file``, ``tasks``, ``pending``, ``done``, ``failed``; ``seconds`` per done task (``mean``,
        ``median``, ``max``, ``sum``; None without any); ``groups``, one dict for each H and γ with
        its counts and mean time; ``failures``, one dict for each failed task.

    Raises
    ------
    InputError
        If the file is not a sound results file.
    """
    import numpy as np

    from ensemble.schema import DONE, FAILED, PENDING
    from ensemble.store import Results

    with Results(path) as results:
        state = results.status()
        wall = results.column("wall_time")
        hurst, gamma = results.column("hurst"), results.column("work_of_adhesion")
        failed = np.flatnonzero(state == FAILED)
        errors = results.errors(failed)
        realisation, seed = results.column("realisation"), results.column("seed")
    times = wall[state == DONE]
    pairs, group_of = np.unique(np.stack([hurst, gamma]), axis=1, return_inverse=True)
    group_of = group_of.ravel()
    size = pairs.shape[1]
    counts = {
        name: np.bincount(group_of[state == code], minlength=size)
        for name, code in (("pending", PENDING), ("done", DONE), ("failed", FAILED))
    }
    seconds = np.bincount(group_of[state == DONE], weights=times, minlength=size)
    return {
        "file": str(path),
        "tasks": len(state),
        "pending": int(np.sum(state == PENDING)),
        "done": int(np.sum(state == DONE)),
        "failed": len(failed),
        "seconds": {
            "mean": float(times.mean()),
            "median": float(np.median(times)),
            "max": float(times.max()),
            "sum": float(times.sum()),
        }
        if times.size
        else None,
        "groups": [
            {
                "hurst": float(pairs[0, i]),
                "work_of_adhesion": float(pairs[1, i]),
                **{name: int(count[i]) for name, count in counts.items()},
                "mean_seconds": float(seconds[i] / counts["done"][i])
                if counts["done"][i]
                else None,
            }
            for i in range(size)
        ],
        "failures": [
            {
                "row": int(row),
                "hurst": float(hurst[row]),
                "work_of_adhesion": float(gamma[row]),
                "realisation": int(realisation[row]),
                "seed": int(seed[row]),
                "seconds": float(wall[row]),
                "error": error,
            }
            for row, error in zip(failed, errors, strict=True)
        ],
    }


def as_text(status: dict[str, Any]) -> str:
    """Return a status as lines for people."""
    lines = [
        f"{status['file']}: {status['tasks']} tasks, {status['done']} done, "
        f"{status['pending']} pending, {status['failed']} failed"
    ]
    if seconds := status["seconds"]:
        lines.append(
            f"time per task: mean {seconds['mean']:.3g} s, median {seconds['median']:.3g} s, "
            f"longest {seconds['max']:.3g} s; all done tasks {seconds['sum'] / 3600:.3g} h"
        )
    groups = status["groups"]
    if len(groups) <= 50:
        lines.append("")
        lines.append("    H   γ in J/m²      done  pending   failed   mean s")
        for g in groups:
            mean = "" if g["mean_seconds"] is None else f"{g['mean_seconds']:.3g}"
            counts = " ".join(f"{g[name]:8d}" for name in ("done", "pending", "failed"))
            lines.append(f"{g['hurst']:5.4g}  {g['work_of_adhesion']:10.4g}  {counts} {mean:>8}")
    failures = status["failures"]
    if failures:
        lines.append("")
        for error, count in Counter(f["error"] for f in failures).most_common(5):
            lines.append(f"failed {count}×: {error}")
        for f in failures[:_MOST_FAILURES_SHOWN]:
            lines.append(
                f"  row {f['row']}: H = {f['hurst']:g}, γ = {f['work_of_adhesion']:g} J/m², "
                f"realisation {f['realisation']}, seed {f['seed']}, after {f['seconds']:.3g} s"
            )
        if len(failures) > _MOST_FAILURES_SHOWN:
            lines.append(f"  … and {len(failures) - _MOST_FAILURES_SHOWN} more (--json lists all)")
        lines.append("again: hysteron run CAMPAIGN.toml --redo failed")
    return "\n".join(lines)
