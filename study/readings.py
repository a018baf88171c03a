"""Readings of the paper's Table 1, each held against its eight values; study/readings.md."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np

from adhesis.ensemble.report.paper import M2, TABLE_1
from study.data import Study, by_realisation
from study.measure import OF_PAPER, Reading, Sample

TURNS = (0.6, 0.7, 0.8, 0.9)
C0 = 1e-13
FEWEST = 6  # realisations of a cell that is held against the paper
BEYOND = 1.5  # works of adhesion are extrapolated by no larger factor
AT_100 = {0.01: ("weak", "cells001"), 0.025: ("between",)}
AT_200 = ("waves", "waves001")
RAYLEIGH = ("rayleigh", "rayleigh001")
CURVES = ("curves", "curves001")
STIFF = ("stiff", "stiff001")
STIFFNESSES, FAR_SIDES = (1e9, 3e9, 1e10), (0.4, 0.5, 0.6, 0.7, 0.8)
FAR_SIDES_COMPUTED = (0.4, 0.6, 0.8)
NANOMETRES = 0.993  # Δ~ of a separation of 20 nm
Series = dict[int, float]


class Losses:
    """W~ of the paper's profiles at any γ and height, from the works of adhesion computed."""

    def __init__(self, study: Study) -> None:
        self._study = study

    def direct(self, name: str, hurst: float, gamma: float, turn: float, ratio: int) -> Series:
        """A column at what was computed; empty if nothing was."""
        return self._study.joined(
            *(name, AT_200 if ratio == 200 else AT_100.get(gamma, ("turns", "cells"))),
            hurst=hurst,
            work_of_adhesion=gamma,
            max_penetration=turn,
        )

    def scaled(
        self, name: str, hurst: float, gamma: float, turn: float, ratio: int, square: float
    ) -> Series:
        """The same for profiles √square times as high: straight in ln W~ against ln γ.

        A profile c times as high has at γ the W~ of the profile at γ/c².
        """
        known = (0.01, 0.025, 0.04, 0.07)
        series = {g: self.direct(name, hurst, g, turn, ratio) for g in known}
        series = {g: one for g, one in series.items() if one}
        wanted = gamma / square
        gammas = sorted(series)
        if len(gammas) < 2 or not gammas[0] / BEYOND <= wanted <= gammas[-1] * BEYOND:
            return {}
        high = int(np.clip(np.searchsorted(gammas, wanted), 1, len(gammas) - 1))
        low, top = gammas[high - 1], gammas[high]
        share = np.log(wanted / low) / np.log(top / low)
        shared = set(series[low]) & set(series[top])
        return {
            r: float(np.exp((1 - share) * np.log(series[low][r]) + share * np.log(series[top][r])))
            for r in shared
            if series[low][r] > 0 and series[top][r] > 0
        }

    def along(self, hurst: float, gamma: float) -> dict[float, Series]:
        """W~ by turning point."""
        return self.column_along("loss_dimensionless", hurst, gamma)

    def column_along(self, name: str, hurst: float, gamma: float) -> dict[float, Series]:
        """A column by turning point, h_rms = 1 µm and q_max/q_min = 100."""
        rows = self._study.loops.where(
            campaign="weak" if gamma == 0.01 else "turns", hurst=hurst, work_of_adhesion=gamma
        )
        turns = rows.values("max_penetration")
        return {turn: self.direct(name, hurst, gamma, turn, 100) for turn in turns}


def _reading(name: str, of_cell: Callable[[float, float], Series]) -> Reading | None:
    """Join the cells of a reading."""
    found = {cell: of_cell(*cell) for cell in TABLE_1}
    found = {cell: series for cell, series in found.items() if len(series) >= FEWEST}
    if len(found) < 4:
        return None
    every = sorted(set().union(*found.values()))
    losses = np.array([[series.get(r, np.nan) for r in every] for series in found.values()])
    return Reading(name, Sample(tuple(found), losses))


def _square(study: Study, normalisation: str, hurst: float, ratio: int) -> float:
    """Squared factor of the heights against h_rms = 1 µm."""
    if normalisation == "h_rms":
        return 1.0
    if normalisation == "m2":
        campaign = "waves" if ratio == 200 else "turns"
        return M2[hurst] / float(study.loops.where(campaign=campaign, hurst=hurst)["m2"][0])
    powers = np.sum((np.arange(10, 10 * ratio + 1) / 10.0) ** -(2 * hurst + 1))
    return float(2 * C0 * powers / 1e-12)


