"""Read the options of ``adhesis loop`` and ``adhesis trace``: loading path, control, and trace."""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from adhesis.ensemble.errors import InputError, quoted, refused_as_input
from adhesis.ensemble.escape import printable
from adhesis.ensemble.quantities import LENGTH, STRESS, read_list
from adhesis.ensemble.reporter import bar
from adhesis.ensemble.trace.loops import MAX_PENETRATION
from adhesis.ensemble.trace.prepare import Prepared, prepare_trace
from adhesis.ensemble.trace.reading.measured_trace import read_trace
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.pattern import stripes_of

_TURNS = ("max_penetration", "max_stress", "preload")
_OF_CYCLE = (
    *("load_steps", "method", "accuracy", "adhesion_range", "strength"),
    *("work_of_adhesion_open", "measure"),
)


def settings_of(args: argparse.Namespace, half_space: HalfSpace) -> dict[str, Any]:
    """Read contact and path, as fields of a cycle (InputError; ValueError for stiffness or layer).

    A path has its turning points in order; loops have theirs as they are given.
    """
    refuse_several(args, "stiffness", "layer")
    stiffness = math.inf if args.stiffness is None else args.stiffness
    control = Control(stiffness if args.layer is None else half_space.layer_stiffness(args.layer))
    is_path = getattr(args, "path", None) is not None
    turns = {"turning_points": _path(args)} if is_path else turns_of(args, control)
    names = {"count": "stripes", "amplitude": "stripe_amplitude", "phase": "stripe_phase"}
    with refused_as_input(vars(args), **names):
        pattern = stripes_of(args.stripes, args.stripe_amplitude, args.stripe_phase)
    settings = {name: getattr(args, name) for name in _OF_CYCLE}
    return {"half_space": half_space, "control": control, "pattern": pattern, **turns, **settings}


def ends_out(path: str) -> bool:
    """Return whether a path continues until contact is lost."""
    return path.rpartition(",")[2].strip() == "out"


def _path(args: argparse.Namespace) -> tuple[float, ...]:
    refuse_several(args, "path", *_TURNS)
    turns, comma, _ = args.path.rpartition(",")
    out = ends_out(args.path)
    if out and not comma:
        raise InputError(f"--path is {quoted(args.path)}: it holds no turning point")
    rule = "numbers with commas between them, and perhaps 'out' behind the last"
    return read_list("--path", turns if out else args.path, rule=rule, given=args.path)


def turns_of(args: argparse.Namespace, control: Control) -> dict[str, Any]:
    """Read turning points in the given order, as fields of a cycle (InputError)."""
    refuse_several(args, "max_stress", "preload")
    if control.is_load:
        if args.preload is not None:
            raise InputError(
                f"--preload is {args.preload} with --stiffness 0: a weight or a machine? For a "
                f"weight give --max-stress {args.preload} with --stiffness 0; for a machine, which "
                "turns at that mean stress, leave --stiffness 0 out"
            )
        refuse_several(args, "max_penetration", "max_stress")
        if args.max_stress is None:
            raise InputError("load control (--stiffness 0) needs --max-stress, in Pa")
        return {"turning_points": _distinct("--max-stress", args.max_stress, STRESS.read)}
    if args.max_stress is not None:
        raise InputError(
            "--max-stress belongs to load control, and --stiffness 0 is not given: a weight or a "
            f"machine? For a weight give --stiffness 0 with --max-stress {args.max_stress}; for a "
            f"machine, which turns at that mean stress, give --preload {args.max_stress} instead"
        )
    rule = "one or more numbers, as 1.5 or 0.5,1.5"
    if control.is_fixed:
        rule = "one or more numbers between 0 and 1, as 0.9 or 0.3,0.6"
    penetrations: tuple[float, ...] = ()
    if args.max_penetration is not None:
        penetrations = _distinct("--max-penetration", args.max_penetration, float, rule)
    if args.preload is None:
        return {"turning_points": penetrations or (MAX_PENETRATION,)}
    if len(penetrations) > 1:
        raise InputError(
            f"--max-penetration is {args.max_penetration} beside --preload: it must be one number, "
            "at which a loop turns that has not reached its preload"
        )
    preloads = _distinct("--preload", args.preload, STRESS.read)
    latest = next(iter(penetrations), None)
    return {"turning_points": preloads, "at_preload": True, "latest": latest}


