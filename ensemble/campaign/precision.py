"""When a cell has enough realisations: the rule of ``[stop]``, on complete batches alone.

Realisations are looked at after the first ones and after every batch. A cell has enough when, at
four looks in a row, half of Student's 95 % interval of the mean loss is narrower than wanted, over
at least :data:`LEAST` losses and at least 25 times their squared skewness.

A rule that stops as soon as an interval looks narrow stops when the spread happens to look small,
and its intervals cover the mean less often than they say (Anscombe 1953, J. R. Stat. Soc. B 15, 1;
Chow & Robbins 1965, Ann. Math. Stat. 36, 457: right only as the interval shrinks to nothing;
Singham & Schruben 2012, INFORMS J. Comput. 24, 624: by how much before). A least number and
several looks keep such luck small; 25 times the squared skewness is Cochran's bound (1977, Sampling
Techniques, 3rd ed., p. 42) for a mean to be normal enough for a 95 % interval.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

LEAST = 32
LOOKS_IN_A_ROW = 4
_OF_SKEWNESS = 25.0
_CONFIDENCE = 0.95

Array = NDArray[np.float64]


def looks(first: int, batch: int, most: int) -> list[int]:
    """Return the numbers of realisations at which a cell is looked at, ascending."""
    return sorted({*range(first, most, batch), most})


def half_width(losses: Array) -> float:
    """Half of Student's 95 % interval of the mean, over the mean; infinite below two losses."""
    n = losses.size
    if n < 2:
        return float("inf")
    mean, std = float(losses.mean()), float(losses.std(ddof=1))
    if std == 0:
        return 0.0
    if mean == 0:
        return float("inf")
    t = float(stdtrit(n - 1, 0.5 + _CONFIDENCE / 2))
    return float(t * std / np.sqrt(n) / abs(mean))


def narrow(losses: Array, relative_error: float) -> bool:
    """Whether one look finds the interval narrow enough, over enough losses."""
    n = losses.size
    if n < LEAST or half_width(losses) > relative_error:
        return False
    spread = losses - losses.mean()
    variance = float(np.mean(spread**2))
    if variance == 0:
        return True
    return n >= _OF_SKEWNESS * float(np.mean(spread**3)) ** 2 / variance**3


def enough(losses: Sequence[float], at: Sequence[int], relative_error: float) -> int | None:
    """Return after how many realisations a cell has enough, None if it has not yet.

    Parameters
    ----------
    losses : sequence of float
        By realisation, so many as are known without a gap; NaN where the task failed.
    at : sequence of int
        Where it is looked at (:func:`looks`).
    relative_error : float
        Wanted half-width of the interval, over the mean.
    """
    values = np.asarray(losses, np.float64)
    row = 0
    for count in at:
        if count > values.size:
            return None
        known = values[:count]
        row = row + 1 if narrow(known[np.isfinite(known)], relative_error) else 0
        if row == LOOKS_IN_A_ROW or count == at[-1]:
            return count
    return None
