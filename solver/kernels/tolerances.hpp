// Tolerances of the kernels, with units and reasons, and measurements where there are any; those of
// method sharp in Python: solver/sharp/tolerances.py.
//
// Units: λ_min is the shortest wavelength of the profile and of γ(x), C_c the critical opening of
// an edge on a flat piece; "longest steps" are EdgeLaw.longest_step, LONGEST_STEP of Python, as a
// unit: it is also that of a step through the model, of which four times as long a one leaps over
// pinned minima, and twice as long a one errs in the times of edges that compete.
#pragma once

namespace adhesis {

// ---------------------------------------------------------------- field of given edges

// Radians of the highest Chebyshev mode over one panel: 8 to 14 Gauss nodes resolve half a wave.
inline constexpr double PANEL_PHASE = 3.0;

// Charges of a run, at most, and more than the nodes of a gap: enough for patches of 5e-10 of their
// run at an accuracy of 1e-14.
inline constexpr int MOST_CHARGES = 160;

// Sine nodes per λ_min that bracket every local minimum of an opening.
inline constexpr double SHAPE_NODES = 6.0;

// Sine nodes of a gap beyond those by its length, for its ends; more where all are finer than those
// of shapes.
inline constexpr int FEWEST_SINE_NODES = 64;

// ---------------------------------------------------------------- equilibrium of the edges

// Corrections by Newton's iteration before an equilibrium counts as lost, many where edges with two
// works of adhesion begin to move and are pinned on the way; and parabolas before a minimum is
// taken as it is.
inline constexpr int MOST_CORRECTIONS = 32;

// Share of the last correction. An iteration that shrinks less is given up early. Corrections no
// longer than EdgeLaw.rest_step are not judged so: the error of references takes part in them. One
// that shrinks less below EdgeLaw.field_error goes to and fro across a step of the field, where
// panels or modes change: there the iteration ends.
inline constexpr double NEWTON_SHRINKS = 0.7;

// Share of a gap or patch by which one step of one edge may shorten it; of the last gap of a period
// that to which it may still shrink.
inline constexpr double CLOSING_SHARE = 0.25;

// ---------------------------------------------------------------- linear response of the gaps

// Share of a gap, or of the patch beside it, by which an edge may leave the reference of its
// gap's linear response. With 0.05 a gap of 0.002 λ_min was 0.3 % too short, and a drop 1.1 %
// too small.
inline constexpr double REFERENCE_SHARE = 0.01;

// Longest steps. An edge may leave its reference by the root of this length and the displacement
// that the error of the field makes. With a hundred times this length an equilibrium of 13 gaps
// was wrong by twice that displacement, with twenty times its rates by 4e-4; loops take 4 % less
// CPU time with 8 patches, and 10 % less with 65.
inline constexpr double REFERENCE_SCALE = 0.1;

// Compliance of an edge, over that of its gap by itself or by roughness of the shortest wave. A
// softer edge is taken to be next to a fold, where its tangent changes fast, too: it may leave
// its reference by less. In loops at the paper's scale half of all edges have 2 to 4. Without
// this folds were found up to 6e-4 h_max late.
inline constexpr double SOFT_EDGE = 6.0;

// C_c. Edges further out of balance do not follow as their tangent has it: in the reference of
// their gap it is renewed, and in a descent they run. Without renewal rates were wrong by 2e-3
// after some gaps had been moved by 0.1 λ_min and back, and by 0.3 λ_min no equilibrium was found.
inline constexpr double UNBALANCED = 0.01;

// Share of a gap or patch beyond which the potential in the old gap is not taken for that in the
// new one. At 0.3, 53 of 857 failures of Newton's iteration were of states that dense matrices find
// (γ = 0.0025 at the paper's scale), at 0.1 eight.
inline constexpr double REFERENCE_FAR = 0.1;

// Share of a patch by which it may change before the nodes beside it are placed anew. With half of
// it rates after some gaps had been moved by 0.1 λ_min and back were wrong by 1.2e-3.
inline constexpr double REFERENCE_PATCH = 0.2;

// Times as many nodes and charges as are needed: so many there is room for, until a response is set
// up anew.
inline constexpr double ROOM = 1.5;

// ---------------------------------------------------------------- sizes of steps

// Largest growth from one step to the next, along a branch and of the reach of a descent.
inline constexpr double STEP_GROWTH = 2.0;

// Factor on a step along a branch that finds no equilibrium; least factor on the reach, and on the
// time of a step through the model.
inline constexpr double STEP_REDUCTION = 0.25;

// ---------------------------------------------------------------- descent in energy

// C_c². Runners that take less force than this from each other do not race.
inline constexpr double HELD_BACK = 0.03;

// Long steps, of the flow through the model of the openings. How often a length decides a loss:
// benchmarks/descent_steps.py.

// Longest steps (0.6 λ_min) that the first step of a flow through the model may go.
inline constexpr double FIRST_REACH = 12.0;

// Longest steps, at least, of a long step. With one instead of two a minimum on the way was passed
// in one of 1,000 loops (accuracy 1e-5): its drop was 7 % too large, and the loss 2e-4 off.
inline constexpr double LEAST_REACH = 2.0;

// Of the reach at which the error would be what is allowed: that of a tangent grows as its
// square.
inline constexpr double REACH_SAFETY = 0.8;

// Share of a gap or patch by which each of its edges may shorten it in a long step: with that of
// short steps descents took a tenth more of them.
inline constexpr double LONG_CLOSING = 0.45;

// C_c on a flat piece. Error of an opening of the model that is allowed in balance. With a
// fiftieth of it a descent over 20 λ_min took 32 fields instead of 9, and ended alike.
inline constexpr double MODEL_ERROR = 0.005;

// C_c² on a flat piece. Where forces have fallen below this the model does not lead on: a
// minimum may be shallower than its error. Without it 3 of 180 loops ended elsewhere with other
// steps.
inline constexpr double NEAR_BALANCE = 0.05;

// Times. Forces that have fallen by more on the way are near a saddle or minimum.
inline constexpr double FORCES_FELL = 8.0;

// Of the distance of an opening from its critical value: the error that is allowed in addition.
inline constexpr double MODEL_SHARE = 0.1;

// Longest steps. A long step through the model in which no edge goes further is taken as a short
// one.
inline constexpr double FOLLOWING = 0.2;

// Longest steps (0.005 λ_min) of one step through the model near balance, where modes of different
// edges may compete, and their times decide: with twenty times this a loop (γ = 0.04, seed 1) lost
// 6e-5 less, as another edge came first. Also the shortest reach.
inline constexpr double MODEL_SHORT_STEP = 0.1;

// Longest steps, a quarter of λ_min. Edges that move further are elsewhere, over other roughness.
//
// In a descent an edge that would follow so far runs: where another patch near its fold followed by
// 6 λ_min, the wrong one vanished, and the loss was wrong by 4e-3. A step that is predicted to move
// one so far is not tried: an edge was predicted to move by 3 λ_min in the first step after a jump,
// and another branch was found there, so that a loss of 30 patches was wrong by 1.6 %, unmarked. A
// gap whose edge has moved so far is not compared with what was searched.
inline constexpr double ELSEWHERE = 5.0;

// Of the largest force. With equal speeds edges with less force than this are slower.
inline constexpr double SLOWEST = 0.01;

// ---------------------------------------------------------------- nucleation

// Share of a clearance that must be left by the nodes of the field, else the gap is searched again.
inline constexpr double CLEARANCE_LEFT = 0.5;

// λ_min. Nearer to the ends of a gap openings are small; only a negative one is looked at.
inline constexpr double NO_MINIMUM_WITHIN = 0.12;

// So many estimated errors above zero a minimum is surely open; lower ones are located more finely.
inline constexpr double MINIMUM_DOUBT = 3.0;

// Parabolas by which a low minimum is located, each an eighth as wide as the one before. Without
// those of equal widths beside them one in eighty minima was too high, by up to 4e-4 h_max, where
// the third derivative is large beside the curvature.
inline constexpr int MINIMUM_REFINEMENTS = 3;

// ---------------------------------------------------------------- continuation of a branch

// Distances between its points, in d or of the leading edge, beyond which a predictor is not
// trusted.
inline constexpr double PREDICTION_TRUSTED = 5.0;

// Likewise for the cubics of the other edges.
inline constexpr double CUBIC_OF_OTHERS_TRUSTED = 1.5;

// Share of the fastest rate; slower edges do not lead. Where the fastest edge always led, loops
// of 25 to 120 patches took 4 % more fields.
inline constexpr double LEADING_SHARE = 0.2;

// Share of the distance to a fold that is left to the next step.
inline constexpr double LEFT_BEFORE_FOLD = 0.1;

// Of the resolution of a jump: so far beyond a fold there is surely no equilibrium, and so much
// before it is left at least to the next step.
inline constexpr double BEYOND_FOLD = 0.2;

}  // namespace adhesis
