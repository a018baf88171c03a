"""The figure of ``adhesis loop --figure``: mean stress and contact fraction along the path."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adhesis.ensemble.report.figures.style import (
    LINE_OF_BRANCH,
    LOOKS,
    MM,
    TWO_COLUMNS,
    new_figure,
    style,
)
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.path import PathResult


def draw_loops(results: Sequence[LoopResult] | PathResult) -> Figure:
    """Draw loops that share their loading branch, or one path.

    Parameters
    ----------
    results : sequence of LoopResult, ascending turning points; or PathResult
    """
    with style():
        figure = new_figure(1, 2, TWO_COLUMNS, 62 * MM)
        stress, contact = figure.axes
        if isinstance(results, PathResult):
            _draw_path(stress, contact, results)
        else:
            _draw_each(stress, contact, results)
        stress.axhline(0, color="0.7", lw=0.5, zorder=0)
        depth = r"penetration $\Delta/h_{\max}$"
        stress.set(xlabel=depth, ylabel=r"mean stress $\bar p$ (kPa)")
        contact.set(xlabel=depth, ylabel="contact fraction $A/A_0$", ylim=(0, None))
        if len(stress.get_legend_handles_labels()[1]) > 1:
            contact.legend()
    return figure


def _draw_path(stress: Axes, contact: Axes, path: PathResult) -> None:
    for leg in range(int(path.leg.max()) + 1):
        rows = path.leg == leg
        look = LOOKS[leg % len(LOOKS)]
        branch = str(path.branch[rows][0])
        label = f"leg {leg + 1}, {branch}"
        options = {"color": look.colour, "ls": LINE_OF_BRANCH[branch], "label": label}
        stress.plot(path.penetration[rows], path.mean_stress[rows] / 1e3, **options)
        contact.plot(path.penetration[rows], path.contact_fraction[rows], **options)


def _draw_each(stress: Axes, contact: Axes, loops: Sequence[LoopResult]) -> None:
    deepest = loops[-1]
    for k, loop in enumerate(loops):
        rows = loop.states("unloading")
        colour = LOOKS[k % len(LOOKS)].colour
        label = f"unloading from {loop.penetration[rows[0]]:.3g}"
        options = {"color": colour, "ls": LINE_OF_BRANCH["unloading"], "label": label}
        stress.plot(loop.penetration[rows], loop.mean_stress[rows] / 1e3, **options)
        contact.plot(loop.penetration[rows], loop.contact_fraction[rows], **options)
    rows = deepest.states("loading")
    options = {"color": "k", "ls": LINE_OF_BRANCH["loading"], "label": "loading"}
    stress.plot(deepest.penetration[rows], deepest.mean_stress[rows] / 1e3, **options)
    contact.plot(deepest.penetration[rows], deepest.contact_fraction[rows], **options)
