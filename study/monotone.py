"""Paired differences of a loss along a parameter, and whether it is monotone.

Along H the parameter is the mean square slope, with the same phases at every H.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import stdtr

from adhesis.ensemble.campaign.precision import interval
from study.data import Array, Study, aligned

# Error probability of a step in one direction. The plan said 0.05; both directions are looked at.
LEVEL = 0.025
# The campaigns that were decided on first, and those of two hundred realisations beside them.
FIRST = ("turns", "slope", "between", "weak")
HUNDREDS = ("cells", "wide", "cells001")
QUANTITIES = ("loss_dimensionless", "loss")
# (γ, turning point, quantity)
ROWS = (
    *((0.04, turn, name) for turn in (0.6, 0.8) for name in QUANTITIES),
    *((0.07, turn, name) for turn in (0.6, 0.8) for name in QUANTITIES),
    *((0.025, turn, name) for turn in (0.6, 0.8) for name in QUANTITIES),
    *((0.01, turn, name) for turn in (0.6, 0.8) for name in QUANTITIES),
)


@dataclass(frozen=True, eq=False)
class Step:
    """From one value of a parameter to the next, by paired differences.

    Attributes
    ----------
    ends : (float, float)
        Values of the parameter.
    difference, low, high : float
        Mean of the differences over the mean of both, and its 95 % interval.
    p_rise, p_fall : float
        One-sided error probabilities of a rise and of a fall, with Holm's correction over the row.
    n : int
        Realisations that both have.
    """

    ends: tuple[float, float]
    difference: float
    low: float
    high: float
    p_rise: float
    p_fall: float
    n: int

    @property
    def p(self) -> float:
        """Two-sided error probability: twice the smaller one."""
        return min(1.0, 2 * min(self.p_rise, self.p_fall))


@dataclass(frozen=True, eq=False)
class Row:
    """Steps of one loss at one γ and turning point."""

    gamma: float
    turn: float
    quantity: str
    steps: tuple[Step, ...]

    @property
    def verdict(self) -> str:
        """One of rises, falls, not monotone, open."""
        return self.verdict_at(LEVEL)

    def verdict_at(self, level: float) -> str:
        """Verdict at a one-sided error probability."""
        rises = [step.p_rise < level for step in self.steps]
        falls = [step.p_fall < level for step in self.steps]
        if any(rises) and any(falls):
            return "not monotone"
        if all(rises):
            return "rises"
        if all(falls):
            return "falls"
        return "open"

    @property
    def p_not_monotone(self) -> float:
        """Error probability of "not monotone": the less certain of a rise and a fall, two-sided."""
        rise = min(step.p_rise for step in self.steps)
        fall = min(step.p_fall for step in self.steps)
        return min(1.0, 2 * max(rise, fall))

    @property
    def p_monotone(self) -> float:
        """Error probability of "monotone": the least certain step of the better sign, two-sided."""
        rise = max(step.p_rise for step in self.steps)
        fall = max(step.p_fall for step in self.steps)
        return min(1.0, 2 * min(rise, fall))


def series(
    study: Study,
    gamma: float,
    turn: float,
    name: str,
    campaigns: Sequence[str] = (*FIRST, *HUNDREDS),
) -> dict[float, dict[int, float]]:
    """A column by H, each by realisation."""
    place = {"work_of_adhesion": gamma, "max_penetration": turn}
    hursts = study.loops.where(**place).values("hurst")
    found = {hurst: study.joined(name, campaigns, hurst=hurst, **place) for hurst in hursts}
    return {hurst: losses for hurst, losses in found.items() if losses}


def rows(study: Study) -> Iterator[Row]:
    """Every row that has been computed: all H, and those of hundreds of realisations."""
    for gamma, turn, name in ROWS:
        first = series(study, gamma, turn, name, FIRST)
        many = series(study, gamma, turn, name, HUNDREDS)
        if len(first) > 1 and not set(first) <= set(many):
            yield row_of(gamma, turn, name, first)
        if len(many) > 1:
            yield row_of(gamma, turn, name, many)


AROUND = (0.9, 0.7, 0.5)  # H on both sides of where the sign of the change turns
NEW = ("fresh",)  # other phases than those that suggested it


def around(study: Study, name: str, campaigns: Sequence[str]) -> Row | None:
    """Two long steps at γ = 0.04 and Δ~max = 0.6; None if they were not computed."""
    losses = series(study, 0.04, 0.6, name, campaigns)
    if not set(AROUND) <= set(losses):
        return None
    return row_of(0.04, 0.6, name, {hurst: losses[hurst] for hurst in AROUND})


def row_of(gamma: float, turn: float, name: str, losses: dict[float, dict[int, float]]) -> Row:
    """One row along H: losses by H and realisation, m2 ascending."""
    return Row(gamma, turn, name, steps_of({h: losses[h] for h in sorted(losses, reverse=True)}))


def steps_of(losses: dict[float, dict[int, float]]) -> tuple[Step, ...]:
    """Steps between neighbours of a series, in its order, each a column by realisation."""
    pairs = [(a, b, aligned(losses[a], losses[b])) for a, b in pairwise(losses)]
    raw = [_one_sided(both[1] - both[0]) for _, _, both in pairs]
    rise = _holm([p for p, _ in raw])
    fall = _holm([p for _, p in raw])
    steps = []
    for (a, b, both), up, down in zip(pairs, rise, fall, strict=True):
        relative = (both[1] - both[0]) / both.mean()
        low, high = (float(end) for end in interval(relative))
        mean = float(relative.mean())
        steps.append(Step((a, b), mean, low, high, up, down, both.shape[1]))
    return tuple(steps)


def _one_sided(differences: Array) -> tuple[float, float]:
    """Error probabilities of a rise and of a fall, by Student's t."""
    n = differences.size
    if np.ptp(differences) == 0:
        mean = float(differences.mean())
        return (0.0 if mean > 0 else 1.0), (0.0 if mean < 0 else 1.0)
    t = differences.mean() / (differences.std(ddof=1) / np.sqrt(n))
    return float(stdtr(n - 1, -t)), float(stdtr(n - 1, t))


def _holm(probabilities: list[float]) -> list[float]:
    """Holm's correction for several probabilities."""
    order = np.argsort(probabilities)
    found, largest = [0.0] * len(probabilities), 0.0
    for place, k in enumerate(order.tolist()):
        largest = max(largest, min(1.0, (len(probabilities) - place) * probabilities[k]))
        found[k] = largest
    return found
