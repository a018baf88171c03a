"""Loss, and for turning points tension and contact too, along a further axis of the campaign."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.campaign.axes import Axis
from adhesis.ensemble.campaign.tables import TURNING_POINTS
from adhesis.ensemble.report.figures.loss_figures import errorbar
from adhesis.ensemble.report.figures.style import (
    MM,
    MOST_PANELS,
    ONE_COLUMN,
    TWO_COLUMNS,
    gamma_label,
    label_panel,
    legend_above,
    new_figure,
    panels,
    say_below,
    shown_gammas,
    spread_out,
)
from adhesis.ensemble.report.further_axes import axis_label, lines_along, place, together

_LOG_FROM = 20  # an axis that spans more is logarithmic

_LOSS = ("loss_dimensionless", r"loss $\tilde W$", 1.0)
_OF_TURNING_POINT = (
    ("pull_off_stress", "largest tension (kPa)", 1e3),
    ("pull_off_penetration", r"last contact lost at $\Delta/h_\mathrm{max}$", 1.0),
    ("largest_contact_fraction", "contact fraction $A/A_0$", 1.0),
    ("loss_per_contact", "loss per contact (mJ/m²)", 1e-3),
)


def with_figure(data: Aggregate) -> list[Axis]:
    """Further axes that have a figure: all but those that vary together with H or γ."""
    return [
        axis
        for axis in data.further
        if not together(data, axis) & {"hurst", "work_of_adhesion"} and lines_along(data, axis)
    ]


def along(axis: Axis) -> Callable[[Aggregate], Figure]:
    """Return the function that draws the figure of one axis."""

    def loss_along(data: Aggregate) -> Figure:
        return _draw(data, axis)

    return loss_along


def _draw(data: Aggregate, axis: Axis) -> Figure:
    """Means with intervals against an axis: a column for each H, a line for each γ."""
    fixed, lines = _lines(data, axis)
    hursts = spread_out(data.hursts, MOST_PANELS)
    gammas = shown_gammas(data)
    rows = [_LOSS, *(_OF_TURNING_POINT if axis.name in TURNING_POINTS else ())]
    width = ONE_COLUMN if len(hursts) == 1 else TWO_COLUMNS
    height = (22 + 40 * len(rows)) * MM
    figure = new_figure(len(rows), len(hursts), width, height, sharex=True, sharey="row")
    low, high = min(axis.values), max(axis.values)
    logarithmic = low > 0 and high > _LOG_FROM * low
    grid = panels(figure, len(rows), len(hursts))
    for row, (name, label, unit) in zip(grid, rows, strict=True):
        for axes, hurst in zip(row, hursts, strict=True):
            for order, (k, gamma) in enumerate(gammas):
                line = lines.get((hurst, gamma), [])
                if not line:
                    continue
                x = np.array([dict(cell.others)[axis.name] for cell in line], dtype=float)
                aside = (order - (len(gammas) - 1) / 2) * 0.01
                x = x * (high / low) ** aside if logarithmic else x + aside * (high - low)
                found = [cell.estimates[name] for cell in line]
                above = name != "pull_off_penetration"
                errorbar(axes, x, found, k, gamma_label(gamma), unit=unit, from_zero=above)
                if name == "largest_contact_fraction" and axis.name == "max_penetration":
                    turning = [cell.curves["loading_contact_fraction"].mean[-1] for cell in line]
                    axes.plot(x, turning, "x", color="0.2", markersize=5, zorder=6, label="_")
        if name != "pull_off_penetration":
            row[0].set_ylim(bottom=0)  # when the panels, which share it, are all drawn
        row[0].set_ylabel(label)
    for axes, hurst in zip(grid[0], hursts, strict=True):
        label_panel(axes, f"H = {hurst:g}")
    for axes in grid[-1]:
        axes.set_xlabel(axis_label(axis))
        if logarithmic:
            axes.set_xscale("log")
    handles, _ = grid[0][0].get_legend_handles_labels()
    legend_above(figure, handles, 3)
    say_below(figure, place(fixed))
    return figure


def _lines(
    data: Aggregate, axis: Axis
) -> tuple[list[tuple[str, float]], dict[tuple[float, float], list[Cell]]]:
    """Return the values on the other further axes that all figures share, and the cells there."""
    moving = together(data, axis)

    def at(cell: Cell) -> list[tuple[str, float]]:
        return [other for other in cell.others if other[0] not in moving]

    wanted = {(c.hurst, c.work_of_adhesion): at(c) for c in data.shown.cells}
    lines = {
        (line[0].hurst, line[0].work_of_adhesion): line
        for line in lines_along(data, axis)
        if at(line[0]) == wanted[line[0].hurst, line[0].work_of_adhesion]
    }
    every = list(wanted.values())
    return [other for other in every[0] if all(other in one for one in every)], lines
