"""Loss, and for turning points tension and contact too, along a further axis of the campaign."""

from __future__ import annotations

import numpy as np

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.campaign.tables import TURNING_POINTS, Axis
from adhesis.ensemble.campaign.tasks import place
from adhesis.ensemble.report.figures import style
from adhesis.ensemble.report.figures.loss_figures import errorbar, hollow_handle, loss_label
from adhesis.ensemble.report.further_axes import (
    axis_label,
    below,
    common,
    from_to,
    gamma_label,
    together,
)

_MOST_TICKS = 5
_LOG_FROM = 20  # an axis that spans more is logarithmic

# Name, label, unit, and whether the panel begins at 0.
_OF_TURNING_POINT = (
    ("pull_off_stress", "largest tension (kPa)", 1e3, True),
    ("pull_off_penetration", r"detached by $\Delta/h_\mathrm{max}$", 1.0, False),
    ("largest_contact_fraction", "contact fraction $A/A_0$", 1.0, True),
)


def along(axis: Axis, data: Aggregate) -> style.PublishedFigure:
    """Means with intervals against an axis, every cell of it and of one more further axis.

    With one more: a column for each (H, γ), a line for each of its values. Else a column for each
    H, a line for each γ.
    """
    moving = together(data, axis)
    second = next((other for other in data.further if other.name not in moving), None)
    fixed, every = _lines(data, axis, second)
    lines = {at: done for at, cells in every.items() if (done := [c for c in cells if c.done])}
    titles = style.spread_out(list(dict.fromkeys(title for title, _ in lines)), style.MOST_PANELS)
    labels = style.spread_out(list(dict.fromkeys(label for _, label in lines)), style.MOST_CURVES)
    rows = [("loss", loss_label(data), 1e-3, True)]
    if axis.name in TURNING_POINTS:
        per_contact = ("loss_per_contact", loss_label(data, "loss per contact"), 1e-3, True)
        rows += [*_OF_TURNING_POINT, per_contact]
    width = style.ONE_COLUMN if len(titles) == 1 else style.TWO_COLUMNS
    height = (22 + 40 * len(rows)) * style.MM
    figure = style.new_figure(len(rows), len(titles), width, height, sharex=True, sharey="row")
    finite = [value for value in axis.values if np.isfinite(value)]
    low, high = min(finite), max(finite)
    logarithmic = low > 0 and high > _LOG_FROM * low
    grid = figure.rows
    axis_text, axis_unit = axis_label(axis)
    for row, (name, label, unit, from_zero) in zip(grid, rows, strict=True):
        for axes, title in zip(row, titles, strict=True):
            for k, of_line in enumerate(labels):
                if not (line := lines.get((title, of_line))):
                    continue
                x = np.array([cell.at[axis.name] for cell in line], dtype=float)
                aside = (k - (len(labels) - 1) / 2) * 0.01
                x = x * (high / low) ** aside if logarithmic else x + aside * (high - low)
                x /= axis_unit
                errorbar(axes, x, line, name, unit, k, of_line, from_zero=from_zero)
                if name == "largest_contact_fraction" and axis.name == "max_penetration":
                    turning = [cell.curves["loading_contact_fraction"].mean[-1] for cell in line]
                    axes.plot(x, turning, "x", color="0.2", markersize=5, zorder=6, label="_")
        for axes in row if from_zero else ():
            axes.set_ylim(bottom=0)  # when the panels, which share it, are all drawn
        row[0].set_ylabel(label)
    for axes, title in zip(grid[0], titles, strict=True):
        style.label_panel(axes, title)
    ticks = [value / axis_unit for value in finite]
    figure.label(axis_text)
    for axes in (*grid[-1], *figure.given):
        if logarithmic:
            axes.set_xscale("log")
        elif len(ticks) <= _MOST_TICKS:
            axes.set_xticks(ticks)
    # Beside what is drawn, cells without finished tasks; not what is left out for the eye's sake.
    drawn = [
        cell
        for (title, label), cells in every.items()
        if (title in titles and label in labels) or (title, label) not in lines
        for cell in cells
    ]
    handles, texts = grid[0][0].get_legend_handles_labels()
    if any(texts):
        figure.legend_above([*handles, *hollow_handle(drawn)], 3 if second is None else 2)
    apart = "" if len(finite) == len(axis.values) else f"not drawn: {axis.name} = inf"
    figure.say_below("\n".join(filter(None, (below(drawn, fixed), apart, _sample(drawn)))))
    return figure


def _sample(cells: list[AveragedCell]) -> str:
    """Return the number of profiles that means are over, and what their bars are."""
    counts = [cell.done for cell in cells if cell.done]
    of_what = "profiles, 95 % interval of the mean" if max(counts) > 1 else "profile"
    return f"n = {from_to(counts)} {of_what}"


def _lines(
    data: Aggregate, axis: Axis, second: Axis | None
) -> tuple[list[tuple[str, float]], dict[tuple[str, str], list[AveragedCell]]]:
    """Return the values that all lines share, and the cells by title of a panel and label.

    The cells of a line ascend along the axis to a finite end, and may have no finished task.
    Further axes beside these two are at one place, that of :attr:`Aggregate.shown`.
    """
    moving = together(data, axis) | (set() if second is None else together(data, second))

    def at(cell: AveragedCell) -> list[tuple[str, float]]:
        return [other for other in cell.others if other[0] not in moving]

    wanted = [at(cell) for cell in data.shown.cells]
    lines: dict[tuple[str, str], list[AveragedCell]] = {}
    for cell in sorted(data.cells, key=lambda cell: cell.at[axis.name]):
        if at(cell) not in wanted or np.isinf(cell.at[axis.name]):
            continue
        title, label = f"H = {cell.hurst:g}", gamma_label(cell.work_of_adhesion)
        if second is not None:
            value = cell.at[second.name]
            title, label = f"{title}, {label}", place([(second.name, value)])
        lines.setdefault((title, label), []).append(cell)
    return [other for other in common(data.shown) if other[0] not in moving], lines
