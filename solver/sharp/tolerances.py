"""Tolerances of method ``sharp``: one table, with unit, reason and the measurement behind each.

Units: λ_min is the shortest wavelength of the profile, C_c the critical opening of an edge on a
flat piece, h_max the highest crest, d the prescribed quantity in the units of the field. Those of
the kernels stand in ``solver/kernels/tolerances.hpp``, too.
"""

from __future__ import annotations

# ---------------------------------------------------------------- field of given edges


SHORT_GAP_PANELS = 4
"""Finest panels (at most λ_min/2 each). A shorter gap is integrated by one Gauss rule: its end
pieces, one to two panels each, would meet."""

PANEL_PHASE = 3.0
"""Radians of the highest Chebyshev mode over one panel: 8 to 14 Gauss nodes resolve half a wave."""

CHARGE_MARGIN = 1.0
"""Natural digits of a run's charges beyond those of the field: errors of several levels add up."""

FEWEST_CHARGES = 4
"""Charges of a run, at least."""

MOST_CHARGES = 160
"""Charges of a run, at most: enough for patches of 3e-7 of their run at an accuracy of 1e-14, and
of 1e-17 at 1e-5."""

ENERGY_NODES = 3.0
"""Sine nodes per λ_min for the energy: two resolve the shortest wave, the rest is margin."""

SHAPE_NODES = 6.0
"""Sine nodes per λ_min that bracket every local minimum of an opening."""

FEWEST_SINE_NODES = 64
"""Sine nodes of a gap beyond those by its length, for its ends."""

# ---------------------------------------------------------------- equilibrium of the edges

SETTLED = 1e-7
"""λ_min. A correction this small ends Newton's iteration."""
COARSE_FIELD = 10.0
"""λ_min per relative error of the field: how far an equilibrium may move with that error."""
CORRECTED = 0.05
"""λ_min. Longest correction of an equilibrium that is searched nearby."""
SMALLEST_LENGTH = 0.005
"""λ_min. Narrower patches and gaps are removed."""
SMALLEST_OF_SEED = 0.05
"""Likewise, of the width at which a patch on the sharpest crest first comes to rest."""
LAST_GAP = 0.05
"""Share of its length to which the last gap of a period may still shrink."""
OVERLAPPING = 0.1
"""An opening this far below zero, of C_c or of the openings that roughness makes, is an overlap
that descent cannot weigh."""
FAINT_FORCE = 10.0
"""C_c² per relative error of the field: forces this small are that error."""
LEAST_FAINT_FORCE = 1e-12
"""C_c². Forces this small are rounding."""

MOST_CORRECTIONS = 8
"""Corrections by Newton's iteration before an equilibrium counts as lost."""
PINNED_CORRECTIONS = 4
"""Times as many with two works of adhesion, where edges begin to move and are pinned on the way."""
PINNED_SLACK = 0.1
"""Faintest forces (``FAINT_FORCE``) by which the opening of a pinned edge may lie outside of both
critical ones: that of Newton's iteration where a path turns back. With a hundred times this an edge
was held beyond its fold, which came 3e-4 h_max late, and losses were 5e-4 too large."""


STALLED_SHARE = 0.3
"""Share of the last correction. One that is no smaller, and below ``EdgeLaw.field_error``, goes to
and fro across a step of the field, where panels or modes change: the iteration ends."""


HIERARCHICAL_NEWTON_GROWTH = 0.7
"""Share of the last correction. An iteration that shrinks less is given up early. Corrections no
longer than ``DESCENT_HANDS_OVER`` are not judged so: the error of references takes part in them."""


CLOSING_SHARE = 0.25
"""Share of a gap or patch by which one step of one edge may shorten it."""

# ---------------------------------------------------------------- linear response of the gaps

