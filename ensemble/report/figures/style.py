"""Set what all figures share: sizes, the look of each γ and branch, and saving.

Figures are built on ``matplotlib.figure.Figure`` itself: no pyplot, no global backend, no window.
Every γ differs by colour (Okabe & Ito), marker and darkness, every branch by line style, so that a
figure can be read in grey and by colour-blind people.
"""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from pathlib import Path
from typing import Any, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.files import whole_file
from adhesis.solver.checks import counted, shown
from adhesis.solver.model.jump import Branch

Shown = TypeVar("Shown")
Curve = tuple[Mapping[str, Any], Any, dict[str, Any]]
"""Columns of states, the rows of those that are drawn, and the look of their line."""

MM = 1 / 25.4  # inches
_MOST_COLUMNS_INSIDE = 2  # of a legend in a panel that is given
CAP = 2  # half of the width of an error bar's cap in points, also in axes that are given
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
# Where one loop is drawn, or both branches over the rigid profile.
LOOK_OF_BRANCH: dict[str, dict[str, Any]] = {
    "loading": {"color": "#0072B2", "linestyle": LINE_OF_BRANCH["loading"]},
    "unloading": {"color": "#D55E00", "linestyle": LINE_OF_BRANCH["unloading"]},
}


# Okabe & Ito's colours, in an order in which the darkness of neighbours differs, and markers.
_LOOKS = (
    *(("#E69F00", "o"), ("#0072B2", "s"), ("#000000", "^")),
    *(("#CC79A7", "D"), ("#009E73", "v"), ("#56B4E9", "P")),
)


def style() -> AbstractContextManager[None]:
    """Return a context in which the style file is used."""
    return mpl.rc_context(fname=str(Path(__file__).with_name("adhesis.mplstyle")))


def look(k: int) -> dict[str, Any]:
    """Return colour and marker of the k-th curve of a panel, as options of matplotlib."""
    return {"color": colour(k), "marker": _LOOKS[k % len(_LOOKS)][1]}


def line(k: int) -> dict[str, Any]:
    """Return colour and line style of the k-th curve of a panel, as options of matplotlib."""
    return {"color": colour(k), "linestyle": LINES[k]}


def colour(k: int) -> str:
    """Return the colour of the k-th curve of a panel."""
    return _LOOKS[k % len(_LOOKS)][0]


def key(label: str, **options: Any) -> Line2D:
    """Return the entry of a legend for a line or marker with these options of matplotlib."""
    return Line2D([], [], label=label, **options)


def spread_out(values: Sequence[Shown], most: int) -> list[Shown]:
    """At most so many of the values, evenly spread, first and last included."""
    if len(values) <= most:
        return list(values)
    return [values[round(k)] for k in np.linspace(0, len(values) - 1, most)]


def shown_gammas(data: Aggregate) -> list[tuple[int, float]]:
    """Works of adhesion that a figure shows, each with the place of its look; with results only."""
    finished = {cell.work_of_adhesion for cell in data.cells if cell.done}
    shown = spread_out(data.works_of_adhesion, MOST_CURVES)
    return [(k, gamma) for k, gamma in enumerate(shown) if gamma in finished]


def curves_of(data: Aggregate, hurst: float) -> list[tuple[int, AveragedCell]]:
    """Cells of one H that a figure shows, each with the place of the look of its γ."""
    shown = shown_gammas(data)
    return [(k, cell) for k, gamma in shown for cell in data.finished([hurst], [gamma])]


def left_out(data: Aggregate) -> str:
    """A sentence on the H and γ that figures leave out for the sake of the eye; empty if none."""
    shown = (("H", data.hursts, MOST_PANELS), ("γ", data.works_of_adhesion, MOST_CURVES))
    parts = [f"{most} of {len(all_)} {name}" for name, all_, most in shown if len(all_) > most]
    what = "Figures with a panel for each H and a curve for each γ show"
    return f"{what} {' and '.join(parts)}." if parts else ""


_given: ContextVar[tuple[Axes, ...]] = ContextVar("_given", default=())


