"""Read and prepare a trace by the options of the command line."""

from __future__ import annotations

import argparse
import os
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from adhesis.ensemble.errors import InputError, quoted, refused_as_input
from adhesis.ensemble.escape import printable
from adhesis.ensemble.quantities import LENGTH
from adhesis.ensemble.reporter import bar
from adhesis.ensemble.trace.prepare import Prepared, prepare_trace
from adhesis.ensemble.trace.reading.measured_trace import read_trace
from adhesis.solver.model.pattern import AdhesionPattern, stripes_of

MAX_PENETRATION = 0.9
"""Turning point Δ/h_max where none is given."""

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


def pattern_of(args: argparse.Namespace) -> AdhesionPattern | None:
    """Make the stripes of the options."""
    names = {"count": "stripes", "amplitude": "stripe_amplitude", "phase": "stripe_phase"}
    with refused_as_input(vars(args), **names):
        return stripes_of(args.stripes, args.stripe_amplitude, args.stripe_phase)


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
