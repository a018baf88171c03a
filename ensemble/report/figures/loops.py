"""Averaged loops: contact fraction against stress (Fig. 6), both against penetration (Fig. 7)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.report.figures.style import (
    LINE_OF_BRANCH,
    MM,
    MOST_CURVES,
    MOST_PANELS,
    ONE_COLUMN,
    TWO_COLUMNS,
    PublishedFigure,
    gamma_label,
    label_panel,
    legend_above,
    look,
    new_figure,
    panels,
    shown_gammas,
    spread_out,
    with_x_label,
)
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.profile import Array

_MARKERS_PER_CURVE = 8
_INTERVALS, _FINE = 60, 50  # of a band, and places between two points that are sorted into them


def contact_against_stress(data: Aggregate) -> PublishedFigure:
    """Fig. 6: A/A0 against σ~/sqrt(m2), one panel for each H, means over realisations."""
    hursts = spread_out(data.hursts, MOST_PANELS)
    figure = new_figure(len(hursts), 1, ONE_COLUMN, (16 + 46 * len(hursts)) * MM, sharex=True)
    column = [row[0] for row in panels(figure, len(hursts), 1)]
    for axes, hurst in zip(column, hursts, strict=True):
        for k, cell in _curves_of(data, hurst):
            for branch in BRANCHES:
                stress = cell.curves[f"{branch}_mean_stress_over_slope"].mean
                area = cell.curves[f"{branch}_contact_fraction"]
                if cell.done > 1:
                    for band in _bands(stress, area.mean - area.std, area.mean + area.std):
                        axes.fill_between(*band, color=look(k).colour, alpha=0.13, linewidth=0)
                axes.plot(
                    stress,
                    area.mean,
                    linestyle=LINE_OF_BRANCH[branch],
                    color=look(k).colour,
                    marker=look(k).marker,
                    markevery=_markers(data, cell, branch, k),
                    label=f"{gamma_label(cell.work_of_adhesion)}, {branch}",
                )
        label_panel(axes, f"H = {hurst:g}")
        axes.set_ylabel("contact fraction $A/A_0$")
        axes.set_ylim(bottom=0)
    for axes in with_x_label(figure, 1, len(hursts)):
        axes.set_xlabel(r"mean stress $\tilde\sigma/\sqrt{m_2}$")
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


def loop_against_penetration(data: Aggregate) -> PublishedFigure:
    """Fig. 7: σ~ and A/A0 against Δ~ with one standard deviation over realisations."""
    hursts = spread_out(data.hursts, MOST_PANELS)
    height = (13 + 46 * len(hursts)) * MM
    figure = new_figure(len(hursts), 2, TWO_COLUMNS, height, sharex=True)
    grid = panels(figure, len(hursts), 2)
    for row, hurst in zip(grid, hursts, strict=True):
        for axes, name in zip(row, ("mean_stress_dimensionless", "contact_fraction"), strict=True):
            for k, cell in _curves_of(data, hurst):
                for branch in BRANCHES:
                    _with_spread(axes, data, cell, branch, name, k)
            label_panel(axes, f"H = {hurst:g}")
        row[0].set_ylabel(r"mean stress $\tilde\sigma$")
        row[0].axhline(0, color="0.5", linewidth=0.5)
        row[1].set_ylabel("contact fraction $A/A_0$")
        row[1].set_ylim(bottom=0)
    label = r"penetration $\tilde\Delta = \Delta/h_\mathrm{max}$"
    if data.campaign.cycle.stiffness is not None:
        label = r"penetration of the far side $u_\mathrm{tot}/h_\mathrm{max}$"
    for axes in with_x_label(figure, 2, 2 * len(hursts)):
        axes.set_xlabel(label)
    _legend(data, figure, 6)
    return figure


def _curves_of(data: Aggregate, hurst: float) -> list[tuple[int, Cell]]:
    """Cells of one H that have finished tasks, each with the place of its γ among those shown."""
    cells = ((k, data.cell(hurst, gamma)) for k, gamma in shown_gammas(data))
    return [(k, cell) for k, cell in cells if cell is not None and cell.done]


def _in_contact(data: Aggregate, cell: Cell, branch: str) -> slice:
    """The part of a branch up to one step after the last realisation has detached."""
    fraction = cell.curves[f"{branch}_contact_fraction"].mean
    touching = np.flatnonzero(fraction > 0)
    if branch == "loading" or not touching.size:
        return slice(0, fraction.size)
    return slice(0, min(fraction.size, int(touching[-1]) + 2))


def _markers(data: Aggregate, cell: Cell, branch: str, k: int) -> tuple[int, int]:
    """Few markers, staggered, so that they tell curves apart and hide none."""
    part = _in_contact(data, cell, branch)
    every = max(1, (part.stop - part.start) // _MARKERS_PER_CURVE)
    return (k * every // MOST_CURVES, every)


def _with_spread(axes: Axes, data: Aggregate, cell: Cell, branch: str, name: str, k: int) -> None:
    part = _in_contact(data, cell, branch)
    axis = cell.penetration[branch][part]
    curve = cell.curves[f"{branch}_{name}"]
    mean, std = curve.mean[part], curve.std[part]
    axes.plot(
        axis,
        mean,
        linestyle=LINE_OF_BRANCH[branch],
        color=look(k).colour,
        marker=look(k).marker,
        markevery=_markers(data, cell, branch, k),
        label=f"{gamma_label(cell.work_of_adhesion)}, {branch}",
    )
    if cell.done > 1:
        axes.fill_between(
            axis, mean - std, mean + std, color=look(k).colour, alpha=0.18, linewidth=0
        )


def _legend(data: Aggregate, figure: PublishedFigure, columns: int) -> None:
    """One entry for each γ, one for each branch."""
    handles = [
        Line2D([], [], color=look(k).colour, marker=look(k).marker, label=gamma_label(gamma))
        for k, gamma in shown_gammas(data)
    ]
    handles += [
        Line2D([], [], color="0.3", linestyle=LINE_OF_BRANCH[branch], label=branch)
        for branch in BRANCHES
    ]
    legend_above(figure, handles, columns)