REFERENCE_SHARE = 0.01
"""Share of a gap, or of the patch beside it, by which an edge may leave the reference of its gap's
linear response. With 0.05 a gap of 0.002 λ_min was 0.3 % too short, and a drop 1.1 % too small."""
REFERENCE_SCALE = 0.1
"""Longest steps. An edge may leave its reference by the root of this length and the displacement
that the error of the field makes. With a hundred times this length an equilibrium of 13 gaps was
wrong by twice that displacement, with twenty times its rates by 4e-4; loops take 4 % less CPU time
with 8 patches, and 10 % less with 65."""
SOFT_EDGE = 6.0
"""Compliance of an edge, over that of its gap by itself or by roughness of the shortest wave. A
softer edge is taken to be next to a fold, where its tangent changes fast, too: it may leave its
reference by less. In loops at the paper's scale half of all edges have 2 to 4. Without this folds
were found up to 6e-4 h_max late."""
WEAK_INTERACTION = 0.7
"""Sum of the squares of the eigenvalues by which two runs act on each other, instability being at
one: below it none is within a sixth (``SOFT_EDGE``) of that, and none is counted."""
REFERENCE_BALANCE = 0.01
"""C_c. Edges further out of balance in the reference of their gap, in the potentials that it had,
follow otherwise than its response has it. Without this rates were wrong by 2e-3 after some gaps had
been moved by 0.1 λ_min and back, and by 0.3 λ_min no equilibrium was found."""
REFERENCE_FAR = 0.1
"""Share of a gap or patch beyond which the potential in the old gap is not taken for that in the
new one. At 0.3, 53 of 857 failures of Newton's iteration were of states that dense matrices find
(γ = 0.0025 at the paper's scale), at 0.1 eight."""
REFERENCE_MOST_FAR = 0.25
"""Share of all gaps that may move so far before all are solved anew."""
FEW_REFERENCES = 8
"""Gaps: fewer count as so many for that."""
REFERENCE_PATCH = 0.2
"""Share of a patch by which it may change before the nodes beside it are placed anew."""
FURTHER_ORDERS = 2
"""Orders by which the rule of a gap that has changed is raised beyond what it needs."""
FURTHER_CHARGES = 1.25
"""Factor on the charges of the runs that hold such a gap."""
RESPONSES_KEPT = 3
"""Responses that are kept, each of another number of gaps."""
RESPONSE_TRIALS = 4
"""Times that a response is set up for one equilibrium, where gaps need more and more nodes."""

# ---------------------------------------------------------------- descent in energy

LONGEST_STEP = 0.05
"""λ_min. Longest short step of an edge. "Longest steps" below is this length as a unit."""
DESCENT_HANDS_OVER = 1e-3
"""λ_min. Shorter descent steps are left to Newton's iteration."""
DESCENT_LIMIT = 100_000
"""Steps of one descent."""
RESTS = 20
"""How often a descent may come to rest without a minimum that Newton's iteration finds."""
MOST_NUCLEATIONS = 10_000
"""Nucleations in one jump; more are an endless loop."""
RAN = 0.05
"""λ_min. An edge that moved further than this in a descent has run."""
HELD_BACK = 0.03
"""C_c². Runners that take less force than this from each other do not race."""
OTHER_MINIMUM = 0.01
"""λ_min. Edges this far apart are those of different minima."""

# Long steps, of the flow through the model of the openings. How often a length decides a loss:
# benchmarks/descent_steps.py.
FIRST_REACH = 12.0
"""Longest steps (0.6 λ_min) that the first step of a flow through the model may go."""
LEAST_REACH = 2.0
"""Longest steps (0.1 λ_min); where the model is wrong sooner the next step is a short one."""
LONGEST_REACH = 100.0
"""Longest steps (5 λ_min)."""
REACH_GROWTH = 3.0
"""Largest growth of the reach from one step to the next."""
REACH_CUT = 0.1
"""Least factor on the reach, also where there is no field at the end."""
REACH_SAFETY = 0.8
"""Of the reach at which the error would be what is allowed: that of a tangent grows as its
square."""
MODEL_ERROR = 0.005
"""C_c on a flat piece. Error of an opening of the model that is allowed in balance. With a fiftieth
of it a descent over 20 λ_min took 32 fields instead of 9, and ended alike."""
NEAR_BALANCE = 0.05
"""C_c² on a flat piece. Where forces have fallen below this the model does not lead on: a minimum
may be shallower than its error. Without it 3 of 180 loops ended elsewhere with other steps."""
FORCES_FELL = 8.0
"""Times. Forces that have fallen by more on the way are near a saddle or minimum."""
MODEL_SHARE = 0.1
"""Of the distance of an opening from its critical value: the error that is allowed in addition."""
MODEL_STEP = 1.0
"""Longest steps (0.05 λ_min) of one step through the model: with four times this length one leaps
over pinned minima, with twice this length the times of edges that compete are wrong."""
LONG_CLOSING = 0.45
"""Share of a gap or patch by which each of its edges may shorten it in a long step."""
MODEL_STEPS = 200
"""Steps through the model in one step of a descent."""
RUNNING_ENDS = 0.01
"""Longest steps; a shorter one ends the flow through the model."""
RUNNING_LENGTH = 0.5
"""Longest steps; edges that move further in the model run."""
RUNNING = 0.01
"""C_c. Edges further out of balance run, those nearer to it follow by their tangent."""
FOLLOWING = 0.2
"""Longest steps; edges that Newton's step of all edges moves further run."""
SHORTEST_REACH = 0.1
"""Longest steps; so short a step is not rejected."""
FAINT_SADDLE = 0.01
"""Faintest forces (``FAINT_FORCE``); at a saddle smaller ones are not followed."""
MODEL_SHORT_STEP = 0.1
"""Longest steps (0.005 λ_min) of one step through the model near balance, where modes of different
edges may compete, and their times decide: with twenty times this a loop (γ = 0.04, seed 1) lost
6e-5 less, as another edge came first."""
SLOWEST = 0.01
"""Of the largest force. With equal speeds edges with less force than this are slower."""
TIME_TRIES = 20
"""Times Δτ that are tried for one step in the model."""
RATE_GROWTH = 4.0
"""By which 1/Δτ grows at most from one try to the next."""
# The way off a saddle.
EQUAL_MODES = 1e-3
"""Of the largest stiffness; modes that differ by less are equally soft."""
EQUAL_AMPLITUDES = 0.99
"""Of the largest; edges that move so far are equal, the first one leads."""
EQUAL_GAINS = 1e-3
"""Of the gain; two ways off that differ by less are equal."""

