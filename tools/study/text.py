"""Texts of numbers in the tables of the study."""

from __future__ import annotations

import numpy as np

from adhesis.ensemble.interval import interval
from tools.study.data import Array

Table = tuple[list[str], list[list[str]]]


def mean_text(values: Array, unit: float = 1.0) -> str:
    """Mean and both ends of its 95 % interval."""
    values = np.asarray(values) / unit
    low, high = (float(end) for end in interval(values))
    ends = f" ({low:.3g} … {high:.3g})" if values.size > 1 else ""
    return f"{values.mean():.3g}{ends}"


def p_text(p: float, below: float = 1e-5) -> str:
    """Probability, with the least one that the method can give."""
    return f"< {below:.0e}".replace("e-0", "e-") if p < below else f"{p:.2g}"


def change_text(mean: float, low: float, high: float) -> str:
    """Relative change in per cent with its interval."""
    return f"{100 * mean:+.0f} % ({100 * low:+.0f} … {100 * high:+.0f})"


def ratio_text(above: Array, below: Array) -> str:
    """Change from one column to another of the same realisations, over the mean of the first."""
    scale = below.mean()
    low, high = (float(end) for end in interval((above - below) / scale))
    return change_text(above.mean() / scale - 1, low, high)
