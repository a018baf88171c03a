"""Compute the loss of a measured trace, and its uncertainty.

The trace is a text of one or two columns, or an instrument's file. One period of a profile is made
of it, its loop is run and those that other decisions would have given, and one page is written.
Lengths are in m and stresses in Pa, unless they carry a unit (5um, 20kPa).
"""

from __future__ import annotations

from pathlib import Path

from adhesis.ensemble.quantities import LENGTH, STIFFNESS, STRESS, WORK_OF_ADHESION

EXAMPLES = (
    "adhesis trace trace.csv --unit um --work-of-adhesion 0.04 --young 1e6 --poisson 0.5 --to out",
    "adhesis trace trace.csv --work-of-adhesion 0.02,0.04 --young 1e6 --poisson 0.5 --plan",
)
_OPENED = (
    "where an edge recedes, at least that where it advances, --work-of-adhesion; between both it "
    "is pinned (default: the same)"
)
_STRIPES = "the work of adhesion varies N times along the period, about --work-of-adhesion"
_MEASURE = "adhesion acts on the length of the profile (arc, default) or its projection (flat)"
_RANGE = (
    "range of adhesion, 0.3nm: surfaces attract each other from a gap of D on, with the strength "
    "G/D (default: zero range)"
)
_TURNS = (
    "turning points in h_max (default 0.9); with --stiffness those of the far side, u_tot/h_max; "
    "with --preload, where a loop turns at the latest (default 0.999)"
)
_STIFFNESS = (
    "in Pa/m of nominal area, or 1GPa/m, of what holds the solid; 0 is load control, that of a "
    "weight (default: fixed separation)"
)
# Laws of adhesion, turning points and control, which `adhesis loop` shares; likewise what follows.
CYCLE = (
    ("--work-of-adhesion-open G", WORK_OF_ADHESION.option, _OPENED),
    ("--stripes N", int, _STRIPES),
    ("--stripe-amplitude EPS", float, "by this share of it, below 1"),
    ("--stripe-phase PHI", float, "in rad: γ(x) = γ (1 + EPS cos(2π N x/L + PHI)) (default 0)"),
    ("--measure NAME", None, _MEASURE, {"default": "arc"}),
    ("--adhesion-range D", LENGTH.option, _RANGE),
    ("--strength S", STRESS.option, "instead, the strength G/D, 10MPa"),
    ("--max-penetration D[,D…]", None, _TURNS),
    (
        *("--preload P[,P…]", None),
        "instead, a machine turns where the mean stress reaches this: in Pa, or 20kPa",
    ),
    (
        *("--max-stress P[,P…]", None),
        "instead, under a weight (--stiffness 0): turning points in Pa, or 20kPa",
    ),
    ("--stiffness K", STIFFNESS.option, _STIFFNESS),
    ("--layer D", LENGTH.option, "instead: the stiffness of a layer of this thickness, 1mm"),
    ("--load-steps N", int, "(default 40)", {"default": 40}),
)
METHOD = ("--method NAME", None, "grid, sharp, zones or auto (default auto)", {"default": "auto"})
READING = (
    "reading a trace",
    ("--unit U", None, "unit of a text: um, or mm,um for positions and heights"),
    ("--step S", LENGTH.option, "step, for heights without positions: 0.5um"),
    ("--columns X,Z", None, "columns of a text, from 1; Z: heights alone"),
    ("--delimiter C", None, "of a text, if it is not found out"),
    ("--decimal", None, "decimal sign, if not found out", {"choices": [",", "."]}),
    ("--row K", int, "row of a map, from 0"),
    ("--channel K", int, "of an instrument's file, from 0"),
    "preparing a trace",
    ("--degree N", int, "polynomial subtracted (default 1, or as is seen)"),
    ("--cut-off W", LENGTH.option, "shortest wave kept: 5um (default from step, noise and tip)"),
    ("--tip-radius R", LENGTH.option, "of the stylus or probe: 2um"),
    ("--longest-gap G", LENGTH.option, "drop-outs up to this length are interpolated: 20um"),
    (
        *("--exclude A:B", None),
        "a range to bridge, from the first point on, 1.2mm:1.3mm; may be given several times",
        {"action": "append"},
    ),
    ("--keep-outliers", bool, "leave spikes in"),
    ("--invert", bool, "z points into the sample: turn it"),
)
_GAMMA = (
    "in J/m², or 20mJ/m2; of several (0.04,0.02,0.08) the first is the answer's, the others make a "
    "table, as of several turning points"
)
OPTIONS = (
    ("file FILE", Path, "text or instrument's file"),
    "contact and cycle",
    ("--work-of-adhesion G", None, _GAMMA, {"required": True}),
    ("--young E", STRESS.option, "in Pa, or 1MPa", {"required": True}),
    ("--poisson NU", float, "0.5: incompressible", {"required": True}),
    *CYCLE,
    METHOD,
    ("--accuracy", float, "of each loop (default 1e-3)", {"default": 1e-3}),
    *READING,
    "output",
    ("--to DIR", Path, "for the page, its figures and JSON"),
    ("--plan", bool, "print the plan, and stop"),
    ("--quick", bool, "without tables of γ and turning point"),
    ("--processes N", int, "side by side (default: cores)"),
    ("--quiet", bool, "no progress on stderr"),
)
