"""Run or resume a campaign; with --ranks or under mpirun, rank 0 hands out, the others work.

A results file that exists is resumed, or extended if the campaign grew; one of another campaign is
refused. Exit codes: 0 all tasks done, 1 some tasks failed, 2 bad input, 70 an error of adhesis
itself, 71 too little memory or too few processes, 74 the results file could not be written, 75
stopped early (a signal, the walltime, a rank that does not answer): run the same command again to
resume.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adhesis.ensemble import exit_codes
from adhesis.ensemble.command.parser import within
from adhesis.ensemble.errors import InputError, WriteError, parameter
from adhesis.ensemble.escape import shell_word
from adhesis.ensemble.quantities import WORK_OF_ADHESION
from adhesis.ensemble.reporter import bar, log

if TYPE_CHECKING:
    from adhesis.ensemble.campaign.tables import Campaign
    from adhesis.ensemble.campaign.tasks import Part
    from adhesis.ensemble.run.session import Engine, Summary

_ALL_ARRIVE = 20.0  # s within which all ranks have the same error, if it is one of all
_MOST = 2**31 - 1
_NUMBER = within(0, _MOST, "a number that is not negative")
_WHOLE = within(0, _MOST, "a whole number that is not negative", int)
EXAMPLES = ("adhesis run jobs/example.toml --ranks 3", "adhesis run jobs/paper.toml --dry-run")


_RANKS = "start N ranks on this machine (one more than cores is right: rank 0 only hands out)"
_DRY_RUN = "estimate the cost from about a minute of pilot loops, and write nothing"
_PART = "compute the K-th of N shares of the tasks into a file of its own (see adhesis merge)"
_WALLTIME = (
    "stop in time for this walltime, as 3600, 1h30m or 12:00:00 (default: what Slurm or Torque say)"
)
_FAILURES = "stop after so many failed tasks; 0: never (default: 20)"
_REDO = "compute tasks again: those that failed (failed), or done ones too (all)"
_ONLY, _MORE = "with --redo: only", {"action": "append", "default": []}
_GAMMA = f"{_ONLY} tasks of this γ in J/m²; may be repeated"
_PATIENCE = "how long to wait for another run to let go of FILE.h5 (default: 10)"
OPTIONS = (
    ("campaign CAMPAIGN.toml", Path, "the campaign file"),
    ("--out FILE.h5", Path, "results file (default: the campaign's name, here)"),
    ("--ranks N", within(1, _MOST, "a whole number of at least 1", int), _RANKS),
    ("--dry-run", bool, _DRY_RUN),
    ("--part K/N", None, _PART),
    ("--walltime TIME", None, _WALLTIME),
    ("--max-failures N", _WHOLE, _FAILURES, {"default": 20}),
    ("--redo WHICH", None, _REDO),
    ("--hurst VALUE", _NUMBER, f"{_ONLY} tasks of this H; may be repeated", _MORE),
    ("--work-of-adhesion VALUE", WORK_OF_ADHESION.option, _GAMMA, _MORE),
    ("--realisation VALUE", _WHOLE, f"{_ONLY} this realisation; may be repeated", _MORE),
    ("--patience SECONDS", _NUMBER, _PATIENCE, {"default": 10.0}),
)


def execute(args: argparse.Namespace, engine: Engine | None = None) -> int:
    """Run; returns the exit code, on ranks above 0 that of success.

    Tests pass another engine than loops.
    """
    from adhesis.ensemble.run.dispatch import Unresponsive
    from adhesis.ensemble.run.launch import check_ranks
    from adhesis.ensemble.run.ranks import OneRank, launched, wait_for_all, world

    started = time.time()
    comm: Any = OneRank()
    try:
        if args.ranks is not None and not args.dry_run:
            check_ranks(args.ranks)
            rule = "leave it out under mpirun or srun"
            if launched()[0] > 1:
                raise InputError(f"--ranks starts ranks of its own: {rule}")
        comm = world()
        code = _run(args, comm, started, engine)
        return code if comm.rank == 0 else exit_codes.DONE
    except InputError as error:
        if comm.size == 1:
            raise
        if comm.rank == 0:
            log(f"adhesis run: {error}")
        if not wait_for_all(comm, _ALL_ARRIVE):  # the error is of this rank alone
            _end_job(comm, exit_codes.BAD_INPUT, f"adhesis run: {error}" if comm.rank else "")
        return exit_codes.BAD_INPUT if comm.rank == 0 else exit_codes.DONE
    except BaseException as error:
        if args.dry_run and (comm.size == 1 or isinstance(error, (BrokenPipeError, WriteError))):
            raise
        if isinstance(error, Unresponsive):  # nobody can be waited for: the results file is sound
            code, sentence = exit_codes.RESUME, str(error)
        else:
            code, sentence = exit_codes.ended_by(error)
        if sentence:
            resumes = code in (exit_codes.INTERRUPTED, exit_codes.RESUME)
            again = f", {_again(args)}" if resumes else ""
            sentence = f"adhesis run: {sentence}; what the file holds is kept{again}"
        _end_job(comm, code, sentence)
        if code == exit_codes.WRITE_FAILED:
            os._exit(code)  # at an orderly exit HDF5 would try to write again, and crash
        return code


def _end_job(comm: Any, code: int, sentence: str = "") -> None:
    """End every rank: the others know nothing of this one's error and would wait for ever."""
    if sentence:
        log(sentence)
    if comm.size > 1:
        comm.Abort(code)


