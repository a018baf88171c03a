"""Loss against the amplitude of the profiles, at fixed H and γ; docs/study/plan.md.

A profile c times as high at γ has the W~ of the profile at γ/c². Every cell is therefore placed at
the height h = h_rms √(0.04/γ) of γ = 0.04 J/m², and its loss in J/m² is multiplied by 0.04/γ.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from adhesis.ensemble.interval import interval
from tools.study import monotone
from tools.study.data import Array, Rows, Study

GAMMA = 0.04
HURSTS, TURNS = (0.7, 0.8, 0.9), (0.6, 0.8, 0.9)
# The campaigns of the plan in which amplitudes differ, and those that were known before it.
NEW = ("amplitude", "amplitude_deep", "amplitude_large", "amplitude_largest")
KNOWN = ("cells", "cells001")
CHECK = "amplitude_same"
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


def vertex(heights: Array, losses: Array) -> tuple[float, float, bool]:
    """Return height and loss at the vertex of ln(loss) over ln(height), and if it is at an end."""
    k = int(np.argmax(losses))
    if k in (0, len(losses) - 1):
        return float(heights[k]), float(losses[k]), True
    x, y = np.log(heights[k - 1 : k + 2]), np.log(losses[k - 1 : k + 2])
    curve = np.polyfit(x - x[1], y, 2)
    place = -curve[1] / (2 * curve[0])
    return float(np.exp(x[1] + place)), float(np.exp(np.polyval(curve, place))), False


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
    found = [vertex(heights, means) for means in sums / counts]
    means = np.array([np.mean(list(one.values())) for one in losses.values()])
    height, loss, _ = vertex(heights, means)
    low, high = np.quantile([one[0] for one in found], [0.025, 0.975])
    loss_low, loss_high = np.quantile([one[1] for one in found], [0.025, 0.975])
    at_end = float(np.mean([one[2] for one in found]))
    return Maximum(
        *(height, float(low), float(high)),
        *(loss / GAMMA, float(loss_low) / GAMMA, float(loss_high) / GAMMA, at_end),
    )


def scaling(study: Study) -> Iterator[tuple[float, float, float, float, float, int]]:
    """Loops at an equivalent work of adhesion against those computed directly.

    Yields height, turning point, largest relative difference of W~, largest ratio of a difference
    to the sum of both estimated errors, largest such sum, and number of pairs.
    """
    check = study.loops.where(campaign=CHECK)
    heights = height_of(check["h_rms"], check["work_of_adhesion"])
    for height in sorted(set(heights.tolist())):
        for turn in TURNS:
            differences, ratios, errors = [], [], []
            keep = (heights == height) & np.isclose(check["max_penetration"], turn)
            for k in np.flatnonzero(keep).tolist():
                hurst, realisation = float(check["hurst"][k]), int(check["realisation"][k])
                direct = series(study, hurst, turn, "loss_dimensionless").get(height, {})
                error = series(study, hurst, turn, "loss_error").get(height, {})
                loss = series(study, hurst, turn, "loss").get(height, {})
                if realisation not in direct:
                    continue
                here = check["loss_error"][k] / check["loss"][k]
                both = here + error[realisation] / loss[realisation]
                difference = abs(direct[realisation] / check["loss_dimensionless"][k] - 1)
                differences.append(difference)
                errors.append(both)
                ratios.append(difference / both)
            if differences:
                yield height, turn, max(differences), max(ratios), max(errors), len(differences)


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
