"""Run ``adhesis trace``: read, plan, run the loops, write the page."""

from __future__ import annotations

import argparse
import sys
import time

from adhesis.ensemble.errors import InputError, refused_as_input
from adhesis.ensemble.loop.record import write_json
from adhesis.ensemble.outputs import Writing, check_output_folder, staged_folder
from adhesis.ensemble.trace.answer import NoAnswer, check, document, make_cycle, run_plan
from adhesis.ensemble.trace.options import prepared_of, trace_of, what_was_read
from adhesis.ensemble.trace.plan import Plan, clock, make_plan
from adhesis.ensemble.trace.pool import Pool
from adhesis.solver.model.half_space import HalfSpace

_SECONDS_BETWEEN_LINES = 10.0
_FIGURES = ("trace.png", "spectrum.png", "loop.png", "cut-off.png", "tables.png")
_FILES = ("trace.json", "trace.html", "trace.md", *_FIGURES)


def execute(args: argparse.Namespace) -> int:
    """Read, plan, run, write; returns the exit code."""
    if args.to is None and not args.plan:
        raise InputError("give --to, the directory for the page, or --plan")
    if args.processes is not None and args.processes < 1:
        raise InputError(f"--processes is {args.processes}: it must be at least 1")
    gammas = _numbers(args.work_of_adhesion, "--work-of-adhesion")
    depths = _numbers(args.max_penetration, "--max-penetration")
    with refused_as_input(vars(args)):
        half_space = HalfSpace(args.young, args.poisson)
        cycle = make_cycle(
            half_space, gammas, depths, args.load_steps, args.method, args.accuracy,
            args.adhesion_range, args.strength,
        )  # fmt: skip
    if args.to is not None:
        check_output_folder("--to", args.to, _FILES, {"the command": args.file})
    prepared = prepared_of(args, trace_of(args, args.file))
    with refused_as_input(vars(args)):
        check(prepared, cycle)
    plan = make_plan(prepared, cycle, quick=args.quick, processes=args.processes)
    print(what_was_read(prepared))
    for warning in prepared.warnings:
        print(f"WARNING     {warning}")
    print(plan.said, flush=True)
    if args.plan:
        return 0
    try:
        answer = run_plan(prepared, cycle, plan, None if args.quiet else _Progress(plan))
    except NoAnswer as error:
        print(f"adhesis trace: {error}", file=sys.stderr)
        return 1
    from adhesis.ensemble.trace.page import summary, write_page

    writing = Writing()
    with writing.output("--to", args.to / "trace.json"):
        args.to.mkdir(parents=True, exist_ok=True)
        write_json(args.to / "trace.json", document(answer))
    with writing.output("--to", args.to / "trace.html"), staged_folder(args.to) as folder:
        write_page(answer, folder)
    print(summary(answer))
    if not writing.failures:
        print(f"wrote       {args.to / 'trace.html'}, trace.md, trace.json and the figures")
    writing.finish()
    return 0


def _numbers(text: str, option: str) -> list[float]:
    try:
        values = [float(word) for word in str(text).split(",")]
    except ValueError:
        raise InputError(f"{option} is {text!r}: one number, or several with commas") from None
    if len(set(values)) < len(values):
        raise InputError(f"{option} is {text!r}: it names a value twice")
    return values


class _Progress:
    """Lines on stderr: loops done, what is running, time left; none is longer silent than 10 s."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.started = self.last = time.monotonic()
        self.live = sys.stderr.isatty()

    def __call__(self, pool: Pool) -> None:
        now = time.monotonic()
        finished = not pool.running and not pool.waiting
        if not self.live and now - self.last < _SECONDS_BETWEEN_LINES:
            return
        self.last = now
        running = ", ".join(
            f"{name} ({branch} {penetration:+.2f})"
            for name, (_, branch, penetration) in pool.running.items()
        )
        left = self._left(pool, now)
        line = f"{len(pool.done)} of {len(self.plan.runs)} loops"
        if not pool.done and now - self.started > 8:
            running += "; the first loop of an installation waits a minute or two for machine code"
        if running:
            line += f"; running {running}"
        line += f"; {now - self.started:.0f} s so far"
        line += f", about {clock(left)} left" if pool.done and not finished else ""
        if self.live:
            print(
                f"\r\x1b[K{line[:150]}", end="\n" if finished else "", file=sys.stderr, flush=True
            )
        else:
            print(line, file=sys.stderr, flush=True)

    def _left(self, pool: Pool, now: float) -> float:
        """Expected wall seconds, corrected by what the loops have taken so far."""
        expected = self.plan.seconds
        running = {name: now - started for name, (started, _, _) in pool.running.items()}
        ended = list(pool.took)[1:]  # without the first one, which may have made machine code
        predicted = sum(expected[name] for name in ended)
        ratio = sum(pool.took[name] for name in ended) / predicted if predicted > 0 else 1.0
        rest = [
            max(ratio * expected[name] - seconds, 0.25 * seconds)
            for name, seconds in running.items()
        ]
        waiting = sum(ratio * expected[job.name] for job in pool.waiting)
        return max([(waiting + sum(rest)) / pool.processes, *rest])