def _run(args: argparse.Namespace, comm: Any, started: float, engine: Engine | None) -> int:
    from adhesis.ensemble.campaign.file import load_campaign
    from adhesis.ensemble.campaign.tasks import WHOLE, Part
    from adhesis.ensemble.run.interrupt import deadline, parse_duration
    from adhesis.ensemble.run.plan import Options
    from adhesis.ensemble.run.ranks import together
    from adhesis.ensemble.run.session import run_campaign

    # One rank reads: a file that changes meanwhile must not split the job.
    campaign = together(comm, lambda: load_campaign(args.campaign))
    path = args.out or Path(f"{args.campaign.stem}.h5")
    together(comm, lambda: _check_out(args, path))
    if args.part and not args.out and not args.dry_run:
        raise InputError("--part needs --out: every part has a results file of its own")
    options = Options(
        part=Part.parse(args.part) if args.part else WHOLE,
        redo=_selection(args),
        max_failures=args.max_failures or math.inf,
        deadline=deadline(parse_duration(args.walltime) if args.walltime else None, started),
        patience=args.patience,
        processes=(args.ranks or 1) - 1,
    )
    if args.dry_run:
        if options.redo is not None:
            why = "the price is that of pending tasks"
            raise InputError(f"--redo and --dry-run cannot be given together: {why}")
        return _price(campaign, path, options.part, engine) if comm.rank == 0 else exit_codes.DONE
    summary = run_campaign(campaign, path, comm, options, log, engine)
    if comm.rank == 0:
        _report_end(campaign, path, summary, _again(args))
    if summary.pending and summary.failed_now < options.max_failures:
        return exit_codes.RESUME
    return exit_codes.SOME_FAILED if summary.failed else exit_codes.DONE


def _check_out(args: argparse.Namespace, path: Path) -> None:
    """Refuse the campaign file itself, and what is no results file or will be none."""
    from adhesis.ensemble.results.layout import check_results_file

    check_results_file(path)
    if os.path.exists(path) and path.samefile(args.campaign):
        raise InputError(f"--out is {path}, the campaign file itself: give another file")


def _again(args: argparse.Namespace) -> str:
    """Return how a run is resumed; with --redo what it did would be computed once more."""
    how = "the same command again" if args.redo is None else "the command again without --redo"
    return f"run {how} to resume"


def _report_end(campaign: Campaign, path: Path, summary: Summary, again: str) -> None:
    from adhesis.ensemble.campaign.precision import precision_lines
    from adhesis.ensemble.task.doubt import doubtful_losses, why_beyond
    from adhesis.solver.checks import counted

    status = f"adhesis status {shell_word(path)}"
    log(f"{path}: {summary}")
    if summary.failed:
        log(f"why they failed, and what to do: {status}")
    for line in precision_lines(summary.precisions):
        log(line)
    if summary.doubtful:
        they = "its own account it" if summary.doubtful == 1 else "their own account they"
        most = f"{100 * campaign.solver.accuracy:g} %, the accuracy asked for ({status})"
        log(doubtful_losses(summary.doubtful, f": by {they} may be off by more than {most}"))
    if summary.beyond_limit:
        why = why_beyond(campaign.material.opens)
        log(doubtful_losses(summary.beyond_limit, f": {why} ({status})"))
    if summary.short_of_preload:
        log(f"{counted(summary.short_of_preload, 'loop')} did not reach the preload ({status})")
    if summary.stopped:
        least = "at least " if summary.precisions else ""  # further batches may follow
        are = "is" if summary.pending == 1 else "are"
        left = f"{least}{counted(summary.pending, 'task')} {are} left"
        log(f"stopped early: {summary.stopped}; {left}, {again}")


def _price(campaign: Campaign, path: Path, part: Part, engine: Engine | None) -> int:
    from adhesis.ensemble.run.price import price
    from adhesis.ensemble.run.session import Engine

    engine = engine or Engine()
    with bar("price", last=False) as show:
        estimate = price(
            *(campaign, path, part),
            compute=lambda c, t: engine.compute(c, t, None),
            check=engine.check,
            on_pilot=lambda task, seconds: show(None, None, f"{task}: {seconds:.3g} s"),
        )
    print(estimate)
    return exit_codes.DONE


def _selection(args: argparse.Namespace) -> Any:
    from adhesis.ensemble.run.plan import Selection

    values = {name: getattr(args, name) for name in ("hurst", "work_of_adhesion", "realisation")}
    if args.redo is None:
        for name in map(parameter, filter(values.get, values)):
            raise InputError(f"{name} needs --redo: it chooses the tasks to compute again")
        return None
    if args.redo not in ("failed", "all"):
        raise InputError(f"--redo is {args.redo!r}: it must be failed or all")
    return Selection(args.redo, values)
