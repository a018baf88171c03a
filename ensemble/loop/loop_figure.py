"""Figures of a loop, mean stress and contact fraction along the path; and of shapes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from adhesis.ensemble.loop.record import Result
from adhesis.ensemble.report.figures import style
from adhesis.ensemble.trace.prepare import Prepared
from adhesis.ensemble.trace.reading.measured_trace import Trace
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.loop_state import LoopState
from adhesis.solver.method import Fields, Opening
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Profile


def draw_loops(results: Sequence[Result], ax: object = None) -> Figure:
    """Draw loops of ascending turning points that share their loading branch, or one path.

    ``ax`` is that of :func:`adhesis.ensemble.report.figures.style.draw_curves`.
    """
    return style.draw_curves(_curves_of(results), ax)


def _curves_of(results: Sequence[Result]) -> Iterator[style.Curve]:
    for k, result in enumerate(results):
        columns = result.columns()
        if isinstance(result, LoopResult):
            rows = result.states("unloading")
            label = f"unloading from {result.penetration[rows[0]]:.3g}"
            yield columns, rows, style.look_of_branch("unloading", k) | {"label": label}
            if result is results[-1]:
                yield columns, result.states("loading"), style.look_of_branch("loading")
            continue
        for leg in range(int(result.leg.max()) + 1):
            chosen = result.leg == leg
            branch = str(result.branch[chosen][0])
            options = {"color": style.colour(leg), "ls": style.LINE_OF_BRANCH[branch]}
            yield columns, chosen, options | {"label": f"leg {leg + 1}, {branch}"}


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
