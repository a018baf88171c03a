"""The table of works: what approach gains and separation spends, per nominal and contact area."""

from __future__ import annotations

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.report.tables.key import key, key_columns
from adhesis.ensemble.report.tables.table import Table, TableColumn, Value, make_table, number

_PER_CONTACT = ("effective_work_of_approach", "effective_work_of_separation", "loss_per_contact")


def works(data: Aggregate) -> Table:
    """One row for each cell; definitions in docs/theory.md, section 8."""
    columns = (
        *key_columns(data),
        TableColumn("n", "n"),
        TableColumn("work_gained_mean [J/m^2]", "gained on approach (mJ/m²)", number(unit=1e-3)),
        TableColumn("work_spent_mean [J/m^2]", "spent on separation (mJ/m²)", number(unit=1e-3)),
        TableColumn("largest_contact_fraction_mean", "largest A/A0", number()),
        TableColumn("largest_contact_fraction_ci_low"),
        TableColumn("largest_contact_fraction_ci_high"),
        *(
            column
            for name, title in zip(
                _PER_CONTACT,
                ("per contact: approach (mJ/m²)", "separation (mJ/m²)", "loss (mJ/m²)"),
                strict=True,
            )
            for column in (
                TableColumn(f"{name}_mean [J/m^2]", title, number(unit=1e-3)),
                TableColumn(f"{name}_ci_low [J/m^2]"),
                TableColumn(f"{name}_ci_high [J/m^2]"),
            )
        ),
        TableColumn("full_contact_energy_mean [J/m^2]", "full contact (mJ/m²)", number(unit=1e-3)),
    )
    return make_table("Work of approach and separation", columns, [_row(c) for c in data.cells])


def _row(cell: Cell) -> list[Value]:
    found = cell.estimates
    contact = found["largest_contact_fraction"]
    return [
        *key(cell),
        cell.done,
        found["work_gained"].mean,
        found["work_spent"].mean,
        *(contact.mean, contact.low, contact.high),
        *(
            value
            for name in _PER_CONTACT
            for value in (found[name].mean, found[name].low, found[name].high)
        ),
        found["full_contact_energy"].mean,
    ]
