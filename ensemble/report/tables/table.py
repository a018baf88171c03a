"""A table: once for people (terminal, Markdown), once for programs (CSV)."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from operator import itemgetter
from pathlib import Path
from typing import Any

from adhesis.ensemble.escape import markdown, markdown_table

Value = float | int | str | None
Format = Callable[[Any], str]
BLANK = "–"


def number(digits: int = 4, unit: float = 1.0) -> Format:
    """Show a number with so many significant digits, in multiples of ``unit``: 12.30, 4e-5."""

    def show(value: Any) -> str:
        mantissa, e, exponent = f"{value / unit:#.{digits}g}".partition("e")
        return mantissa.rstrip(".") + (f"e{int(exponent)}" if e else "")

    return show


def plain(value: Any) -> str:
    """Show a value as it is."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def fixed(digits: int) -> Format:
    """Show a number with so many digits after the point."""
    return lambda value: f"{value:.{digits}f}"


@dataclass(frozen=True)
class TableColumn:
    """One column of a table."""

    # In the CSV file, with its unit in brackets unless dimensionless; empty if the column is for
    # people only
    name: str
    # Takes its value from what a row is about: a function, or the path of attributes and keys
    # ("estimates.loss.mean")
    value: str | Callable[[Any], Value]
    heading: str = ""  # for people; empty if the column is for the CSV file only
    show: Format = plain  # turns a value into text
    only_if_any: bool = False  # for people only if a row has a value that is not zero
    last: bool = False  # for people behind the others
    note: str = ""  # what the heading means, as a clause

    def of(self, entry: Any) -> Value:
        """Take the value from what a row is about."""
        if callable(self.value):
            return self.value(entry)
        for name in self.value.split("."):
            entry = entry[name] if isinstance(entry, Mapping) else getattr(entry, name)
        found: Value = entry
        return found


@dataclass(frozen=True)
class Table:
    """Rows of values; None and NaN are blank."""

    title: str
    columns: tuple[TableColumn, ...]
    rows: tuple[tuple[Value, ...], ...]

    def write_csv(self, path: Path) -> None:
        """Write every column, at full precision, one row of names first."""
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            kept = [bool(column.name) for column in self.columns]
            writer.writerow([column.name for column in self.columns if column.name])
            known = ([None if _missing(value) else value for value in row] for row in self.rows)
            writer.writerows(compress(row, kept) for row in known)

    def markdown(self) -> str:
        """Return the columns that have a heading as a Markdown table."""
        shown = self._texts()
        return markdown_table(shown[0], *([markdown(cell) for cell in row] for row in shown[1:]))

    def notes(self) -> str:
        """Return what the headings mean, as a sentence."""
        shown = sorted(self._shown(), key=itemgetter(0))
        return "; ".join(column.note for _, column in shown if column.note) + "."

    def __str__(self) -> str:
        """Return the columns that have a heading as lines, of which no terminal cuts a number."""
        shown = self._texts()
        widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
        lines = ("  ".join(map(str.rjust, row, widths)).rstrip() for row in shown)
        return "\n".join((self.title, *lines))

    def _shown(self) -> list[tuple[int, TableColumn]]:
        """Return the columns for people, each with its place in the rows."""
        kept = [
            (k, column)
            for k, column in enumerate(self.columns)
            if column.heading
            and not (column.only_if_any and all(_missing(r[k]) or not r[k] for r in self.rows))
        ]
        return sorted(kept, key=lambda entry: entry[1].last)

    def _texts(self) -> list[list[str]]:
        """Return the headings, and the values of each row as texts."""
        kept = self._shown()
        body = [
            [BLANK if _missing(row[k]) else column.show(row[k]) for k, column in kept]
            for row in self.rows
        ]
        return [[column.heading for _, column in kept], *body]


def make_table(title: str, columns: Sequence[TableColumn], of: Iterable[Any]) -> Table:
    """Build a table with one row for each entry of ``of``, from which the columns take values."""
    rows = (tuple(column.of(entry) for column in columns) for entry in of)
    return Table(title, tuple(columns), tuple(rows))


def _missing(value: Value) -> bool:
    return value is None or (isinstance(value, float) and math.isnan(value))
