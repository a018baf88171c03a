"""Set what all figures share: sizes, the look of each γ and branch, and saving.

Figures are built on ``matplotlib.figure.Figure`` itself: no pyplot, no global backend, no window.
Every γ differs by colour (Okabe & Ito), marker and darkness, every branch by line style, so that a
figure can be read in grey and by colour-blind people.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from adhesis.ensemble.aggregate.average import Aggregate

STYLE = Path(__file__).parent / "adhesis.mplstyle"

MM = 1 / 25.4  # inches
ONE_COLUMN = 85 * MM
TWO_COLUMNS = 175 * MM

# A panel with more curves than this cannot be read; panels beyond it make no page.
MOST_CURVES = 6
MOST_PANELS = 4

LINES: tuple[Any, ...] = (
    "-",
    (0, (4, 1.5)),
    (0, (1, 1)),
    (0, (4, 1, 1, 1)),
    (0, (7, 1.5)),
    (0, (4, 1, 1, 1, 1, 1)),
)
LINE_OF_BRANCH: dict[str, Any] = {"loading": "-", "unloading": LINES[1]}


@dataclass(frozen=True)
class Look:
    """Colour and marker of one curve."""

    colour: str
    marker: str


# Okabe & Ito's colours, in an order in which the darkness of neighbours differs.
LOOKS = (
    Look("#E69F00", "o"),
    Look("#0072B2", "s"),
    Look("#000000", "^"),
    Look("#CC79A7", "D"),
    Look("#009E73", "v"),
    Look("#56B4E9", "P"),
)


@contextmanager
def style() -> Iterator[None]:
    """Use the style file inside the block only."""
    with mpl.rc_context(fname=str(STYLE)):
        yield


def look(k: int) -> Look:
    """Return the look of the k-th curve of a panel."""
    return LOOKS[k % len(LOOKS)]


def spread_out(values: Sequence[float], most: int) -> list[float]:
    """At most so many of the values, evenly spread, first and last included."""
    if len(values) <= most:
        return list(values)
    return [values[round(k)] for k in np.linspace(0, len(values) - 1, most)]


def shown_gammas(data: Aggregate) -> list[tuple[int, float]]:
    """Works of adhesion that a figure shows, each with the place of its look; with results only."""
    finished = {cell.work_of_adhesion for cell in data.cells if cell.done}
    shown = spread_out(data.works_of_adhesion, MOST_CURVES)
    return [(k, gamma) for k, gamma in enumerate(shown) if gamma in finished]


def left_out(data: Aggregate) -> str:
    """A sentence on the H and γ that figures leave out for the sake of the eye; empty if none."""
    parts = [
        f"{most} of {len(values)} {name}"
        for name, values, most in (
            ("H", data.hursts, MOST_PANELS),
            ("γ", data.works_of_adhesion, MOST_CURVES),
        )
        if len(values) > most
    ]
    what = "Figures with a panel for each H and a curve for each γ show"
    return f"{what} {' and '.join(parts)}." if parts else ""


class PublishedFigure(Figure):
    """A figure whose PDF has TrueType fonts, also when it is saved outside of :func:`style`.

    Publishers refuse the Type 3 fonts that matplotlib writes by default.
    """

    def savefig(self, *args: Any, **options: Any) -> None:
        """Save as :meth:`matplotlib.figure.Figure.savefig` does."""
        with mpl.rc_context({"pdf.fonttype": 42, "ps.fonttype": 42}):
            super().savefig(*args, **options)


def new_figure(rows: int, columns: int, width: float, height: float, **options: Any) -> Figure:
    """Return a figure of the given width and height (inches) with a grid of panels."""
    figure = PublishedFigure(figsize=(width, height))
    figure.subplots(rows, columns, squeeze=False, **options)
    return figure


def panels(figure: Figure, rows: int, columns: int) -> list[list[Axes]]:
    """Return the panels of :func:`new_figure`, row by row."""
    axes = figure.axes[: rows * columns]
    return [axes[k * columns : (k + 1) * columns] for k in range(rows)]


def plain_decades(axes: Sequence[Axes]) -> None:
    """Label whole decades of logarithmic axes only."""
    for panel in axes:
        for axis, scale in ((panel.xaxis, panel.get_xscale()), (panel.yaxis, panel.get_yscale())):
            low, high = axis.get_view_interval()
            if scale == "log" and high >= 20 * low:
                axis.set_minor_formatter(NullFormatter())


def legend_above(figure: Figure, handles: Sequence[Any], columns: int) -> None:
    """Put the legend above the panels, where it hides no data."""
    figure.legend(handles=handles, loc="outside upper center", ncols=columns)


def say_below(figure: Figure, text: str) -> None:
    """Write below the panels what all of them have in common; nothing if empty."""
    if text:
        figure.supxlabel(text, fontsize=6, x=0.99, ha="right")


def label_panel(axes: Axes, text: str) -> None:
    """Write what a panel shows into its upper left corner."""
    axes.set_title(text, loc="left", pad=3)


def gamma_label(work_of_adhesion: float) -> str:
    """Return the legend of one γ."""
    return rf"$\gamma$ = {work_of_adhesion:g} J/m²"


@contextmanager
def _without_shaping_tables() -> Iterator[None]:
    """Leave out of a PDF's fonts what shapes text, which costs more than all else in them.

    A PDF names its glyphs by number, so that no reader looks there. The list does not belong to
    fontTools' interface: where there is none, a PDF takes longer and is a little larger.
    """
    options: Any = import_module("fontTools.subset").Options  # matplotlib's own dependency
    dropped = getattr(options, "_drop_tables_default", [])
    options._drop_tables_default = [*dropped, "GSUB", "GPOS", "GDEF"]
    try:
        yield
    finally:
        options._drop_tables_default = dropped


def save(figure: Figure, stem: Path) -> tuple[Path, Path]:
    """Save a figure as PNG (300 dpi) and PDF; the same figure gives the same bytes.

    The layout is found once, on the canvas of the PNG, which keeps the sizes of texts.
    """
    png, pdf = stem.with_suffix(".png"), stem.with_suffix(".pdf")
    # What no layout engine means: savefig, too, sets it again.
    with (
        style(),
        _without_shaping_tables(),
        mpl.rc_context({"figure.constrained_layout.use": False}),
    ):
        FigureCanvasAgg(figure)
        figure.set_dpi(mpl.rcParams["savefig.dpi"])
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(png, metadata={"Software": None})
        figure.savefig(pdf, metadata={"CreationDate": None, "Producer": None, "Creator": None})
    return png, pdf
