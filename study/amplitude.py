"""Loss against the amplitude of the profiles, at fixed H and γ; study/plan.md.

A profile c times as high at γ has the W~ of the profile at γ/c², exactly if adhesion acted on the
flat length. It acts on sqrt(1 + h'²), so that W~ differs by the order of m2/2. Every cell is placed
at the height h = h_rms √(0.04/γ) of γ = 0.04 J/m², and its loss in J/m² is multiplied by 0.04/γ.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.precision import interval
from study import monotone
from study.data import Array, Rows, Study

GAMMA = 0.04
HURSTS, TURNS = (0.7, 0.8, 0.9), (0.6, 0.8, 0.9)
# The campaigns of the plan in which amplitudes differ, and those that were known before it.
NEW = ("amplitude", "amplitude_deep", "amplitude_large", "amplitude_largest")
KNOWN = ("cells", "cells001")
# Loops at another γ, compared with those of NEW at the same height.
CHECKS = ("amplitude_same", "weak")
# Height of h_rms = 1 µm at the paper's three γ.
OF_PAPER = {0.01: 2.0, 0.04: 1.0, 0.07: 0.7559}
RESAMPLES, SEED = 2000, 1511
Series = dict[float, dict[int, float]]


def height_of(h_rms: Array, gamma: Array) -> Array:
    """Height h in µm of the same W~ at γ = 0.04 J/m²."""
    return np.round(1e6 * np.asarray(h_rms) * np.sqrt(GAMMA / np.asarray(gamma)), 4)


@cache
def _cells(study: Study, hurst: float, turn: float) -> dict[tuple[str, float], Rows]:
    """Rows of one H and turning point by campaign and height, campaigns of the plan first."""
    found = {}
    for campaign in (*NEW, *KNOWN):
        rows = study.loops.where(campaign=campaign, hurst=hurst, max_penetration=turn)
        heights = height_of(rows["h_rms"], rows["work_of_adhesion"])
        for height in sorted(set(heights.tolist())):
            keep = heights == height
            found[campaign, height] = Rows({n: c[keep] for n, c in rows.columns.items()})
    return found


def series(study: Study, hurst: float, turn: float, name: str) -> Series:
    """A column by height and realisation; heights ascending. ``share`` is the small-scale share."""
    found: Series = {}
    for (_, height), rows in _cells(study, hurst, turn).items():
        if name == "share":
            values = rows["loss_small_scale"] / rows["loss"]
        elif name in ("loss", "loss_error"):
            values = rows[name] * GAMMA / rows["work_of_adhesion"]
        elif name == "m2":
            values = rows["m2"] * GAMMA / rows["work_of_adhesion"]
        else:
            values = rows[name]
        known = np.isfinite(values)
        if known.any():
            realisations = rows["realisation"][known].astype(int).tolist()
            here = dict(zip(realisations, values[known].tolist(), strict=True))
            found[height] = {**here, **found.get(height, {})}
    return {height: found[height] for height in sorted(found)}


def rows(study: Study, name: str) -> Iterator[tuple[float, monotone.Row]]:
    """Steps along the amplitude for each H and turning point: (H, row)."""
    for hurst in HURSTS:
        for turn in TURNS:
            losses = series(study, hurst, turn, name)
            if len(losses) > 2:
                row = monotone.Row(GAMMA, turn, name, monotone.steps_of(losses))
                yield hurst, row


def rows_along_hurst(study: Study, name: str) -> Iterator[tuple[float, monotone.Row]]:
    """Steps along H for each amplitude and turning point: (height, row)."""
    for turn in TURNS:
        by_hurst = {hurst: series(study, hurst, turn, name) for hurst in HURSTS}
        shared = set.intersection(*(set(one) for one in by_hurst.values()))
        for height in sorted(shared):
            losses = {hurst: by_hurst[hurst][height] for hurst in HURSTS}
            yield height, monotone.row_of(GAMMA, turn, name, losses)


@dataclass(frozen=True)
class Maximum:
    """Where the mean loss in J/m² is largest along the amplitude, at γ = 0.04 J/m².

    Attributes
    ----------
    height, low, high : float
        h in µm with its 95 % interval.
    loss, loss_low, loss_high : float
        Loss at the vertex over γ, with its interval.
    at_end : float
        Share of the resamples whose largest mean is at an end of the range.
    """

    height: float
    low: float
    high: float
    loss: float
    loss_low: float
    loss_high: float
    at_end: float


def vertices(heights: Array, losses: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Locate the vertex of ln(loss) over ln(height) at the largest loss of each row.

    Returns height, loss, and whether the largest loss is at an end, where the vertex is that end.
    """
    place = np.argmax(losses, axis=1)
    at_end = (place == 0) | (place == heights.size - 1)
    middle = np.clip(place, 1, heights.size - 2)
    each = np.arange(len(losses))
    x, y = np.log(heights), np.log(losses)
    before, after = x[middle] - x[middle - 1], x[middle + 1] - x[middle]
    rise = (y[each, middle] - y[each, middle - 1]) / before
    fall = (y[each, middle + 1] - y[each, middle]) / after
    curvature = (fall - rise) / (before + after)
    slope = (rise * after + fall * before) / (before + after)
    curved = np.where(at_end, -1.0, curvature)
    aside = np.where(at_end, 0.0, -slope / (2 * curved))
    top = np.where(at_end, y[each, place], y[each, middle] + slope * aside / 2)
    return np.exp(np.where(at_end, x[place], x[middle] + aside)), np.exp(top), at_end


