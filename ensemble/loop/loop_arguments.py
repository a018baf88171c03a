"""Compute one loading-unloading loop of one profile: its losses, its jumps and its energy audit.

The profile is either given as heights (one period, equally spaced, band-limited interpolation
between them), a measured trace, or self-affine with random phases. Lengths are in m and stresses
in Pa, unless they carry a unit (5um, 20kPa).
"""

from __future__ import annotations

import math

from adhesis.ensemble.trace.trace_arguments import CYCLE, METHOD, READING, SHARED

# The paper's profile (arXiv 1511.08891): period 2π mm, wave numbers 10 to 1000, h_rms 1 µm.
PERIOD, N0, RATIO, H_RMS = 2e-3 * math.pi, 10, 100, 1e-6
EXAMPLES = (
    "adhesis loop --hurst 0.8 --seed 1 --json loop.json",
    "adhesis loop --heights heights.csv --period 1mm --work-of-adhesion 0.04 --young 1e6 "
    "--poisson 0.5 --figure loop.png",
)
ARGUMENTS = f"""
[profile (--heights, --hurst or --trace)]
--heights FILE file: text or .npy: heights in m, or in the unit of the header or of --unit
--trace FILE file: a measured trace: see adhesis trace
--hurst H number: Hurst exponent, 0 < H < 1
--seed K whole: seed of the phases (default 0)
--period L length: period: 2mm (default with --hurst: 2π mm)
--n0 whole: lowest harmonic (default {N0})
--ratio whole: highest over lowest harmonic (default {RATIO})
--h-rms M height: rms height: 0.5um (default 1um)
--m2 number: mean square slope, instead of --h-rms
--c0 number: |a_n0|² in m², instead of --h-rms
--amplitudes KIND text: deterministic (default) or rayleigh
{READING}
[contact and cycle]
--work-of-adhesion G work: in J/m², or 20mJ/m2 (required unless the profile is that of --hurst;
    there 0.04)
--young E stress: in Pa, or 1MPa (likewise; with --hurst 1e6)
--poisson NU number: (likewise; with --hurst 0.5)
{CYCLE}
--path A,B,…,out text: instead of turning points: any path, loading first, ending with 'out' of
    contact or in contact
[method]
{METHOD}
--accuracy number: relative error of the loss (default 1e-3)
--nodes-per-wave N whole: for grid
[output]
--json OUT file: states, losses and jumps
--csv FILE file: the curve: a row a state, units in the header
--figure FILE file: stress and contact: .png, .pdf or .svg
--film FILE file: the loop as a film: .html (a page with a slider), .gif or .mp4 (needs ffmpeg)
--fields FILE.npz file: stress, shape and gap
--field-penetrations D number: Δ/h_max of the fields on both branches (default: quarters of
    --max-penetration)
--field-stresses P stress: instead, mean stresses of the fields on both branches: 10kPa, a tension
    in Pa alone: -500 (default with --preload: its quarters)
--field-nodes N whole: nodes of the fields
--strict: exit code 1 if the loss is doubtful
--quiet: no progress on stderr
"""
DETAILS = SHARED | {name: {"nargs": "+"} for name in ("field_penetrations", "field_stresses")}
