"""Compute the loss of a measured trace, and its uncertainty.

The trace is a text of one or two columns, or an instrument's file. One period of a profile is made
of it, its loop is run and those that other decisions would have given, and one page is written.
Lengths are in m and stresses in Pa, unless they carry a unit (5um, 20kPa).
"""

from __future__ import annotations

import argparse
from pathlib import Path

from adhesis.ensemble.option_table import add_options
from adhesis.ensemble.quantities import STRESS

EXAMPLES = (
    "adhesis trace trace.csv --unit um --work-of-adhesion 0.04 --young 1e6 --poisson 0.5 --to out",
    "adhesis trace trace.csv --work-of-adhesion 0.02,0.04 --young 1e6 --poisson 0.5 --plan",
)


_OUTPUT = """
--to DIR path: for the page, its figures and JSON
--plan: print the plan, and stop
--quick: without tables of γ and turning point
--processes N int: side by side (default: cores)
--quiet: no progress on stderr
"""
_CYCLE = """
--adhesion-range D length: range of adhesion, 0.3nm; patches open from inside at the strength G/D
    (default: zero range, they never do)
--strength S stress: instead, that strength, 10MPa
--max-penetration D[,D…]: turning points in h_max (default 0.9); with --stiffness those of the far
    side, u_tot/h_max; with --preload, where a loop turns at the latest
--preload P[,P…]: instead, a machine turns where the mean stress reaches this: in Pa, or 20kPa
--max-stress P[,P…]: instead, under a weight (--stiffness 0): turning points in Pa, or 20kPa
--stiffness K stiffness: in Pa/m of nominal area, or 1GPa/m, of what holds the solid; 0 is load
    control, that of a weight (default: fixed separation)
--layer D length: instead: the stiffness of a layer of this thickness, 1mm
--load-steps N int=40: (default 40)
"""
_OPEN = """
--work-of-adhesion-open G work: where an edge recedes, at least that where it advances,
    --work-of-adhesion; between both it is pinned (default: the same)
"""
_READING = """
--unit U: unit of a text: um, or mm,um for positions and heights
--step S length: step, for heights without positions: 0.5um
--columns X,Z: columns of a text, from 1; Z: heights alone
--delimiter C: of a text, if it is not found out
"""
_MAP = """
--row K int: row of a map, from 0
--channel K int: of an instrument's file, from 0
"""
_PREPARING = """
--degree N int: polynomial subtracted (default 1, or as is seen)
--cut-off W length: shortest wave kept: 5um (default from step, noise and tip)
--tip-radius R length: of the stylus or probe: 2um
--longest-gap G length: drop-outs up to this length are interpolated: 20um
--exclude A:B +: a range of positions to bridge, 1.2mm:1.3mm; may be given several times
--keep-outliers: leave spikes in
--invert: z points into the sample: turn it
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``adhesis trace``."""
    parser.add_argument("file", type=Path, metavar="FILE", help="text or instrument's file")
    contact = parser.add_argument_group("contact and cycle")
    contact.add_argument(
        "--work-of-adhesion",
        required=True,
        metavar="G",
        help="in J/m², or 20mJ/m2; of several (0.04,0.02,0.08) the first is the answer's, the "
        "others make a table, as of several turning points",
    )
    contact.add_argument(
        "--young", type=STRESS.option, required=True, metavar="E", help="in Pa, or 1MPa"
    )
    contact.add_argument("--poisson", type=float, required=True, metavar="NU")
    add_open_argument(contact)
    add_cycle_arguments(contact)
    add_method_arguments(contact, "of each loop (default 1e-3)")
    add_reading_arguments(parser)
    add_options(parser.add_argument_group("output"), _OUTPUT)


def add_cycle_arguments(group: argparse._ArgumentGroup) -> None:
    """Declare strength, turning points and control, which ``adhesis loop`` shares."""
    add_options(group, _CYCLE)


def add_open_argument(group: argparse._ArgumentGroup) -> None:
    """Declare the work of adhesion of an edge that recedes; ``adhesis loop`` shares it."""
    add_options(group, _OPEN)


def add_method_arguments(group: argparse._ArgumentGroup, accuracy: str) -> None:
    """Declare method and accuracy; ``adhesis loop`` shares them."""
    method = "--method NAME text=auto: grid, sharp or auto (default auto)"
    add_options(group, f"{method}\n--accuracy ACCURACY float=1e-3: {accuracy}")


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how a trace is read and prepared; ``adhesis loop --trace`` shares them."""
    reading = parser.add_argument_group("reading a trace")
    add_options(reading, _READING)
    reading.add_argument("--decimal", choices=[",", "."], help="decimal sign, if not found out")
    add_options(reading, _MAP)
    add_options(parser.add_argument_group("preparing a trace"), _PREPARING)
