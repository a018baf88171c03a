"""Shapes (Fig. 3), spectra (Figs. 4 and 5), densities of gap (Fig. 8) and height (Fig. 9).

Each shows the (H, γ) and the Δ/h_max of the paper's figure where the campaign has them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.aggregate.mean_fields import DeformedShape, FieldStatistics
from adhesis.ensemble.report import paper
from adhesis.ensemble.report.figures.selection import cell_of_hurst, cells_of, state_of
from adhesis.ensemble.report.figures.style import (
    LINE_OF_BRANCH,
    LINES,
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
    plain_decades,
    spread_out,
    with_x_label,
)
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.profile import Array

_LEAST_DENSITY = 1e-6
# Shapes on fewer nodes are interpolated, with so many nodes beyond the ends of a part.
_FEWEST_NODES, _BEYOND = 1000, 4
# Colour of a branch where both are drawn over the rigid profile.
_COLOUR_OF_BRANCH = {"loading": "#0072B2", "unloading": "#D55E00"}


def shapes(data: Aggregate) -> PublishedFigure:
    """Fig. 3: rigid profile and elastic surface above it of one realisation on both branches.

    Heights are those of the profile: on a machine or under a load the two branches have different
    separations at one prescribed value.

    Raises
    ------
    ValueError
        If no cell has kept its fields.
    """
    fields = data.fields
    kept = [cell for cell in data.cells if fields.shapes[data.cells.index(cell)] is not None]
    wished = [cell for cell in cells_of(data, paper.FIGURE_3) if cell in kept]
    if not kept:
        raise ValueError("no loop has kept its fields")
    cell = (wished or kept)[0]
    shape = fields.shapes[data.cells.index(cell)]
    assert shape is not None
    chosen = shown_penetrations(fields, 3)
    figure = new_figure(
        len(chosen),
        2,
        TWO_COLUMNS,
        (12 + 38 * len(chosen)) * MM,
        sharex="col",
        gridspec_kw={"width_ratios": [2, 1]},
    )
    everywhere = np.arange(cell.plan.position.size)
    window = _window(cell, shape)
    for (whole, detail), k in zip(panels(figure, len(chosen), 2), chosen, strict=True):
        for axes, part in ((whole, everywhere), (detail, window)):
            _draw_shape(axes, cell.plan.position, shape, k, part)
            # Ticks that follow the size of a panel change while the layout is found.
            axes.locator_params(axis="y", nbins=5)
        label_panel(
            whole,
            f"{_cell_label(cell)}, {_depth(data, cell, k)}, $s$ = {_separations(shape, k)}",
        )
        label_panel(detail, "detail")
        whole.set_ylabel("height (µm)")
    for axes in with_x_label(figure, 2, 2 * len(chosen)):
        axes.set_xlabel("position $x$ (mm)")
    handles: list[Artist] = [Patch(facecolor="0.8", edgecolor="0.4", label="rigid profile $h$")]
    handles += [
        Line2D(
            [],
            [],
            color=_COLOUR_OF_BRANCH[branch],
            linestyle=LINE_OF_BRANCH[branch],
            label=f"elastic surface $v + s$, {branch}",
        )
        for branch in BRANCHES
    ]
    legend_above(figure, handles, 3)
    return figure


def spectra_of_branches(data: Aggregate) -> PublishedFigure:
    """Fig. 4: spectral density of profile and deformed surface on both branches at one state."""
    cells = cells_of(data, paper.FIGURE_4)
    figure = new_figure(len(cells), 1, ONE_COLUMN, (16 + 52 * len(cells)) * MM, sharex=True)
    for (axes,), cell in zip(panels(figure, len(cells), 1), cells, strict=True):
        k = state_of(cell.plan, paper.FIGURE_4)
        for b, branch in enumerate(BRANCHES):
            _spectrum(
                axes,
                cell,
                data.fields.psd_displacement[data.cells.index(cell), b, k],
                color=_COLOUR_OF_BRANCH[branch],
                linestyle=LINE_OF_BRANCH[branch],
                label=branch,
            )
        _finish_spectra(axes, data, cell, f", {_depth(data, cell, k)}")
    handles = [
        Line2D([], [], color=_COLOUR_OF_BRANCH[b], linestyle=LINE_OF_BRANCH[b], label=b)
        for b in BRANCHES
    ]
    _label_spectra(figure, len(cells), handles)
    return figure


def spectra_on_loading(data: Aggregate) -> PublishedFigure:
    """Fig. 5(a): spectral density of profile and deformed surface on loading, state by state."""
    return _spectra(data, 0)


def spectra_on_unloading(data: Aggregate) -> PublishedFigure:
    """Fig. 5(b): the same on unloading."""
    return _spectra(data, 1)


def gap_density(data: Aggregate) -> PublishedFigure:
    """Fig. 8: probability density of the gap on either branch, for each H."""
    hursts = spread_out(data.hursts, MOST_PANELS)
    height = (16 + 46 * len(hursts)) * MM
    figure = new_figure(len(hursts), 2, TWO_COLUMNS, height, sharex=True, sharey=True)
    grid = panels(figure, len(hursts), 2)
    fields = data.fields
    chosen = shown_penetrations(fields, MOST_CURVES)
    for row, hurst in zip(grid, hursts, strict=True):
        cell = cell_of_hurst(data, hurst, paper.FIGURE_8)
        row[0].set_ylabel(r"density of $t/h_\mathrm{max}$")
        if cell is None:
            continue
        for b, (axes, branch) in enumerate(zip(row, BRANCHES, strict=True)):
            for place, k in enumerate(chosen):
                # The outermost bins also hold all gaps beyond the axis.
                values = fields.gap_density[data.cells.index(cell), b, k][1:-1]
                if np.any(values > 0):
                    axes.plot(
                        fields.gap_bin[1:-1],
                        np.where(values > 0, values, np.nan),
                        color=look(place).colour,
                        linestyle=LINES[place],
                        label=f"{cell.plan.penetration[k]:.2f}",
                    )
            label_panel(axes, f"{_cell_label(cell)}, {branch}")
    for axes in figure.panels:
        axes.set(xscale="log", yscale="log")
        axes.set_ylim(bottom=max(axes.get_ylim()[0], _LEAST_DENSITY))
    for axes in with_x_label(figure, 2, 2 * len(hursts)):
        axes.set_xlabel(r"gap $t/h_\mathrm{max}$")
    plain_decades(figure.panels)
    legend_above(figure, _penetration_handles(data, chosen, markers=False), len(chosen))
    return figure


def height_density(data: Aggregate) -> PublishedFigure:
    """Fig. 9: probability density of the heights of the rigid profiles, and the Gaussian."""
    figure = new_figure(1, 1, ONE_COLUMN, 62 * MM)
    axes = figure.panels[0]
    fields = data.fields
    for k, hurst in enumerate(spread_out(data.hursts, MOST_CURVES)):
        # All γ have the same profiles: the cell with most of them says all.
        cell = max((c for c in data.cells if c.hurst == hurst), key=lambda c: c.done)
        if cell.done:
            density = fields.height_density[data.cells.index(cell)]
            axes.plot(
                fields.height_bin,
                np.where(density > 0, density, np.nan),
                color=look(k).colour,
                linestyle="none",
                marker=look(k).marker,
                markersize=2.4,
                label=f"H = {hurst:g}",
            )
    x = np.linspace(-4.5, 4.5, 200)
    axes.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color="0.3", label="Gaussian")
    axes.set_yscale("log")
    axes.set_ylim(1e-4, 1)
    axes.set_xlim(-4.5, 4.5)
    axes.set_xlabel(r"height $h/h_\mathrm{rms}$")
    axes.set_ylabel("probability density")
    legend_above(figure, axes.get_legend_handles_labels()[0], 4)
    return figure


def shown_penetrations(fields: FieldStatistics, most: int) -> list[int]:
    """Places of the penetrations that a figure shows, deepest first."""
    places = list(range(fields.penetration.size))[::-1]
    return [int(k) for k in spread_out(places, most)]


def _spectra(data: Aggregate, b: int) -> PublishedFigure:
    hursts = spread_out(data.hursts, MOST_PANELS)
    figure = new_figure(len(hursts), 1, ONE_COLUMN, (16 + 52 * len(hursts)) * MM, sharex=True)
    fields = data.fields
    chosen = shown_penetrations(fields, 3)
    for (axes,), hurst in zip(panels(figure, len(hursts), 1), hursts, strict=True):
        cell = cell_of_hurst(data, hurst, paper.FIGURE_5)
        if cell is None:
            continue
        for place, k in enumerate(chosen):
            _spectrum(
                axes,
                cell,
                fields.psd_displacement[data.cells.index(cell), b, k],
                color=look(place).colour,
                linestyle=LINES[place],
                marker=look(place).marker,
                label=f"{cell.plan.penetration[k]:.2f}",
            )
        _finish_spectra(axes, data, cell)
    _label_spectra(figure, len(hursts), _penetration_handles(data, chosen))
    return figure


def _spectrum(axes: Axes, cell: Cell, values: Array, **options: Any) -> None:
    """Draw the spectrum of one state, unless no realisation is in contact there."""
    if np.any(values > 0):
        axes.loglog(
            cell.plan.wave_number,
            np.where(values > 0, values, np.nan),
            markersize=2,
            markevery=4,
            **options,
        )


def _finish_spectra(axes: Axes, data: Aggregate, cell: Cell, state: str = "") -> None:
    """Add the rigid profile and the reference slopes to a panel, and its labels."""
    rigid, present = data.fields.psd_height[data.cells.index(cell)], cell.plan.filled
    axes.loglog(
        cell.plan.wave_number[present],
        rigid[present],
        color="0.55",
        linewidth=2,
        label="rigid",
        zorder=1.5,
    )
    _reference_slopes(axes, cell.hurst, rigid[present], cell.plan.wave_number[present])
    axes.set_ylabel(r"spectral density $C(q)$ (m³)")
    label_panel(axes, f"{_cell_label(cell)}{state}")


def _label_spectra(figure: PublishedFigure, count: int, handles: list[Line2D]) -> None:
    """Label the wave numbers, and put the legend of all panels above them."""
    plain_decades(figure.panels[:count])
    for axes in with_x_label(figure, 1, count):
        axes.set_xlabel("wave number $q$ (rad/m)")
    handles = [
        Line2D([], [], color="0.55", linewidth=2, label="rigid profile"),
        *handles,
        Line2D([], [], color="0.3", linewidth=0.7, linestyle=":", label="$q^{-(2H+1)}$"),
        Line2D([], [], color="0.3", linewidth=0.7, linestyle="-.", label="$q^{-(2+H)}$"),
    ]
    legend_above(figure, handles, 3)


def _reference_slopes(axes: Axes, hurst: float, rigid: np.ndarray, q: np.ndarray) -> None:
    """Lines q^-(2H+1) below and q^-(2+H) above the data, over the profile's own wave numbers."""
    ends = np.array([q[0], q[-1]])
    for exponent, factor, line in ((2 * hurst + 1, 0.2, ":"), (2 + hurst, 5.0, "-.")):
        axes.loglog(
            ends,
            factor * rigid[0] * (ends / q[0]) ** -exponent,
            color="0.3",
            linewidth=0.7,
            linestyle=line,
            label=f"slope {-exponent:.1f}",
        )


