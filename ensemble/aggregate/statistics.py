"""Means over realisations and how well they are known.

The interval of a mean is scipy's bias-corrected and accelerated bootstrap (BCa; Efron 1987) at the
expanded level of Hesterberg (2015, Am. Stat. 69, 371, section 3.4.1). A plain bootstrap interval of
ten realisations is too narrow, because it resamples a spread that n values underestimate: it covers
the true mean in about 91 % of all ensembles instead of 95 %. The expanded level
1 - 2Φ(-sqrt(n/(n-1)) t) has the width of Student's interval for values with a normal distribution
and still follows the skewness of others. No bootstrap can leave the range of the values, which is
too narrow for fewer than five of them: those get Student's interval (docs/theory.md has the
measured coverage of both).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy import stats

from solver.profile import Array

CONFIDENCE = 0.95
RESAMPLES = 9999
SEED = 20151128  # any fixed number: the same file must give the same interval
FEWEST_FOR_BOOTSTRAP = 5

# Random numbers held at once by the bootstrap: bounds its memory to some 30 MB.
_BATCH = 2_000_000
# Random numbers drawn in all: thousands of realisations need fewer resamples, not hours.
_DRAWS = 20_000_000
_FEWEST_RESAMPLES = 999


def interval_method(n: int) -> str:
    """How the interval of ``n`` values is found: "bootstrap", "student" or "none"."""
    return "bootstrap" if n >= FEWEST_FOR_BOOTSTRAP else "student" if n >= 2 else "none"


@dataclass(frozen=True)
class Estimate:
    """A mean over realisations and how well it is known; NaN where n is too small.

    Attributes
    ----------
    n : int
        Realisations.
    mean, std : float
        Mean, and standard deviation of one realisation (n - 1 in the denominator; n ≥ 2).
    sem : float
        Standard error of the mean, std/sqrt(n); n ≥ 2.
    low, high : float
        Interval of the mean at :data:`CONFIDENCE`; n ≥ 2.
    """

    n: int
    mean: float
    std: float
    sem: float
    low: float
    high: float


def expanded_level(n: int, confidence: float = CONFIDENCE) -> float:
    """Level at which a bootstrap interval of ``n`` ≥ 2 values has the width of Student's."""
    t = float(stats.t.ppf(0.5 + confidence / 2, n - 1))
    return float(1 - 2 * stats.norm.cdf(-np.sqrt(n / (n - 1)) * t))


def interval(values: Array, confidence: float = CONFIDENCE) -> tuple[Array, Array]:
    """Interval of the mean over the last axis.

    Parameters
    ----------
    values : array, shape (…, n)
        Finite; the rows share their resamples.
    confidence : float

    Returns
    -------
    low, high : array, shape (…)
        NaN for n < 2; both the mean where all values are equal.
    """
    values = np.asarray(values, dtype=float)
    n = values.shape[-1]
    if n < 2:
        nothing = np.full(values.shape[:-1], np.nan)
        return nothing, nothing.copy()
    mean = values.mean(axis=-1)
    if n < FEWEST_FOR_BOOTSTRAP:
        half = stats.t.ppf(0.5 + confidence / 2, n - 1) * values.std(axis=-1, ddof=1) / np.sqrt(n)
        return mean - half, mean + half
    low, high = mean.copy(), mean.copy()
    # The acceleration of BCa is 0/0 for equal values; their mean is known exactly.
    spread = np.ptp(values, axis=-1) > 1e-14 * np.abs(mean)
    if not np.any(spread):
        return low, high
    sample = values[spread]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        found = stats.bootstrap(
            (sample,),
            np.mean,
            n_resamples=int(np.clip(_DRAWS // n, _FEWEST_RESAMPLES, RESAMPLES)),
            batch=max(1, _BATCH // sample.size),
            confidence_level=expanded_level(n, confidence),
            method="BCa",
            axis=-1,
            rng=np.random.default_rng(SEED),
        ).confidence_interval
    # At an extreme level BCa can fail to a NaN: what it stands for then is the range itself.
    low[spread] = np.where(np.isfinite(found.low), found.low, sample.min(axis=-1))
    high[spread] = np.where(np.isfinite(found.high), found.high, sample.max(axis=-1))
    return low, high


def estimates(values: Array, with_interval: bool = True) -> list[Estimate]:
    """One :class:`Estimate` for each row of ``values``, shape (quantities, n)."""
    values = np.atleast_2d(np.asarray(values, dtype=float))
    count, n = values.shape
    nothing = np.full(count, np.nan)
    mean = values.mean(axis=1) if n else nothing
    std = values.std(axis=1, ddof=1) if n > 1 else nothing
    low, high = interval(values) if with_interval and n else (nothing, nothing)
    return [
        Estimate(
            n=n,
            mean=float(mean[k]),
            std=float(std[k]),
            sem=float(std[k] / np.sqrt(n)) if n else float("nan"),
            low=float(low[k]),
            high=float(high[k]),
        )
        for k in range(count)
    ]
