"""Run ``adhesis loop``: one profile, from the options to the files that they ask for."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ensemble.errors import InputError
from ensemble.loop.arguments import H_RMS, N0, PERIOD, RATIO
from ensemble.loop.cycle import Cycle, cycle_of
from ensemble.loop.record import (
    FieldStates,
    check_writable,
    loop_summary,
    loops_document,
    path_document,
    path_summary,
    write_json,
    write_npz,
)
from ensemble.ticker import tell
from ensemble.trace.options import (
    given,
    prepared_of,
    trace_of,
    what_was_read,
)
from ensemble.warm import warm_missing
from solver.loop import Progress, run_loop
from solver.loop_result import LoopResult
from solver.material import HalfSpace
from solver.method import Branch, ContactState, Method, PathError
from solver.path import PathResult, run_path
from solver.problem import Problem
from solver.profile import Array, Profile, profile_from_heights, self_affine_profile
from solver.registry import make_method
from solver.turns import run_loops

_FIELD_PARTS = (0.25, 0.5, 0.75, 1.0)
_SECONDS_BETWEEN_LINES = 5.0
FIGURE_FORMATS = (".png", ".pdf", ".svg")


def execute(args: argparse.Namespace) -> int:
    """Run the loop, loops or path, and write what was asked for."""
    with _bad_input():
        profile = _profile(args)
        half_space = HalfSpace(args.young, args.poisson)
        cycle = cycle_of(args, half_space)
        problem = Problem(profile, half_space, args.work_of_adhesion, cycle.control)
        cycle.check(problem)
    if args.figure is not None and args.figure.suffix.lower() not in FIGURE_FORMATS:
        raise InputError(
            f"--figure is {args.figure}: the name must end in {', '.join(FIGURE_FORMATS)}"
        )
    files = [path for path in (args.json, args.fields, args.figure) if path is not None]
    for path in files:
        check_writable(path)
    penetrations = _field_penetrations(args, cycle)
    with _bad_input():
        method = make_method(
            args.method, problem, accuracy=args.accuracy, nodes_per_wave=args.nodes_per_wave
        )
    warm_missing([method.name], _quiet if args.quiet else tell)
    nodes = _field_nodes(args, method) if penetrations else 0
    picked = FieldStates(method, penetrations)
    try:
        results = _run(args, method, cycle, picked.visit if penetrations else None)
    except PathError as error:
        print(f"adhesis loop: {error}", file=sys.stderr)
        return 1
    fields = picked.collect(nodes) if penetrations else {}  # everything is there before a file is
    if isinstance(results, PathResult):
        document, summary = path_document(results), path_summary(results)
    else:
        document, summary = loops_document(results), "\n\n".join(map(loop_summary, results))
    if args.json is not None:
        write_json(args.json, document)
    if fields:
        write_npz(args.fields, fields)
    if args.figure is not None:
        from ensemble.loop.figure import draw_loops

        draw_loops(results).savefig(args.figure, dpi=200)
    print(summary)
    for path in files:
        print(f"wrote       {path}")
    loops = [] if isinstance(results, PathResult) else results
    doubts = list(dict.fromkeys(text for result in loops for text in result.warnings))
    for text in doubts:
        print(f"adhesis loop: {text}", file=sys.stderr)
    return 1 if doubts and args.strict else 0


def _run(
    args: argparse.Namespace,
    method: Method,
    cycle: Cycle,
    on_state: Callable[[Branch, ContactState], None] | None,
) -> tuple[LoopResult, ...] | PathResult:
    progress = (
        None if args.quiet else _progress(cycle.top / cycle.load_steps, cycle.control.is_load)
    )
    if cycle.is_path:
        return run_path(
            method,
            cycle.turning_points,
            load_steps=cycle.load_steps,
            out=cycle.out,
            progress=progress,
            on_state=on_state,
        )
    name = "max_stress" if cycle.control.is_load else "max_penetration"
    if len(cycle.turning_points) > 1:
        turns: Any = {name: cycle.turning_points}
        return run_loops(method, load_steps=cycle.load_steps, progress=progress, **turns)
    turn: Any = {name: cycle.turning_points[0]}
    loop = run_loop(
        method, load_steps=cycle.load_steps, progress=progress, on_state=on_state, **turn
    )
    return (loop,)


# ---------------------------------------------------------------------- input


@contextmanager
def _bad_input() -> Iterator[None]:
    """Turn the refusals of the solver's constructors into the user's errors; nothing else."""
    try:
        yield
    except (ValueError, NotImplementedError) as error:
        raise InputError(str(error)) from None


def _profile(args: argparse.Namespace) -> Profile:
    """Return the profile of the one source that is given."""
    if args.trace is None:
        for option in given(args):
            raise InputError(f"{option} belongs to --trace")
        return _given_heights(args) if _wants_heights(args) else _self_affine(args)
    if args.heights is not None or args.hurst is not None:
        raise InputError("give one of --heights, --hurst and --trace: several are given")
    _refuse_options_of_hurst(args, "period")
    prepared = prepared_of(args, trace_of(args, args.trace))
    print(what_was_read(prepared))
    for warning in prepared.warnings:
        print(f"WARNING     {warning}")
    return prepared.profile()


def _wants_heights(args: argparse.Namespace) -> bool:
    if (args.heights is None) == (args.hurst is None):
        both = "neither is" if args.hurst is None else "both are"
        raise InputError(f"give either --heights or --hurst: {both} given")
    if args.heights is None:
        return False
    if args.period is None:
        raise InputError("--heights needs --period, the length of the period in m")
    _refuse_options_of_hurst(args)
    return True


def _refuse_options_of_hurst(args: argparse.Namespace, *more: str) -> None:
    for name in ("seed", "n0", "ratio", "h_rms", "m2", "c0", "amplitudes", *more):
        if getattr(args, name) is not None:
            option = "--" + name.replace("_", "-")
            raise InputError(f"{option} belongs to --hurst: given heights are taken as they are")


def _given_heights(args: argparse.Namespace) -> Profile:
    return profile_from_heights(_read_heights(args.heights), args.period)


def _self_affine(args: argparse.Namespace) -> Profile:
    norms = {name: getattr(args, name) for name in ("h_rms", "m2", "c0")}
    if all(value is None for value in norms.values()):
        norms["h_rms"] = H_RMS
    return self_affine_profile(
        args.hurst,
        period=PERIOD if args.period is None else args.period,
        n0=N0 if args.n0 is None else args.n0,
        ratio=RATIO if args.ratio is None else args.ratio,
        seed=0 if args.seed is None else args.seed,
        amplitudes=args.amplitudes or "deterministic",
        **norms,
    )


def _read_heights(path: Path) -> Array:
    """Heights of a .npy (one row) or a .csv (one column, or one row) in m.

    Raises
    ------
    InputError
        If the file cannot be read as one row of numbers.
    """
    if path.suffix not in (".npy", ".csv"):
        raise InputError(f"heights file {path}: it must be a .npy or a .csv file")
    table: Any
    try:
        if path.suffix == ".npy":
            table = np.load(path, allow_pickle=False)
        else:
            lines = path.read_text(encoding="utf-8").split("\n")
            rows = [line.split(",") for line in lines if line.strip() and line.strip()[0] != "#"]
            if len({len(row) for row in rows}) > 1:
                raise ValueError("its lines differ in length")
            table = np.array([[float(word) for word in row] for row in rows])
    except OSError as error:
        raise InputError(f"cannot read heights file {path}: {error.strerror or error}") from None
    except (ValueError, EOFError) as error:
        raise InputError(f"heights file {path} is not a table of numbers: {error}") from None
    if table.dtype.kind not in "fiu":
        raise InputError(f"heights file {path} holds {table.dtype}: heights are real numbers")
    if table.ndim > 2 or (table.ndim == 2 and 1 not in table.shape):
        shape = " × ".join(str(size) for size in table.shape)
        raise InputError(
            f"heights file {path} holds {shape} numbers: it must hold one column (or one row), "
            "the heights of one period"
        )
    return np.asarray(table, dtype=float).reshape(-1)


def _field_penetrations(args: argparse.Namespace, cycle: Cycle) -> list[float]:
    """Penetrations of the fields; empty if no fields are wanted."""
    if args.fields is None:
        for name in ("field_penetrations", "field_nodes"):
            if getattr(args, name) is not None:
                raise InputError(f"--{name.replace('_', '-')} needs --fields, where to write them")
        return []
    if args.fields.suffix != ".npz":
        raise InputError(f"--fields is {args.fields}: the name must end in .npz")
    if cycle.is_path or len(cycle.turning_points) > 1 or not cycle.control.is_fixed:
        raise InputError(
            "--fields belongs to one loop at fixed separation: give one --max-penetration, and "
            "neither --path nor --stiffness"
        )
    if args.field_penetrations is None:
        return [part * cycle.top for part in _FIELD_PARTS]
    wanted = [float(value) for value in args.field_penetrations]
    for value in wanted:
        if not (np.isfinite(value) and value <= cycle.top):
            raise InputError(
                f"--field-penetrations holds {value}: the loop goes no deeper than {cycle.top:g}"
            )
    return list(dict.fromkeys(wanted))


def _field_nodes(args: argparse.Namespace, method: Method) -> int:
    """Nodes of the fields: those asked for, else the method's own, else 32 per shortest wave."""
    if args.field_nodes is None:
        if method.nodes is not None:
            return method.nodes
        return 1 << (32 * method.problem.profile.highest_harmonic - 1).bit_length()
    with _bad_input():
        # A method refuses a number of nodes here, not after the loop has been computed.
        method.problem.profile.heights(args.field_nodes)
        method.fields(method.detached(method.problem.separation(0.0)), args.field_nodes)
    return int(args.field_nodes)


# ---------------------------------------------------------------------- progress


def _quiet(_: str) -> None:
    pass


def _progress(step: float, load: bool) -> Progress:
    """Progress lines on stderr: one that is rewritten on a terminal, else one every few seconds."""
    live = sys.stderr.isatty()
    name = "p̄ in Pa" if load else "Δ/h_max"
    started = last = time.monotonic()

    def show(branch: Branch, drive: float, state: ContactState) -> None:
        nonlocal last
        now = time.monotonic()
        done = branch == "unloading" and not state.patches
        if not live and not done and now - last < _SECONDS_BETWEEN_LINES:
            return
        last = now
        line = (
            f"{branch:<9} step {round(drive / step):>4}  {name} {drive:+.4g}  "
            f"A/A0 {state.contact_fraction:.4f}  patches {state.patches:>4}  "
            f"{now - started:.0f} s"
        )
        end = "\n" if done or not live else ""
        print(f"\r{line}" if live else line, end=end, file=sys.stderr, flush=True)

    return show
