"""Draw the figure of the benchmark: error in the loss against CPU time, one panel a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from adhesis.ensemble.bench.benchmark import Line
from adhesis.ensemble.report.figures import style

# sharp has the darkest colour, so that the methods differ in grey too.
_LOOKS = {
    "grid": {**style.look(0), "ls": style.LINES[0]},
    "sharp": {**style.look(2), "ls": style.LINES[1], "marker": "s"},
}
_PANELS_IN_A_ROW = 2
_PANEL_HEIGHT = 62 * style.MM
# Smaller errors are rounding or chance, and are drawn at this value.
_MIN_ERROR = 1e-10


def draw(lines: Sequence[Line]) -> Figure:
    """Draw the figure; runs that did not finish are left out."""
    scenes = list(dict.fromkeys(line.run.scene for line in lines))
    columns = min(len(scenes), _PANELS_IN_A_ROW)
    rows = math.ceil(len(scenes) / columns)
    with style.style():
        height = 8 * style.MM + rows * _PANEL_HEIGHT
        figure = style.new_figure(rows, columns, style.TWO_COLUMNS, height)
        shown: dict[str, Line2D] = {}
        finished = [line for line in lines if math.isfinite(line.error)]
        for axes, scene in zip(figure.axes, scenes, strict=False):
            for method in _LOOKS:
                here = [line for line in finished if line.run.scene is scene]
                if chosen := [line for line in here if line.run.method == method]:
                    shown[method] = _series(axes, method, chosen)
            style.label_panel(axes, scene.title)
            axes.set(xlabel="CPU time (s)", ylabel="|error in the loss| / loss")
        for axes in figure.axes[len(scenes) :]:
            axes.set_visible(False)
        # One range for all, so that the panels can be compared; with margins for the labels.
        seconds = [line.measured.cpu_seconds for line in finished]
        errors = [_plotted_error(line) for line in finished]
        for axes in figure.axes if finished else ():
            axes.set(xscale="log", yscale="log")
            axes.set_xlim(min(seconds) / 2, 2.5 * max(seconds))
            axes.set_ylim(min(errors) / 3, 5 * max(errors))
        figure.legend_above(list(shown.values()), len(shown))
    return figure


def _series(axes: Axes, method: str, lines: Sequence[Line]) -> Line2D:
    """Draw the runs of one method, each with its setting beside it."""
    seconds = [line.measured.cpu_seconds for line in lines]
    errors = [_plotted_error(line) for line in lines]
    (drawn,) = axes.plot(seconds, errors, label=method, **_LOOKS[method])
    for number, (line, x, y) in enumerate(zip(lines, seconds, errors, strict=True)):
        # Left below for sharp; right for grid, alternately above and below, as its runs lie close.
        left = method == "sharp"
        below = left or number % 2 == 1
        look: Any = {"ha": "right" if left else "left", "va": "top" if below else "bottom"}
        look |= {"textcoords": "offset points", "fontsize": 5, "color": "0.25"}
        setting = f"{line.run.setting:{'.0e' if left else 'g'}}".replace("e-0", "e-")
        axes.annotate(setting, (x, y), (-3 if left else 3, -3 if below else 3), **look)
    return drawn


def _plotted_error(line: Line) -> float:
    return max(abs(line.error), _MIN_ERROR)