def _draw_shape(
    axes: Axes,
    position: Array,
    shape: DeformedShape,
    k: int,
    part: NDArray[np.intp],
) -> None:
    """Draw the nodes ``part``, counted on beyond the period where they exceed it.

    Each surface stands above the profile by its own gap.
    """
    factor = -(-_FEWEST_NODES // position.size)
    x = 1e3 * _between(part, factor) * (position[1] - position[0])
    rigid = 1e6 * _refined(CubicSpline, shape.height, part, factor)
    axes.fill_between(x, rigid, rigid.min(), color="0.8", linewidth=0)
    axes.plot(x, rigid, color="0.4", linewidth=0.5, label="rigid")
    for b, branch in enumerate(BRANCHES):
        gap = shape.displacement[b, k] - shape.height + _separation(shape, b, k)
        if np.all(np.isfinite(gap)):
            # monotone between nodes: contact stays contact, and nothing overlaps
            axes.plot(
                x,
                rigid + 1e6 * _refined(PchipInterpolator, gap, part, factor),
                color=_COLOUR_OF_BRANCH[branch],
                linestyle=LINE_OF_BRANCH[branch],
                linewidth=0.9,
                label=branch,
            )
    axes.set_xlim(x[0], x[-1])


def _separation(shape: DeformedShape, b: int, k: int) -> float:
    """Return the separation s in m of a state in contact: there v = h - s, elsewhere v > h - s."""
    return float(np.max(shape.height - shape.displacement[b, k]))


def _separations(shape: DeformedShape, k: int) -> str:
    """Return the separation of both branches, once if they are alike: "0.45 µm"."""
    found = [_separation(shape, b, k) for b in range(len(BRANCHES))]
    texts = [f"{1e6 * s:.2f}" for s in found if np.isfinite(s)]
    return f"{' and '.join(dict.fromkeys(texts))} µm"


def _between(part: NDArray[np.intp], factor: int) -> Array:
    """Return ``factor`` places for each node of a part, in units of the spacing."""
    return np.linspace(part[0], part[-1], factor * (part.size - 1) + 1)


def _refined(
    interpolator: Callable[[Array, Array], Callable[[Array], Array]],
    values: Array,
    part: NDArray[np.intp],
    factor: int,
) -> Array:
    """Interpolate periodic values to :func:`_between`, where few nodes would show as a polygon."""
    if factor == 1:
        return np.asarray(values[part % values.size])
    wide = np.arange(part[0] - _BEYOND, part[-1] + _BEYOND + 1)
    return interpolator(wide.astype(float), values[wide % values.size])(_between(part, factor))


def _window(cell: Cell, shape: DeformedShape) -> NDArray[np.intp]:
    """Nodes of one and a half of the longest waves around the highest point, across the ends."""
    nodes = cell.plan.position.size
    half = min(max(4, round(0.75 * nodes / cell.campaign.profile.n0)), nodes // 2)
    top = int(np.argmax(shape.height))
    return np.arange(top - half, top + half, dtype=np.intp)


def _penetration_handles(
    data: Aggregate, chosen: list[int], *, markers: bool = True
) -> list[Line2D]:
    # Where the largest penetration varies with H or γ, only its share is the same for all.
    tops = {cell.campaign.cycle.turning_point for cell in data.cells}
    unit = _penetration_sign(data)
    if len(tops) > 1 and not data.campaign.cycle.turns_at_stress:
        unit = r"\Delta/\Delta"
    penetration = data.cells[0].plan.penetration if len(tops) == 1 else data.fields.penetration
    return [
        Line2D(
            [],
            [],
            color=look(place).colour,
            linestyle=LINES[place],
            marker=look(place).marker if markers else "",
            label=rf"${unit}_\mathrm{{max}}$ = {penetration[k]:.2f}",
        )
        for place, k in enumerate(chosen)
    ]


def _penetration_sign(data: Aggregate) -> str:
    cycle = data.campaign.cycle
    if cycle.turns_at_stress:
        return r"\bar p/\bar p"
    return r"\Delta/h" if cycle.stiffness is None else r"u_\mathrm{tot}/h"


def _depth(data: Aggregate, cell: Cell, k: int) -> str:
    """Return "Δ/h_max = 0.41" for the state at one place."""
    return rf"${_penetration_sign(data)}_\mathrm{{max}}$ = {cell.plan.penetration[k]:.2f}"


def _cell_label(cell: Cell) -> str:
    return f"H = {cell.hurst:g}, {gamma_label(cell.work_of_adhesion)}"
