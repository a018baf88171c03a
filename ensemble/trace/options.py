"""Options of the command line that say how a trace is read and prepared."""

from __future__ import annotations

import argparse
from pathlib import Path

from ensemble.errors import InputError
from ensemble.trace.prepare import Prepared, prepare_trace
from ensemble.trace.read import Trace, read_trace
from ensemble.trace.text import DELIMITERS
from ensemble.trace.units import counted, length_text, parse_length

_NAMES = (
    *("unit", "step", "columns", "delimiter", "decimal", "row", "channel", "degree", "cut_off"),
    *("tip_radius", "longest_gap", "keep_outliers", "invert"),
)


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how a trace is read and prepared; ``adhesis loop --trace`` shares them."""
    reading = parser.add_argument_group("reading a trace")
    reading.add_argument(
        "--unit", metavar="U", help="unit of a text: um, or mm,um for positions and heights"
    )
    reading.add_argument("--step", metavar="S", help="step, for heights without positions: 0.5um")
    reading.add_argument("--columns", metavar="X,Z", help="columns of a text, from 1")
    reading.add_argument("--delimiter", metavar="C", help="of a text, if it is not found out")
    reading.add_argument("--decimal", choices=[",", "."], help="decimal sign, if not found out")
    reading.add_argument("--row", type=int, metavar="K", help="row of an instrument's map, from 0")
    reading.add_argument("--channel", type=int, metavar="K", help="of an instrument's file, from 0")
    making = parser.add_argument_group("preparing a trace")
    making.add_argument(
        "--degree", type=int, metavar="N", help="polynomial taken off (default 1, or as is seen)"
    )
    making.add_argument(
        "--cut-off", metavar="W", help="shortest wave kept (default from step, noise and tip)"
    )
    making.add_argument("--tip-radius", metavar="R", help="of the stylus or probe: 2um")
    making.add_argument(
        "--longest-gap", metavar="G", help="drop-outs up to this length are interpolated"
    )
    making.add_argument("--keep-outliers", action="store_true", help="leave spikes in")
    making.add_argument("--invert", action="store_true", help="z points into the sample: turn it")


def trace_of(args: argparse.Namespace, path: Path) -> Trace:
    """Read the trace as the options say."""
    columns = None
    if args.columns is not None:
        try:
            columns = [int(word) for word in args.columns.split(",")]
        except ValueError:
            raise InputError(
                f"--columns is {args.columns!r}: two whole numbers, as in 1,3"
            ) from None
    return read_trace(
        path,
        unit=args.unit,
        step=None if args.step is None else parse_length(args.step, "--step"),
        columns=columns,
        row=args.row,
        channel=args.channel,
        delimiter=delimiter_of(args),
        decimal=args.decimal,
    )


def delimiter_of(args: argparse.Namespace) -> str | None:
    """Delimiter of a text, as the option names it; None to find it out."""
    sign: str | None = args.delimiter
    delimiter = {"\\t": "\t", "tab": "\t", "space": " "}.get(sign, sign) if sign else sign
    if delimiter is not None and delimiter not in DELIMITERS:
        known = ", ".join(DELIMITERS.values())
        raise InputError(f"--delimiter is {sign!r}: it must be one of {known} (; tab , space |)")
    return delimiter


def prepared_of(args: argparse.Namespace, trace: Trace) -> Prepared:
    """Prepare the trace as the options say."""

    def length(text: str | None, option: str) -> float | None:
        return None if text is None else parse_length(text, option)

    return prepare_trace(
        trace,
        degree=args.degree,
        cut_off=length(args.cut_off, "--cut-off"),
        tip_radius=length(args.tip_radius, "--tip-radius"),
        longest_gap=length(args.longest_gap, "--longest-gap"),
        keep_outliers=args.keep_outliers,
        invert=args.invert,
    )


def what_was_read(prepared: Prepared) -> str:
    """What was read and done, line by line, for the terminal."""
    trace = prepared.trace
    lines = [
        f"read        {trace.path}: {trace.points} points, step {length_text(trace.step, 5)}, "
        f"length {length_text(trace.length, 5)}, range {length_text(trace.height_range, 4)}, "
        f"{counted(trace.drop_outs, 'drop-out')}"
    ]
    lines += [f"            {said}" for said in trace.said]
    lines += [f"{step.name:<11} {step.said}" for step in prepared.steps]
    return "\n".join(lines)


def given(args: argparse.Namespace) -> list[str]:
    """Options of reading and preparing that were given."""
    return [f"--{name.replace('_', '-')}" for name in _NAMES if getattr(args, name)]
