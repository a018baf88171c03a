"""Compute one loading-unloading loop of one profile: its losses, its jumps and its energy audit.

The profile is either given as heights (one period, equally spaced, band-limited interpolation
between them), a measured trace, or self-affine with random phases. Lengths are in m and stresses
in Pa, unless they carry a unit (5um, 20kPa).
"""

from __future__ import annotations

import math
from pathlib import Path

from adhesis.ensemble.command.trace_arguments import CYCLE, METHOD, READING
from adhesis.ensemble.quantities import HEIGHT, LENGTH, STRESS, WORK_OF_ADHESION

# The paper's profile (arXiv 1511.08891): period 2π mm, wave numbers 10 to 1000, h_rms 1 µm.
PERIOD, N0, RATIO, H_RMS = 2e-3 * math.pi, 10, 100, 1e-6
EXAMPLES = (
    "adhesis loop --hurst 0.8 --seed 1 --json loop.json",
    "adhesis loop --heights heights.csv --period 1mm --work-of-adhesion 0.04 --young 1e6 "
    "--poisson 0.5 --figure loop.png",
)
_FILM = "the loop as a film: .html (a page with a slider), .gif or .mp4 (needs ffmpeg)"
_PENETRATIONS = "Δ/h_max of the fields on both branches (default: quarters of --max-penetration)"
_STRESSES = (
    "instead, mean stresses of the fields on both branches: 10kPa, a tension in Pa alone: -500 "
    "(default with --preload: its quarters)"
)
OPTIONS = (
    "profile (--heights, --hurst or --trace)",
    (
        *("--heights FILE", Path),
        "text or .npy: heights in m, or in the unit of the header or of --unit",
    ),
    ("--trace FILE", Path, "a measured trace: see adhesis trace"),
    ("--hurst H", float, "Hurst exponent, 0 < H < 1"),
    ("--seed K", int, "seed of the phases (default 0)"),
    ("--period L", LENGTH.option, "period: 2mm (default with --hurst: 2π mm)"),
    ("--n0", int, f"lowest harmonic (default {N0})"),
    ("--ratio", int, f"highest over lowest harmonic (default {RATIO})"),
    ("--h-rms M", HEIGHT.option, "rms height: 0.5um (default 1um)"),
    ("--m2", float, "mean square slope, instead of --h-rms"),
    ("--c0", float, "|a_n0|² in m², instead of --h-rms"),
    ("--amplitudes KIND", None, "deterministic (default) or rayleigh"),
    *READING,
    "contact and cycle",
    (
        *("--work-of-adhesion G", WORK_OF_ADHESION.option),
        "in J/m², or 20mJ/m2 (required unless the profile is that of --hurst; there 0.04)",
    ),
    ("--young E", STRESS.option, "in Pa, or 1MPa (likewise; with --hurst 1e6)"),
    ("--poisson NU", float, "(likewise; with --hurst 0.5)"),
    *CYCLE,
    (
        *("--path A,B,…,out", None),
        "instead of turning points: any path, loading first, ending with 'out' of contact or in "
        "contact",
    ),
    "method",
    METHOD,
    ("--accuracy", float, "relative error of the loss (default 1e-3)", {"default": 1e-3}),
    ("--nodes-per-wave N", int, "for grid and zones"),
    "output",
    ("--json OUT", Path, "states, losses and jumps"),
    ("--csv FILE", Path, "the curve: a row a state, units in the header"),
    ("--figure FILE", Path, "stress and contact: .png, .pdf or .svg"),
    ("--film FILE", Path, _FILM),
    ("--fields FILE.npz", Path, "stress, shape and gap"),
    ("--field-penetrations D", float, _PENETRATIONS, {"nargs": "+"}),
    ("--field-stresses P", STRESS.option, _STRESSES, {"nargs": "+"}),
    ("--field-nodes N", int, "nodes of the fields"),
    ("--strict", bool, "exit code 1 if the loss is doubtful"),
    ("--quiet", bool, "no progress on stderr"),
)
