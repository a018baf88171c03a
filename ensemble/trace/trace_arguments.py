"""Compute the loss of a measured trace, and its uncertainty.

The trace is a text of one or two columns, or an instrument's file. One period of a profile is made
of it, its loop is run and those that other decisions would have given, and one page is written.
Lengths are in m and stresses in Pa, unless they carry a unit (5um, 20kPa).
"""

from __future__ import annotations

from typing import Any

EXAMPLES = (
    "adhesis trace trace.csv --unit um --work-of-adhesion 0.04 --young 1e6 --poisson 0.5 --to out",
    "adhesis trace trace.csv --work-of-adhesion 0.02,0.04 --young 1e6 --poisson 0.5 --plan",
)
CYCLE = """
--work-of-adhesion-open G work: where an edge recedes, at least that where it advances,
    --work-of-adhesion; between both it is pinned (default: the same)
--stripes N whole: the work of adhesion varies N times along the period, about --work-of-adhesion
--stripe-amplitude EPS number: by this share of it, below 1
--stripe-phase PHI number: in rad: γ(x) = γ (1 + EPS cos(2π N x/L + PHI)) (default 0)
--measure NAME text: adhesion acts on the length of the profile (arc, default) or its projection
    (flat)
--adhesion-range D length: range of adhesion, 0.3nm; surfaces touch at a gap of D, and patches open
    from inside at the strength G/D (default: zero range; method sharp alone)
--strength S stress: instead, that strength, 10MPa
--max-penetration D[,D…] text: turning points in h_max (default 0.9); with --stiffness those of the
    far side, u_tot/h_max; with --preload, where a loop turns at the latest
--preload P[,P…] text: instead, a machine turns where the mean stress reaches this: in Pa, or 20kPa
--max-stress P[,P…] text: instead, under a weight (--stiffness 0): turning points in Pa, or 20kPa
--stiffness K stiffness: in Pa/m of nominal area, or 1GPa/m, of what holds the solid; 0 is load
    control, that of a weight (default: fixed separation)
--layer D length: instead: the stiffness of a layer of this thickness, 1mm
--load-steps N whole: (default 40)
"""
METHOD = "--method NAME text: grid, sharp or auto (default auto)"
READING = """
[reading a trace]
--unit U text: unit of a text: um, or mm,um for positions and heights
--step S length: step, for heights without positions: 0.5um
--columns X,Z text: columns of a text, from 1; Z: heights alone
--delimiter C text: of a text, if it is not found out
--decimal text: decimal sign, if not found out
--row K whole: row of a map, from 0
--channel K whole: of an instrument's file, from 0
[preparing a trace]
--degree N whole: polynomial subtracted (default 1, or as is seen)
--cut-off W length: shortest wave kept: 5um (default from step, noise and tip)
--tip-radius R length: of the stylus or probe: 2um
--longest-gap G length: drop-outs up to this length are interpolated: 20um
--exclude A:B text: a range to bridge, from the first point on, 1.2mm:1.3mm; may be given several
    times
--keep-outliers: leave spikes in
--invert: z points into the sample: turn it
"""
ARGUMENTS = f"""
file FILE file: text or instrument's file
[contact and cycle]
--work-of-adhesion G text: in J/m², or 20mJ/m2; of several (0.04,0.02,0.08) the first is the
    answer's, the others make a table, as of several turning points
--young E stress: in Pa, or 1MPa
--poisson NU number
{CYCLE}
{METHOD}
--accuracy number: of each loop (default 1e-3)
{READING}
[output]
--to DIR file: for the page, its figures and JSON
--plan: print the plan, and stop
--quick: without tables of γ and turning point
--processes N whole: side by side (default: cores)
--quiet: no progress on stderr
"""
SHARED: dict[str, dict[str, Any]] = {
    "measure": {"default": "arc"},
    "load_steps": {"default": 40},
    "method": {"default": "auto"},
    "accuracy": {"default": 1e-3},
    "decimal": {"choices": [",", "."]},
    "exclude": {"action": "append"},
}
"""Details of the arguments that ``adhesis loop`` has too."""
_NEEDED = ("work_of_adhesion", "young", "poisson")
DETAILS = SHARED | {name: {"required": True} for name in _NEEDED}
