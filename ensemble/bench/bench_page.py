"""Write the tables of the benchmark: cells, columns of the CSV file, a Markdown page."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter

from adhesis.ensemble.bench.equal_error import Exponent, Line, Quotient, Ratio
from adhesis.ensemble.escape import markdown_table
from adhesis.ensemble.report.tables.table import TableColumn

_COLUMNS: dict[str, Callable[[Line], str]] = {
    "scene": lambda line: line.run.scene.title,
    "method": lambda line: line.run.method,
    "setting": lambda line: line.run.described,
    "CPU s": lambda line: _seconds(line.measured.cpu_seconds),
    "MB": lambda line: f"{line.measured.megabytes:.0f}",
    "W~": lambda line: f"{line.measured.loss_dimensionless:.6g}",
    "error": lambda line: _signed(line.error),
    "audit": lambda line: _signed(line.measured.audit_residual),
    "patches": lambda line: str(line.measured.patches),
    "jumps": lambda line: str(line.measured.jumps),
    "solutions": lambda line: str(line.measured.solutions),
    "ms": lambda line: f"{1e3 * line.measured.cpu_seconds / line.measured.solutions:.2f}",
}
LINE_COLUMNS = ("method", "setting", "CPU s", "MB", "W~", "error", "audit", "solutions")
GROWTH_COLUMNS = (
    *("scene", "method", "setting", "CPU s", "MB", "W~", "audit"),
    *("patches", "jumps", "solutions", "ms"),
)
_COST = ("cpu_seconds", "megabytes", "megabytes_before", "loss", "loss_dimensionless")
RECORD = (
    TableColumn("scene", attrgetter("run.scene.name")),
    *(TableColumn(n, attrgetter(f"run.{n}")) for n in ("method", "setting", "load_steps")),
    *(TableColumn(name, attrgetter(f"measured.{name}")) for name in _COST),
    TableColumn("error", attrgetter("error")),
    TableColumn("audit_residual", attrgetter("measured.audit_residual")),
    *(TableColumn(n, attrgetter(f"measured.{n}")) for n in ("solutions", "jumps", "patches")),
    TableColumn("reference_loss", attrgetter("reference.loss")),
    TableColumn("reference", attrgetter("reference.text")),
    TableColumn("note", attrgetter("measured.note")),
)
"""Columns of the CSV file."""
_RATIO_COLUMNS = ("scene", "sharp", "error", "grid / sharp", "cheapest grid / sharp")
_EXPONENT_COLUMNS = ("among", "grows with", "from", "to", "CPU time of a loop", "of a solution")


def cells(line: Line, columns: Sequence[str]) -> list[str]:
    """Return one line of a table as text; behind the setting a note, if it did not finish."""
    note = line.measured.note
    known = columns[: columns.index("setting") + 1] if note else columns
    found = [_COLUMNS[name](line) for name in known] + ([note] if note else [])
    return found + [""] * (len(columns) - len(found))


def page(
    lines: Sequence[Line],
    grown: Sequence[Line],
    compared: Sequence[Ratio],
    fitted: Sequence[Exponent],
    made_by: str,
) -> str:
    """Return the Markdown page: a table for each scene, the ratios, the growth."""
    parts = [f"Made by {made_by}."]
    for scene in dict.fromkeys(line.run.scene for line in lines):
        chosen = [line for line in lines if line.run.scene is scene]
        parts += [
            f"### {scene.title[0].upper()}{scene.title[1:]}",
            f"Δ~max = {scene.max_penetration:g}, {scene.load_steps} load steps. "
            f"Reference: {chosen[0].reference.text}.",
            _table(LINE_COLUMNS, (cells(line, LINE_COLUMNS) for line in chosen)),
        ]
    if compared:
        rows = [
            [
                ratio.line.run.scene.title,
                ratio.line.run.described,
                f"{abs(ratio.line.error):.1e}",
                _quotient(ratio.converged),
                _quotient(ratio.cheapest),
            ]
            for ratio in compared
        ]
        parts += ["### CPU time of grid over sharp at equal error", _table(_RATIO_COLUMNS, rows)]
    if grown:
        rows = [cells(line, GROWTH_COLUMNS) for line in grown]
        parts += ["### How the cost grows", _table(GROWTH_COLUMNS, rows)]
    if fitted:
        rows = [
            [
                *(one.among, one.variable, str(one.least), str(one.most)),
                *(f"{one.of_loop:.2f}", f"{one.of_solution:.2f}"),
            ]
            for one in fitted
        ]
        parts += ["### Exponents of the growth of sharp", _table(_EXPONENT_COLUMNS, rows)]
    return "\n\n".join(parts) + "\n"


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    return markdown_table(columns, *rows, left_columns=2)


def _quotient(one: Quotient) -> str:
    return f"{one.bound} {one.value:.2g}".strip()


def _seconds(value: float) -> str:
    return f"{value:.2f}" if value < 10 else f"{value:.1f}"


def _signed(value: float) -> str:
    return f"{value:+.1e}" if math.isfinite(value) else ""
