"""Run ``adhesis trace``: read, plan, run the loops, write the page."""

from __future__ import annotations

import argparse
import sys

from adhesis.ensemble.command.options import (
    in_options,
    prepared_of,
    settings_of,
    what_was_read,
)
from adhesis.ensemble.errors import InputError, refused_as_input
from adhesis.ensemble.exit_codes import SOME_FAILED
from adhesis.ensemble.files import Writing, check_output_folder, staged_folder, write_json
from adhesis.ensemble.quantities import WORK_OF_ADHESION, read_list
from adhesis.ensemble.trace.answer import (
    FIGURE_FILES,
    FILES,
    NoAnswer,
    check,
    document,
    make_cycle,
    run_plan,
)
from adhesis.ensemble.trace.variants import make_plan
from adhesis.ensemble.versions import input_record, provenance
from adhesis.solver.model.half_space import HalfSpace


def execute(args: argparse.Namespace) -> int:
    """Read, plan, run, write; returns the exit code."""
    if args.to is None and not args.plan:
        raise InputError("--to is missing: give the directory for the page, or --plan for none")
    if args.processes is not None and args.processes < 1:
        raise InputError(f"--processes is {args.processes}: it must be at least 1")
    gammas = read_list("--work-of-adhesion", args.work_of_adhesion, WORK_OF_ADHESION.read)
    with refused_as_input(vars(args), thickness="layer"):
        half_space = HalfSpace(args.young, args.poisson)
        settings = settings_of(args, half_space)
        cycle = make_cycle(works_of_adhesion=gammas, **settings)
    if args.to is not None:
        check_output_folder("--to", args.to, FILES, {"the command": args.file})
    prepared = prepared_of(args, args.file)
    source = input_record(args.file)
    with refused_as_input(vars(args)):
        check(prepared, cycle)
    plan = make_plan(prepared, cycle, quick=args.quick, processes=args.processes)
    print(what_was_read(prepared))
    print(plan.text, flush=True)
    if args.plan:
        return 0
    try:
        answer = run_plan(prepared, cycle, plan, progress=not args.quiet)
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
    page = args.to / "trace.html"
    with writing.output("--to", page), staged_folder(args.to, FIGURE_FILES) as folder:
        write_page(answer, folder)
    print(summary(answer))
    if not writing.failures:
        print(f"wrote       {page}, trace.md, trace.json and the figures")
    writing.finish()
    return 0
