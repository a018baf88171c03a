"""Compute one loading-unloading loop of one profile: its losses, its jumps and its energy audit.

The profile is either given as heights (one period, equally spaced, band-limited interpolation
between them), a measured trace, or self-affine with random phases. Lengths are in m and stresses
in Pa, unless they carry a unit (5um, 20kPa).
"""

from __future__ import annotations

import argparse
import math

from adhesis.ensemble.option_table import add_options
from adhesis.ensemble.quantities import STRESS
from adhesis.ensemble.trace import trace_arguments

# The paper's profile (arXiv 1511.08891): period 2π mm, wave numbers 10 to 1000, h_rms 1 µm.
PERIOD, N0, RATIO, H_RMS = 2e-3 * math.pi, 10, 100, 1e-6
EXAMPLES = (
    "adhesis loop --hurst 0.8 --seed 1 --json loop.json",
    "adhesis loop --heights heights.csv --period 1mm --work-of-adhesion 0.04 --young 1e6 "
    "--poisson 0.5 --figure loop.png",
)


_SHAPE = f"""
--heights FILE path: text or .npy: heights in m, or in the unit of the header or of --unit
--trace FILE path: a measured trace: see adhesis trace
--hurst H float: Hurst exponent, 0 < H < 1
--seed K int: seed of the phases (default 0)
--period L length: period: 2mm (default with --hurst: 2π mm)
--n0 N0 int: lowest harmonic (default {N0})
--ratio RATIO int: highest over lowest harmonic (default {RATIO})
--h-rms M height: rms height: 0.5um (default 1um)
--m2 M2 float: mean square slope, instead of --h-rms
--c0 C0 float: |a_n0|² in m², instead of --h-rms
--amplitudes KIND: deterministic (default) or rayleigh
"""
_MATERIAL = """
--work-of-adhesion G work: in J/m², or 20mJ/m2 (required unless the profile is that of --hurst;
    there 0.04)
--young E stress: in Pa, or 1MPa (likewise; with --hurst 1e6)
--poisson NU float: (likewise; with --hurst 0.5)
"""
_MEASURE = """
--measure NAME text=arc: adhesion acts on the length of the profile (arc, default) or its
    projection (flat)
"""
_PATH = """
--path A,B,…,out: instead of turning points: any path, loading first, ending with 'out' of contact
    or in contact
"""
_OUTPUT = """
--json OUT path: states, losses and jumps
--csv FILE path: the curve: a row a state, units in the header
--figure FILE path: stress and contact: .png, .pdf or .svg
--film FILE path: the loop as a film: .html (a page with a slider), .gif or .mp4 (needs ffmpeg)
--fields FILE.npz path: stress, shape and gap
"""
_FIELDS = """
--field-nodes N int: nodes of the fields
--strict: exit code 1 if the loss is doubtful
--quiet: no progress on stderr
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``adhesis loop``."""
    add_options(parser.add_argument_group("profile (--heights, --hurst or --trace)"), _SHAPE)
    trace_arguments.add_reading_arguments(parser)
    contact = parser.add_argument_group("contact and cycle")
    add_options(contact, _MATERIAL)
    trace_arguments.add_open_argument(contact)
    add_options(contact, _MEASURE)
    trace_arguments.add_cycle_arguments(contact)
    add_options(contact, _PATH)
    method = parser.add_argument_group("method")
    trace_arguments.add_method_arguments(method, "relative error of the loss (default 1e-3)")
    add_options(method, "--nodes-per-wave N int: for grid")
    output = parser.add_argument_group("output")
    add_options(output, _OUTPUT)
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
    add_options(output, _FIELDS)