@cache
def _height_factor(study: Study, heights: str, hurst: float, ratio: int) -> Series:
    """What W~ with own h_max is to be multiplied by, for each realisation."""
    h_max = Losses(study).direct("h_max", hurst, 0.04, 0.8, ratio)
    values = np.sort(np.array(list(h_max.values())))
    if heights == "own":
        return dict.fromkeys(h_max, 1.0)
    if heights == "mean":
        common = values.mean()
    else:  # mean of the largest of ten drawn
        share = (np.arange(len(values) + 1) / len(values)) ** OF_PAPER
        common = float(np.sum(values * np.diff(share)))
    return {r: float((h / common) ** 2) for r, h in h_max.items()}


NORMALISATIONS = (("h_rms", 100), ("m2", 100), ("C0", 100), ("h_rms", 200), ("m2", 200))


def readings(study: Study) -> Iterator[Reading]:
    """Every reading of the page, in its order."""
    losses = Losses(study)
    for normalisation, ratio in NORMALISATIONS:
        if ratio == 200 and not len(study.loops.where(campaign="waves")):
            continue
        turns = (
            (0.5, 0.6, 0.65, 0.7, 0.8, 0.9) if (normalisation, ratio) == ("h_rms", 100) else TURNS
        )
        for turn in turns:
            for part, column in (("", "loss_dimensionless"), (", Δ~ ≥ 0", "loss_curve_above")):
                for heights in ("own", "mean", "largest"):
                    name = f"{normalisation}, N = {ratio}, Δ~max = {turn:g}{part}"
                    name += "" if heights == "own" else f", {heights} h_max"

                    def of_cell(
                        hurst: float,
                        gamma: float,
                        normalisation: str = normalisation,
                        ratio: int = ratio,
                        turn: float = turn,
                        column: str = column,
                        heights: str = heights,
                    ) -> Series:
                        factor = _height_factor(study, heights, hurst, ratio)
                        if normalisation == "h_rms" and not (turn == 0.65 and gamma != 0.01):
                            found = losses.direct(column, hurst, gamma, turn, ratio)
                        elif normalisation == "h_rms":
                            found = _between(losses.column_along(column, hurst, gamma), turn)
                        else:
                            square = _square(study, normalisation, hurst, ratio)
                            found = losses.scaled(column, hurst, gamma, turn, ratio, square)
                        return {r: w * factor[r] for r, w in found.items() if r in factor}

                    reading = _reading(name, of_cell)
                    if reading is not None:
                        yield reading
    yield from _other_turning_points(study, losses)
    yield from _others(study)


def _between(along: dict[float, Series], turn: float) -> Series:
    """A series at a turning point between those computed, straight lines between them."""
    return at_turns(along, lambda r: turn)


def at_turns(
    along: dict[float, Series], turn_of: Callable[[int], float], beyond: float = 0.05
) -> Series:
    """W~ of each realisation at a turning point of its own, none further outside than ``beyond``.

    Straight lines between the turning points that were computed.
    """
    turns = sorted(along)
    if len(turns) < 2:
        return {}
    found: Series = {}
    for r in set.intersection(*(set(one) for one in along.values())):
        turn = turn_of(r)
        if not turns[0] - beyond <= turn <= turns[-1] + beyond:
            continue
        k = int(np.clip(np.searchsorted(turns, turn), 1, len(turns) - 1))
        share = (turn - turns[k - 1]) / (turns[k] - turns[k - 1])
        low, high = along[turns[k - 1]][r], along[turns[k]][r]
        found[r] = float((1 - share) * low + share * high)
    return found


