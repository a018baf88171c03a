"""Set what all figures share: sizes, the look of each γ and branch, and saving.

Figures are built on ``matplotlib.figure.Figure`` itself: no pyplot, no global backend, no window.
Every γ differs by colour (Okabe & Ito), marker and darkness, every branch by line style, so that a
figure can be read in grey and by colour-blind people.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
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
from adhesis.ensemble.quantities import gamma_text
from adhesis.solver.checks import counted, shown

STYLE = Path(__file__).parent / "adhesis.mplstyle"

MM = 1 / 25.4  # inches
_DPI_OF_NOTEBOOK = 110
_SMALL = 6  # points, and the mean width of a sign of that size in inches
_WIDTH_OF_SIGN = 0.58 * _SMALL / 72
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


_given: ContextVar[tuple[Axes, ...]] = ContextVar("_given", default=())


@contextmanager
def drawn_into(ax: object) -> Iterator[None]:
    """Let the first panels of a figure be axes that a user gives, in the user's own style.

    Parameters
    ----------
    ax : Axes or array of Axes, or None
        Without them, all panels are the figure's, in the style of the product.

    Raises
    ------
    TypeError
        If it is anything else.
    """
    found = () if ax is None else np.ravel(np.array(ax, dtype=object))
    given = tuple(panel for panel in found if isinstance(panel, Axes))
    if ax is not None and (not given or len(given) < len(found)):
        raise TypeError(f"ax is {shown(ax)}: it must be one Axes of matplotlib, or several of them")
    token = _given.set(given)
    try:
        with nullcontext() if given else style():
            yield
    finally:
        _given.reset(token)


class PublishedFigure(Figure):
    """A figure that a notebook displays, and whose PDF has TrueType fonts.

    Also when it is saved outside of :func:`style`: publishers refuse the Type 3 fonts that
    matplotlib writes by default.

    Attributes
    ----------
    given : tuple of Axes
        Those of :func:`drawn_into`, which take the place of its first panels.
    """

    given: tuple[Axes, ...] = ()

    @property
    def panels(self) -> list[Axes]:
        """The axes of its panels, row by row: those given, and its own."""
        return [*self.given, *self.axes[len(self.given) :]]

    def finish(self) -> Figure:
        """Lay it out, and return the figure that was drawn into: this one, or that of the axes."""
        if not self.given:
            self.canvas.draw()  # the layout is found with the style's own sizes
            return self
        found = self.given[0].get_figure(root=True)
        assert found is not None
        return found

    def _repr_png_(self) -> bytes:
        """Return the figure as a picture, for notebooks."""
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=_DPI_OF_NOTEBOOK)
        return stream.getvalue()

    def savefig(self, *args: Any, **options: Any) -> None:
        """Save as :meth:`matplotlib.figure.Figure.savefig` does."""
        with mpl.rc_context({"pdf.fonttype": 42, "ps.fonttype": 42}):
            super().savefig(*args, **options)


def new_figure(
    rows: int, columns: int, width: float, height: float, **options: Any
) -> PublishedFigure:
    """Return a figure of the given width and height (inches) with a grid of panels.

    Raises
    ------
    ValueError
        If more axes are given than it has panels.
    """
    given = _given.get()
    if len(given) > rows * columns:
        raise ValueError(
            f"ax holds {len(given)} Axes: this figure has {counted(rows * columns, 'panel')}"
        )
    figure = PublishedFigure(figsize=(width, height))
    figure.subplots(rows, columns, squeeze=False, **options)
    figure.given = given
    return figure


def panels(figure: PublishedFigure, rows: int, columns: int) -> list[list[Axes]]:
    """Return the panels of :func:`new_figure`, row by row."""
    axes = figure.panels[: rows * columns]
    return [axes[k * columns : (k + 1) * columns] for k in range(rows)]


def with_x_label(figure: PublishedFigure, columns: int, count: int) -> list[Axes]:
    """Return the panels that have a label below: the lowest of ``count``, and all given ones."""
    return [*figure.panels[max(count - columns, 0) : count], *figure.given]


def plain_decades(axes: Sequence[Axes]) -> None:
    """Label whole decades of logarithmic axes only."""
    for panel in axes:
        for axis, scale in ((panel.xaxis, panel.get_xscale()), (panel.yaxis, panel.get_yscale())):
            low, high = axis.get_view_interval()
            if scale == "log" and high >= 20 * low:
                axis.set_minor_formatter(NullFormatter())


def legend_above(figure: PublishedFigure, handles: Sequence[Any], columns: int) -> None:
    """Put the legend above the panels, where it hides no data; or into the first axes given."""
    if figure.given:
        figure.given[0].legend(handles=handles)
        return
    figure.legend(handles=handles, loc="outside upper center", ncols=columns)


def say_below(figure: PublishedFigure, text: str) -> None:
    """Write below the panels what all of them have in common; nothing below axes that are given."""
    if text and not figure.given:
        width = int(figure.get_figwidth() / _WIDTH_OF_SIGN)
        figure.supxlabel(textwrap.fill(text, width), fontsize=_SMALL, x=0.99, ha="right")


def label_panel(axes: Axes, text: str) -> None:
    """Write what a panel shows into its upper left corner."""
    axes.set_title(text, loc="left", pad=3)


def gamma_label(work_of_adhesion: float) -> str:
    """Return the legend of one γ."""
    return rf"$\gamma$ = {gamma_text(work_of_adhesion)}"


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
