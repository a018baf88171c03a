"""The columns that tables share: places on the axes of the campaign, and means over a cell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.campaign.axes import Axis
from adhesis.ensemble.interval import Estimate
from adhesis.ensemble.quantities import UNITS, common_unit
from adhesis.ensemble.report.tables.table import Format, TableColumn, Value, at_least_0, number


def _itself(entry: Any) -> Any:
    return entry


def key_columns(
    data: Aggregate, cell_of: Callable[[Any], Cell] = _itself
) -> tuple[TableColumn, ...]:
    """Return the columns of what a row is about: H, γ, and every further axis.

    ``cell_of`` returns the cell that a row belongs to, if the row is not about the cell itself.
    """
    return (
        TableColumn("hurst", lambda entry: cell_of(entry).hurst, "H"),
        gamma_column(data, "", lambda entry: cell_of(entry).work_of_adhesion, "γ"),
        *axis_columns(data.further, cell_of),
    )


def gamma_column(
    data: Aggregate, suffix: str, value: Callable[[Any], Value], heading: str
) -> TableColumn:
    """Return a column of works of adhesion, for people in the unit of the campaign."""
    unit, size = common_unit("work_of_adhesion", data.works_of_adhesion)
    name = f"work_of_adhesion{suffix} [J/m^2]"
    return TableColumn(name, value, f"{heading} ({unit})", partial(_in_unit, size))


def axis_columns(
    axes: Sequence[Axis], cell_of: Callable[[Any], Any] = _itself
) -> tuple[TableColumn, ...]:
    """One column for each axis, from the ``others`` of what a row is about."""
    columns = []
    for axis in axes:
        shown, size = common_unit(axis.name, axis.values)
        unit = UNITS.get(axis.name, "")
        columns.append(
            TableColumn(
                f"{axis.name} [{unit.replace('²', '^2')}]" if unit else axis.name,
                partial(_at, axis.name, cell_of),
                f"{axis.name} ({shown})" if shown else axis.name,
                partial(_in_unit, size),
            )
        )
    return tuple(columns)


def _at(name: str, cell_of: Callable[[Any], Any], entry: Any) -> Value:
    others: dict[str, Value] = dict(cell_of(entry).others)
    return others[name]


def _in_unit(size: float, value: float) -> str:
    return f"{value / size:g}"


def estimate(name: str, part: str = "mean") -> Callable[[Cell], float]:
    """Return what takes a mean over a cell, or another part of its estimate, from the cell."""
    return lambda cell: float(getattr(cell.estimates[name], part))


_HEADINGS = {"std": "", "sem": "s.e.", "ci_low": "95 % from", "ci_high": "to"}


def estimated(
    name: str,
    parts: str = "mean",
    heading: str = "",
    show: Format | None = None,
    *,
    unit: str = "",
    size: float = 1.0,
    of: Callable[[Any], Estimate] | None = None,
    least: bool = False,
    last: bool = False,
) -> list[TableColumn]:
    """Return columns of an estimate: "mean sem ci_low", or "value", a mean by the name alone.

    Without a ``heading`` they are for programs. People see multiples of ``size``; with ``least`` no
    end of an interval below 0. ``of`` takes the estimate from what a row is about, by default that
    of the same name from a cell.
    """
    formats = {"sem": number(2, unit=size)}
    if least:
        formats["ci_low"] = partial(at_least_0, unit=size)
    columns = []
    for part in parts.split():
        attribute = "mean" if part == "value" else part.removeprefix("ci_")
        columns.append(
            TableColumn(
                f"{name}{unit}" if part == "value" else f"{name}_{part}{unit}",
                partial(_part, of or (lambda cell: cell.estimates[name]), attribute),
                _HEADINGS.get(part, heading) if heading else "",
                formats.get(part, show or number(unit=size)),
                last=last,
            )
        )
    return columns


def _part(of: Callable[[Any], Estimate], part: str, entry: Any) -> float:
    return float(getattr(of(entry), part))
