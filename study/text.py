"""Texts of numbers in the tables of the study."""

from __future__ import annotations

import numpy as np

from adhesis.ensemble.campaign.precision import interval
from study.data import Array

Table = tuple[list[str], list[list[str]]]


FEWEST_OF_MEAN = 3  # loops: fewer have no interval that says anything


def mean_text(values: Array, unit: float = 1.0) -> str:
    """Mean and both ends of its 95 % interval; empty for one loop or two."""
    values = np.asarray(values) / unit
    if values.size < FEWEST_OF_MEAN:
        return ""
    low, high = (float(end) for end in interval(values))
    return f"{values.mean():.3g} ({low:.3g} … {high:.3g})"


def p_text(p: float, below: float = 1e-6) -> str:
    """Probability, or the least that can be resolved.

    Student's t holds for losses that are nearly normal only; far out its p means "very small".
    """
    return f"< {below:.0e}".replace("e-0", "e-") if p < below else f"{p:.2g}"


def p_equals(p: float) -> str:
    """The same as an equation."""
    text = p_text(p)
    return f"p {text}" if text.startswith("<") else f"p = {text}"


def change_text(mean: float, low: float, high: float) -> str:
    """Relative change in per cent with its interval."""
    return f"{100 * mean:+.0f} % ({100 * low:+.0f} … {100 * high:+.0f})"


def ratio_text(above: Array, below: Array) -> str:
    """Change from one column to another of the same realisations, over the mean of the first."""
    scale = below.mean()
    low, high = (float(end) for end in interval((above - below) / scale))
    return change_text(above.mean() / scale - 1, low, high)
