"""Loss, and for turning points tension and contact too, along a further axis of the campaign."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.campaign.axes import Axis
from adhesis.ensemble.campaign.tables import TURNING_POINTS
from adhesis.ensemble.report.figures.loss_figures import errorbar
from adhesis.ensemble.report.figures.style import (
    MM,
    MOST_CURVES,
    MOST_PANELS,
    ONE_COLUMN,
    TWO_COLUMNS,
    PublishedFigure,
    gamma_label,
    label_panel,
    legend_above,
    new_figure,
    panels,
    say_below,
    spread_out,
    with_x_label,
)
from adhesis.ensemble.report.further_axes import axis_label, below, lines_along, symbols, together

_MOST_TICKS = 5
_LOG_FROM = 20  # an axis that spans more is logarithmic

_LOSS = ("loss", "loss (mJ/m²)", 1e-3)
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
        if not together(data, axis) & {"hurst", "work_of_adhesion"}
        and any(len(line) > 1 for line in lines_along(data, axis))
    ]


def along(axis: Axis) -> Callable[[Aggregate], PublishedFigure]:
    """Return the function that draws the figure of one axis."""

    def loss_along(data: Aggregate) -> PublishedFigure:
        return _draw(data, axis)

    return loss_along


def _draw(data: Aggregate, axis: Axis) -> PublishedFigure:
    """Means with intervals against an axis, every cell of it and of one more further axis.

    With one more: a column for each (H, γ), a line for each of its values. Else a column for each
    H, a line for each γ.
    """
    second = _second_axis(data, axis)
    fixed, lines = _lines(data, axis, second)
    titles = list(dict.fromkeys(title for title, _ in lines))
    titles = [titles[round(k)] for k in spread_out(range(len(titles)), MOST_PANELS)]
    labels = list(dict.fromkeys(label for _, label in lines))
    labels = [labels[round(k)] for k in spread_out(range(len(labels)), MOST_CURVES)]
    rows = [_LOSS, *(_OF_TURNING_POINT if axis.name in TURNING_POINTS else ())]
    width = ONE_COLUMN if len(titles) == 1 else TWO_COLUMNS
    height = (22 + 40 * len(rows)) * MM
    figure = new_figure(len(rows), len(titles), width, height, sharex=True, sharey="row")
    low, high = min(axis.values), max(axis.values)
    logarithmic = low > 0 and high > _LOG_FROM * low
    grid = panels(figure, len(rows), len(titles))
    axis_text, axis_unit = axis_label(axis)
    for row, (name, label, unit) in zip(grid, rows, strict=True):
        for axes, title in zip(row, titles, strict=True):
            for k, of_line in enumerate(labels):
                line = lines.get((title, of_line), [])
                if not line:
                    continue
                x = np.array([dict(cell.others)[axis.name] for cell in line], dtype=float)
                aside = (k - (len(labels) - 1) / 2) * 0.01
                x = x * (high / low) ** aside if logarithmic else x + aside * (high - low)
                x /= axis_unit
                found = [cell.estimates[name] for cell in line]
                above = name != "pull_off_penetration"
                errorbar(axes, x, found, k, of_line, unit=unit, from_zero=above)
                if name == "largest_contact_fraction" and axis.name == "max_penetration":
                    turning = [cell.curves["loading_contact_fraction"].mean[-1] for cell in line]
                    axes.plot(x, turning, "x", color="0.2", markersize=5, zorder=6, label="_")
        for axes in row if name != "pull_off_penetration" else ():
            axes.set_ylim(bottom=0)  # when the panels, which share it, are all drawn
        row[0].set_ylabel(label)
    for axes, title in zip(grid[0], titles, strict=True):
        label_panel(axes, title)
    ticks = [value / axis_unit for value in axis.values]
    for axes in with_x_label(figure, len(titles), len(rows) * len(titles)):
        axes.set_xlabel(axis_text)
        if logarithmic:
            axes.set_xscale("log")
        elif len(ticks) <= _MOST_TICKS:
            axes.set_xticks(ticks)
    handles, texts = grid[0][0].get_legend_handles_labels()
    if any(texts):
        legend_above(figure, handles, 3 if second is None else 2)
    say_below(figure, below(data, fixed))
    return figure


def _second_axis(data: Aggregate, axis: Axis) -> Axis | None:
    """Return the further axis whose values are the lines of a figure along another one."""
    moving = together(data, axis)
    return next((other for other in data.further if other.name not in moving), None)


def _lines(
    data: Aggregate, axis: Axis, second: Axis | None
) -> tuple[list[tuple[str, float]], dict[tuple[str, str], list[Cell]]]:
    """Return the values that all lines share, and the cells by title of a panel and label.

    Further axes beside these two are at one place, that of :attr:`Aggregate.shown`.
    """
    moving = together(data, axis)
    names = set() if second is None else together(data, second)

    def at(cell: Cell) -> list[tuple[str, float]]:
        return [other for other in cell.others if other[0] not in moving | names]

    wanted = {(c.hurst, c.work_of_adhesion): at(c) for c in data.shown.cells}
    lines = {}
    for line in lines_along(data, axis):
        cell = line[0]
        if at(cell) != wanted[cell.hurst, cell.work_of_adhesion]:
            continue
        title, label = f"H = {cell.hurst:g}", gamma_label(cell.work_of_adhesion)
        if second is not None:
            value = dict(cell.others)[second.name]
            title, label = f"{title}, {label}", symbols([(second.name, value)])
        lines[title, label] = line
    every = list(wanted.values())
    return [other for other in every[0] if all(other in one for one in every)], lines
