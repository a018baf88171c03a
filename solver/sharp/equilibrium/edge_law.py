"""The law by which edges move, and the lengths of one problem."""

from __future__ import annotations

from typing import NamedTuple


class EdgeLaw(NamedTuple):
    """Law by which the edges move, with the tolerances of one problem; lengths in θ.

    Attributes
    ----------
    critical : float
        Critical opening on a flat piece.
    newton_tolerance : float
        A correction this small ends Newton's iteration.
    field_error : float
        Largest displacement of an equilibrium by the error of the field; no less than
        ``newton_tolerance``.
    rest_step : float
        A descent whose steps are shorter than this is left to Newton's iteration.
    longest_step : float
        Longest short step of an edge in a descent.
    smallest : float
        Narrower patches and gaps are removed.
    overlap_limit : float
        An opening this far below zero is an overlap that descent cannot weigh.
    force_error : float
        A force C_c² - C² this small is that of rounding.
    origin : float
        θ of the highest crest.
    pinning : float
        sqrt(γ_open/γ) - 1, by which the critical opening of an edge that recedes is larger; 0 for
        one work of adhesion.
    """

    critical: float
    newton_tolerance: float
    field_error: float
    rest_step: float
    longest_step: float
    smallest: float
    overlap_limit: float
    force_error: float
    origin: float
    pinning: float
