"""Distributions of the jumps: power laws by maximum likelihood.

Clauset, Shalizi & Newman, SIAM Review 51, 661 (2009): the exponent is the maximum of the likelihood
above x_min, and x_min is where the distance of Kolmogorov and Smirnov between the two is smallest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_ndtr

from study.data import Array, Rows

FEWEST = 50  # jumps above x_min
# Decades below the largest jump over which a power law with a cut-off is fitted.
ENERGY_DECADES, AREA_DECADES = 4.0, 2.5
CANDIDATES = 60
RESAMPLES, SEED = 100, 7


@dataclass(frozen=True)
class PowerLaw:
    """p(x) ∝ x^-exponent from ``smallest`` to the largest value seen.

    Attributes
    ----------
    exponent, low, high : float
        With the 95 % interval by resampling of realisations.
    smallest, largest : float
        Its range; ``largest`` is the largest jump.
    n, of : int
        Jumps in that range, and all.
    distance : float
        Of Kolmogorov and Smirnov.
    p : float
        Probability of a distance as large from the law itself, by simulation.
    against_lognormal : float
        Normalised log-likelihood ratio (Vuong); below -2 the lognormal tail is the better one.
    """

    exponent: float
    low: float
    high: float
    smallest: float
    largest: float
    n: int
    of: int
    distance: float
    p: float
    against_lognormal: float

    @property
    def decades(self) -> float:
        """Decades of its range."""
        return float(np.log10(self.largest / self.smallest))


def fit(values: Array) -> tuple[float, float, float]:
    """Return exponent, x_min and distance."""
    values = np.sort(values[values > 0])
    top = values.size - FEWEST
    places = np.unique(np.linspace(0, max(top, 0), CANDIDATES).astype(int))
    best = (np.nan, values[0], np.inf)
    logs = np.log(values)
    for place in places.tolist():
        tail = logs[place:] - logs[place]
        exponent = 1 + tail.size / np.sum(tail)
        distance = _distance(tail, exponent)
        if distance < best[2]:
            best = (float(exponent), float(values[place]), distance)
    return best


def _distance(logs: Array, exponent: float) -> float:
    """Distance of Kolmogorov and Smirnov of sorted ln(x/x_min) from the law."""
    n = logs.size
    above = np.arange(1, n + 1) / n + np.expm1((1 - exponent) * logs)
    return float(max(above.max(), 1 / n - above.min()))


def power_law(rows: Rows, name: str) -> PowerLaw:
    """Fit a column of jumps (its size), with intervals over realisations of all H."""
    values = np.abs(rows[name])
    values = values[values > 0]
    exponent, smallest, distance = fit(values)
    rng = np.random.default_rng(SEED)
    groups = [
        np.abs(rows.where(hurst=h, realisation=r)[name])
        for h in rows.values("hurst")
        for r in rows.where(hurst=h).values("realisation")
    ]
    groups = [group[group > 0] for group in groups]
    drawn = [
        fit(np.concatenate([groups[k] for k in rng.integers(len(groups), size=len(groups))]))[0]
        for _ in range(RESAMPLES)
    ]
    low, high = np.quantile(drawn, [0.025, 0.975])
    tail = values[values >= smallest]
    below = values[values < smallest]
    share = tail.size / values.size
    worse = 0
    for _ in range(RESAMPLES):
        count = rng.binomial(values.size, share)
        made = smallest * rng.random(count) ** (1 / (1 - exponent))
        rest = rng.choice(below, values.size - count) if below.size else np.empty(0)
        worse += fit(np.concatenate([rest, made]))[2] >= distance
    return PowerLaw(
        exponent=exponent,
        low=float(low),
        high=float(high),
        smallest=smallest,
        largest=float(values.max()),
        n=int(tail.size),
        of=int(values.size),
        distance=distance,
        p=worse / RESAMPLES,
        against_lognormal=_against_lognormal(tail, exponent),
    )


@dataclass(frozen=True)
class CutPowerLaw:
    """p(x) ∝ x^-exponent exp(-x/cut) above ``smallest``, by maximum likelihood.

    Attributes
    ----------
    exponent, low, high : float
        With the 95 % interval by resampling of realisations.
    cut : float
    smallest : float
    n, of : int
        Jumps above ``smallest``, and all.
    distance : float
        Of Kolmogorov and Smirnov.
    drawn : array, shape (resamples, 2)
        Exponent and cut of each resample.
    """

    exponent: float
    low: float
    high: float
    cut: float
    smallest: float
    n: int
    of: int
    distance: float
    drawn: Array


_NODES = 400


def _grid(smallest: float, cut: float, exponent: float) -> tuple[Array, Array]:
    """Places from ``smallest`` to far beyond the cut, and the law's density dx at them."""
    logs = np.linspace(np.log(smallest), np.log(60 * cut + smallest), _NODES)
    x = np.exp(logs)
    density = (logs[1] - logs[0]) * np.exp((1 - exponent) * logs - x / cut)
    density[[0, -1]] *= 0.5
    return x, density


