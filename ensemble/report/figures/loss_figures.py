"""Losses: Table 1 as a figure, against m2, by mechanism, along further axes; jumps and pull-off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN

from adhesis.ensemble.aggregate.average import (
    BIN_EDGES,
    BINS_PER_DECADE,
    SMALL,
    Aggregate,
    AveragedCell,
)
from adhesis.ensemble.aggregate.cells import Cell, stress_scale
from adhesis.ensemble.campaign.precision import Estimate
from adhesis.ensemble.campaign.tables import TURNING_POINTS, Axis
from adhesis.ensemble.campaign.tasks import place
from adhesis.ensemble.quantities import common_unit
from adhesis.ensemble.report import paper
from adhesis.ensemble.report.figures import style
from adhesis.ensemble.report.further_axes import (
    axis_label,
    below,
    common,
    from_to,
    gamma_label,
    together,
)
from adhesis.solver.model.profile import Array

_FEWEST_BARS = 4  # for which there is room
_MOST_BARS = 9  # in one column, so that their labels do not touch
_MOST_BESIDE = 3  # panels beside each other in one column
_MOST_TICKS, _MOST_TICKS_ALONG = 4, 5
_LOG_FROM = 20  # a further axis that spans more is logarithmic
# Fewer points are not joined by a line: it would claim a course between them.
FEWEST_FOR_A_LINE = 5
_STAR: Any = {
    "linestyle": "none",
    "marker": "*",
    "markersize": 8,
    "markerfacecolor": "white",
    "markeredgecolor": "0.3",
}


def loss_quantity(data: Aggregate) -> tuple[str, str, float]:
    """Return name, label and unit of the loss in figures: W~ where it is set beside the paper's."""
    if paper.are_its_cells(data.cells):
        return "loss_dimensionless", r"loss $\tilde W$", 1.0
    return "loss", loss_label(data), 1e-3


def loss_label(data: Aggregate, what: str = "loss") -> str:
    """Return the label of a loss in mJ/m², which says so if it is one under a weight."""
    return (
        f"{what}\nunder a weight (mJ/m²)" if data.campaign.cycle.under_load else f"{what} (mJ/m²)"
    )


