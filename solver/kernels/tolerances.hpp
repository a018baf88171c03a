// Tolerances of the kernels; units and reasons: tolerances.py.
#pragma once

namespace adhesis {

inline constexpr double SHORT_GAP_PANELS = 4, PANEL_PHASE = 3.0;
inline constexpr double CHARGE_MARGIN = 1.0;
inline constexpr int FEWEST_CHARGES = 4, MOST_CHARGES = 160;
inline constexpr int MOST_RANK = 160;  // charges of a run, or nodes of a gap (at most 128)

inline constexpr int MOST_CORRECTIONS = 8, PINNED_CORRECTIONS = 4;
inline constexpr double PINNED_SLACK = 0.1;
inline constexpr double STALLED_SHARE = 0.3, HIERARCHICAL_NEWTON_GROWTH = 0.7;
inline constexpr double CLOSING_SHARE = 0.25;
inline constexpr double REFERENCE_SHARE = 0.01, REFERENCE_SCALE = 0.1, SOFT_EDGE = 6.0;
inline constexpr double WEAK_INTERACTION = 0.7;
inline constexpr double REFERENCE_BALANCE = 0.01, REFERENCE_FAR = 0.1, REFERENCE_MOST_FAR = 0.25;
inline constexpr double REFERENCE_PATCH = 0.2, FURTHER_CHARGES = 1.25;
inline constexpr int FEW_REFERENCES = 8, FURTHER_ORDERS = 2;

inline constexpr double LEAST_REACH = 2.0, LONGEST_REACH = 100.0, REACH_GROWTH = 3.0;
inline constexpr double REACH_CUT = 0.1, REACH_SAFETY = 0.8;
inline constexpr double MODEL_ERROR = 0.005, MODEL_SHARE = 0.1, MODEL_STEP = 1.0;
inline constexpr double MODEL_SHORT_STEP = 0.1, NEAR_BALANCE = 0.05, FORCES_FELL = 8.0;
inline constexpr double LONG_CLOSING = 0.45, RUNNING_ENDS = 0.01, RUNNING_LENGTH = 0.5;
inline constexpr double RUNNING = 0.01, FOLLOWING = 0.2, LONGEST_STEP = 0.05;
inline constexpr double RAN = 0.05, HELD_BACK = 0.03;
inline constexpr double SHORTEST_REACH = 0.1, FAINT_SADDLE = 0.01;
inline constexpr double SLOWEST = 0.01, RATE_GROWTH = 4.0, FURTHEST_FOLLOWING = 5.0;
inline constexpr int MODEL_STEPS = 200, TIME_TRIES = 20;

inline constexpr double PREDICTION_TRUSTED = 4.0, CUBIC_TRUSTED = 5.0, LEADING_SHARE = 0.2;
inline constexpr double CUBIC_OF_OTHERS_TRUSTED = 1.5;
inline constexpr int PREDICTOR_ITERATIONS = 60;

inline constexpr double ENERGY_NODES = 3.0, SHAPE_NODES = 6.0;
inline constexpr double MINIMUM_IS_LOW = 0.1, MINIMUM_DOUBT = 3.0, NO_CURVATURE = 1e-100;
inline constexpr double COMPARABLE = 0.3, CLOSING_SAFETY = 1.5, CLEARANCE_LEFT = 0.3;
inline constexpr double NO_MINIMUM_WITHIN = 0.12;
inline constexpr int FEWEST_SINE_NODES = 64, MINIMUM_REFINEMENTS = 3;

}  // namespace adhesis
