"""Run ``adhesis trace``: read, plan, run the loops, write the page."""

from __future__ import annotations

import argparse
import sys

from adhesis.ensemble.errors import InputError, refused_as_input
from adhesis.ensemble.exit_codes import SOME_FAILED
from adhesis.ensemble.loop.cycle import control_of, in_options, turns_of
from adhesis.ensemble.outputs import Writing, check_output_folder, staged_folder, write_json
from adhesis.ensemble.provenance import input_record, provenance
from adhesis.ensemble.quantities import (
    WORK_OF_ADHESION,
    drive_text,
    duration,
    read_words,
    words_of,
)
from adhesis.ensemble.reporter import StatusLine
from adhesis.ensemble.trace.answer import (
    FIGURE_FILES,
    FILES,
    NoAnswer,
    check,
    document,
    make_cycle,
    run_plan,
)
from adhesis.ensemble.trace.loops import Loops
from adhesis.ensemble.trace.options import pattern_of, prepared_of, trace_of, what_was_read
from adhesis.ensemble.trace.variants import Plan, make_plan
from adhesis.solver.model.half_space import HalfSpace

_SECONDS_BETWEEN_LINES = 10.0


def execute(args: argparse.Namespace) -> int:
    """Read, plan, run, write; returns the exit code."""
    if args.to is None and not args.plan:
        raise InputError("--to is missing: give the directory for the page, or --plan for none")
    if args.processes is not None and args.processes < 1:
        raise InputError(f"--processes is {args.processes}: it must be at least 1")
    option, text = "--work-of-adhesion", args.work_of_adhesion
    gammas = read_words(option, words_of(option, text), WORK_OF_ADHESION.read)
    if len(set(gammas)) < len(gammas):
        raise InputError(f"{option} is {text!r}: its values must differ")
    with refused_as_input(vars(args), thickness="layer"):
        half_space = HalfSpace(args.young, args.poisson)
        control = control_of(args, half_space)
        turns = turns_of(args, control)
        cycle = make_cycle(
            half_space, gammas, turns.points, args.load_steps, args.method, args.accuracy, control,
            args.adhesion_range, args.strength, at_preload=turns.are_preloads, latest=turns.latest,
            work_of_adhesion_open=args.work_of_adhesion_open, measure=args.measure,
            pattern=pattern_of(args),
        )  # fmt: skip
    if args.to is not None:
        check_output_folder("--to", args.to, FILES, {"the command": args.file})
    prepared = prepared_of(args, trace_of(args, args.file))
    source = input_record(args.file)
    with refused_as_input(vars(args)):
        check(prepared, cycle)
    plan = make_plan(prepared, cycle, quick=args.quick, processes=args.processes)
    print(what_was_read(prepared))
    print(plan.text, flush=True)
    if args.plan:
        return 0
    try:
        progress = None if args.quiet else _Progress(plan, control.is_load)
        answer = run_plan(prepared, cycle, plan, progress)
    except NoAnswer as error:
        print(f"adhesis trace: {in_options(str(error), args)}", file=sys.stderr)
        return SOME_FAILED
    from adhesis.ensemble.trace.trace_page import summary, write_page

    writing = Writing()
    with writing.output("--to", args.to / "trace.json"):
        args.to.mkdir(parents=True, exist_ok=True)
        numbers = document(answer)
        numbers["provenance"] = provenance(args.words, source, None, numbers)
        write_json(args.to / "trace.json", numbers)
    with (
        writing.output("--to", args.to / "trace.html"),
        staged_folder(args.to, FIGURE_FILES) as folder,
    ):
        write_page(answer, folder)
    print(summary(answer))
    if not writing.failures:
        print(f"wrote       {args.to / 'trace.html'}, trace.md, trace.json and the figures")
    writing.finish()
    return 0


class _Progress:
    """Lines on stderr: loops done, what is running, time left; none is longer silent than 10 s."""

    def __init__(self, plan: Plan, load: bool) -> None:
        self.plan, self.load = plan, load
        self.line = StatusLine(_SECONDS_BETWEEN_LINES)

    def __call__(self, loops: Loops) -> None:
        finished = not loops.running and not loops.waiting
        self.line.show(lambda: self._text(loops, finished), last=finished)

    def _text(self, loops: Loops, finished: bool) -> str:
        running = ", ".join(
            f"{name} ({branch}, {drive_text(drive, self.load)})"
            for name, (_, branch, drive) in loops.running.items()
        )
        left = self._left(loops)
        line = f"{len(loops.done)} of {len(self.plan.runs)} loops"
        if running:
            line += f"; running {running}"
        line += f"; {self.line.seconds:.0f} s so far"
        return line + (f", about {duration(left)} left" if loops.done and not finished else "")

    def _left(self, loops: Loops) -> float:
        """Expected wall seconds, corrected by what the loops have taken so far."""
        expected = self.plan.seconds
        running = {name: seconds for name, (seconds, _, _) in loops.running.items()}
        ended = list(loops.took)[1:]  # the first one loads what the processes share
        predicted = sum(expected[name] for name in ended)
        ratio = sum(loops.took[name] for name in ended) / predicted if predicted > 0 else 1.0
        rest = [
            max(ratio * expected[name] - seconds, 0.25 * seconds)
            for name, seconds in running.items()
        ]
        waiting = sum(ratio * expected[name] for name in loops.waiting)
        return max([(waiting + sum(rest)) / max(loops.processes, 1), *rest])