def loss_against_hurst(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Loss of each H and work of adhesion"."""
    shown, (name, label, unit) = style.shown_gammas(data), loss_quantity(data)
    columns = min(len(shown), _MOST_BESIDE)
    rows = -(-len(shown) // columns)
    height = (20 + 42 * rows) * style.MM
    figure = style.new_figure(rows, columns, style.ONE_COLUMN, height, sharex=True, sharey=True)
    hursts = style.spread_out(data.hursts, style.MOST_CURVES)
    aside = 0.2 * min(np.diff(hursts), default=0.1)
    for axes, (k, gamma) in zip(figure.panels, shown, strict=False):
        cells = data.finished(hursts, [gamma])
        x = np.array([cell.hurst for cell in cells])
        errorbar(axes, x, cells, name, unit, k, "_")
        _stars(axes, [(cell.hurst + aside, paper.table_1(cell), style.colour(k)) for cell in cells])
        style.label_panel(axes, gamma_label(gamma))
    for axes in figure.panels[len(shown) :]:
        axes.set_axis_off()
    figure.label("Hurst exponent $H$", label)
    for axes in figure.panels[: len(shown)]:
        axes.set_ylim(bottom=0)
        if len(hursts) <= _MOST_TICKS:
            axes.set_xticks(hursts)
        axes.set_xlim(min(hursts) - 2.5 * aside, max(hursts) + 2.5 * aside)
    mean = style.key("mean and 95 % interval", color="0.3", marker="o", linestyle="none")
    figure.legend_above([mean, *_star_handle(data), *hollow_handle(data.cells)], 2)
    return figure


def loss_against_slope(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Loss against mean square slope"."""
    shown, (name, label, unit) = style.shown_gammas(data), loss_quantity(data)
    figure = style.new_figure(
        len(shown), 1, style.ONE_COLUMN, (20 + 33 * len(shown)) * style.MM, sharex=True
    )
    hursts = style.spread_out(data.hursts, style.MOST_CURVES)
    for axes, (_, gamma) in zip(figure.panels, shown, strict=True):
        for k, hurst in enumerate(hursts):
            cells = data.finished([hurst], [gamma])
            m2 = np.array([cell.estimates["m2"].mean for cell in cells])
            errorbar(axes, m2, cells, name, unit, k, f"H = {hurst:g}")
            _stars(axes, [(paper.m2(c.hurst), paper.table_1(c), style.colour(k)) for c in cells])
        axes.set_ylim(0, 1.06 * axes.get_ylim()[1])
        style.label_panel(axes, gamma_label(gamma))
    figure.label("mean square slope $m_2$", label)
    handles = [style.key(f"H = {h:g}", ls="none", **style.look(k)) for k, h in enumerate(hursts)]
    figure.legend_above([*handles, *_star_handle(data), *hollow_handle(data.cells)], 4)
    return figure


def _stars(axes: Axes, values: list[tuple[float | None, float | None, str]]) -> None:
    """Draw values of the paper, where it gives them: (x, W~, colour)."""
    for x, value, edge in values:
        if x is not None and value is not None:
            star = {**_STAR, "markeredgecolor": edge}
            axes.plot([x], [value], **star, zorder=5, label="paper")


def _star_handle(data: Aggregate) -> list[Line2D]:
    """The entry of the paper's values in a legend, if any are drawn."""
    if all(paper.table_1(cell) is None for cell in data.cells if cell.done):
        return []
    return [style.key("paper", **_STAR)]


def loss_by_mechanism(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Loss by mechanism"."""
    gammas = style.spread_out(data.works_of_adhesion, style.MOST_CURVES)
    cells = data.finished(style.spread_out(data.hursts, style.MOST_PANELS), gammas)
    width = style.ONE_COLUMN if len(cells) <= _MOST_BARS else style.TWO_COLUMNS
    figure = style.new_figure(1, 1, width, 68 * style.MM)
    axes = figure.panels[0]
    place = np.arange(len(cells))
    large = [cell.estimates["loss_large_scale"] for cell in cells]
    small = [cell.estimates["loss_small_scale"] for cell in cells]
    bottom = np.zeros(len(cells))
    for found, face, hatch, label, aside in (
        (large, "#56B4E9", "", "large scale", -0.15),
        (small, "#E69F00", "////", "small scale", 0.15),
    ):
        mean, low, bars = _in_unit(found, 1e-3)
        edge: Any = {"edgecolor": "black", "linewidth": 0.5}
        axes.bar(place, mean, bottom=bottom, color=face, hatch=hatch, label=label, **edge)
        line: Any = {"fmt": "none", "ecolor": "black", "elinewidth": 0.8, "capsize": style.CAP}
        axes.errorbar(place + aside, bottom + mean, yerr=bars, label="_", **line)
        mark_below_zero(axes, (place + aside)[bottom + low < 0], "black")
        bottom = bottom + mean
    above = 1e3 * np.nan_to_num([found.high - found.mean for found in small])
    reach = np.fmax(bottom + above, 1e3 * np.array([found.high for found in large]))
    shares = mean / np.where(bottom > 0, bottom, 1.0)
    for x, share, top in zip(place, shares, reach, strict=True):
        place_of_text: Any = {"textcoords": "offset points", "ha": "center", "fontsize": 6}
        axes.annotate(f"{100 * share:.0f} %", (x, top), (0, 3), **place_of_text)
    unit, size = common_unit("work_of_adhesion", data.works_of_adhesion)
    texts = [f"{cell.hurst:g}\n{cell.work_of_adhesion / size:g}" for cell in cells]
    axes.set_xticks(place, texts)
    drops = loss_label(data, "sum of drops")
    figure.label(rf"$H$ (upper line), $\gamma$ in {unit} (lower line)", drops)
    axes.set_ylim(0, 1.12 * float(reach.max(initial=0)) or 1)
    middle, half = (len(cells) - 1) / 2, max(len(cells), _FEWEST_BARS) / 2
    axes.set_xlim(middle - half, middle + half)
    axes.grid(False, axis="x")
    figure.legend_above(axes.get_legend_handles_labels()[0], 2)
    return figure


def jump_energies(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Distribution of the energy drops"."""
    figure, rows = style.row_for_each_hurst(data, 2, 13, 44, sharey=True)
    occupied = _occupied(data)
    for row, hurst in rows:
        for axes, small in zip(row, (False, True), strict=True):
            for k, cell in style.curves_of(data, hurst):
                _jump_density(axes, cell, small, k, occupied)
            style.label_panel(axes, f"H = {hurst:g}, {'small' if small else 'large'} scale")
    figure.label("energy drop of one jump (J/m²)", "jumps per loop and decade")
    for axes in figure.panels:
        axes.set(xscale="log", yscale="log")
    handles = [style.key(gamma_label(g), **style.line(k)) for k, g in style.shown_gammas(data)]
    figure.legend_above(handles, len(handles))
    return figure


def _jump_density(axes: Axes, cell: AveragedCell, small: bool, k: int, part: slice) -> None:
    density = cell.jumps.histogram[small == SMALL].sum(axis=0) * BINS_PER_DECADE / cell.done
    edges = BIN_EDGES[part.start : part.stop + 1]
    # Jumps are counted: n of them are known to sqrt(n).
    scatter = density / np.sqrt(np.maximum(density * cell.done / BINS_PER_DECADE, 1))
    below = np.maximum(density - scatter, 0.3 * density)[part]
    band: Any = {"fill": True, "color": style.colour(k), "alpha": 0.1, "linewidth": 0, "label": "_"}
    axes.stairs((density + scatter)[part], edges, baseline=below, **band)
    shown = np.where(density > 0, density, np.nan)[part]
    label: Any = {"baseline": None, "label": gamma_label(cell.work_of_adhesion)}
    axes.stairs(shown, edges, linewidth=1.4, **label, **style.line(k))


def pull_off(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Pull-off stress"."""
    figure = style.new_figure(1, 1, style.ONE_COLUMN, 62 * style.MM)
    axes = figure.panels[0]
    hursts = style.spread_out(data.hursts, style.MOST_CURVES)
    unit, size = common_unit("work_of_adhesion", data.works_of_adhesion)
    for k, hurst in enumerate(hursts):
        cells = data.finished([hurst], data.works_of_adhesion)
        x = np.array([cell.work_of_adhesion for cell in cells]) / size
        # apart, so that intervals can be distinguished
        x += (k - (len(hursts) - 1) / 2) * 0.01 * max(data.works_of_adhesion) / size
        errorbar(axes, x, cells, "pull_off_stress", 1e3, k, f"H = {hurst:g}")
    figure.label(rf"work of adhesion $\gamma$ ({unit})", "largest tension (kPa)")
    axes.set_ylim(bottom=0)
    handles = [*axes.get_legend_handles_labels()[0], *hollow_handle(data.cells)]
    figure.legend_above(handles, 3)
    _second_scale(axes, data)
    return figure


def _second_scale(axes: Axes, data: Aggregate) -> None:
    """Beside kPa, σ~ at the mean h_max of all cells; none where these have several units of it."""
    h_max = np.concatenate([cell.values["h_max"] for cell in data.cells]).mean(keepdims=True)
    scales = {float(stress_scale(cell.campaign, h_max)[0]) for cell in data.cells}
    if len(scales) > 1:  # as where the modulus or the period varies with H
        return
    (scale,) = scales
    to_and_fro = (lambda stress: 1e3 * stress / scale, lambda stress: stress * scale / 1e3)
    axes.tick_params(right=False)
    right = axes.secondary_yaxis("right", functions=to_and_fro)
    right.set_ylabel(r"$\tilde\sigma$ at the mean $h_\mathrm{max}$")


def _occupied(data: Aggregate) -> slice:
    """The bins from the first to the last that holds a jump of any cell; at most eight decades."""
    filled = np.flatnonzero(np.sum([cell.jumps.histogram for cell in data.cells], axis=(0, 1)))
    if not filled.size:  # drawn from Python: the report leaves the figure out
        return slice(0, 1)
    stop = int(filled[-1]) + 1
    return slice(int(filled[filled >= stop - 8 * BINS_PER_DECADE][0]), stop)


def errorbar(
    axes: Axes,
    x: np.ndarray,
    cells: Sequence[Cell],
    name: str,
    unit: float,
    k: int,
    label: str,
    *,
    from_zero: bool = True,
) -> None:
    """Draw means over cells with their intervals, in multiples of a unit; joined if they are many.

    Hollow where loops of a cell failed or were short of their preload. Where the panel begins at 0,
    a mark there shows which intervals go on below.
    """
    mean, low, bars = _in_unit([cell.estimates[name] for cell in cells], unit)
    line = style.LINES[k] if x.size >= FEWEST_FOR_A_LINE else "none"
    look = style.look(k)
    axes.errorbar(x, mean, yerr=bars, linestyle=line, label=label, capsize=style.CAP, **look)
    hollow = np.array([bool(cell.failed or cell.short_of_preload) for cell in cells], dtype=bool)
    if hollow.any():
        options = {"linestyle": "none", "markerfacecolor": "white", "zorder": 5, "label": "_"}
        axes.plot(x[hollow], mean[hollow], **look | options)
    if from_zero:
        mark_below_zero(axes, x[low < 0], style.colour(k))


def _in_unit(found: list[Estimate], unit: float) -> tuple[Array, Array, Array]:
    """Return means, low ends of their intervals, and both distances from the mean as bars."""
    mean, low, high = (
        np.array([getattr(estimate, part) for estimate in found]) / unit
        for part in ("mean", "low", "high")
    )
    return mean, low, np.nan_to_num(np.array([mean - low, high - mean]))


def hollow_handle(cells: Sequence[Cell]) -> list[Line2D]:
    """Return the entry of hollow marks in a legend, if there are any."""
    drawn = [cell for cell in cells if cell.done]
    reasons = {
        "failed": any(cell.failed for cell in drawn),
        "short of the preload": any(cell.short_of_preload for cell in drawn),
    }
    label = " or ".join(reason for reason, holds in reasons.items() if holds)
    look_of_mark: Any = {"color": "0.3", "marker": "o", "markerfacecolor": "white"}
    return [style.key(f"loops {label}", linestyle="none", **look_of_mark)] if label else []


def mark_below_zero(axes: Axes, x: np.ndarray, colour: str) -> None:
    """Mark at 0, where a panel begins, that intervals at these places go on below."""
    if x.size:
        options: dict[str, Any] = {"clip_on": False, "zorder": 6, "label": "_", "markersize": 5}
        axes.plot(x, 0 * x, color=colour, marker=CARETDOWN, linestyle="none", **options)


# ---------------------------------------------------------------------- further axes


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
        elif len(ticks) <= _MOST_TICKS_ALONG:
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
