"""The table of works: what approach gains and separation spends, per nominal and contact area."""

from __future__ import annotations

from operator import attrgetter
from typing import Any

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.report.tables.key import estimated, key_columns
from adhesis.ensemble.report.tables.table import Table, TableColumn, make_table


def works(data: Aggregate) -> Table:
    """One row for each cell; definitions in docs/theory.md, section 8."""
    energy: Any = {"unit": " [J/m^2]", "size": 1e-3}
    per_contact = {
        "effective_work_of_approach": "per contact: approach (mJ/m²)",
        "effective_work_of_separation": "separation (mJ/m²)",
        "loss_per_contact": "loss (mJ/m²)",
    }
    columns = [
        *key_columns(data),
        TableColumn("n", attrgetter("done"), "n"),
        *estimated("work_gained", "mean", "gained on approach (mJ/m²)", **energy),
        *estimated("work_spent", "mean", "spent on separation (mJ/m²)", **energy),
        *estimated("largest_contact_fraction", "mean", "largest A/A0"),
        *estimated("largest_contact_fraction", "ci_low ci_high"),
    ]
    for name, heading in per_contact.items():
        columns += estimated(name, "mean", heading, **energy)
        columns += estimated(name, "ci_low ci_high", **energy)
    columns += estimated("full_contact_energy", "mean", "full contact (mJ/m²)", **energy)
    return make_table("Work of approach and separation", columns, data.cells)
