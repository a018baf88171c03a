"""Tolerances of method ``sharp``: one table, with units and reasons, and some measurements.

Units: λ_min is the shortest wavelength of the profile and of γ(x), C_c the critical opening of an
edge on a flat piece, h_max the highest crest, d the prescribed quantity in the units of the field.
Those of the kernels stand in ``solver/kernels/tolerances.hpp``; Python takes from there what it
needs.
"""

from __future__ import annotations

# ---------------------------------------------------------------- equilibrium of the edges

NEWTON_TOLERANCE = 1e-7
"""λ_min. An edge this near to the reference of its gap keeps it, which ends Newton's iteration."""
BY_FIELD = 1e5
"""Likewise, per relative error of the field: where adhesion is weak, work and energy of steel
differed by 2.3e-4 of the loss, as edges were off by 1e-7 λ_min at an error of 1e-14."""
FIELD_ERROR = 10.0
"""λ_min per relative error of the field: how far an equilibrium may move with that error."""
SMALLEST_LENGTH = 0.005
"""λ_min. Narrower patches and gaps are removed."""
SMALLEST_OF_SEED = 0.05
"""Likewise, of the half-width at which a patch on the sharpest crest first comes to rest."""

# ---------------------------------------------------------------- descent in energy

LONGEST_STEP = 0.05
"""λ_min. Length over which an edge is taken to follow its tangent: longest short step of a descent,
and longest correction of an equilibrium that is searched nearby."""
DESCENT_HANDS_OVER = 1e-3
"""λ_min. Shorter descent steps are left to Newton's iteration, and edges that a descent moves by
less have not left their branch."""
ENDLESS = 10_000
"""Steps of one descent, or nucleations in one jump: more go to and fro, or are an endless loop.
With ten times as many three of 96 loops of a patch that rocks from bump to bump were refused."""
RESTS = 20
"""How often a descent may come to rest without a minimum that Newton's iteration finds; as often
again edges that are nearly in equilibrium are taken, or moved. Without it
one of 72 loops (H = 0.9, γ = 0.07) went to and fro between two places beside a fold."""
OTHER_MINIMUM = 0.01
"""λ_min. Edges this far apart are those of different minima."""
FINER_STEPS = 0.3
"""Of the longest steps, in descents in which edges may have raced. Whole ones may end on the other
side of a separatrix: a loop (γ = 0.04, seed 1, accuracy 1e-5) lost 5e-5 less. Equal speeds ended
there, too, so that no race was flagged. With half of them the loss is wrong as well; with 0.3 and
0.1 it is right."""

# The way off a saddle.
EQUAL = 1e-3
"""Share by which stiffnesses, amplitudes, rates and gains of energy of edges that are copies of
each other may differ and count as equal: of equal edges the first one leads. So much of the largest
stiffness a mode may have, too, that has softened at a fold: there the error of the field decides
its sign, and with that losses of equal crests differed by up to 4 %."""

# ---------------------------------------------------------------- nucleation

OVERLAP = 1e-6
"""h_max. Smaller overlaps may remain in a state."""
TRIAL_WIDTHS = 1.25
"""Ratio of the widths of seeds that are tried one after the other, where surfaces attract."""
HEALED_OPENING = 0.99
"""Of the opening at which a touch did not hold: from there on it is tried again."""
GROWTH = 1.1
"""γ/G of the seed that is put where surfaces attract."""
LONGEST_TRIAL_HALF_WIDTH = 0.25
"""λ_min. Half-width of the widest of these seeds: it is then as wide as half a wave."""
IN_GAP = 0.8
"""Half-width of the widest one, over the distance of its middle from the nearest edge."""
LONGEST_GRIFFITH_CRACK = 0.25
"""λ_min of the profile. Longest Griffith crack at the strength, 4E*γ/(πσ_th²), for which edges are
taken as those of zero range: it is 1.6 times as long as Dugdale's zone at an edge."""

# ---------------------------------------------------------------- tension inside patches

MOST_MAXIMA = 32
"""Maxima of tension of one field that are refined."""

# ---------------------------------------------------------------- continuation of a branch

PREDICTED_MOTION = 0.15
"""λ_min. Longest predicted motion of the edge that leads in one step."""
ORDER_RESOLVED = 0.1
"""Of the resolution of a jump. A touch and a fold nearer to each other may come in either order:
the error of the field displaces them by up to that."""
SECOND_FOLD_DISPLACED = 10.0
"""Times what the error of the field displaces the first fold by: folds so near to each other may
come in either order. Of 400 loops with 20 to 80 patches two were wrong, by 0.09 and 2.7 %, as their
order was not that at a finer accuracy: they were 0.5 and 4.5 times that apart. Where all folds
less than a resolution apart counted, half of the loops with 20 to 80 patches had races, instead of
a tenth."""
PINNED_PLACE = 0.2
"""Of the displacement of an equilibrium by the error of the field: so far from its place an edge
with two works of adhesion may be left, as later events keep that. One that is pinned where it turns
back may have gone back by so much in a step (with five times as much a loss was off by 2.8 of its
``loss_error``), and one edge of a mirrored patch is moved on by so much where they part (with
1e-3 λ_min by up to 13; of several patches one is moved by 1e-3 λ_min still, or the error of the
field would choose which of them goes first)."""
TRAPEZOID_FAR = 4.0
"""Of the allowed error of the trapezoidal rule: a step with more is halved."""
QUIET_STRESS = 0.05
"""σ~. Smaller mean stresses do not tighten the trapezoidal rule."""

# ---------------------------------------------------------------- error of the loss

JUMP_RESOLUTION = 0.05
"""accuracy·h_max. Separation to which jumps are located at first."""
FIELD_RESOLVES = 0.5
"""h_max per relative error of the field: nearer to a fold that error hides whether there is a
minimum."""
FIELD_ACCURACY = 1e-2
"""Accuracy of what is computed from it: relative accuracy of the field. So much more accurate, too,
is the field that shows the error of the path's, and that of a path under a load: before a fold s
goes like a square root there, and where contact is lost it counts."""
ROUNDING = 1e-14
"""Smallest relative tolerance of the field, and of h_max to which a jump is located."""
LARGEST_FIELD_TOLERANCE = 1e-5
"""Largest relative tolerance of the field."""
PLACED_BY_PROFILE = 3e-3
"""Largest error of the field in units of the openings that roughness makes, which alone hold the
last gap in its place."""
RANGE_RESOLVED = 5e-4
"""Range of adhesion: largest error of an opening by the field, in units of h_max per relative error
of the field. With that of zero range touches were up to 3e-3 of the range late."""
FIELD_SHARE = 0.05
"""Accuracy of the loss: least error of a drop that the error of the field makes; folds that the
field's error displaces by more count with that."""
LATE_DROP = 0.5
"""Accuracy of the loss: a jump may be late by a work of this share of its drop."""
LEAST_DROP = 2e-3
"""γ. Drops below this are taken as this when the lateness of a jump is judged."""
TRAPEZOID = 1.5e-4
"""Largest relative error of the trapezoidal rule over one step at accuracy 1e-3."""
WEAKNESS_POWER = 1.25
"""Power of the weakness of adhesion with which the allowed errors of a step's work fall."""
