"""The table of works: what approach gains and separation spends, per nominal and contact area."""

from __future__ import annotations

from operator import attrgetter

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.report.tables.key import estimate, key_columns
from adhesis.ensemble.report.tables.table import Format, Table, TableColumn, make_table, number


def works(data: Aggregate) -> Table:
    """One row for each cell; definitions in docs/theory.md, section 8."""
    milli = number(unit=1e-3)

    def mean(name: str, heading: str) -> TableColumn:
        return TableColumn(f"{name}_mean [J/m^2]", estimate(name), heading, milli)

    def with_interval(name: str, heading: str, show: Format, unit: str = "") -> list[TableColumn]:
        return [
            TableColumn(f"{name}_mean{unit}", estimate(name), heading, show),
            TableColumn(f"{name}_ci_low{unit}", estimate(name, "low")),
            TableColumn(f"{name}_ci_high{unit}", estimate(name, "high")),
        ]

    per_contact = {
        "effective_work_of_approach": "per contact: approach (mJ/m²)",
        "effective_work_of_separation": "separation (mJ/m²)",
        "loss_per_contact": "loss (mJ/m²)",
    }
    columns = (
        *key_columns(data),
        TableColumn("n", attrgetter("done"), "n"),
        mean("work_gained", "gained on approach (mJ/m²)"),
        mean("work_spent", "spent on separation (mJ/m²)"),
        *with_interval("largest_contact_fraction", "largest A/A0", number()),
        *(
            column
            for name, heading in per_contact.items()
            for column in with_interval(name, heading, milli, " [J/m^2]")
        ),
        mean("full_contact_energy", "full contact (mJ/m²)"),
    )
    return make_table("Work of approach and separation", columns, data.cells)
