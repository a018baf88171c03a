"""The first columns of a table: where a row stands on the axes of the campaign."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.campaign.axes import Axis
from adhesis.ensemble.quantities import AXIS_UNITS, shown_unit
from adhesis.ensemble.report.tables.table import KEY, TableColumn, Value


def key_columns(data: Aggregate) -> tuple[TableColumn, ...]:
    """Return the columns of what a row is about: H, γ, and every further axis."""
    return (*KEY, *axis_columns(data.further))


def axis_columns(axes: Iterable[Axis]) -> tuple[TableColumn, ...]:
    """One column for each axis."""
    columns = []
    for axis in axes:
        shown, size = shown_unit(axis.name, max(axis.values))
        si = AXIS_UNITS.get(axis.unit, "")
        unit = shown or si
        columns.append(
            TableColumn(
                f"{axis.name} [{si.replace('²', '^2')}]" if si else axis.name,
                f"{axis.name} ({unit})" if unit else axis.name,
                partial(_in_unit, size),
            )
        )
    return tuple(columns)


def _in_unit(size: float, value: float) -> str:
    return f"{value / size:g}"


def key(cell: Cell) -> list[Value]:
    """Return the place of a cell on the axes, under :func:`key_columns`."""
    return [cell.hurst, cell.work_of_adhesion, *(value for _, value in cell.others)]
