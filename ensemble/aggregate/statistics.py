"""Means over realisations and how well they are known (:mod:`adhesis.ensemble.interval`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adhesis.ensemble.interval import interval, relative_error
from adhesis.solver.model.profile import Array


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
        Interval of the mean at :data:`adhesis.ensemble.interval.CONFIDENCE`; n ≥ 2.
    """

    n: int
    mean: float
    std: float
    sem: float
    low: float
    high: float

    @property
    def relative_error(self) -> float:
        """Distance of the further end of the interval over the mean; infinite without one."""
        return relative_error(self.mean, self.low, self.high)


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
