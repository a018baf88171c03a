"""Figure, film, tables and file of a result, as its methods return them, and the progress bar.

The mechanics find this module by :data:`adhesis.solver.views.maker`. A call loads matplotlib.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adhesis.ensemble.outputs import check_output_folder
from adhesis.ensemble.quantities import (
    UNITS,
    drive_text,
    in_works_of_adhesion,
    stress_text,
    with_units,
)
from adhesis.ensemble.reporter import bar
from adhesis.solver import checks
from adhesis.solver.loading.loop import Progress
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.path import PathResult
from adhesis.solver.method import Branch, ContactState, Method
from adhesis.solver.values import brief

if TYPE_CHECKING:
    from adhesis.ensemble.loop.film import Film
    from adhesis.ensemble.trace.answer import Answer

Result = LoopResult | PathResult


def plot(result: Result, ax: Any = None) -> Any:
    """Draw mean stress and contact fraction; see :meth:`adhesis.LoopResult.plot`."""
    from adhesis.ensemble.loop.loop_figure import draw_loops

    return draw_loops(result if isinstance(result, PathResult) else [result], ax)


def film(
    result: Result,
    path: str | os.PathLike[str] | None,
    *,
    frames: int,
    progress: Callable[[int, int], None] | bool | None,
) -> Film:
    """Make a film, and write it where a path is given; see :meth:`adhesis.LoopResult.film`."""
    from adhesis.ensemble.loop.film import check_film, film_of

    if path is not None:
        path = check_film("path", path)
    if isinstance(progress, bool):
        with bar("frames") if progress else nullcontext() as shown:
            made = film_of(result, frames=frames, progress=shown)
    else:
        made = film_of(result, frames=frames, progress=progress)
    if path is not None:
        made.save(path)
    return made


# Made by other modules, and loaded when they are asked for.
_ELSEWHERE = dict.fromkeys(("to_dataframe", "to_xarray", "save"), "adhesis.ensemble.loop.saved")


def __getattr__(name: str) -> Any:
    if name not in _ELSEWHERE:
        raise AttributeError(name)
    return getattr(import_module(_ELSEWHERE[name]), name)


# ---------------------------------------------------------------------- in notebooks


def page(shown: Any) -> str:
    """Return the numbers of an object with their units, and its figure if it has one, as HTML."""
    from adhesis.ensemble.loop.loop_figure import draw_shape
    from adhesis.ensemble.report.html import picture_of, table_of

    if isinstance(shown, LoopResult | PathResult):
        return table_of(_rows_of_result(shown)) + picture_of(plot(shown))
    figure = draw_shape(shown)
    return table_of(_rows(shown)) + ("" if figure is None else picture_of(figure))


def trace_summary(answer: Answer) -> str:
    """Return the summary of an answer as text."""
    from adhesis.ensemble.trace.trace_page import summary

    return summary(answer)


def trace_page(answer: Answer) -> str:
    """Return the summary of a trace's answer and the figure of its loop as HTML."""
    from adhesis.ensemble.report.html import picture_of, table_of
    from adhesis.ensemble.trace.figures import draw_loop

    rows = [line.split(maxsplit=1) for line in str(answer).splitlines()]
    return table_of((name, text) for name, text in rows) + picture_of(draw_loop(answer))


def write_trace_page(answer: Answer, folder: str | os.PathLike[str]) -> Path:
    """Write page, figures and numbers of an answer; see its method ``page``."""
    from adhesis.ensemble.trace.trace_page import write_all

    path = checks.path("folder", folder)
    check_output_folder("folder", path, (), {})
    return write_all(answer, path)


def table_of_runs(answer: Answer) -> Any:
    """Return the loops of an answer as a table; see its method ``to_dataframe``."""
    import pandas as pd

    from adhesis.ensemble.trace.answer import run_rows

    hidden = (
        *("range_warnings", "preload_warnings", "fall_warnings", "strain_warnings", "failed"),
    )
    rows = [{k: v for k, v in row.items() if k not in hidden} for row in run_rows(answer)]
    return with_units(pd.DataFrame(rows).rename(columns={"said": "description"}))


def _rows_of_result(result: Result) -> list[tuple[str, str]]:
    """Return the main numbers of a loop or path."""
    problem = result.problem
    is_loop = isinstance(result, LoopResult)
    rows = [
        (
            "loss" if is_loop else "work",
            f"{result.loss:.5g} ± {result.loss_error:.1g} J/m²"
            f"{in_works_of_adhesion(result.loss, problem.work_of_adhesion)}"
            f"{f'; {result.loss_note}' if result.loss_note else ''}",
        ),
        ("sum of energy drops", f"{result.loss_from_drops:.5g} J/m²"),
        *(("friction", text) for text in (result.friction_summary(),) if text),
        ("jumps", str(len(result.jumps))),
        ("work of adhesion γ", problem.adhesion_text),
        ("h_max", f"{problem.profile.h_max:.4g} m"),
        ("largest contact fraction A/A0", f"{result.largest_contact_fraction:.4g}"),
        ("method", result.method.name),
    ]
    if isinstance(result, LoopResult):
        rows.insert(3, ("pull-off stress", f"{result.pull_off_stress:.4g} Pa"))
        rows.insert(1, ("turns at", result.turning_text))
    return rows + [("warning", text) for text in result.warnings]


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
    """Show a bar on stderr, or in the notebook, while a loop or path is followed.

    It is full at the turning point ``top``; unloading has no end that is known ahead.
    """
    end = stress_text(top) if load else f"{top:g}"
    with bar("loading") as shown:

        def show(branch: Branch, drive: float, state: ContactState) -> None:
            text = f"{branch:<9} {drive_text(drive, load)} of {end}, {state.patches} patches"
            if branch == "loading":
                shown(drive / top, 1.0, text)
            else:
                shown(None if state.patches else 1.0, None if state.patches else 1.0, text)

        yield show
