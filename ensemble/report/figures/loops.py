"""Averaged loops: contact fraction against stress (Fig. 6), both against penetration (Fig. 7)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.report.figures import style
from adhesis.ensemble.report.further_axes import gamma_label
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.profile import Array

_MARKERS_PER_CURVE = 8


def contact_against_stress(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Contact fraction against mean stress"."""
    figure, rows = style.row_for_each_hurst(data, 1, 16, 46)
    for (axes,), hurst in rows:
        for k, cell in style.curves_of(data, hurst):
            for branch in BRANCHES:
                stress = cell.curves[f"{branch}_mean_stress_over_slope"].mean
                area = cell.curves[f"{branch}_contact_fraction"]
                if cell.done > 1:
                    _shade(axes, stress, area.mean - area.std, area.mean + area.std, k)
                _plot(axes, stress, area.mean, cell, branch, k)
        style.label_panel(axes, f"H = {hurst:g}")
        axes.set_ylim(bottom=0)
    figure.label(r"mean stress $\tilde\sigma/\sqrt{m_2}$", "contact fraction $A/A_0$")
    _legend(data, figure, 3)
    return figure


def _shade(axes: Axes, x: Array, low: Array, high: Array, k: int) -> None:
    """Shade between two curves, also where x runs back: all between each two points of both."""
    known = np.isfinite(x) & np.isfinite(low)  # loops end at several places
    points = np.stack([x, low, high], axis=1)[known]
    ends = np.stack([points[:-1], points[1:]])
    back = ends[0, :, 0] > ends[1, :, 0]
    ends[:, back] = ends[::-1, back]  # all quadrilaterals turn one way: none cancels another
    (left, right), low_end, high_end = ends, [0, 1], [0, 2]
    corners = (left[:, low_end], right[:, low_end], right[:, high_end], left[:, high_end])
    path = Path.make_compound_path_from_polys(np.stack(corners, axis=1))
    axes.add_patch(PathPatch(path, color=style.colour(k), alpha=0.15, linewidth=0))


def loop_against_penetration(data: Aggregate) -> style.PublishedFigure:
    """Draw the figure "Mean stress and contact fraction against penetration"."""
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
                        _shade(axes, depth, mean - std, mean + std, k)
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
