"""Shapes (Fig. 3), spectra (Figs. 4 and 5), densities of gap (Fig. 8) and height (Fig. 9).

Each shows the (H, γ) and the Δ/h_max of the paper's figure, or the nearest that the campaign has.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.report import paper
from adhesis.ensemble.report.figures import style
from adhesis.ensemble.report.further_axes import cell_label, state_sign
from adhesis.ensemble.report.paper import PaperFigure
from adhesis.ensemble.task.fields import GAP_BINS, HEIGHT_BINS, FieldPlan
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.profile import Array

Places = NDArray[np.intp]
# Of spectra: the cell, a text behind its name, and branch, state, label and look of each line.
Panel = tuple[AveragedCell | None, str, Sequence[tuple[int, int, str, dict[str, Any]]]]

_LEAST_DENSITY = 1e-6
# Shapes on fewer nodes are interpolated, with so many nodes beyond the ends of a part.
_FEWEST_NODES, _BEYOND = 1000, 4
# Signs of :func:`state_sign` in formulas, without their index.
_SIGNS = {
    "Δ/h_max": r"\Delta/h",
    "u_tot/h_max": r"u_\mathrm{tot}/h",
    "p̄/p̄_max": r"\bar p/\bar p",
}
_SLOPE: Any = {"color": "0.3", "linewidth": 0.7}


def shapes(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Deformed shapes".

    Heights are those of the profile: on a machine or under a load the two branches have different
    separations at one prescribed value. ValueError if no cell has kept its fields.
    """
    found = nearest(cells_with_shape(data), paper.FIGURE_3)
    if not found:
        raise ValueError("no loop has kept its fields")
    cell, shape = found[0], found[0].fields.shape
    assert shape is not None
    profile, surfaces = shape
    chosen = shown_penetrations(data, 3)
    height, ratios = (12 + 38 * len(chosen)) * style.MM, {"width_ratios": [2, 1]}
    figure = style.new_figure(
        len(chosen), 2, style.TWO_COLUMNS, height, sharex="col", gridspec_kw=ratios
    )
    nodes, top = cell.plan.position.size, int(np.argmax(profile))
    # one and a half of the longest waves around the highest point, across the ends
    half = min(max(4, round(0.75 * nodes / cell.campaign.profile.n0)), nodes // 2)
    parts = (np.arange(nodes), np.arange(top - half, top + half))
    for (whole, detail), k in zip(figure.rows, chosen, strict=True):
        # in contact v = h - s, elsewhere v > h - s
        separation = np.max(profile - surfaces[:, k], axis=-1)
        gaps = surfaces[:, k] - profile + separation[:, None]
        for axes, part in zip((whole, detail), parts, strict=True):
            _draw_shape(axes, cell.plan.position, profile, gaps, part)
            # Ticks that follow the size of a panel change while the layout is found.
            axes.locator_params(axis="y", nbins=5)
        texts = dict.fromkeys(f"{1e6 * s:.2f}" for s in separation if np.isfinite(s))
        state = f"{_depth(data, cell, k)}, $s$ = {' and '.join(texts)} µm"
        style.label_panel(whole, f"{cell_label(cell)}, {state}")
        style.label_panel(detail, "detail")
    figure.label("position $x$ (mm)", "height (µm)")
    handles: list[Artist] = [Patch(facecolor="0.8", edgecolor="0.4", label="rigid profile $h$")]
    handles += [
        style.key(f"elastic surface $v + s$, {b}", **style.LOOK_OF_BRANCH[b]) for b in BRANCHES
    ]
    figure.legend_above(handles, 3)
    return figure


def spectra_of_branches(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Spectral density on both branches"."""
    panels: list[Panel] = []
    for cell in nearest(data.cells, paper.FIGURE_4):
        k = state_of(cell.plan, paper.FIGURE_4)
        lines = [(b, k, branch, style.LOOK_OF_BRANCH[branch]) for b, branch in enumerate(BRANCHES)]
        panels.append((cell, f", {_depth(data, cell, k)}", lines))
    return _spectra(panels, [style.key(b, **style.LOOK_OF_BRANCH[b]) for b in BRANCHES])


def spectra_on_loading(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Spectral density on loading"."""
    return _spectra_of_branch(data, 0)


def spectra_on_unloading(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Spectral density on unloading"."""
    return _spectra_of_branch(data, 1)


def gap_density(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Probability density of the separation"."""
    figure, rows = style.row_for_each_hurst(data, 2, 16, 46, sharey=True)
    chosen = shown_penetrations(data, style.MOST_CURVES)
    for row, hurst in rows:
        (cell,) = nearest(data.finished([hurst], data.works_of_adhesion), paper.FIGURE_8) or (None,)
        if cell is None:
            continue
        for b, (axes, branch) in enumerate(zip(row, BRANCHES, strict=True)):
            for place, k in enumerate(chosen):
                # The outermost bins also hold all gaps beyond the axis.
                values = cell.fields.gap_density[b, k][1:-1]
                if np.any(values > 0):
                    y, depth = np.where(values > 0, values, np.nan), cell.plan.penetration[k]
                    axes.plot(GAP_BINS[1:-1], y, label=f"{depth:.2f}", **style.line(place))
            style.label_panel(axes, f"{cell_label(cell)}, {branch}")
    for axes in figure.panels:
        axes.set(xscale="log", yscale="log")
        axes.set_ylim(bottom=max(axes.get_ylim()[0], _LEAST_DENSITY))
    figure.label(r"gap $t/h_\mathrm{max}$", r"density of $t/h_\mathrm{max}$")
    looks = [style.line(place) for place in range(len(chosen))]
    figure.legend_above(_penetration_handles(data, chosen, looks), len(chosen))
    return figure


def height_density(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Probability density of the heights"."""
    figure = style.new_figure(1, 1, style.ONE_COLUMN, 62 * style.MM)
    axes = figure.panels[0]
    for k, hurst in enumerate(style.spread_out(data.hursts, style.MOST_CURVES)):
        # All γ have the same profiles: the cell with most of them says all.
        cell = max((c for c in data.cells if c.hurst == hurst), key=lambda c: c.done)
        if cell.done:
            density = cell.fields.height_density
            points: Any = {"linestyle": "none", "markersize": 2.4, "label": f"H = {hurst:g}"}
            y = np.where(density > 0, density, np.nan)
            axes.plot(HEIGHT_BINS, y, **points, **style.look(k))
    x = np.linspace(-4.5, 4.5, 200)
    axes.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color="0.3", label="Gaussian")
    axes.set(yscale="log", ylim=(1e-4, 1), xlim=(-4.5, 4.5))
    figure.label(r"height $h/h_\mathrm{rms}$", "probability density")
    figure.legend_above(axes.get_legend_handles_labels()[0], 4)
    return figure


def cells_with_shape(data: Aggregate) -> list[AveragedCell]:
    """Cells of which a finished loop has kept its fields."""
    return [cell for cell in data.cells if cell.fields.shape is not None]


def shown_penetrations(data: Aggregate, most: int) -> list[int]:
    """Places of the penetrations that a figure shows, deepest first."""
    return style.spread_out(range(data.cells[0].plan.penetration.size)[::-1], most)


def _spectra_of_branch(data: Aggregate, b: int) -> style.PublishedFigure:
    """Spectral densities on one branch, a panel for each H."""
    chosen = shown_penetrations(data, 3)
    looks = [style.look(n) | style.line(n) for n in range(len(chosen))]
    panels: list[Panel] = []
    for hurst in style.spread_out(data.hursts, style.MOST_PANELS):
        (cell,) = nearest(data.finished([hurst], data.works_of_adhesion), paper.FIGURE_5) or (None,)
        depths = [] if cell is None else [f"{cell.plan.penetration[k]:.2f}" for k in chosen]
        lines = [(b, *line) for line in zip(chosen, depths, looks, strict=False)]
        panels.append((cell, "", lines))
    return _spectra(panels, _penetration_handles(data, chosen, looks))


def _spectra(panels: Sequence[Panel], handles: list[Line2D]) -> style.PublishedFigure:
    """Draw states over the rigid profile and the reference slopes; nothing without a cell."""
    height = (16 + 52 * len(panels)) * style.MM
    figure = style.new_figure(len(panels), 1, style.ONE_COLUMN, height, sharex=True)
    for axes, (cell, state, lines) in zip(figure.panels, panels, strict=True):
        if cell is None:
            continue
        for b, k, label, look in lines:
            values = cell.fields.psd_displacement[b, k]
            if np.any(values > 0):  # else no realisation is in contact
                y = np.where(values > 0, values, np.nan)
                options = {"markersize": 2, "markevery": 4, "label": label}
                axes.loglog(cell.plan.wave_number, y, **options, **look)
        present = cell.plan.filled
        q, rigid = cell.plan.wave_number[present], cell.fields.psd_height[present]
        axes.loglog(q, rigid, color="0.55", linewidth=2, label="rigid", zorder=1.5)
        # q^-(2H+1) below and q^-(2+H) above the data, over the profile's own wave numbers
        ends = np.array([q[0], q[-1]])
        for exponent, factor, line in ((2 * cell.hurst + 1, 0.2, ":"), (2 + cell.hurst, 5.0, "-.")):
            slope = factor * rigid[0] * (ends / q[0]) ** -exponent
            axes.loglog(ends, slope, linestyle=line, label=f"slope {-exponent:.1f}", **_SLOPE)
        style.label_panel(axes, f"{cell_label(cell)}{state}")
    figure.label("wave number $q$ (rad/m)", r"spectral density $C(q)$ (m³)")
    profile = style.key("rigid profile", color="0.55", linewidth=2)
    slopes = {"$q^{-(2H+1)}$": ":", "$q^{-(2+H)}$": "-."}
    keys = [style.key(name, ls=line, **_SLOPE) for name, line in slopes.items()]
    figure.legend_above([profile, *handles, *keys], 3)
    return figure


def _draw_shape(axes: Axes, position: Array, profile: Array, gaps: Array, part: Places) -> None:
    """Draw the nodes ``part``, counted on beyond the period where they exceed it.

    Each surface stands above the profile by its own gap. Few nodes, which would show as a polygon,
    are interpolated.
    """
    wide = np.arange(part[0] - _BEYOND, part[-1] + _BEYOND + 1)
    inside, fine = wide % position.size, -(-_FEWEST_NODES // position.size)
    nodes = np.linspace(part[0], part[-1], fine * (part.size - 1) + 1)
    x = 1e3 * nodes * (position[1] - position[0])
    rigid = 1e6 * CubicSpline(wide, profile[inside])(nodes)
    axes.fill_between(x, rigid, rigid.min(), color="0.8", linewidth=0)
    axes.plot(x, rigid, color="0.4", linewidth=0.5, label="rigid")
    for branch, gap in zip(BRANCHES, gaps, strict=True):
        if np.all(np.isfinite(gap)):
            # monotone between nodes: contact stays contact, and nothing overlaps
            surface = rigid + 1e6 * PchipInterpolator(wide, gap[inside])(nodes)
            axes.plot(x, surface, linewidth=0.9, label=branch, **style.LOOK_OF_BRANCH[branch])
    axes.set_xlim(x[0], x[-1])


def _penetration_handles(
    data: Aggregate, chosen: list[int], looks: list[dict[str, Any]]
) -> list[Line2D]:
    # Where the largest penetration varies with H or γ, only its share is the same for all.
    tops = {cell.campaign.cycle.turning_point for cell in data.cells}
    unit = _SIGNS[state_sign(data)]
    if len(tops) > 1 and not data.campaign.cycle.turns_at_stress:
        unit = r"\Delta/\Delta"
    penetration = (data.cells[0].plan if len(tops) == 1 else FieldPlan(data.campaign)).penetration
    return [
        style.key(rf"${unit}_\mathrm{{max}}$ = {penetration[k]:.2f}", **look)
        for k, look in zip(chosen, looks, strict=True)
    ]


def _depth(data: Aggregate, cell: Cell, k: int) -> str:
    """Return "Δ/h_max = 0.41" for the state at one place."""
    return rf"${_SIGNS[state_sign(data)]}_\mathrm{{max}}$ = {cell.plan.penetration[k]:.2f}"


# ---------------------------------------------------------------------- which cells and states


def has_fields(cell: AveragedCell) -> bool:
    """Whether a loop of a cell was in contact at a state with fields, as short of a preload."""
    return bool(np.any(cell.fields.psd_displacement > 0))


def nearest(cells: Sequence[AveragedCell], figure: PaperFigure) -> list[AveragedCell]:
    """Return the cells that are nearest to those of a figure, first in H and then in γ.

    Of those with fields, or, if there are none, of those with results.
    """
    known = [cell for cell in cells if has_fields(cell)] or [cell for cell in cells if cell.done]

    def away(cell: AveragedCell, gamma: float) -> tuple[float, float]:
        return abs(cell.hurst - figure.hurst), abs(cell.work_of_adhesion - gamma)

    found = (
        sorted(known, key=partial(away, gamma=gamma))[:1] for gamma in figure.works_of_adhesion
    )
    return list(dict.fromkeys(chain.from_iterable(found)))


def state_of(plan: FieldPlan, figure: PaperFigure) -> int:
    """Return the place of the stored state that is nearest to a figure's penetration.

    The last state is the turning point, where both branches are one: it is taken if it is alone.
    """
    assert figure.penetration is not None
    before = plan.penetration[:-1] if plan.penetration.size > 1 else plan.penetration
    return int(np.argmin(np.abs(before - figure.penetration)))


def beside_paper(data: Aggregate, figure: PaperFigure) -> str:
    """Return a sentence on what the paper's figure shows, and what is nearest to it here."""
    cells, at = nearest(data.cells, figure), figure.penetration
    plan, drawn = cells[0].plan, at
    if at is not None:
        found = float(plan.penetration[state_of(plan, figure)])
        # A state is stored at the load step that is nearest to the penetration that was asked for.
        half = 0.5 * plan.max_penetration / plan.campaign.cycle.load_steps
        drawn = at if abs(found - at) <= 1.001 * half else found
    wanted = _place(figure.hurst, figure.works_of_adhesion, at)
    here = _place(cells[0].hurst, [cell.work_of_adhesion for cell in cells], drawn)
    rest = "" if here == wanted else f"; the nearest to it here is {here}"
    return f"The paper's figure is at {wanted}{rest}."


def _place(hurst: float, gammas: Sequence[float], penetration: float | None) -> str:
    text = f"H = {hurst:g}, γ = {' and '.join(f'{gamma:g}' for gamma in gammas)} J/m²"
    return text if penetration is None else f"{text}, Δ/h_max = {penetration:.2g}"
