"""Compute the loss of a measured trace, and its uncertainty.

The trace is a text of one or two columns, or an instrument's file. One period of a profile is made
of it, its loop is run and those that other decisions would have given, and one page is written.
Lengths are in m and stresses in Pa, unless they carry a unit (5um, 20kPa).
"""

from __future__ import annotations

import argparse
from pathlib import Path

from adhesis.ensemble.quantities import LENGTH, STIFFNESS, STRESS, WORK_OF_ADHESION

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
        help="in J/m², or 20mJ/m2; of several (0.04,0.02,0.08) the first is the answer's, the "
        "others make a table, as of several turning points",
    )
    contact.add_argument(
        "--young", type=STRESS.option, required=True, metavar="E", help="in Pa, or 1MPa"
    )
    contact.add_argument(
        "--poisson", type=float, required=True, metavar="NU", help="0.5: incompressible"
    )
    add_cycle_arguments(contact)
    add_method_arguments(contact, "of each loop (default 1e-3)")
    add_reading_arguments(parser)
    output = parser.add_argument_group("output")
    output.add_argument("--to", type=Path, metavar="DIR", help="for the page, its figures and JSON")
    output.add_argument("--plan", action="store_true", help="print the plan, and stop")
    output.add_argument(
        "--quick", action="store_true", help="without tables of γ and turning point"
    )
    output.add_argument("--processes", type=int, metavar="N", help="side by side (default: cores)")
    output.add_argument("--quiet", action="store_true", help="no progress on stderr")


def add_cycle_arguments(group: argparse._ArgumentGroup) -> None:
    """Declare laws of adhesion, turning points and control, which ``adhesis loop`` shares."""
    group.add_argument(
        "--work-of-adhesion-open",
        type=WORK_OF_ADHESION.option,
        metavar="G",
        help="where an edge recedes, at least that where it advances, --work-of-adhesion; between "
        "both it is pinned (default: the same)",
    )
    group.add_argument(
        "--stripes",
        type=int,
        metavar="N",
        help="the work of adhesion varies N times along the period, about --work-of-adhesion",
    )
    group.add_argument(
        "--stripe-amplitude", type=float, metavar="EPS", help="by this share of it, below 1"
    )
    group.add_argument(
        "--stripe-phase",
        type=float,
        metavar="PHI",
        help="in rad: γ(x) = γ (1 + EPS cos(2π N x/L + PHI)) (default 0)",
    )
    group.add_argument(
        "--measure",
        default="arc",
        metavar="NAME",
        help="adhesion acts on the length of the profile (arc, default) or its projection (flat)",
    )
    group.add_argument(
        "--adhesion-range",
        type=LENGTH.option,
        metavar="D",
        help="range of adhesion, 0.3nm; surfaces touch at a gap of D (default: zero range; method "
        "sharp alone)",
    )
    group.add_argument(
        "--strength", type=STRESS.option, metavar="S", help="instead, the strength G/D, 10MPa"
    )
    group.add_argument(
        "--max-penetration",
        metavar="D[,D…]",
        help="turning points in h_max (default 0.9); with --stiffness those of the far side, "
        "u_tot/h_max; with --preload, where a loop turns at the latest (default 0.999)",
    )
    group.add_argument(
        "--preload",
        metavar="P[,P…]",
        help="instead, a machine turns where the mean stress reaches this: in Pa, or 20kPa",
    )
    group.add_argument(
        "--max-stress",
        metavar="P[,P…]",
        help="instead, under a weight (--stiffness 0): turning points in Pa, or 20kPa",
    )
    group.add_argument(
        "--stiffness",
        type=STIFFNESS.option,
        metavar="K",
        help="in Pa/m of nominal area, or 1GPa/m, of what holds the solid; 0 is load control, that "
        "of a weight (default: fixed separation)",
    )
    group.add_argument(
        "--layer",
        type=LENGTH.option,
        metavar="D",
        help="instead: the stiffness of a layer of this thickness, 1mm",
    )
    group.add_argument("--load-steps", type=int, default=40, metavar="N", help="(default 40)")


def add_method_arguments(group: argparse._ArgumentGroup, accuracy: str) -> None:
    """Declare method and accuracy; ``adhesis loop`` shares them."""
    group.add_argument(
        "--method", default="auto", metavar="NAME", help="grid, sharp or auto (default auto)"
    )
    group.add_argument("--accuracy", type=float, default=1e-3, help=accuracy)


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how a trace is read and prepared; ``adhesis loop --trace`` shares them."""
    reading = parser.add_argument_group("reading a trace")
    reading.add_argument(
        "--unit", metavar="U", help="unit of a text: um, or mm,um for positions and heights"
    )
    reading.add_argument(
        "--step", type=LENGTH.option, metavar="S", help="step, for heights without positions: 0.5um"
    )
    reading.add_argument(
        "--columns", metavar="X,Z", help="columns of a text, from 1; Z: heights alone"
    )
    reading.add_argument("--delimiter", metavar="C", help="of a text, if it is not found out")
    reading.add_argument("--decimal", choices=[",", "."], help="decimal sign, if not found out")
    reading.add_argument("--row", type=int, metavar="K", help="row of a map, from 0")
    reading.add_argument("--channel", type=int, metavar="K", help="of an instrument's file, from 0")
    making = parser.add_argument_group("preparing a trace")
    making.add_argument(
        "--degree", type=int, metavar="N", help="polynomial subtracted (default 1, or as is seen)"
    )
    making.add_argument(
        "--cut-off",
        type=LENGTH.option,
        metavar="W",
        help="shortest wave kept: 5um (default from step, noise and tip)",
    )
    making.add_argument(
        "--tip-radius", type=LENGTH.option, metavar="R", help="of the stylus or probe: 2um"
    )
    making.add_argument(
        "--longest-gap",
        type=LENGTH.option,
        metavar="G",
        help="drop-outs up to this length are interpolated: 20um",
    )
    making.add_argument(
        "--exclude",
        action="append",
        metavar="A:B",
        help="a range to bridge, from the first point on, 1.2mm:1.3mm; may be given several times",
    )
    making.add_argument("--keep-outliers", action="store_true", help="leave spikes in")
    making.add_argument("--invert", action="store_true", help="z points into the sample: turn it")