FURTHEST_FOLLOWING = 5.0
"""Longest steps, a quarter of λ_min: an edge that would follow further runs. Where another patch
near its fold followed by 6 λ_min, the wrong one vanished, and the loss was wrong by 4e-3."""

# ---------------------------------------------------------------- nucleation

CLOSING_BY_MOTION = 4.0
"""The motion of one gap's edges counts so many times where it may close others, of many gaps."""
OVERLAP = 1e-6
"""h_max. Smaller overlaps may remain in a state."""
TOUCH_TRIALS = 60
"""Trials to locate a touch; a bisection would exhaust the digits."""
CLEAR_TRIALS = 2
"""Trials by the secant that find no overlap, one after the other, before a bisection."""
BISECTION_EVERY = 5
"""Of many gaps, which are interpolated one by one, one in so many trials is a bisection."""
TRIAL_FROM_END = 1e-4
"""Share of an interval within which of its ends no trial is made."""
COMPARABLE = 0.3
"""λ_min. Edges that moved by less than this leave a gap comparable to what was searched."""
CLOSING_SAFETY = 1.5
"""Safety factor on the closing that the nodes of the field show."""
CLEARANCE_LEFT = 0.3
"""Share of a clearance that must surely be left, else the gap is searched again."""
NO_MINIMUM_WITHIN = 0.12
"""λ_min. Nearer to the ends of a gap openings are small; only a negative one is looked at."""
MINIMUM_IS_LOW = 0.1
"""Of the parabola's rise over its half-width: lower minima are located more finely."""
MINIMUM_DOUBT = 3.0
"""So many estimated errors above zero a minimum is surely open."""
MINIMUM_REFINEMENTS = 3
"""Parabolas by which a low minimum is located, each an eighth as wide as the one before."""
NO_CURVATURE = 1e-100
"""Half the curvature of a minimum where none is seen."""

# ---------------------------------------------------------------- opening from inside

STRENGTH_EXCEEDED = 2e-5
"""σ_th. Tension inside a patch may exceed the strength by this share when it opens."""
SHORTEST_CRACK = 0.02
"""λ_min. Shorter ones are not put: steps of their edges would count as rest."""

# ---------------------------------------------------------------- continuation of a branch

