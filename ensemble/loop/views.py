"""Figure, film, tables and file of a result, as its methods return them, and the progress bar.

The mechanics find this module by :data:`adhesis.solver.views.maker`. A call loads matplotlib.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import fields, is_dataclass
from typing import Any

from adhesis.ensemble.loop.record import Result
from adhesis.ensemble.quantities import UNITS, drive_text, stress_text
from adhesis.ensemble.reporter import bar
from adhesis.solver.checks import counted
from adhesis.solver.loading.path_record import Progress
from adhesis.solver.method import Branch, ContactState, Method
from adhesis.solver.values import brief


def plot(result: Result, ax: Any = None) -> Any:
    """Draw mean stress and contact fraction; see :meth:`adhesis.LoopResult.plot`."""
    from adhesis.ensemble.loop.loop_figure import draw_loops

    return draw_loops([result], ax)


def film(
    result: Result,
    path: str | os.PathLike[str] | None,
    *,
    frames: int,
    progress: Callable[[int, int], None] | bool | None,
) -> Any:
    """Make a film, and write it where a path is given; see :meth:`adhesis.LoopResult.film`."""
    from adhesis.ensemble.loop.film import Film, check_film

    if path is not None:
        path = check_film("path", path)
    with bar("frames") if progress is True else nullcontext(progress or None) as shown:
        made = Film(result, frames, shown)
        if path is not None:
            made.save(path, progress=shown if progress is True else None)
    return made


def __getattr__(name: str) -> Any:
    if name not in ("to_dataframe", "to_xarray", "save"):
        raise AttributeError(name)
    from adhesis.ensemble.loop import saved  # loads pandas and xarray

    return getattr(saved, name)


def page(shown: Any) -> str:
    """Return the numbers of an object with their units, and its figure if it has one, as HTML."""
    from adhesis.ensemble.loop.loop_figure import draw_shape
    from adhesis.ensemble.report.html import picture_of, table_of

    if isinstance(shown, Result):
        rows = shown.summary_rows() + [("warning", text) for text in shown.warnings]
        return table_of(rows) + picture_of(plot(shown))
    figure = draw_shape(shown)
    return table_of(_rows(shown)) + ("" if figure is None else picture_of(figure))


# By class: what the figure shows, and what is shown beside the fields.
_DRAWN = {"Profile": ("coefficients",), "Trace": ("heights",)}
_ALSO_SHOWN = {
    "Profile": ("h_max", "h_rms", "m2"),
    "HalfSpace": ("modulus",),
    "ContactState": ("patches", "energy"),
    "Trace": ("points", "length", "height_range", "drop_outs"),
}


def _rows(shown: Any) -> list[tuple[str, str]]:
    """Return the fields of an object with their units, without what is drawn, unknown or empty."""
    from adhesis.ensemble.trace.prepare import Prepared

    if isinstance(shown, Prepared):
        steps = ((step.name, step.description) for step in shown.steps)
        return [("trace", repr(shown.trace)), *steps, *(("warning", w) for w in shown.warnings)]
    names = [entry.name for entry in fields(shown) if entry.repr] if is_dataclass(shown) else []
    if isinstance(shown, Method):
        names = ["name", "problem", "chosen"]
    names += _ALSO_SHOWN.get(type(shown).__name__, ())
    values = {name: getattr(shown, name) for name in names}
    drawn = _DRAWN.get(type(shown).__name__, ())
    texts = {
        name: value if isinstance(value, str) else brief(value)
        for name, value in values.items()
        if not (value is None or (isinstance(value, tuple) and not value) or name in drawn)
    }
    return [(name, f"{text} {UNITS.get(name, '')}".rstrip()) for name, text in texts.items()]


@contextmanager
def progress_bar(top: float, load: bool) -> Iterator[Progress]:
    """Show a bar on a terminal, and lines elsewhere, while a loop or path is followed.

    It is full at the turning point ``top``; unloading has no end that is known ahead.
    """
    end = stress_text(top) if load else f"{top:g}"
    with bar("loading") as shown:

        def show(branch: Branch, drive: float, state: ContactState) -> None:
            text = (
                f"{branch:<9} {drive_text(drive, load)} of {end}  A/A0 "
                f"{state.contact_fraction:.4f}  {counted(state.patches, 'patch')}"
            )
            share = drive / top if branch == "loading" else None if state.patches else 1.0
            shown(share, 1.0, text)

        yield show
