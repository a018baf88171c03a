"""The small tables of the study, read back."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TEXTS = ("campaign", "status", "branch", "kind")


@dataclass(frozen=True, eq=False)
class Rows:
    """Columns of a table, by name, all of one length."""

    columns: dict[str, NDArray[Any]]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """One column."""
        return self.columns[name]

    def __len__(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values())))

    def where(self, **values: Any) -> Rows:
        """Rows with these values; numbers within rounding of the table."""
        kept = np.arange(len(self))
        for name, value in values.items():
            column = self[name][kept]
            same = column == value if name in TEXTS else np.isclose(column, value, rtol=1e-5)
            kept = kept[same]
        return Rows({name: column[kept] for name, column in self.columns.items()})

    def values(self, name: str) -> list[float]:
        """Different values of a column, ascending."""
        return sorted(set(self[name].tolist()))


def read(path: Path) -> Rows:
    """Read a table; empty places are NaN."""
    with path.open(encoding="utf-8") as stream:
        header, *rows = list(csv.reader(stream))
    columns = {
        name: np.array([row[i] for row in rows])
        if name in TEXTS
        else np.array([float(row[i]) if row[i] else np.nan for row in rows])
        for i, name in enumerate(header)
    }
    return Rows(columns)


@dataclass(frozen=True, eq=False)
class Study:
    """The study's tables.

    Attributes
    ----------
    loops : Rows
        Done ones.
    failed : Rows
    jumps : Rows
    coarse : Rows
        Loops in coarse steps (study/coarse.py).
    """

    loops: Rows
    failed: Rows
    jumps: Rows
    coarse: Rows

    @classmethod
    def at(cls, folder: Path) -> Study:
        """Read them from the study's folder."""
        loops = read(folder / "data" / "loops.csv")
        return cls(
            loops.where(status="done"),
            loops.where(status="failed"),
            read(folder / "data" / "jumps.csv"),
            read(folder / "data" / "coarse.csv"),
        )

    def joined(self, name: str, campaigns: Sequence[str], **values: Any) -> dict[int, float]:
        """One column of the loops with these values; the first campaign that has a realisation."""
        return dict(_joined(self, name, tuple(campaigns), **values))

    def by_realisation(self, name: str, **values: Any) -> dict[int, float]:
        """One column of the loops with these values, by realisation."""
        return by_realisation(self.loops.where(**values), name)


@cache
def _joined(study: Study, name: str, campaigns: tuple[str, ...], **values: Any) -> dict[int, float]:
    """Look a cell up once: many tables and readings use the same."""
    found: dict[int, float] = {}
    for campaign in campaigns:
        found = {**study.by_realisation(name, campaign=campaign, **values), **found}
    return found


def by_realisation(rows: Rows, name: str) -> dict[int, float]:
    """One column of the rows of one cell, by realisation."""
    found = dict(zip(rows["realisation"].astype(int).tolist(), rows[name].tolist(), strict=True))
    assert len(found) == len(rows), "the rows are of more than one cell"
    return found


def aligned(*series: dict[int, float]) -> Array:
    """Values of the realisations that all series have, shape (series, realisations)."""
    shared = sorted(set.intersection(*(set(one) for one in series)))
    return np.array([[one[r] for r in shared] for one in series])
