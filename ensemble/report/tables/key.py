"""The columns that tables share: places on the axes of the campaign, and means over a cell."""

from __future__ import annotations

from typing import Any

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.campaign.tables import Axis
from adhesis.ensemble.quantities import UNITS, common_unit
from adhesis.ensemble.report.tables.table import Format, TableColumn, number

_SIGNS = {"hurst": "H", "work_of_adhesion": "γ"}


def key_columns(data: Aggregate) -> list[TableColumn]:
    """Return the columns of the cell that a row is about: H, γ, and every further axis."""
    return [axis_column(axis) for axis in data.campaign.axes]


def axis_column(axis: Axis, cell: str = "", suffix: str = "", heading: str = "") -> TableColumn:
    """Return the column of an axis, for people in the unit of the campaign.

    Of two cells of a row, ``cell`` is the path ("upper."), ``suffix`` and ``heading`` tell them
    apart.
    """
    shown, size = common_unit(axis.name, axis.values)
    unit = UNITS.get(axis.name, "").replace("²", "^2")
    name, heading = f"{axis.name}{suffix}", heading or _SIGNS.get(axis.name, axis.name)
    return TableColumn(
        f"{name} [{unit}]" if unit else name,
        f"{cell}at.{axis.name}",
        f"{heading} ({shown})" if shown else heading,
        lambda value: f"{value / size:g}",
    )


_HEADINGS = {"std": "", "sem": "s.e.", "ci_low": "95 % from", "ci_high": "to"}


def estimated(
    name: str,
    parts: str = "mean",
    heading: str = "",
    show: Format | None = None,
    *,
    of: str = "",
    unit: str = "",
    size: float = 1.0,
    least: bool = False,
    **options: Any,
) -> list[TableColumn]:
    """Return columns of an estimate: "mean sem ci_low", or "value", a mean by the name alone.

    Without a ``heading`` they are for programs. People see multiples of ``size``; with ``least`` no
    end of an interval below 0. ``of`` is the path to the estimate, by default that of the same name
    of a cell. ``options`` are those of the columns.
    """
    formats = {"sem": number(2, unit=size)}
    if least:
        formats["ci_low"] = lambda value: number(unit=size)(value) if value > 0 else "0"
    columns = []
    for part in parts.split():
        attribute = "mean" if part == "value" else part.removeprefix("ci_")
        columns.append(
            TableColumn(
                f"{name}{'' if part == 'value' else f'_{part}'}{unit}",
                f"{of or f'estimates.{name}'}.{attribute}",
                heading and _HEADINGS.get(part, heading),
                formats.get(part, show or number(unit=size)),
                **options,
            )
        )
        options = {**options, "note": ""}
    return columns
