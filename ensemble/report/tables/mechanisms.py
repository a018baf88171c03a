"""The tables of jumps, mechanisms and spectra, from an aggregate."""

from __future__ import annotations

from collections.abc import Sequence

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.mean_fields import fitted_slope
from adhesis.ensemble.report.tables.key import key, key_columns
from adhesis.ensemble.report.tables.table import (
    Table,
    TableColumn,
    Value,
    fixed,
    make_table,
    number,
    percent,
    plain,
)
from adhesis.solver.method import BRANCHES


def jumps(data: Aggregate) -> Table:
    """One row for each cell and kind: how many jumps, and their share of all drops."""
    found = data.jumps
    columns = (
        *key_columns(data),
        TableColumn("kind", "kind"),
        TableColumn("scale", "scale"),
        TableColumn("jumps_per_loop", "jumps a loop", number(3)),
        TableColumn("energy_per_loop [J/m^2]", "drops a loop (mJ/m²)", number(3, unit=1e-3)),
        TableColumn("share_of_drops", "share", percent),
    )
    rows: list[list[Value]] = []
    for k, cell in enumerate(data.cells):
        total = float(found.energy[k].sum())
        for j, kind in enumerate(found.kinds):
            if not found.number[k, j]:
                continue
            rows.append(
                [
                    *key(cell),
                    kind,
                    "small" if found.small_scale[j] else "large",
                    float(found.number[k, j] / cell.done),
                    float(found.energy[k, j] / cell.done),
                    float(found.energy[k, j] / total) if total else None,
                ]
            )
    return make_table("Jumps by kind", columns, rows)


def shares_by_kind(data: Aggregate) -> Table:
    """Share of each kind in the drops, one row for each cell: :func:`jumps` at a glance."""
    found = data.jumps
    used = [j for j in range(len(found.kinds)) if found.number[:, j].any()]
    columns = (
        *key_columns(data),
        *(TableColumn(found.kinds[j], found.kinds[j], percent) for j in used),
    )
    rows: list[list[Value]] = []
    for k, cell in enumerate(data.cells):
        total = float(found.energy[k].sum())
        shares = [float(found.energy[k, j]) / total if total else None for j in used]
        rows.append([*key(cell), *shares])
    return make_table("Share of the drops by kind of the jump", columns, rows)


def mechanisms(data: Aggregate) -> Table:
    """Loss by mechanism, largest tension and loss of contact, one row for each cell.

    The largest tension of a loop is reached before the last contact is lost, at another
    penetration.
    """
    columns = (
        *key_columns(data),
        TableColumn("small_scale_share", "small-scale share", percent),
        TableColumn("small_scale_share_ci_low", "95 % from", percent),
        TableColumn("small_scale_share_ci_high", "to", percent),
        TableColumn("jumps_per_loop", "jumps a loop", number(3)),
        TableColumn("pull_off_stress [Pa]", "largest tension (kPa)", number(3, unit=1e3)),
        TableColumn("pull_off_stress_sem [Pa]", "s.e. (kPa)", number(2, unit=1e3)),
        TableColumn("pull_off_penetration", "last contact lost at Δ/h_max", number(3)),
        TableColumn("wall_time [s]", "s a loop", plain),
    )
    rows: list[list[Value]] = []
    for cell in data.cells:
        share, pull_off = cell.estimates["small_scale_share"], cell.estimates["pull_off_stress"]
        rows.append(
            [
                *key(cell),
                share.mean,
                share.low,
                share.high,
                cell.estimates["jump_count"].mean,
                pull_off.mean,
                pull_off.sem,
                cell.estimates["pull_off_penetration"].mean,
                float(f"{cell.estimates['wall_time'].mean:.3g}"),
            ]
        )
    return make_table("Mechanisms and pull-off", columns, rows)


def slopes(data: Aggregate, branches: Sequence[str] = BRANCHES) -> Table:
    """Exponent of the deformed surface's spectrum at small wave numbers, state by state."""
    depth = "p̄/p̄_max" if data.campaign.cycle.turns_at_stress else "Δ/h_max"
    columns = (
        *key_columns(data),
        TableColumn("branch", "branch"),
        TableColumn("penetration", depth, fixed(2)),
        TableColumn("realisations", "n"),
        TableColumn("slope", "slope", fixed(2)),
        TableColumn("slope_sem", "s.e.", number(1)),
        TableColumn("slope_persson", "-(2+H)", fixed(2)),
        TableColumn("slope_profile", "-(2H+1)", fixed(2)),
    )
    fields = data.fields
    rows: list[list[Value]] = []
    for index, cell in enumerate(data.cells):
        for branch in branches:
            b = BRANCHES.index(branch)
            for k, penetration in enumerate(cell.plan.penetration.tolist()):
                if not fields.in_contact[index, b, k]:
                    continue
                density = fields.psd_displacement[index, b, k]
                slope, error = fitted_slope(cell.plan, density)
                rows.append(
                    [
                        *key(cell),
                        branch,
                        penetration,
                        int(fields.in_contact[index, b, k]),
                        slope,
                        error,
                        -(2 + cell.hurst),
                        -(2 * cell.hurst + 1),
                    ]
                )
    return make_table("Slope of the spectrum of the deformed surface", columns, rows)