FIRST_MOTION = 0.05
"""λ_min. Longest predicted motion of an edge in the first step after a jump, which is straight."""
PREDICTED_MOTION = 0.15
"""λ_min. Longest predicted motion of the edge that leads in one step."""
LONGEST_PREDICTION = 0.3
"""λ_min. Longest predicted motion of any edge: a step with a longer one is not tried. Without it an
edge was predicted to move by 3 λ_min in the first step after a jump, and another branch was found
there: a loss of 30 patches was wrong by 1.6 %, unmarked."""
UNMOVED_BY_JUMP = 0.015
"""λ_min. Edges that a jump moves by less keep their motion before it for the next prediction. With
65 and 120 patches that takes 3 and 4 % fewer fields; ten times this length takes 1 % more with few
patches."""
ORDER_RESOLVED = 0.1
"""Of the resolution of a jump. A touch and a fold nearer to each other may come in either order:
the error of the field displaces them by up to that."""
SAME_BRANCH = 1e-3
"""λ_min. Edges that a descent moves by less than this have not left their branch."""
STEP_GROWTH = 2.0
"""Largest growth of the step after an accepted one."""
STEP_REDUCTION = 0.25
"""Reduction of the step where no equilibrium is found."""
FOLD_RESOLVED = 0.999
"""Of the resolution of a jump: the shortest step, rounding apart."""
TWO_FOLDS_SEEN = 50.0
"""Resolutions of a jump: two folds ahead that are nearer are compared. Of 400 loops with 20 to 80
patches two were wrong, by 0.09 and 2.7 %, as their order was not that at a finer accuracy."""
SECOND_FOLD_DISPLACED = 10.0
"""Times what the error of the field displaces the first fold by: folds so near to each other may
come in either order. In the two wrong loops they were 0.5 and 4.5 times that apart. Where all folds
less than a resolution apart counted, half of the loops with 20 to 80 patches had races, instead of
a tenth."""
PREDICTION_TRUSTED = 4.0
"""Distances between its points beyond which a predictor is not trusted."""
CUBIC_TRUSTED = 5.0
"""Likewise for a fold of the cubic, in motions of the leading edge."""
CUBIC_OF_OTHERS_TRUSTED = 1.5
"""Likewise for the cubics of the other edges."""
LEADING_SHARE = 0.2
"""Share of the fastest rate; slower edges do not lead. Where the fastest edge always led, loops of
25 to 120 patches took 4 % more fields."""
LEFT_BEFORE_FOLD = 0.1
"""Share of the distance to a fold that is left to the next step."""
LEAST_LEFT_BEFORE_FOLD = 0.3
"""Likewise at least, of the resolution of a jump."""
BEYOND_FOLD = 0.2
"""Of the resolution of a jump: so far beyond a fold there is surely no equilibrium."""
PREDICTOR_ITERATIONS = 60
"""Bisections that invert the cubic of the leading edge; more would exhaust the digits."""
TRAPEZOID_FAR = 4.0
"""Of the allowed error of the trapezoidal rule: a step with more is halved."""
QUIET_STRESS = 0.05
"""σ~. Smaller mean stresses do not tighten the trapezoidal rule."""

# ---------------------------------------------------------------- error of the loss

JUMP_RESOLUTION = 0.05
"""accuracy·h_max. Separation to which jumps are located at first."""
LEAST_JUMP_RESOLUTION = 1e-13
"""h_max. No jump is located more finely: this is rounding."""
FIELD_RESOLVES = 0.5
"""h_max per relative error of the field: nearer to a fold that error hides whether there is a
minimum."""
FINER_UNDER_LOAD = 1e-2
"""Factor on the field's tolerance under a load: before a fold s goes like a square root, and where
contact is lost it counts."""
FIELD_ACCURACY = 1e-2
"""Accuracy of the loss: relative accuracy of the field."""
LEAST_FIELD_TOLERANCE = 1e-14
"""Smallest relative tolerance of the field: rounding."""
LARGEST_FIELD_TOLERANCE = 1e-5
"""Largest relative tolerance of the field."""
PLACED_BY_PROFILE = 3e-3
"""Largest error of the field in units of the openings that roughness makes, which alone hold the
last gap in its place."""
FIELD_SHARE = 0.05
"""Accuracy of the loss: least error of a drop that the error of the field makes; folds that the
field's error displaces by more count with that."""
LATE_DROP = 0.5
"""Accuracy of the loss: a jump may be late by a work of this share of its drop."""
LEAST_DROP = 2e-3
"""γ. Drops below this are taken as this when the lateness of a jump is judged."""
LATE_REFINEMENT = 0.5
"""Of the allowed lateness: what a fold that was found too late is located to."""
LEAST_REFINEMENT = 1e-3
"""Largest factor by which a fold's location is refined at once."""
FINER_FIELD = 1e-2
"""Tolerance, over that of the path, of the field that shows the error of the path's."""
WORK_OF_STEP = 8e-4
"""Accuracy of the loss times γ, at strong adhesion: largest difference of the work and the change
of energy over one step where patches open from inside. The loss is then a smaller part of the work
than the rule of ``TRAPEZOID`` supposes, and between two folds the slopes at both ends hide the
error. Steps of a loop err to the same side, so that a loop of steel with 2,000 steps needs this for
an audit of 2e-5. With weak adhesion it falls as ``TRAPEZOID`` does."""
LARGEST_WORK_OF_STEP = 2e-5
"""Accuracy of the loss times γ: the largest value, however strong adhesion is."""
WORK_RESOLVED = 0.01
"""Resolution of jumps. Over shorter steps the difference is that of the fields."""
WORK_STALLED = 0.5
"""Share of the difference of work and energy over a step that a shorter one may leave at most, if
it is an error of the step: half a step has a sixteenth of it, next to a fold a third."""
TRAPEZOID = 1.5e-4
"""Largest relative error of the trapezoidal rule over one step at accuracy 1e-3."""
WEAKNESS_POWER = 1.25
"""Power of the weakness of adhesion with which the allowed errors of a step's work fall."""