def fit_cut(tail: Array, smallest: float) -> tuple[float, float]:
    """Return exponent and cut of the values above ``smallest``."""
    sum_logs, total = float(np.sum(np.log(tail))), float(np.sum(tail))

    def negative(parameters: Array) -> float:
        exponent, cut = float(parameters[0]), float(np.exp(parameters[1]))
        whole = np.log(np.sum(_grid(smallest, cut, exponent)[1]))
        return float(exponent * sum_logs + total / cut + tail.size * whole)

    best = minimize(negative, np.array([1.2, np.log(tail.max() / 3)]), method="Nelder-Mead")
    return float(best.x[0]), float(np.exp(best.x[1]))


def cut_power_law(rows: Rows, name: str, decades: float) -> CutPowerLaw:
    """Fit a column of jumps over so many decades below the largest one."""
    values = np.sort(np.abs(rows[name]))
    smallest = float(values[-1] / 10**decades)
    tail = values[values >= smallest]
    exponent, cut = fit_cut(tail, smallest)
    groups = [
        np.abs(rows.where(hurst=h, realisation=r)[name])
        for h in rows.values("hurst")
        for r in rows.where(hurst=h).values("realisation")
    ]
    groups = [group[group >= smallest] for group in groups]
    rng = np.random.default_rng(SEED)
    drawn = [
        fit_cut(
            np.concatenate([groups[k] for k in rng.integers(len(groups), size=len(groups))]),
            smallest,
        )
        for _ in range(RESAMPLES)
    ]
    low, high = np.quantile([a for a, _ in drawn], [0.025, 0.975])
    law = 1 - share_above(tail, smallest, exponent, cut)
    n = tail.size
    distance = max((np.arange(1, n + 1) / n - law).max(), (law - np.arange(n) / n).max())
    return CutPowerLaw(
        *(exponent, float(low), float(high), cut, smallest, n, values.size, float(distance)),
        np.array(drawn),
    )


def share_above(x: Array, smallest: float, exponent: float, cut: float) -> Array:
    """Share of the jumps above ``smallest`` that are larger than ``x``, by the law."""
    places, density = _grid(smallest, cut, exponent)
    below = np.interp(x, places, (np.cumsum(density) - 0.5 * density) / density.sum())
    return np.asarray(1 - below)


def _against_lognormal(tail: Array, exponent: float) -> float:
    """Normalised log-likelihood ratio of the power law over a lognormal cut at x_min."""
    logs = np.log(tail)
    start = logs.min()
    power = np.log((exponent - 1) / tail[0 : tail.size].min()) - exponent * (logs - start)

    def density(parameters: Array) -> Array:
        mean, spread = parameters[0], np.exp(parameters[1])
        above = log_ndtr((mean - start) / spread)
        normal = -0.5 * (((logs - mean) / spread) ** 2 + np.log(2 * np.pi))
        return np.asarray(normal - np.log(spread) - logs - above)

    first = np.array([logs.mean(), np.log(logs.std())])
    best = minimize(lambda p: -np.sum(density(p)), first, method="Nelder-Mead")
    difference = power - density(best.x)
    return float(difference.sum() / (np.sqrt(tail.size) * difference.std()))
