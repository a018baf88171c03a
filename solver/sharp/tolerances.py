"""Tolerances of method ``sharp``: one table, with unit, reason and the measurement behind each.

Units: λ_min is the shortest wavelength of the profile, C_c the critical opening of an edge on a
flat piece, h_max the highest crest, d the prescribed quantity in the units of the field. Compiled
code reads these values when it is compiled.
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

FORCE_SAMPLES = 16
"""Places along a step of a running edge at which its force, a cubic, is looked at for a zero."""

CUBIC_ERROR = 1 / 24
"""Error of that cubic in units of its twist (h³/6 of its third derivative): that of a wave over
almost half its length."""

FORCE_MARGIN = 0.02
"""Share of a force's range along a step below which it may be zero."""

ENERGY_NODES = 3.0
"""Sine nodes per λ_min for the energy: two resolve the shortest wave, the rest is margin."""

SHAPE_NODES = 6.0
"""Sine nodes per λ_min that bracket every local minimum of an opening."""

FEWEST_SINE_NODES = 64
"""Sine nodes of a gap beyond those by its length, for its ends."""

# ---------------------------------------------------------------- equilibrium of the edges

MOST_CORRECTIONS = 8
"""Corrections by Newton's iteration before an equilibrium counts as lost."""

NEWTON_SHARE = 0.01
"""Share of ``EdgeLaw.field_error`` (a length in θ) below which a correction ends the iteration: it
is small against the motion that the error of the field makes anyway."""

STALLED_SHARE = 0.3
"""Share of the last correction. One that is no smaller, and below ``EdgeLaw.field_error``, goes to
and fro across a step of the field, where panels or modes change: the iteration ends."""

NEWTON_GROWTH = 2.0
"""Share of the last correction that the next one may have, at most; else the iteration diverges."""

HIERARCHICAL_NEWTON_GROWTH = 0.7
"""The same for many gaps, where an iteration that hardly shrinks is given up early: of some 1,300
that came to a minimum one in a hundred had a correction half as large as the one before."""

KNOWN_TANGENT = 1e-3
"""Relative change of the tangent by a last correction below which it serves for the branch after
it."""

CLOSING_SHARE = 0.25
"""Share of a gap or patch by which one step of one edge may shorten it."""

SHORT_SPAN = 0.3
"""Share of the distance in d to an earlier point of a branch. A point nearer than that gives the
edges' earlier rates with too large an error."""

CHANGED_RATE = 0.3
"""Relative change of an edge's rate in a jump above which its earlier rate no longer counts."""

# ---------------------------------------------------------------- windows of few gaps among many

# ---------------------------------------------------------------- descent in energy

# ---------------------------------------------------------------- nucleation

# ---------------------------------------------------------------- continuation of a branch

# ---------------------------------------------------------------- error of the loss