@contextmanager
def drawn_into(ax: object) -> Iterator[None]:
    """Let the first panels of a figure be axes that a user gives, in the user's own style.

    Without them, all panels are the figure's, in the style of the product. TypeError if ``ax`` is
    neither None nor one or several Axes.
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
    """

    given: tuple[Axes, ...] = ()  # those of :func:`drawn_into`, in place of its first panels
    columns = 1
    inside: Legend | None = None  # at the top of the first panel given
    note: Annotation | None = None  # below the last panel given

    @property
    def panels(self) -> list[Axes]:
        """The axes of its panels, row by row: those given, and its own."""
        return [*self.given, *self.axes[len(self.given) :]]

    @property
    def rows(self) -> list[list[Axes]]:
        """The panels of each row."""
        panels, n = self.panels, self.columns
        return [panels[k : k + n] for k in range(0, len(panels), n)]

    def label(self, x: str, *y: str) -> None:
        """Label the lowest panels, and all given ones, below, and the first of each row aside."""
        for axes in (*self.panels[-self.columns :], *self.given):
            axes.set_xlabel(x)
        for row in self.rows:
            for axes, text in zip(row, y, strict=False):
                axes.set_ylabel(text)

    def legend_above(self, handles: Sequence[Any], columns: int) -> None:
        """Put the legend above the panels, where it hides no data.

        In the first panel given, whose surroundings are not the figure's own, :meth:`finish` makes
        room for it.
        """
        if self.given:
            narrow = min(columns, _MOST_COLUMNS_INSIDE)
            self.inside = self.given[0].legend(handles=handles, loc="upper center", ncols=narrow)
        else:
            self.legend(handles=handles, loc="outside upper center", ncols=columns)

    def say_below(self, text: str) -> None:
        """Write lines below the panels, or below the last one given."""
        if not text:
            return
        if not self.given:
            lines = _wrapped(text, self.get_figwidth())
            self.supxlabel(lines, fontsize=_SMALL, x=0.99, ha="right")
            return
        axes = self.given[-1]
        box = axes.get_window_extent()
        below: Any = {"xycoords": ("axes fraction", axes.xaxis.label), "va": "top", "ha": "right"}
        below |= {"textcoords": "offset points", "fontsize": _SMALL}
        lines = _wrapped(text, box.width / axes.figure.dpi)
        self.note = axes.annotate(lines, (1, 0), (0, -3), **below)

    def finish(self) -> Figure:
        """Lay it out, and return the figure that was drawn into: this one, or that of the axes.

        A note that the layout of a given figure cuts off is a warning.
        """
        if not self.given:
            self.canvas.draw()  # the layout is found with the style's own sizes
            return self
        found = self.given[0].get_figure(root=True)
        assert found is not None
        found.draw_without_rendering()  # the layout decides how high axes and legend are
        if self.inside is not None:
            _make_room(self.given[0], self.inside)
        if self.note is not None and self.note.get_window_extent().y0 < 0:
            warnings.warn(
                'a figure with layout="constrained" has room for the note below the axes: '
                + "; ".join(self.note.get_text().splitlines()),
                stacklevel=4,  # the line that calls a method of Plots
            )
        return found

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=_DPI_OF_NOTEBOOK)
        return stream.getvalue()

    def savefig(self, *args: Any, **options: Any) -> None:
        """Save as :meth:`matplotlib.figure.Figure.savefig` does."""
        with mpl.rc_context({"pdf.fonttype": 42, "ps.fonttype": 42}):
            super().savefig(*args, **options)


def _wrapped(text: str, width: float) -> str:
    """Break small lines of text to a width in inches."""
    signs = max(1, int(width / _WIDTH_OF_SIGN))
    return "\n".join(textwrap.fill(line, signs) for line in text.splitlines())


def _make_room(axes: Axes, legend: Legend) -> None:
    """Raise the upper end of the y axis by the height of a legend that stands at the top."""
    box = axes.get_window_extent()
    share = (box.y1 - legend.get_window_extent().y0) / box.height
    if share < 1:  # else the legend alone fills the panel
        scale = axes.yaxis.get_transform()
        low, high = scale.transform(axes.get_ylim())
        top = scale.inverted().transform([low + (high - low) / (1 - share)])
        axes.set_ylim(top=float(top[0]))


def new_figure(
    rows: int, columns: int, width: float, height: float, **options: Any
) -> PublishedFigure:
    """Return a figure of this size (inches) with panels; ValueError for more given axes."""
    given = _given.get()
    if len(given) > rows * columns:
        raise ValueError(
            f"ax holds {len(given)} Axes: this figure has {counted(rows * columns, 'panel')}"
        )
    figure = PublishedFigure(figsize=(width, height))
    figure.subplots(rows, columns, squeeze=False, **options)
    figure.given, figure.columns = given, columns
    return figure


def row_for_each_hurst(
    data: Aggregate, columns: int, above: float, each: float, **options: Any
) -> tuple[PublishedFigure, list[tuple[list[Axes], float]]]:
    """Return a figure with a row of panels for each H, ``each`` so high in mm, and the rows."""
    hursts = spread_out(data.hursts, MOST_PANELS)
    width, height = ONE_COLUMN if columns == 1 else TWO_COLUMNS, (above + each * len(hursts)) * MM
    figure = new_figure(len(hursts), columns, width, height, sharex=True, **options)
    return figure, list(zip(figure.rows, hursts, strict=True))


def label_panel(axes: Axes, text: str) -> None:
    """Write what a panel shows into its upper left corner."""
    axes.set_title(text, loc="left", pad=3)


def draw_curves(curves: Iterable[Curve], ax: object = None) -> Figure:
    """Draw curves.

    ``ax`` is one Axes for the mean stress, or two for mean stress and contact fraction (TypeError,
    ValueError).
    """
    with drawn_into(ax):
        figure = new_figure(1, 2, TWO_COLUMNS, 62 * MM)
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
    shade = "k" if branch == "loading" else colour(k)
    return {"color": shade, "ls": LINE_OF_BRANCH[branch], "label": branch}


def save(figure: Figure, stem: Path) -> None:
    """Save a figure as PNG (300 dpi) and PDF; the same figure gives the same bytes.

    The layout is found once, on the canvas of the PNG, which keeps the sizes of texts.
    """
    # What no layout engine means: savefig, too, sets it again.
    with style(), mpl.rc_context({"figure.constrained_layout.use": False}):
        FigureCanvasAgg(figure)
        figure.set_dpi(mpl.rcParams["savefig.dpi"])
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine(None)
        write(figure, stem.with_suffix(".png"), metadata={"Software": None})
        created = {"CreationDate": None, "Producer": None, "Creator": None}
        write(figure, stem.with_suffix(".pdf"), metadata=created)


def write(figure: Figure, path: Path, **options: Any) -> None:
    """Write a figure to a file, whole or not at all (OSError).

    It is drawn in memory: where the writer of a format meets a full disk, it raises what it likes.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format=path.suffix[1:].lower(), **options)
    with whole_file(path) as stream:
        stream.write(drawn.getvalue())
