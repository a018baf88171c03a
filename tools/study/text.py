"""How the tables of the study tell numbers."""

from __future__ import annotations

import numpy as np

from adhesis.ensemble.interval import interval
from tools.study.data import Array

Table = tuple[list[str], list[list[str]]]


def mean_text(values: Array, unit: float = 1.0) -> str:
    """Mean and half of its 95 % interval."""
    values = np.asarray(values) / unit
    low, high = (float(end) for end in interval(values))
    half = f" ± {(high - low) / 2:.2g}" if values.size > 1 else ""
    return f"{values.mean():.3g}{half}"


def ratio_text(above: Array, below: Array) -> str:
    """Ratio of two means of paired values, with Fieller's spirit: relative differences."""
    scale = below.mean()
    low, high = (float(end) for end in interval((above - below) / scale))
    return f"{100 * (above.mean() / scale - 1):+.0f} % ({100 * low:+.0f} … {100 * high:+.0f})"
