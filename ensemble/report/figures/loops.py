"""Averaged loops: contact fraction against stress (Fig. 6), both against penetration (Fig. 7)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.report.figures import style
from adhesis.ensemble.report.further_axes import gamma_label
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.profile import Array

_MARKERS_PER_CURVE = 8
_INTERVALS, _FINE = 60, 50  # of a band, and places between two points that are sorted into them


def contact_against_stress(data: Aggregate) -> style.PublishedFigure:
    """Contact fraction against mean stress.

    Means over realisations, taken at equal penetration; σ~ = 2p̄/(E* q0 h_max) with each
    realisation's own h_max, compression positive. Shading: one standard deviation of A/A0 of a
    single realisation.
    """
    figure, rows = style.row_for_each_hurst(data, 1, 16, 46)
    for (axes,), hurst in rows:
        for k, cell in style.curves_of(data, hurst):
            for branch in BRANCHES:
                stress = cell.curves[f"{branch}_mean_stress_over_slope"].mean
                area = cell.curves[f"{branch}_contact_fraction"]
                if cell.done > 1:
                    for band in _bands(stress, area.mean - area.std, area.mean + area.std):
                        axes.fill_between(*band, color=style.colour(k), alpha=0.13, linewidth=0)
                _plot(axes, stress, area.mean, cell, branch, k)
        style.label_panel(axes, f"H = {hurst:g}")
        axes.set_ylim(bottom=0)
    figure.label(r"mean stress $\tilde\sigma/\sqrt{m_2}$", "contact fraction $A/A_0$")
    _legend(data, figure, 3)
    return figure


def _bands(x: Array, low: Array, high: Array) -> list[tuple[Array, Array, Array]]:
    """Return x, lower and upper end of the shading of a curve, before and after its least x.

    The mean stress runs back and forth by small steps, where a band from point to point would cross
    itself: it is the envelope in narrow intervals of x.
    """
    known = np.isfinite(x) & np.isfinite(low)  # loops end at several places
    if not known.any():
        return []
    x, low, high = x[known], low[known], high[known]
    turn = int(np.argmin(x))
    return [
        _envelope(x[part], low[part], high[part])
        for part in (slice(0, turn + 1), slice(turn, x.size))
        if np.ptp(x[part]) > 0
    ]


def _envelope(x: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    places = np.arange(x.size)
    fine = np.linspace(0, x.size - 1, _FINE * x.size)
    x, low, high = (np.interp(fine, places, values) for values in (x, low, high))
    edges = np.linspace(x.min(), x.max(), _INTERVALS + 1)
    inside = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, _INTERVALS - 1)
    lower, upper = np.full(_INTERVALS, np.inf), np.full(_INTERVALS, -np.inf)
    np.minimum.at(lower, inside, low)
    np.maximum.at(upper, inside, high)
    crossed = np.isfinite(lower)
    middle = (edges[1:] + edges[:-1]) / 2
    return middle[crossed], np.maximum(lower[crossed], 0), upper[crossed]


def loop_against_penetration(data: Aggregate) -> style.PublishedFigure:
    """Mean stress and contact fraction against penetration.

    Lines: means over realisations; shading: one standard deviation of a single realisation. A
    realisation that has detached counts with zero.
    """
    figure, rows = style.row_for_each_hurst(data, 2, 13, 46, sharey="col")
    for row, hurst in rows:
        for axes, name in zip(row, ("mean_stress_dimensionless", "contact_fraction"), strict=True):
            for k, cell in style.curves_of(data, hurst):
                for branch in BRANCHES:
                    part = _in_contact(cell, branch)
                    depth, curve = cell.penetration[branch][part], cell.curves[f"{branch}_{name}"]
                    mean, std = curve.mean[part], curve.std[part]
                    _plot(axes, depth, mean, cell, branch, k)
                    if cell.done > 1:
                        band: Any = {"color": style.colour(k), "alpha": 0.18, "linewidth": 0}
                        axes.fill_between(depth, mean - std, mean + std, **band)
            style.label_panel(axes, f"H = {hurst:g}")
        row[0].axhline(0, color="0.5", linewidth=0.5)
        row[1].set_ylim(bottom=0)
    label = r"penetration $\tilde\Delta = \Delta/h_\mathrm{max}$"
    if data.campaign.cycle.stiffness is not None:
        label = r"penetration of the far side $u_\mathrm{tot}/h_\mathrm{max}$"
    figure.label(label, r"mean stress $\tilde\sigma$", "contact fraction $A/A_0$")
    _legend(data, figure, 6)
    return figure


def _in_contact(cell: AveragedCell, branch: str) -> slice:
    """The part of a branch up to one step after the last realisation has detached."""
    fraction = cell.curves[f"{branch}_contact_fraction"].mean
    touching = np.flatnonzero(fraction > 0)
    if branch == "loading" or not touching.size:
        return slice(0, fraction.size)
    return slice(0, min(fraction.size, int(touching[-1]) + 2))


def _plot(axes: Axes, x: Array, y: Array, cell: AveragedCell, branch: str, k: int) -> None:
    """Draw a branch, with few markers, staggered, so that they tell curves apart and hide none."""
    part = _in_contact(cell, branch)
    every = max(1, (part.stop - part.start) // _MARKERS_PER_CURVE)
    axes.plot(
        *(x, y),
        linestyle=style.LINE_OF_BRANCH[branch],
        markevery=(k * every // style.MOST_CURVES, every),
        label=f"{gamma_label(cell.work_of_adhesion)}, {branch}",
        **style.look(k),
    )


def _legend(data: Aggregate, figure: style.PublishedFigure, columns: int) -> None:
    """One entry for each γ, one for each branch."""
    shown = style.shown_gammas(data)
    handles = [style.key(gamma_label(gamma), **style.look(k)) for k, gamma in shown]
    handles += [style.key(b, color="0.3", linestyle=style.LINE_OF_BRANCH[b]) for b in BRANCHES]
    figure.legend_above(handles, columns)
