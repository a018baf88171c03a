"""Write a sample trace, as a stylus would measure it, to try ``adhesis trace`` with.

It is synthetic: 1 mm in steps of 1 µm, rough down to 20 µm, with tilt, bow, noise and drop-outs.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from adhesis.ensemble.outputs import write_new

SAMPLE = Path(__file__).with_name("sample.csv")
EXAMPLES = (
    "adhesis sample trace.csv",
    "adhesis sample data/stylus.csv",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("file", type=Path, metavar="FILE", help="the file to write, as .csv")


def execute(args: argparse.Namespace) -> int:
    """Write the file; returns 0."""
    write_new("FILE", args.file, SAMPLE.read_bytes)
    print(
        f"next        adhesis trace {args.file} --work-of-adhesion 0.04 --young 1e6 --poisson 0.5 "
        "--to out"
    )
    return 0