@cache
def maximum(study: Study, hurst: float, turn: float) -> Maximum | None:
    """Locate the maximum, with an interval by resampling realisations.

    A realisation is drawn with all its heights, among those that have the same heights.
    """
    losses = series(study, hurst, turn, "loss")
    if len(losses) < 3:
        return None
    heights = np.array(list(losses))
    groups: dict[tuple[bool, ...], list[int]] = {}
    for realisation in sorted(set().union(*losses.values())):
        held = tuple(realisation in one for one in losses.values())
        groups.setdefault(held, []).append(realisation)
    counts = np.array([len(one) for one in losses.values()])
    rng = np.random.default_rng(SEED)
    sums = np.zeros((RESAMPLES, heights.size))
    for held, members in groups.items():
        table = np.array([[one.get(r, 0.0) for one in losses.values()] for r in members])
        drawn = rng.multinomial(len(members), np.full(len(members), 1 / len(members)), RESAMPLES)
        sums += (drawn @ table) * np.array(held)
    means = np.array([[np.mean(list(one.values())) for one in losses.values()]])
    height, loss, _ = (float(one[0]) for one in vertices(heights, means))
    places, tops, ends = vertices(heights, sums / counts)
    low, high = np.quantile(places, [0.025, 0.975])
    loss_low, loss_high = np.quantile(tops, [0.025, 0.975])
    at_end = float(np.mean(ends))
    return Maximum(
        *(height, float(low), float(high)),
        *(loss / GAMMA, float(loss_low) / GAMMA, float(loss_high) / GAMMA, at_end),
    )


@dataclass(frozen=True)
class Comparison:
    """Loops at one γ against those of higher or lower profiles at γ = 0.04 J/m².

    Attributes
    ----------
    height, gamma, turn : float
    pairs : int
    slope : float
        Half of the largest difference of m2 between the two.
    mean, low, high, largest : float
        Relative difference of W~, the higher γ over the lower one: its mean with the 95 % interval
        (NaN of a single pair) and its largest size.
    error : float
        Largest sum of both estimated relative errors.
    """

    height: float
    gamma: float
    turn: float
    pairs: int
    slope: float
    mean: float
    low: float
    high: float
    largest: float
    error: float


def scaling(study: Study) -> Iterator[Comparison]:
    """Check the law of scaling loop by loop."""
    for campaign in CHECKS:
        rows = study.loops.where(campaign=campaign)
        for gamma in rows.values("work_of_adhesion"):
            for turn in TURNS:
                here = rows.where(work_of_adhesion=gamma, max_penetration=turn)
                if len(here):
                    found = _compare(study, gamma, turn, here)
                    if found is not None:
                        yield found


def _compare(study: Study, gamma: float, turn: float, here: Rows) -> Comparison | None:
    height = float(height_of(here["h_rms"], here["work_of_adhesion"])[0])
    differences, errors, slopes = [], [], []
    for k in range(len(here)):
        hurst, realisation = float(here["hurst"][k]), int(here["realisation"][k])
        direct = {}
        for campaign in NEW:
            rows = _cells(study, hurst, turn).get((campaign, height))
            if rows is not None:
                direct = {int(r): i for i, r in enumerate(rows["realisation"])}
                break
        if rows is None or realisation not in direct:
            continue
        one = {n: rows[n][direct[realisation]] for n in rows.columns}
        other = {n: here[n][k] for n in here.columns}
        ratio = one["loss_dimensionless"] / other["loss_dimensionless"]
        differences.append(ratio - 1 if gamma < GAMMA else 1 / ratio - 1)
        slopes.append(abs(one["m2"] - other["m2"]) / 2)
        errors.append(sum(r["loss_error"] / r["loss"] for r in (one, other)))
    if not differences:
        return None
    values = np.array(differences)
    ends = interval(values) if values.size > 1 else (np.nan, np.nan)
    return Comparison(
        *(height, gamma, turn, values.size, float(max(slopes))),
        *(float(values.mean()), float(ends[0]), float(ends[1])),
        *(float(np.abs(values).max()), float(max(errors))),
    )


def largest_error(study: Study) -> float:
    """Mean estimated error over half the interval of the mean loss, largest of all cells."""
    found = 0.0
    for hurst in HURSTS:
        for turn in TURNS:
            errors = series(study, hurst, turn, "loss_error")
            for height, losses in series(study, hurst, turn, "loss").items():
                if len(losses) > 1:
                    low, high = interval(np.array(list(losses.values())))
                    error = np.mean(list(errors[height].values()))
                    found = max(found, float(error / ((high - low) / 2)))
    return found
