"""A measured trace to its loss, with what is doubtful about it.

Reads a text of one or two columns, or an instrument's file, says what it read, makes one period of
it step by step, runs the loop and what could have been decided otherwise, and writes one page.
Lengths are in m unless they carry a unit (5um), stresses in Pa.
"""

from __future__ import annotations

import argparse
from pathlib import Path

EXAMPLES = (
    "adhesis trace trace.csv --unit um --work-of-adhesion 0.04 --young 1e6 --poisson 0.5 --to out",
    "adhesis trace trace.csv --work-of-adhesion 0.02,0.04 --young 1e6 --poisson 0.5 --plan",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``adhesis trace``."""
    parser.add_argument("file", type=Path, metavar="FILE", help="text or instrument's file")
    contact = parser.add_argument_group("contact and cycle")
    contact.add_argument(
        "--work-of-adhesion",
        required=True,
        metavar="G",
        help="J/m²; of several (0.04,0.02,0.08) the first is the answer's, the others a table",
    )
    contact.add_argument("--young", type=float, required=True, metavar="E", help="Pa")
    contact.add_argument("--poisson", type=float, required=True, metavar="NU")
    add_strength_arguments(contact)
    contact.add_argument(
        "--max-penetration", default="0.9", metavar="D", help="Δ/h_max, or several (default 0.9)"
    )
    contact.add_argument("--load-steps", type=int, default=40, metavar="N", help="(default 40)")
    contact.add_argument(
        "--method", default="auto", metavar="NAME", help="grid, sharp or auto (default auto)"
    )
    contact.add_argument("--accuracy", type=float, default=1e-3, help="of each loop (default 1e-3)")
    add_reading_arguments(parser)
    output = parser.add_argument_group("output")
    output.add_argument("--to", type=Path, metavar="DIR", help="for the page, its figures and JSON")
    output.add_argument("--plan", action="store_true", help="say what would be done, do nothing")
    output.add_argument(
        "--quick", action="store_true", help="without tables of γ and turning point"
    )
    output.add_argument("--processes", type=int, metavar="N", help="side by side (default: cores)")
    output.add_argument("--quiet", action="store_true", help="no progress on stderr")


def add_strength_arguments(group: argparse._ArgumentGroup) -> None:
    """Declare the strength of the interface; ``adhesis loop`` shares it."""
    group.add_argument(
        "--adhesion-range",
        type=float,
        metavar="D",
        help="m: range of adhesion; patches open from inside at the strength G/D "
        "(default: zero range, they never do)",
    )
    group.add_argument("--strength", type=float, metavar="S", help="Pa: instead, that strength")


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
