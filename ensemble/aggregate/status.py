"""Report counts, times, failures and losses of a campaign so far, from its results file alone.

Never loads MPI: it works on a login node, and while the run writes. It reads all rows with a
result, for their checksums.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from adhesis.ensemble.aggregate.cells import (
    COUNTS,
    Cell,
    doubtful_loops,
    loops_beyond_zero_range,
    read_cells,
)
from adhesis.ensemble.campaign.precision import estimates
from adhesis.ensemble.campaign.tasks import WHOLE, Tasks
from adhesis.ensemble.escape import one_line, printable, shell_word
from adhesis.ensemble.quantities import UNITS, with_error
from adhesis.ensemble.results.read import Results, mixture, named_rows
from adhesis.ensemble.results.schema import FAILED, axis_datasets
from adhesis.ensemble.task import doubt
from adhesis.solver.checks import counted
from adhesis.solver.loading.zero_range import RANGES
from adhesis.solver.values import finite

_MOST_FAILURES_SHOWN = 10
_MOST_GROUPS_SHOWN = 60
_OF_TIMES = ("mean", "median", "max", "sum")
_AVERAGED = ("wall_time", "loss", "loss_dimensionless")
_TASK = ("hurst", "work_of_adhesion", "realisation", "seed")


def read_status(path: Path | str) -> dict[str, Any]:
    """Return counts, times and failures of a results file (InputError), the entries of ``--json``.

    ``part`` is the share of the campaign that the file holds ("1/3"), None if it is the whole.
    ``damaged`` rows count as nothing else; ``computed_by`` has the number of done rows by versions
    and processor; ``seconds`` are of a done task. ``groups`` has an entry for each cell (a value of
    each of the ``axes``, in the ``axis_units``) with its counts, its mean time, its mean loss with
    standard error (J/m², and W~), and with ``[stop]`` how well the mean of the steered quantity is
    known. ``doubtful`` lists the worst losses first, ``beyond_limit`` the least range;
    ``preload_not_reached`` counts loops (None without a preload). ``last_row`` is when the file was
    last written to (as ``time.time()`` counts), None before the first row. None stands for what is
    unknown.
    """
    with Results(path) as results:
        campaign, tasks, state = results.campaign, results.tasks, results.status()
        units = {axis.name: axis.unit for axis in campaign.axes[:2]}
        units |= {dataset.name: dataset.unit for dataset in axis_datasets(campaign)}
        cells = read_cells(results)
        failed = np.flatnonzero(state == FAILED)
        seconds = results.column("wall_time", failed).tolist()
        errors = map(one_line, results.errors(failed))
        damaged, part = results.damaged(), results.part
        origins = results.origins()
    times = np.concatenate([cell.values["wall_time"] for cell in cells])
    failures = [
        _named(tasks, row) | {"seconds": took, "error": error}
        for row, took, error in zip(failed.tolist(), seconds, errors, strict=True)
    ]
    short = sum(cell.short_of_preload for cell in cells)

    def listed(loops: Iterable[tuple[Cell, int]], names: Sequence[str]) -> list[dict[str, Any]]:
        """Return the place, the loss and further numbers of loops; None where not finite."""
        return [
            _named(tasks, int(cell.rows[k]))
            | {name: finite(float(cell.values[name][k])) for name in ("loss", *names)}
            for cell, k in loops
        ]

    return {
        "file": str(path),
        "part": None if part == WHOLE else str(part),
        "tasks": len(state),
        **{name: int(np.sum(state == code)) for name, code in COUNTS.items()},
        "damaged": [_named(tasks, row) for row in damaged.tolist()],
        "computed_by": origins,
        "seconds": {name: float(getattr(np, name)(times)) for name in _OF_TIMES}
        if times.size
        else None,
        "doubtful": listed(doubtful_loops(cells), ("audit_residual", "loss_error")),
        "opens": campaign.material.opens,
        "under_load": campaign.cycle.under_load,
        "preload_not_reached": None if campaign.cycle.preload is None else short,
        "beyond_limit": listed(loops_beyond_zero_range(cells), RANGES),
        "last_row": os.stat(path).st_mtime if times.size or failures else None,
        "axes": list(units),
        "axis_units": units,
        "groups": [
            dict(zip(units, cell.at.values(), strict=True)) | _group(cell) for cell in cells
        ],
        "failures": failures,
    }


def _named(tasks: Tasks, row: int) -> dict[str, Any]:
    task = tasks[row]
    return {"row": row, "task": str(task), **{name: getattr(task, name) for name in _TASK}}


def _group(cell: Cell) -> dict[str, Any]:
    values = np.array([cell.values[name] for name in _AVERAGED])
    seconds, loss, scaled = estimates(values, with_interval=False)  # which loads scipy
    group: dict[str, Any] = {
        **{name: getattr(cell, name) for name in COUNTS},
        "mean_seconds": finite(seconds.mean),
        "loss": finite(loss.mean),
        "loss_standard_error": finite(loss.sem),
        "loss_dimensionless": finite(scaled.mean),
        "loss_dimensionless_standard_error": finite(scaled.sem),
    }
    if (now := cell.precision) is not None:
        group |= {
            "quantity": now.quantity,
            "relative_error": finite(now.estimate.relative_error),
            "interval_low": finite(now.estimate.low),
            "interval_high": finite(now.estimate.high),
            "wanted_relative_error": now.wanted,
            "met": now.met,
            "precision": str(now),
        }
    return group


def as_text(status: dict[str, Any], pace: str = "") -> str:
    """Return a status as lines for people; ``pace`` is added to the first."""
    part = f", part {status['part']} of a campaign" if status["part"] else ""
    lines = [
        f"{status['file']}{part}: {counted(status['tasks'], 'task')}, {status['done']} done, "
        f"{status['pending']} pending, {status['failed']} failed"
        + (f", {status['not_needed']} not needed" if status["not_needed"] else "")
        + (f", {len(status['damaged'])} damaged" if status["damaged"] else "")
        + pace
    ]
    if mixed := mixture(status["computed_by"]):
        lines.append(f"the file {mixed}")
    if seconds := status["seconds"]:
        lines.append(
            f"time per task: mean {seconds['mean']:.3g} s, median {seconds['median']:.3g} s, "
            f"longest {seconds['max']:.3g} s; all done tasks {seconds['sum'] / 3600:.3g} h"
        )
    groups = status["groups"]
    if len(groups) <= _MOST_GROUPS_SHOWN:
        further = {
            name: f"{key} in {UNITS[key]}" if key in UNITS else key
            for name in status["axes"][2:]
            for key in [name.removeprefix("wanted_")]
        }
        lines += [
            "",
            f"    H  γ in J/m² {''.join(f'{heading}  ' for heading in further.values())}"
            "    done  pending  failed    mean s  loss in mJ/m² ± standard error of the mean",
        ]
        lines += [_group_line(group, further) for group in groups]
    else:
        many = f"{len(groups)} cells are too many for a table here"
        lines += ["", f"{many}: --json lists them, and adhesis report writes losses.csv"]
    if status["under_load"]:
        lines += ["", "losses under a weight: closed at the separation of its fall"]
    if status["damaged"]:
        lines += ["", *damage_lines(status["damaged"])]
    for sentence, rows, about in doubts(status):
        lines += ["", sentence, *_listed(rows, about, ": ")]
    if status["failures"]:
        lines += ["", *_failure_lines(status["failures"], status["file"], status["part"])]
    return printable("\n".join(lines))


def doubts(status: Mapping[str, Any]) -> Iterator[tuple[str, Sequence[Any], Callable[..., str]]]:
    """Return sentences on what is doubtful in a status: with rows, and what is to be said of each.

    On loops short of their preload there is no list.
    """
    if short := status["preload_not_reached"]:
        yield f"{counted(short, 'loop')} did not reach the preload", (), str
    by_own = "their" if len(status["doubtful"]) > 1 else "its"
    less = f"by {by_own} own account less accurate than asked for"
    for rows, why, about in (
        (status["doubtful"], less, doubt.errors_text),
        (status["beyond_limit"], doubt.why_beyond(status["opens"]), _range_of),
    ):
        if rows:
            yield doubt.doubtful_losses(len(rows), f": {why}"), rows, about


def _group_line(group: dict[str, Any], further: Mapping[str, str]) -> str:
    counts = f"{group['done']:8d} {group['pending']:8d} {group['failed']:7d}"
    mean, loss, error = group["mean_seconds"], group["loss"], group["loss_standard_error"]
    shown = ""
    if loss is not None and not group["work_of_adhesion"]:  # nothing is lost: it is rounding
        shown = "  0"
    elif loss is not None:
        loss *= 1e3
        shown = f"  {loss:.4g}" if error is None else f"  {with_error(loss, 1e3 * error)}"
    return (
        f"{group['hurst']:5.6g}  {group['work_of_adhesion']:9.6g} "
        + "".join(f"{group[name]:{len(heading)}.6g}  " for name, heading in further.items())
        + f"{counts} "
        + (f"{mean:9.3g}" if mean is not None else " " * 9)
        + shown
        + (f"  {group['precision']}" if "precision" in group else "")
    ).rstrip()


def _listed(
    rows: Sequence[Mapping[str, Any]],
    about: Callable[[Mapping[str, Any]], str] = lambda row: "",
    between: str = "",
) -> list[str]:
    """Return a line for each of the first rows, and how many more there are."""
    lines = [
        f"  row {row['row']}: {row['task']}, seed {row['seed']}{between}{about(row)}"
        for row in rows[:_MOST_FAILURES_SHOWN]
    ]
    if len(rows) > _MOST_FAILURES_SHOWN:
        lines.append(f"  … and {len(rows) - _MOST_FAILURES_SHOWN} more (--json lists all)")
    return lines


def _range_of(row: Mapping[str, Any]) -> str:
    loss = math.nan if row["loss"] is None else row["loss"]
    known = {name: row[name] for name in RANGES if row[name] is not None}
    least = min(known, key=known.__getitem__, default="")
    shown = f"{least} {known[least]:.2g} m" if known else "no finite range"
    return f"{shown}, loss {loss:.3g} J/m²"


def damage_lines(damaged: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the damaged rows as lines for people, and what is to be done."""
    return [
        f"damaged: {named_rows([d['row'] for d in damaged])}; damaged rows are not used",
        *_listed(damaged),
        "again: adhesis run CAMPAIGN.toml computes damaged rows as if they were pending",
    ]


def _failure_lines(failures: Sequence[Mapping[str, Any]], path: str, part: str | None) -> list[str]:
    """Return the failures as lines for people, and what is to be done."""
    errors = [f["error"] for f in failures]
    lines = [f"failed {count}×: {error}" for error, count in Counter(errors).most_common(5)]
    lines += _listed(
        failures, lambda row: f", after {row['seconds']:.3g} s" if row["seconds"] else ""
    )
    refused = sum(error.startswith("PathError") for error in errors)  # by the solver: fail again
    if not refused:
        options = f"--out {shell_word(path)}{f' --part {part}' if part else ''} --redo failed"
        late = any(error.startswith("longer than the time limit") for error in errors)
        limit = ", with a longer time_limit in [solver]" if late else ""
        return [*lines, f"again{limit}: adhesis run CAMPAIGN.toml {options}"]
    which = "they" if refused == len(errors) else f"{refused} of them"
    fail, they_are = ("fails", "it is") if refused == 1 else ("fail", "they are")
    if len(errors) == 1:
        which = "it"
    again = f"again if {they_are} computed again: follow the reason given, in a campaign with other"
    return [*lines, f"{which} {fail} {again} values"]
