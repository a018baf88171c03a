"""Compute one loading-unloading loop of one profile: its losses, its jumps and its energy audit.

The profile is either given as heights (one period, equally spaced, band-limited interpolation
between them), a measured trace, or self-affine with random phases. Lengths are in m and stresses
in Pa, unless they carry a unit (5um, 20kPa).
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from adhesis.ensemble.quantities import HEIGHT, LENGTH, STRESS, WORK_OF_ADHESION
from adhesis.ensemble.trace import trace_arguments

# The paper's profile (arXiv 1511.08891): period 2π mm, wave numbers 10 to 1000, h_rms 1 µm.
PERIOD, N0, RATIO, H_RMS = 2e-3 * math.pi, 10, 100, 1e-6
EXAMPLES = (
    "adhesis loop --hurst 0.8 --seed 1 --json loop.json",
    "adhesis loop --heights heights.csv --period 1mm --work-of-adhesion 0.04 --young 1e6 "
    "--poisson 0.5 --figure loop.png",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``adhesis loop``."""
    shape = parser.add_argument_group("profile (--heights, --hurst or --trace)")
    shape.add_argument(
        "--heights",
        type=Path,
        metavar="FILE",
        help="text or .npy: heights in m, or in the unit of the header or of --unit",
    )
    shape.add_argument(
        "--trace", type=Path, metavar="FILE", help="a measured trace: see adhesis trace"
    )
    shape.add_argument("--hurst", type=float, metavar="H", help="Hurst exponent, 0 < H < 1")
    shape.add_argument("--seed", type=int, metavar="K", help="seed of the phases (default 0)")
    shape.add_argument(
        "--period",
        type=LENGTH.option,
        metavar="L",
        help="period: 2mm (default with --hurst: 2π mm)",
    )
    shape.add_argument("--n0", type=int, help=f"lowest harmonic (default {N0})")
    shape.add_argument("--ratio", type=int, help=f"highest over lowest harmonic (default {RATIO})")
    shape.add_argument(
        "--h-rms", type=HEIGHT.option, metavar="M", help="rms height: 0.5um (default 1um)"
    )
    shape.add_argument("--m2", type=float, help="mean square slope, instead of --h-rms")
    shape.add_argument("--c0", type=float, help="|a_n0|² in m², instead of --h-rms")
    shape.add_argument("--amplitudes", metavar="KIND", help="deterministic (default) or rayleigh")
    trace_arguments.add_reading_arguments(parser)
    contact = parser.add_argument_group("contact and cycle")
    contact.add_argument(
        "--work-of-adhesion",
        type=WORK_OF_ADHESION.option,
        metavar="G",
        help="in J/m², or 20mJ/m2 (required unless the profile is that of --hurst; there 0.04)",
    )
    contact.add_argument(
        "--young",
        type=STRESS.option,
        metavar="E",
        help="in Pa, or 1MPa (likewise; with --hurst 1e6)",
    )
    contact.add_argument("--poisson", type=float, metavar="NU", help="(likewise; with --hurst 0.5)")
    trace_arguments.add_cycle_arguments(contact)
    contact.add_argument(
        "--path",
        metavar="A,B,…,out",
        help="instead of turning points: any path, loading first, ending with 'out' of contact or "
        "in contact",
    )
    method = parser.add_argument_group("method")
    trace_arguments.add_method_arguments(method, "relative error of the loss (default 1e-3)")
    method.add_argument("--nodes-per-wave", type=int, metavar="N", help="for grid")
    output = parser.add_argument_group("output")
    output.add_argument("--json", type=Path, metavar="OUT", help="states, losses and jumps")
    output.add_argument(
        "--csv", type=Path, metavar="FILE", help="the curve: a row a state, units in the header"
    )
    output.add_argument(
        "--figure", type=Path, metavar="FILE", help="stress and contact: .png, .pdf or .svg"
    )
    output.add_argument(
        "--film",
        type=Path,
        metavar="FILE",
        help="the loop as a film: .html (a page with a slider), .gif or .mp4 (needs ffmpeg)",
    )
    output.add_argument("--fields", type=Path, metavar="FILE.npz", help="stress, shape and gap")
    output.add_argument(
        "--field-penetrations",
        nargs="+",
        type=float,
        metavar="D",
        help="Δ/h_max of the fields on both branches (default: quarters of --max-penetration)",
    )
    output.add_argument(
        "--field-stresses",
        nargs="+",
        type=STRESS.option,
        metavar="P",
        help="instead, mean stresses of the fields on both branches: 10kPa, a tension in Pa alone: "
        "-500 (default with --preload: its quarters)",
    )
    output.add_argument("--field-nodes", type=int, metavar="N", help="nodes of the fields")
    output.add_argument("--strict", action="store_true", help="exit code 1 if the loss is doubtful")
    output.add_argument("--quiet", action="store_true", help="no progress on stderr")
