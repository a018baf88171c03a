"""Tolerances of method ``sharp``: one table, with unit, reason and the measurement behind each.

Units: λ_min is the shortest wavelength of the profile, C_c the critical opening of an edge on a
flat piece, h_max the highest crest, d the prescribed quantity in the units of the field. Compiled
code reads these values when it is compiled.
"""

from __future__ import annotations

# ---------------------------------------------------------------- field of given edges

# ---------------------------------------------------------------- equilibrium of the edges

# ---------------------------------------------------------------- windows of few gaps among many

# ---------------------------------------------------------------- descent in energy

# Lengths are in longest steps of a running edge, 0.05 λ_min: unchecked steps above 0.1 λ_min
# leap over pinned minima. How often a length decides a loss: benchmarks/descent_steps.py.
UNCHECKED_ALONE = 2.0  # longest steps (0.1 λ_min); up to here a step of one edge that runs alone
# is not checked for a minimum, up to 1 that of several. The check is a cubic of the force.
LONGEST_STRIDE = 3.0  # longest steps (0.15 λ_min); checked steps of several edges
LONGEST_STRIDE_ALONE = 6.0  # longest steps (0.3 λ_min); checked steps of one edge. 0.45 λ_min leapt
# over a minimum in 3 of 12 loops of benchmarks/few_gaps.py; 0.3 missed less than unchecked 0.1.
RUNNING_LENGTH = 0.5  # longest steps; an edge that moves further runs
RUNNING_SHARE = 0.25  # of the longest motion; an edge that moves less does not run beside it
STANDING_SHARE = 0.01  # of its limit; while others run an edge that would move less stands, so that
# nodes, moments and kernels of its gap are kept
REUSES = 2  # steps; further ones of several edges with one tangent, which decides their direction
REUSES_ALONE = 8  # steps; of one edge, where the tangent decides the length of a step only
TURNING_SHARE = 0.2  # of the reach; an edge that would turn by so much asks for a new tangent
ENERGY_ROUNDING = 1e-3  # of the work done either way; a smaller rise of the energy is rounding
LEAST_STEP_SHARE = 0.02  # of the longest step; steps are not shortened below
TURNS = 8  # turns of one edge over a minimum that no check shows, after which steps become shorter
TURNS_FACTOR = 0.8  # by which they do at each further turn

# Step of the linear flow, in shares of an edge's limit.
FLOW_REACHED = 0.97  # a step that takes an edge so far is long enough
FLOW_AIM = 0.99  # the share that is aimed at
FLOW_TRIES = 60  # times τ at most; then the edge passes its limit within rounding of τ
FLOW_DECAYED = 36.0  # exponent; exp(-36) is rounding, the mode has come to rest
UNSTABLE_FORCE = 1e-3  # of the force; an unstable mode that is pulled by less is not followed: the
# pull is that of rounding or of the field's error, and would break a symmetry

# Step with equal speeds.
LEAST_PIVOT = 1e-9  # of the largest diagonal element; the matrix of free edges is singular below
SYMMETRIC_FORCE = 1e-6  # of the force; a softest mode that is pulled by less keeps its symmetry
LEADING_FORCE = 0.5  # of the largest force; an edge with more goes where its own force points
BOUND_SWEEPS = 200  # sweeps over the edges; where the active set returns to what it was
BOUND_SWEEPS_CHANGE = 1e-12  # of the limits; sweeps that change less are the last

# The way off a saddle.
EQUAL_MODES = 1e-3  # of the largest stiffness; modes that differ by less are equally soft
EQUAL_AMPLITUDES = 0.99  # of the largest; edges that move so far are equal, the first one leads
EQUAL_GAINS = 1e-3  # of the gain; two ways off that differ by less are equal

# Comparison with the trajectory of another descent.
ON_TRAJECTORY = 0.4  # longest steps (0.02 λ_min); edges this close are on it. Where paths race they
# part by far more: contact 0.32 and 0.60 in tests/solver/test_kinetics.py
COMPARISONS = 3  # in a row, after which a descent has rejoined the trajectory
FIELDS_PER_COMPARISON = 2  # fields from one comparison to the next
SEGMENT_MARGIN = 1.2  # of the longest stride; a longer segment lies between two descents
SEGMENT_SHARE = 0.25  # of an edge's distance from a point, in segments: further away is far

# Windows of many gaps.
WINDOW_HALF_WIDTH = 4  # gaps on each side of the edge that leads
WINDOW_WIDEST = 48  # gaps on each side, to which windows double while nothing moves in them
WINDOW_FIELDS = 60  # fields in a window before all gaps are solved again
FAR_FROM_BALANCE = 0.02  # C_c; above, the edge furthest from balance leads, below, Newton's step
FOLLOWING_SHARE = 0.2  # longest steps; an edge outside that its tangent moves further is held
NEWTON_STEPS_IN_A_ROW = 12  # of all edges, after which a window is opened though they are stable
LOCAL_WINDOW_MARGIN = 4  # gaps on each side of what changed, where a descent begins in a window
LOCAL_WINDOW_WIDEST = 24  # gaps; changes further apart are not those of one window
LOCAL_WINDOW_FIELDS = 300  # fields in it before all gaps are solved again

# ---------------------------------------------------------------- nucleation

# ---------------------------------------------------------------- continuation of a branch

# ---------------------------------------------------------------- error of the loss
