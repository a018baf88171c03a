"""Figures of a loop, mean stress and contact fraction along the path; and of shapes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from adhesis.ensemble.report.figures import style
from adhesis.ensemble.trace.prepare import Prepared
from adhesis.ensemble.trace.reading.measured_trace import Trace
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.loop_state import LoopState
from adhesis.solver.loading.path import PathResult
from adhesis.solver.method import Fields, Opening
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Profile


def draw_loops(results: Sequence[LoopResult] | PathResult, ax: object = None) -> Figure:
    """Draw loops of ascending turning points that share their loading branch, or one path.

    ``ax`` is one Axes for the mean stress, or two for mean stress and contact fraction (TypeError,
    ValueError).
    """
    with style.drawn_into(ax):
        figure = style.new_figure(1, 2, style.TWO_COLUMNS, 62 * style.MM)
        panels = figure.given or figure.panels
        for result, rows, options in _lines(results):
            columns = (result.mean_stress[rows] / 1e3, result.contact_fraction[rows])
            for panel, y in zip(panels, columns, strict=False):
                panel.plot(result.penetration[rows], y, **options)
        stress, depth = panels[0], r"penetration $\Delta/h_{\max}$"
        stress.axhline(0, color="0.7", lw=0.5, zorder=0)
        stress.set(xlabel=depth, ylabel=r"mean stress $\bar p$ (kPa)")
        for contact in panels[1:]:
            contact.set(xlabel=depth, ylabel="contact fraction $A/A_0$", ylim=(0, None))
        if len(stress.get_legend_handles_labels()[1]) > 1:
            panels[-1].legend()
        return figure.finish()


def _lines(
    results: Sequence[LoopResult] | PathResult,
) -> Iterator[tuple[LoopResult | PathResult, Any, dict[str, Any]]]:
    """Return what is drawn: a result, the rows of its states, and the look of their line."""
    if isinstance(results, PathResult):
        for leg in range(int(results.leg.max()) + 1):
            rows = results.leg == leg
            branch = str(results.branch[rows][0])
            options = {"color": style.colour(leg), "ls": style.LINE_OF_BRANCH[branch]}
            yield results, rows, options | {"label": f"leg {leg + 1}, {branch}"}
        return
    for k, loop in enumerate(results):
        rows = loop.states("unloading")
        options = {"color": style.colour(k), "ls": style.LINE_OF_BRANCH["unloading"]}
        yield loop, rows, options | {"label": f"unloading from {loop.penetration[rows[0]]:.3g}"}
    options = {"color": "k", "ls": style.LINE_OF_BRANCH["loading"], "label": "loading"}
    yield results[-1], results[-1].states("loading"), options


_POINTS = 2000  # of a drawn profile


def draw_shape(shown: Any) -> Figure | None:
    """Draw heights, gap or fields against the position; None for what has none of them."""
    curves = _curves(shown)
    if not curves:
        return None
    with style.style():
        figure = style.new_figure(1, 1, style.TWO_COLUMNS, 48 * style.MM)
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
