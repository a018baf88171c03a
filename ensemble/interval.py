"""The 95 % interval of a mean: the one that tables print and that ``[stop]`` goes by.

For ten values or more it reaches as far on each side as the further of Student's interval and
Hall's transformation of it, for fewer it is Student's: docs/theory.md, "Interval", says why, with
the measured coverage of all three. Nothing is drawn at random: a run with ``[stop]`` looks at its
intervals as it goes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

CONFIDENCE = 0.95
FEWEST_FOR_SKEWNESS = 10

Array = NDArray[np.float64]


def interval_method(n: int) -> str:
    """Return the method of the interval of ``n`` values: "transformed", "student" or "none"."""
    return "transformed" if n >= FEWEST_FOR_SKEWNESS else "student" if n >= 2 else "none"


def interval(values: ArrayLike) -> tuple[Array, Array]:
    """Return low and high ends of the interval of the mean over the last axis of finite values.

    NaN for fewer than two values; both the mean where all values are equal.
    """
    values = np.asarray(values, dtype=np.float64)
    n = values.shape[-1]
    if n < 2:
        nothing = np.full(values.shape[:-1], np.nan)
        return nothing, nothing.copy()
    mean = values.mean(axis=-1)
    away = values - mean[..., np.newaxis]
    square = np.mean(away * away, axis=-1)
    # Of equal values the spread is rounding, and its skewness anything.
    spread = np.max(np.abs(away), axis=-1) > 1e-14 * np.abs(mean)
    std = np.where(spread, np.sqrt(square * n / (n - 1)), 0.0)
    from scipy.special import stdtrit  # here: most commands have no use for it, and it takes long

    t = float(stdtrit(n - 1, 0.5 + CONFIDENCE / 2)) / np.sqrt(n)
    low, high = mean - std * t, mean + std * t
    if n < FEWEST_FOR_SKEWNESS:
        return low, high
    cube = np.mean(away * away * away, axis=-1)
    skewness = np.where(spread, cube, 0.0) / np.where(spread, square, 1.0) ** 1.5
    above, below = untransformed(t, skewness, n), untransformed(-t, skewness, n)
    return np.minimum(low, mean - std * above), np.maximum(high, mean - std * below)


def untransformed(x: float, skewness: Array, n: int) -> Array:
    """Return (mean - true mean)/std where Hall's cubic of it is ``x``.

    The cubic is w + g w²/3 + g² w³/27 + g/(6n), of skewness g: monotonic, and solved in closed form
    (Hall 1992, eq. 2.2).
    """
    g = np.where(np.abs(skewness) < 1e-6, 1e-6, skewness)
    solved: Array = 3 / g * (np.cbrt(1 + g * (x - g / (6 * n))) - 1)
    return solved


@dataclass(frozen=True)
class Estimate:
    """A mean over realisations and how well it is known; NaN where n is too small."""

    n: int  # realisations
    mean: float
    std: float  # standard deviation of one realisation (n - 1 in the denominator)
    sem: float  # standard error of the mean, std/sqrt(n)
    low: float  # and high: the interval of the mean at :data:`CONFIDENCE`
    high: float

    @property
    def relative_error(self) -> float:
        """Distance of the further end of the interval over the mean; infinite without one."""
        furthest = max(self.mean - self.low, self.high - self.mean)
        if furthest == 0:
            return 0.0
        known = bool(self.mean) and not np.isnan(furthest)
        return furthest / abs(self.mean) if known else float("inf")


def estimates(values: Array, with_interval: bool = True) -> list[Estimate]:
    """One :class:`Estimate` for each row of ``values``, shape (quantities, n)."""
    values = np.atleast_2d(np.asarray(values, dtype=float))
    count, n = values.shape
    nothing = np.full(count, np.nan)
    mean = values.mean(axis=1) if n else nothing
    std = values.std(axis=1, ddof=1) if n > 1 else nothing
    low, high = interval(values) if with_interval and n else (nothing, nothing)
    sem = std / np.sqrt(max(n, 1))
    return [Estimate(n, *map(float, row)) for row in zip(mean, std, sem, low, high, strict=True)]
