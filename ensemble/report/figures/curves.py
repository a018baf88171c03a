"""Draw mean stress and contact fraction of loops, paths and answers against penetration."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from matplotlib.figure import Figure

from adhesis.ensemble.report.figures import style
from adhesis.solver.model.jump import Branch

Curve = tuple[Mapping[str, Any], Any, dict[str, Any]]
"""Columns of states, the rows of those that are drawn, and the look of their line."""


def draw_curves(curves: Iterable[Curve], ax: object = None) -> Figure:
    """Draw curves.

    ``ax`` is one Axes for the mean stress, or two for mean stress and contact fraction (TypeError,
    ValueError).
    """
    with style.drawn_into(ax):
        figure = style.new_figure(1, 2, style.TWO_COLUMNS, 62 * style.MM)
        panels = figure.given or figure.panels
        for states, rows, look in curves:
            columns = (states["mean_stress"][rows] / 1e3, states["contact_fraction"][rows])
            for panel, y in zip(panels, columns, strict=False):
                panel.plot(states["penetration"][rows], y, **look)
        stress, depth = panels[0], r"penetration $\Delta/h_{\max}$"
        stress.axhline(0, color="0.7", lw=0.5, zorder=0)
        stress.set(xlabel=depth, ylabel=r"mean stress $\bar p$ (kPa)")
        for contact in panels[1:]:
            contact.set(xlabel=depth, ylabel="contact fraction $A/A_0$", ylim=(0, None))
        if len(stress.get_legend_handles_labels()[1]) > 1:
            panels[-1].legend()
        return figure.finish()


def look_of_branch(branch: Branch, k: int = 0) -> dict[str, Any]:
    """Return the look of a branch of the k-th loop; all loops share their loading branch."""
    colour = "k" if branch == "loading" else style.colour(k)
    return {"color": colour, "ls": style.LINE_OF_BRANCH[branch], "label": branch}
