"""When a cell has enough realisations: the rule of ``[stop]``, on complete batches alone.

Realisations are looked at after the first ones and after every batch. A cell has enough when, at
:data:`LOOKS_IN_A_ROW` looks in a row, the 95 % interval of the mean loss that the tables print
(:mod:`adhesis.ensemble.interval`) reaches no further from it than wanted, over at least
:data:`LEAST` losses.

A rule that stops as soon as an interval looks narrow stops when the spread happens to look small,
and its intervals cover the mean less often than they say (Anscombe 1953, J. R. Stat. Soc. B 15, 1;
Chow & Robbins 1965, Ann. Math. Stat. 36, 457: right only as the interval shrinks to nothing;
Glynn & Whitt 1992, Ann. Appl. Probab. 2, 180: unless early stops are kept out; Singham & Schruben
2012, INFORMS J. Comput. 24, 624: by how much before). A least number and several looks keep such
luck small, and an interval that follows the skewness is wide as soon as one loss of a tail is seen.
To wait until the sample's skewness is small would do harm: that picks the samples without a tail.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.interval import interval

LEAST = 32
LOOKS_IN_A_ROW = 4

Array = NDArray[np.float64]


def looks(first: int, batch: int, most: int) -> list[int]:
    """Return the numbers of realisations at which a cell is looked at, ascending."""
    return sorted({*range(first, most, batch), most})


def fewest(at: Sequence[int]) -> int:
    """Return the fewest realisations after which a cell can have enough, by its looks."""
    first = next((place for place, count in enumerate(at) if count >= LEAST), len(at) - 1)
    return at[min(first + LOOKS_IN_A_ROW, len(at)) - 1]


def relative_error(losses: Array) -> float:
    """How far the interval of the mean reaches from it, over the mean; infinite below two losses.

    Parameters
    ----------
    losses : array, shape (n,)
        In any unit.
    """
    if losses.size < 2:
        return float("inf")
    mean = float(losses.mean())
    low, high = interval(losses)
    furthest = max(mean - float(low), float(high) - mean)
    if furthest == 0:
        return 0.0
    return furthest / abs(mean) if mean else float("inf")


def narrow(losses: Array, wanted: float) -> bool:
    """Whether one look finds the interval narrow enough, over enough losses."""
    return losses.size >= LEAST and relative_error(losses) <= wanted


def enough(losses: Sequence[float] | Array, at: Sequence[int], wanted: float) -> int | None:
    """Return after how many realisations a cell has enough, None if it has not yet.

    Parameters
    ----------
    losses : sequence of float
        By realisation, so many as are known without a gap; NaN where the task failed.
    at : sequence of int
        Where it is looked at (:func:`looks`).
    wanted : float
        How far the interval may reach from the mean, over the mean.
    """
    values = np.asarray(losses, np.float64)
    row = 0
    for count in at:
        if count > values.size:
            return None
        known = values[:count]
        row = row + 1 if narrow(known[np.isfinite(known)], wanted) else 0
        if row == LOOKS_IN_A_ROW or count == at[-1]:
            return count
    return None