def _other_turning_points(study: Study, losses: Losses) -> Iterator[Reading]:
    for s in (0.2e-6, 0.4e-6, 0.6e-6, 0.8e-6, 1.0e-6):

        def at_separation(hurst: float, gamma: float, s: float = s) -> Series:
            h_max = losses.direct("h_max", hurst, 0.04, 0.8, 100)
            return at_turns(losses.along(hurst, gamma), lambda r: 1 - s / h_max.get(r, np.nan))

        reading = _reading(f"common separation {1e6 * s:.1f} µm", at_separation)
        if reading is not None:
            yield reading
    for turn in TURNS:
        at = losses.direct("contact_at_turn", 0.8, 0.04, turn, 100)
        contact = float(np.mean(list(at.values()))) if at else np.nan

        def at_contact(hurst: float, gamma: float, contact: float = contact) -> Series:
            contacts = losses.column_along("contact_at_turn", hurst, gamma)
            turns = np.array(sorted(contacts))

            def turn_of(r: int) -> float:
                values = np.array([contacts[t].get(r, np.nan) for t in turns])
                inside = values[0] <= contact <= values[-1]
                return float(np.interp(contact, values, turns)) if inside else np.nan

            return at_turns(losses.along(hurst, gamma), turn_of)

        reading = _reading(f"common contact fraction {contact:.2f}", at_contact)
        if reading is not None:
            yield reading


def _others(study: Study) -> Iterator[Reading]:
    for turn in TURNS:

        def rayleigh(hurst: float, gamma: float, turn: float = turn) -> Series:
            return study.joined(
                *("loss_dimensionless", RAYLEIGH),
                hurst=hurst,
                work_of_adhesion=gamma,
                max_penetration=turn,
            )

        reading = _reading(f"Rayleigh amplitudes, Δ~max = {turn:g}", rayleigh)
        if reading is not None:
            yield reading

    def deepest(hurst: float, gamma: float) -> Series:
        if gamma == 0.01:
            return {}
        return Losses(study).direct("loss_dimensionless", hurst, gamma, 0.95, 100)

    reading = _reading("unloading from the deepest state, Δ~ = 0.95", deepest)
    if reading is not None:
        yield reading
    yield from _of_curves(study)
    yield from _of_machines(study)
    yield from _coarse(study)


def _of_curves(study: Study) -> Iterator[Reading]:
    columns = (("detached ones left out", "loss_in_contact", TURNS),
               ("20 nm", "loss_dimensionless", (NANOMETRES,)))  # fmt: skip
    for name, column, turns in columns:
        for turn in turns:

            def of_cell(
                hurst: float, gamma: float, column: str = column, turn: float = turn
            ) -> Series:
                return study.joined(
                    *(column, CURVES), hurst=hurst, work_of_adhesion=gamma, max_penetration=turn
                )

            reading = _reading(f"{name}, Δ~max = {turn:g}", of_cell)
            if reading is not None:
                yield reading


def _of_machines(study: Study) -> Iterator[Reading]:
    for stiffness in STIFFNESSES:
        for far in FAR_SIDES:

            def of_cell(
                hurst: float, gamma: float, stiffness: float = stiffness, far: float = far
            ) -> Series:
                along = along_far_side(study, hurst, gamma, stiffness)
                if far in FAR_SIDES_COMPUTED:
                    return along.get(far, {})
                near = {u: one for u, one in along.items() if abs(u - far) < 0.15}
                return _between(near, far)

            reading = _reading(f"machine of {stiffness:.0e} Pa/m, u_tot = {far:g}", of_cell)
            if reading is not None:
                yield reading


def along_far_side(
    study: Study, hurst: float, gamma: float, stiffness: float, name: str = "loss_dimensionless"
) -> dict[float, Series]:
    """A column by the turning point of the far side, u_tot/h_max."""
    place = {"hurst": hurst, "work_of_adhesion": gamma, "stiffness": stiffness}
    found = {
        turn: study.joined(name, STIFF, max_penetration=turn, **place)
        for turn in FAR_SIDES_COMPUTED
    }
    return {turn: one for turn, one in found.items() if one}


def _coarse(study: Study) -> Iterator[Reading]:
    for step in study.coarse.values("unloading_step"):
        for turn in TURNS:

            def of_cell(
                hurst: float, gamma: float, step: float = step, turn: float = turn
            ) -> Series:
                rows = study.coarse.where(
                    hurst=hurst, work_of_adhesion=gamma, max_penetration=turn, unloading_step=step
                )
                return by_realisation(rows, "loss_dimensionless")

            reading = _reading(f"coarse, unloading in steps of {step:g}, Δ~max = {turn:g}", of_cell)
            if reading is not None:
                yield reading