def _distinct(
    option: str, text: str, read: Callable[[str], float], rule: str = ""
) -> tuple[float, ...]:
    """Read turning points with commas between them, all different."""
    points = read_list(option, text, read, rule)
    if len(set(points)) < len(points):
        raise InputError(f"{option} is {text}: turning points must differ")
    return points


def in_options(text: str, args: argparse.Namespace) -> str:
    """Return a message on a path with the options that prescribe a stiffness or the separation."""
    option = "--stiffness" if args.layer is None else "--layer"
    weight, change = "--stiffness 0 --max-stress", "larger" if args.layer is None else "thinner"
    for words, replacement in (
        ("give a preload in place of max_stress", f"give --preload in place of {weight}"),
        ("give a larger stiffness", f"give a {change} {option}"),
        ("prescribe the separation", f"prescribe the separation by leaving {option} out"),
    ):
        text = text.replace(words, replacement)
    return text


_LARGE = 2_000_000  # bytes; smaller files are read within a few seconds

_OF_READING = ("unit", "step", "delimiter", "decimal", "row", "channel")
_OF_PREPARING = ("degree", "cut_off", "tip_radius", "longest_gap", "keep_outliers", "invert")
_NAMES = (*_OF_READING, "columns", *_OF_PREPARING, "exclude")


def prepared_of(args: argparse.Namespace, path: Path) -> Prepared:
    """Read a trace and prepare it by the options."""
    columns = None
    if args.columns is not None:
        try:
            columns = [int(word) for word in args.columns.split(",")]
        except ValueError:
            raise InputError(
                f"--columns is {args.columns!r}: it must be one or two whole numbers, as in 1,3"
            ) from None
    of_reading, of_preparing = (
        {name: getattr(args, name) for name in names} for names in (_OF_READING, _OF_PREPARING)
    )
    exclude = [_range(text) for text in args.exclude or ()]
    with shown_while_read(path, args.quiet):
        trace = read_trace(path, columns=columns, **of_reading)
        return prepare_trace(trace, exclude=exclude, **of_preparing)


def shown_while_read(path: Path, quiet: bool) -> AbstractContextManager[object]:
    """Return a context that reports on stderr how long a large file is being read."""
    is_large = os.path.isfile(path) and os.path.getsize(path) > _LARGE
    return bar(f"reading {path}", last=False) if is_large and not quiet else nullcontext()


def _range(text: str) -> tuple[float, float]:
    """Read a range of positions in m, as 1.2mm:1.3mm."""
    words = text.split(":")
    if len(words) != 2:
        raise InputError(
            f"--exclude is {quoted(text)}: it must be two positions with a colon between them, as "
            "in 1.2mm:1.3mm; give it once for each range"
        )
    try:
        begin, end = (LENGTH.read(word) for word in words)
    except InputError as error:
        raise InputError(f"--exclude is {quoted(text)}: a position of it {error}") from None
    return begin, end


def what_was_read(prepared: Prepared) -> str:
    """Describe reading and preparation, and what is doubtful, line by line, for the terminal."""
    trace = prepared.trace
    lines = [
        f"read        {trace.source}: {trace.summary}",
        *(f"            {note}" for note in trace.notes),
        *(f"{step.name:<11} {step.description}" for step in prepared.steps),
        *(f"WARNING     {warning}" for warning in prepared.warnings),
    ]
    return printable("\n".join(lines))


def refuse_several(args: argparse.Namespace, *names: str) -> None:
    """Refuse options that exclude each other (InputError)."""
    found = given(args, *names)
    if len(found) > 1:
        raise InputError(f"{' and '.join(found)} are given: give one of them")


def given(args: argparse.Namespace, *names: str) -> list[str]:
    """Return which of these options are given; without names, of reading and preparation."""
    found = {name: getattr(args, name) for name in names or _NAMES}
    return [
        f"--{name.replace('_', '-')}"
        for name, value in found.items()
        if value is not None and value is not False
    ]
