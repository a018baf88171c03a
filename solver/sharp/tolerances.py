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

# ---------------------------------------------------------------- nucleation

# ---------------------------------------------------------------- continuation of a branch

# ---------------------------------------------------------------- error of the loss
