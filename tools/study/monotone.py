"""Is the loss monotone in the mean square slope? Neighbouring H on the same phases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import stdtr

from adhesis.ensemble.interval import interval
from tools.study.data import Array, Study, aligned

LEVEL = 0.05
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
    """From one H to the next lower one, so from one m2 to the next higher one.

    Attributes
    ----------
    hursts : (float, float)
        The higher H first: m2 ascends.
    slopes : (float, float)
        m2.
    difference, low, high : float
        Mean of the paired differences over the mean of both, and its 95 % interval.
    p_rise, p_fall : float
        One-sided error probabilities of saying that it rises or falls, Holm's correction in.
    n : int
    """

    hursts: tuple[float, float]
    slopes: tuple[float, float]
    difference: float
    low: float
    high: float
    p_rise: float
    p_fall: float
    n: int


@dataclass(frozen=True, eq=False)
class Row:
    """Losses over m2 at one γ and turning point."""

    gamma: float
    turn: float
    quantity: str
    steps: tuple[Step, ...]

    @property
    def verdict(self) -> str:
        """Rises, falls, is not monotone, or is open; as decided beforehand."""
        rises = [step.p_rise < LEVEL for step in self.steps]
        falls = [step.p_fall < LEVEL for step in self.steps]
        if any(rises) and any(falls):
            return "not monotone"
        if all(rises):
            return "rises"
        if all(falls):
            return "falls"
        return "open"


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
        slopes = series(study, gamma, turn, "m2")
        if len(first) > 1 and not set(first) <= set(many):
            yield row_of(gamma, turn, name, first, slopes)
        if len(many) > 1:
            yield row_of(gamma, turn, name, many, slopes)


AROUND = (0.9, 0.7, 0.5)  # H on both sides of where the sign of the change turns
NEW = ("fresh",)  # other phases than those that suggested it


def around(study: Study, name: str, campaigns: Sequence[str]) -> Row | None:
    """Two long steps at γ = 0.04 and Δ~max = 0.6; None if they were not computed."""
    losses = series(study, 0.04, 0.6, name, campaigns)
    if not set(AROUND) <= set(losses):
        return None
    slopes = series(study, 0.04, 0.6, "m2", campaigns)
    return row_of(0.04, 0.6, name, {hurst: losses[hurst] for hurst in AROUND}, slopes)


def row_of(
    gamma: float,
    turn: float,
    name: str,
    losses: dict[float, dict[int, float]],
    slopes: dict[float, dict[int, float]],
) -> Row:
    """One row: losses by H and realisation."""
    hursts = sorted(losses, reverse=True)
    pairs = [(a, b, aligned(losses[a], losses[b])) for a, b in pairwise(hursts)]
    raw = [_one_sided(both[1] - both[0]) for _, _, both in pairs]
    rise = _holm([p for p, _ in raw])
    fall = _holm([p for _, p in raw])
    steps = []
    for (a, b, both), up, down in zip(pairs, rise, fall, strict=True):
        scale = both.mean()
        relative = (both[1] - both[0]) / scale
        low, high = interval(relative)
        steps.append(
            Step(
                hursts=(a, b),
                slopes=(next(iter(slopes[a].values())), next(iter(slopes[b].values()))),
                difference=float(relative.mean()),
                low=float(low),
                high=float(high),
                p_rise=up,
                p_fall=down,
                n=both.shape[1],
            )
        )
    return Row(gamma, turn, name, tuple(steps))


def _one_sided(differences: Array) -> tuple[float, float]:
    """Error probabilities of a rise and of a fall, by Student's t."""
    n = differences.size
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
