"""Run ``adhesis loop``: one profile, from the options to the files that they ask for."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from adhesis.ensemble.command import options
from adhesis.ensemble.command.loop_arguments import H_RMS, N0, PERIOD, RATIO
from adhesis.ensemble.command.options import in_options
from adhesis.ensemble.errors import InputError, parameter, refused_as_input
from adhesis.ensemble.escape import printable
from adhesis.ensemble.exit_codes import DONE, SOME_FAILED
from adhesis.ensemble.files import Writing, check_ending, check_outputs, whole_file, write_json
from adhesis.ensemble.loop import record
from adhesis.ensemble.loop.heights import heights_warning, read_heights
from adhesis.ensemble.trace.loops import Cycle
from adhesis.ensemble.versions import input_record, provenance
from adhesis.solver import checks
from adhesis.solver.checks import plain
from adhesis.solver.loading.cycle import check_cycle, latest_turn
from adhesis.solver.loading.loop import run_loop, run_loops
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.loop_state import field_nodes
from adhesis.solver.loading.path import check_path, run_path
from adhesis.solver.method import Method, PathError
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Profile, profile_from_heights, self_affine_profile
from adhesis.solver.registry import make_method

_FIELD_PARTS = (0.25, 0.5, 0.75, 1.0)
FIGURE_FORMATS = (".png", ".pdf", ".svg")
_MATERIAL = {"work_of_adhesion": 0.04, "young": 1e6, "poisson": 0.5}
# Of every field that is kept, over all its states: three arrays of so many numbers take 1.6 GB.
_MOST_FIELD_VALUES = 2**26


def execute(args: argparse.Namespace) -> int:
    """Run the loop, loops or path, and write what was asked for."""
    taken = _take_defaults(args)
    _check_files(args)
    with refused_as_input(vars(args), thickness="layer", turning_points="path"):
        profile, warnings, said = _profile(args)
        source = input_record(args.heights or args.trace)
        half_space = HalfSpace(args.young, args.poisson)
        gammas = (args.work_of_adhesion,)
        cycle = Cycle(works_of_adhesion=gammas, **options.settings_of(args, half_space))
        if args.path is None:
            cycle = replace(cycle, turning_points=tuple(sorted(cycle.turning_points)))
        problem = cycle.problem(profile, args.work_of_adhesion)
        _check_cycle(args, cycle, problem)
    _check_film(args, cycle)
    wanted, at_stresses = _wanted_fields(args, cycle)
    with refused_as_input(vars(args)):
        settings = {"accuracy": args.accuracy, "nodes_per_wave": args.nodes_per_wave}
        method = make_method(args.method, problem, **settings)
    nodes = _field_nodes(args, method, wanted) if wanted else 0
    fields: dict[str, Any] = {}
    try:
        results = _run(args, method, cycle)
        if wanted:
            (loop,) = results
            assert isinstance(loop, LoopResult)  # a path has no fields
            fields = record.fields_of(loop, method, wanted, at_stresses, nodes)
    except PathError as error:
        print(f"adhesis loop: {in_options(str(error), args)}", file=sys.stderr)
        return SOME_FAILED
    writing = Writing()
    if args.json is not None:
        with writing.output("--json", args.json):
            numbers = record.document(results, warnings)
            if source is not None:
                numbers["read"] = {"said": said}
            seed = args.seed if source is None else None
            numbers["provenance"] = provenance(args.words, source, seed, numbers)
            write_json(args.json, numbers)
    if args.csv is not None:
        from adhesis.ensemble.loop.saved import write_csv  # loads pandas

        with writing.output("--csv", args.csv):
            write_csv(args.csv, results)
    if fields:
        with writing.output("--fields", args.fields), whole_file(args.fields) as stream:
            np.savez_compressed(stream, **fields)
    if args.figure is not None:
        from adhesis.ensemble.loop.loop_figure import draw_loops  # loads matplotlib
        from adhesis.ensemble.report.figures.style import write

        with writing.output("--figure", args.figure):
            write(draw_loops(results), args.figure, dpi=200)
    if args.film is not None:
        with writing.output("--film", args.film):
            results[0].film(args.film, progress=not args.quiet)
    if args.heights is not None:
        print(printable(f"read        {args.heights}: {'; '.join(said)}"))
    print("\n\n".join(result.summary() for result in results))
    if taken:
        print(f"defaults    {' '.join(taken)}: taken as they are not given")
    for path in writing.written:
        print(f"wrote       {path}")
    doubts = dict.fromkeys([*warnings, *(t for result in results for t in result.warnings)])
    for text in doubts:
        print(f"adhesis loop: {text}", file=sys.stderr)
    writing.finish()
    return SOME_FAILED if doubts and args.strict else DONE


def _run(args: argparse.Namespace, method: Method, cycle: Cycle) -> tuple[record.Result, ...]:
    settings: dict[str, Any] = {"load_steps": cycle.load_steps, "progress": not args.quiet}
    turns = cycle.turning_points
    if args.path is not None:
        return (run_path(method, turns, out=options.ends_out(args.path), **settings),)
    if len(turns) > 1:
        return run_loops(method, **cycle.arguments(turns), **settings)
    return (run_loop(method, **cycle.arguments(turns[0]), **settings),)


def _check_cycle(args: argparse.Namespace, cycle: Cycle, problem: Problem) -> None:
    """Check that the path can be followed; the ValueError gives the rule that it breaks."""
    turns, steps = cycle.turning_points, cycle.load_steps
    if args.path is not None:
        check_path(turns, steps, problem, options.ends_out(args.path))
        return
    for turn in turns:
        end = latest_turn(problem, turn, cycle.latest) if cycle.at_preload else turn
        check_cycle(end, steps, cycle.control)


def _take_defaults(args: argparse.Namespace) -> list[str]:
    """Set what ``--hurst`` leaves open of profile and material; return it as options.

    With heights or a trace of one's own the material has no defaults (InputError).
    """
    if args.hurst is not None:
        texts = {"period": f"{1e3 * PERIOD:.5g}mm", "h_rms": f"{1e6 * H_RMS:g}um"}
        defaults: dict[str, Any] = {"period": PERIOD, "n0": N0, "ratio": RATIO, "seed": 0}
        if args.m2 is None and args.c0 is None:
            defaults["h_rms"] = H_RMS
        taken = []
        for name, value in {**defaults, **_MATERIAL}.items():
            if getattr(args, name) is None:
                setattr(args, name, value)
                text = plain(value) if isinstance(value, float) else value
                taken.append(f"{parameter(name)} {texts.get(name, text)}")
        return taken
    missing = [parameter(name) for name in _MATERIAL if getattr(args, name) is None]
    if missing and (args.heights or args.trace):
        raise InputError(
            f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing: with "
            f"{'--heights' if args.heights else '--trace'} the material has to be given "
            "(--work-of-adhesion in J/m², --young in Pa, --poisson)"
        )
    return []


def _check_files(args: argparse.Namespace) -> None:
    """Refuse output files that cannot be written, or that would destroy an input or each other."""
    if args.figure is not None:
        check_ending("--figure", args.figure, *FIGURE_FORMATS)
    if args.fields is not None:
        check_ending("--fields", args.fields, ".npz")

    def named(*names: str) -> dict[str, Path]:
        paths = {f"--{name}": getattr(args, name) for name in names}
        return {option: path for option, path in paths.items() if path is not None}

    check_outputs(named("json", "csv", "fields", "figure", "film"), named("heights", "trace"))


def _check_film(args: argparse.Namespace, cycle: Cycle) -> None:
    """Refuse a film that cannot be made, before the loop is run."""
    if args.film is None:
        return
    if args.path is None and len(cycle.turning_points) > 1:
        name = "--max-stress" if cycle.control.is_load else "--max-penetration"
        name = "--preload" if cycle.at_preload else name
        raise InputError(
            f"--film is given with {len(cycle.turning_points)} turning points: a film shows one "
            f"loop, so give {name} one value"
        )
    from adhesis.ensemble.loop.film import check_film

    check_film("--film", args.film)


def _profile(args: argparse.Namespace) -> tuple[Profile, list[str], list[str]]:
    """Return the profile of the one source that is given, what is doubtful, and how it was read."""
    options.refuse_several(args, "hurst", "heights", "trace")
    if not options.given(args, "hurst", "heights", "trace"):
        raise InputError("no profile is given: give one of --hurst, --heights and --trace")
    if args.heights is not None and args.period is None:
        raise InputError("--heights needs --period, the length of the period, as in 2mm")
    if args.hurst is None:
        of_hurst = ("seed", "n0", "ratio", "h_rms", "m2", "c0", "amplitudes")
        for option in options.given(args, *of_hurst, *(() if args.trace is None else ("period",))):
            those = "--hurst and --heights" if option == "--period" else "--hurst"
            raise InputError(f"{option} belongs to {those}: given heights are taken as they are")
    if args.trace is None:
        of_heights = () if args.heights is None else ("--unit", "--delimiter", "--decimal")
        for option in options.given(args):
            if option not in of_heights:
                raise InputError(f"{option} belongs to --trace, which is not given")
    if args.hurst is not None:
        return _self_affine(args), [], []
    if args.heights is not None:
        return _given_heights(args)
    prepared = options.prepared_of(args, args.trace)
    print(options.what_was_read(prepared))
    return prepared.profile(), list(prepared.warnings), list(prepared.trace.notes)


def _given_heights(args: argparse.Namespace) -> tuple[Profile, list[str], list[str]]:
    period = checks.real("period", args.period, checks.LENGTH)
    form = {name: getattr(args, name) for name in ("unit", "delimiter", "decimal")}
    with options.shown_while_read(args.heights, args.quiet):
        heights, said = read_heights(args.heights, period=period, **form)
    warning = heights_warning(heights, f"{args.heights}")
    return profile_from_heights(heights, args.period), [warning] if warning else [], [said]


def _self_affine(args: argparse.Namespace) -> Profile:
    norms = {name: getattr(args, name) for name in ("h_rms", "m2", "c0")}
    options.refuse_several(args, *norms)
    shape = {name: getattr(args, name) for name in ("hurst", "period", "n0", "ratio", "seed")}
    amplitudes: Any = args.amplitudes or "deterministic"
    return self_affine_profile(**shape, amplitudes=amplitudes, **norms)


def _wanted_fields(args: argparse.Namespace, cycle: Cycle) -> tuple[list[float], bool]:
    """Return where fields are wanted, and whether these are mean stresses in Pa; else Δ/h_max."""
    if args.fields is None:
        for option in options.given(args, "field_penetrations", "field_stresses", "field_nodes"):
            raise InputError(f"{option} needs --fields, the file to which fields are written")
        return [], False
    if args.path is not None or len(cycle.turning_points) > 1:
        raise InputError("--fields belongs to one loop: give one turning point, and no --path")
    penetrations, stresses = args.field_penetrations, args.field_stresses
    options.refuse_several(args, "field_penetrations", "field_stresses")
    at_preload, (top,) = cycle.at_preload, cycle.turning_points
    at_stresses = stresses is not None or (at_preload and penetrations is None)
    if not at_stresses and (at_preload or not cycle.control.is_fixed):
        raise InputError(
            "--fields at penetrations belongs to one loop that turns at --max-penetration at fixed "
            "separation: give --field-stresses, as 5kPa 10kPa, instead"
        )
    wanted = stresses if at_stresses else penetrations
    if wanted is None:
        return [part * top for part in _FIELD_PARTS], at_stresses
    for value in wanted:
        if at_stresses and not np.isfinite(value):
            raise InputError(f"--field-stresses holds {value}: it must be a finite number, in Pa")
        if not at_stresses and not (np.isfinite(value) and value <= top):
            limit = f"the loop goes no deeper than {top:g}"
            raise InputError(f"--field-penetrations holds {value}: {limit}")
    return list(dict.fromkeys(wanted)), at_stresses


def _field_nodes(args: argparse.Namespace, method: Method, wanted: Sequence[float]) -> int:
    """Nodes of the fields: those asked for, else the method's own, else 32 per shortest wave."""
    nodes = field_nodes(method) if args.field_nodes is None else args.field_nodes
    states = 2 * len(wanted)
    if nodes * states > _MOST_FIELD_VALUES:
        raise InputError(
            f"--field-nodes is {nodes}{'' if args.field_nodes else ' by default'}: with the fields "
            f"of {states} states it must be at most {_MOST_FIELD_VALUES // states}"
        )
    if args.field_nodes is not None:
        with refused_as_input(vars(args), nodes="field_nodes", n="field_nodes"):
            # A method refuses a number of nodes here, not after the loop has been computed.
            method.problem.profile.heights(nodes)
            method.fields(method.detached(method.problem.separation(0.0)), nodes)
    return int(nodes)
