"""Figure, film, tables and file of a result, as its methods return them, and the progress bar.

The mechanics find this module by :data:`adhesis.solver.views.maker`. A call loads matplotlib.
"""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any

from adhesis.ensemble.quantities import in_works_of_adhesion
from adhesis.solver.loading.loop import Progress
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.path import PathResult
from adhesis.solver.method import Branch, ContactState

if TYPE_CHECKING:
    from adhesis.ensemble.loop.film import Film
    from adhesis.ensemble.trace.answer import Answer

Result = LoopResult | PathResult


def plot(result: Result) -> Any:
    """Draw mean stress and contact fraction; see :meth:`adhesis.LoopResult.plot`."""
    from adhesis.ensemble.loop.figure import draw_loops

    return draw_loops(result if isinstance(result, PathResult) else [result])


def film(
    result: Result,
    path: str | os.PathLike[str] | None,
    *,
    frames: int,
    progress: Callable[[int, int], None] | None,
) -> Film:
    """Make a film, and write it where a path is given; see :meth:`adhesis.LoopResult.film`."""
    from adhesis.ensemble.loop.film import check_film, film_of

    if path is not None:
        path = check_film("path", path)
    made = film_of(result, frames=frames, progress=progress)
    if path is not None:
        made.save(path)
    return made


def to_dataframe(result: Result, of: str) -> Any:
    """Return states or jumps as a table; see :meth:`adhesis.LoopResult.to_dataframe`."""
    from adhesis.ensemble.loop.saved import to_dataframe

    return to_dataframe(result, of)


def to_xarray(result: Result) -> Any:
    """Return a labelled dataset; see :meth:`adhesis.LoopResult.to_xarray`."""
    from adhesis.ensemble.loop.saved import to_xarray

    return to_xarray(result)


def save(result: Result, path: str | os.PathLike[str]) -> None:
    """Write a netCDF file; see :meth:`adhesis.LoopResult.save`."""
    from adhesis.ensemble.loop.saved import save

    save(result, path)


def page(result: Result) -> str:
    """Return the main numbers and the figure of a result as HTML, for notebooks."""
    problem = result.problem
    name = "loss"
    if isinstance(result, PathResult):
        name, value = "work", result.work
    else:
        value = result.loss
    rows = [
        (
            name,
            f"{value:.5g} ± {result.loss_error:.1g} J/m²"
            f"{in_works_of_adhesion(value, problem.work_of_adhesion)}",
        ),
        ("sum of energy drops", f"{result.loss_from_drops:.5g} J/m²"),
        ("jumps", str(len(result.jumps))),
        ("work of adhesion γ", f"{problem.work_of_adhesion:g} J/m²"),
        ("h_max", f"{problem.profile.h_max:.4g} m"),
        ("largest contact fraction A/A0", f"{result.contact_fraction.max():.4g}"),
        ("method", result.method.name),
    ]
    if isinstance(result, LoopResult):
        rows.insert(3, ("pull-off stress", f"{result.pull_off_stress:.4g} Pa"))
        rows += [("warning", text) for text in result.warnings]
    return table_of(rows) + picture_of(plot(result))


def trace_page(answer: Answer) -> str:
    """Return the summary of a trace's answer and the figure of its loop as HTML."""
    from adhesis.ensemble.trace.figures import draw_loop
    from adhesis.ensemble.trace.page import summary

    rows = [line.split(maxsplit=1) for line in summary(answer).splitlines()]
    return table_of((name, text) for name, text in rows) + picture_of(draw_loop(answer))


def table_of(rows: Iterable[tuple[str, str]]) -> str:
    """Return rows of a name and a value as a table in HTML."""
    cells = (f"<th>{escape(name)}</th><td>{escape(text)}</td>" for name, text in rows)
    return f"<table>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def picture_of(figure: Any) -> str:
    """Return a figure as a picture in HTML."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    data = base64.b64encode(stream.getvalue()).decode()
    return f'<img alt="loop" src="data:image/png;base64,{data}">'


@contextmanager
def progress_bar(top: float) -> Iterator[Progress]:
    """Show a bar on stderr, or in the notebook, while a loop or path is followed.

    It is full at the turning point ``top``; unloading has no end that is known ahead.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("loading", total=1.0)

        def show(branch: Branch, drive: float, state: ContactState) -> None:
            loading = branch == "loading"
            done = drive / top if loading else None
            over = not loading and not state.patches
            text = f"{branch:<9} {drive:+.3f} of {top:g}, {state.patches} patches"
            bar.update(
                task,
                description=text,
                completed=1.0 if over else done,
                total=1.0 if loading or over else None,
            )

        yield show
