"""Figures of a loop, mean stress and contact fraction along the path; and of shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adhesis.ensemble.report.figures.style import (
    LINE_OF_BRANCH,
    LOOKS,
    MM,
    TWO_COLUMNS,
    drawn_into,
    new_figure,
    style,
)
from adhesis.ensemble.trace.prepare import Prepared
from adhesis.ensemble.trace.reading.measured_trace import Trace
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.loop_state import LoopState
from adhesis.solver.loading.path import PathResult
from adhesis.solver.method import Fields, Opening
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array, Profile


def draw_loops(results: Sequence[LoopResult] | PathResult, ax: object = None) -> Figure:
    """Draw loops that share their loading branch, or one path.

    Parameters
    ----------
    results : sequence of LoopResult, ascending turning points; or PathResult
    ax : Axes or sequence of Axes, optional
        One for the mean stress, or two for mean stress and contact fraction.

    Raises
    ------
    TypeError
        If ``ax`` is neither.
    ValueError
        If it holds more than two.
    """
    with drawn_into(ax):
        figure = new_figure(1, 2, TWO_COLUMNS, 62 * MM)
        _draw(results, figure.given or figure.panels)
        return figure.finish()


def _draw(results: Sequence[LoopResult] | PathResult, panels: Sequence[Axes]) -> None:
    """Draw the mean stress into the first of the panels, and the contact fraction into a second."""
    if isinstance(results, PathResult):
        _draw_path(panels, results)
    else:
        _draw_each(panels, results)
    stress, depth = panels[0], r"penetration $\Delta/h_{\max}$"
    stress.axhline(0, color="0.7", lw=0.5, zorder=0)
    stress.set(xlabel=depth, ylabel=r"mean stress $\bar p$ (kPa)")
    for contact in panels[1:]:
        contact.set(xlabel=depth, ylabel="contact fraction $A/A_0$", ylim=(0, None))
    if len(stress.get_legend_handles_labels()[1]) > 1:
        panels[-1].legend()


def _plot(panels: Sequence[Axes], x: Array, stress: Array, contact: Array, **options: Any) -> None:
    for panel, y in zip(panels, (stress / 1e3, contact), strict=False):
        panel.plot(x, y, **options)


def _draw_path(panels: Sequence[Axes], path: PathResult) -> None:
    for leg in range(int(path.leg.max()) + 1):
        rows = path.leg == leg
        look = LOOKS[leg % len(LOOKS)]
        branch = str(path.branch[rows][0])
        label = f"leg {leg + 1}, {branch}"
        options = {"color": look.colour, "ls": LINE_OF_BRANCH[branch], "label": label}
        _plot(panels, *_curve(path, rows), **options)


def _curve(path: LoopResult | PathResult, rows: Any) -> tuple[Array, Array, Array]:
    return path.penetration[rows], path.mean_stress[rows], path.contact_fraction[rows]


def _draw_each(panels: Sequence[Axes], loops: Sequence[LoopResult]) -> None:
    deepest = loops[-1]
    for k, loop in enumerate(loops):
        rows = loop.states("unloading")
        colour = LOOKS[k % len(LOOKS)].colour
        label = f"unloading from {loop.penetration[rows[0]]:.3g}"
        options = {"color": colour, "ls": LINE_OF_BRANCH["unloading"], "label": label}
        _plot(panels, *_curve(loop, rows), **options)
    rows = deepest.states("loading")
    options = {"color": "k", "ls": LINE_OF_BRANCH["loading"], "label": "loading"}
    _plot(panels, *_curve(deepest, rows), **options)


_POINTS = 2000  # of a drawn profile


def draw_shape(shown: Any) -> Figure | None:
    """Draw heights, gap or fields against the position; None for what has none of them."""
    curves = _curves(shown)
    if not curves:
        return None
    with style():
        figure = new_figure(1, 1, TWO_COLUMNS, 48 * MM)
        (axes,) = figure.axes
        for label, x, y in curves:
            axes.plot(1e3 * x, 1e6 * y, lw=0.8, label=label)
        axes.set(xlabel="position (mm)", ylabel="µm")
        axes.legend(loc="best")
    return figure


def _curves(shown: Any) -> list[tuple[str, Any, Any]]:
    """Return label, positions and heights (m) of the curves of an object."""
    if isinstance(shown, Problem):
        shown = shown.profile
    if isinstance(shown, Profile):
        x = np.linspace(0.0, shown.period, _POINTS)
        return [("profile", x, shown.at(x))]
    if isinstance(shown, Trace):
        return [("heights as read", shown.step * np.arange(shown.points), shown.heights)]
    if isinstance(shown, Prepared):
        level = shown.level()
        used = _curves(shown.profile())[0][1:]
        return [("level", shown.step * np.arange(level.size), level), ("used, one period", *used)]
    if isinstance(shown, LoopState):
        shown = shown.fields()
    if isinstance(shown, Fields):
        return [("profile", shown.x, shown.height), ("surface", shown.x, shown.height + shown.gap)]
    if isinstance(shown, Opening):
        return [("gap", shown.x, shown.gap)]
    return []
