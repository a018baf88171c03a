"""The tables of jumps, mechanisms and spectra, from an aggregate."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from adhesis.ensemble.aggregate.average import SMALL, Aggregate, AveragedCell, fitted_slope
from adhesis.ensemble.quantities import percent
from adhesis.ensemble.report.further_axes import state_sign
from adhesis.ensemble.report.tables.key import estimated, key_columns
from adhesis.ensemble.report.tables.table import Table, TableColumn, fixed, make_table, number
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.jump import JUMP_KINDS


def _share(kind: int, cell: AveragedCell) -> float | None:
    """Return the share of a kind in the drops of a cell; None without any."""
    drops = float(cell.jumps.energy.sum())
    return float(cell.jumps.energy[kind]) / drops if drops else None


def jumps(data: Aggregate) -> Table:
    """One row for each cell and kind: how many jumps, and their share of all drops."""
    rows = [
        {
            "at": cell.at,
            "kind": JUMP_KINDS[k],
            "scale": "small" if SMALL[k] else "large",
            "number": float(cell.jumps.number[k]) / cell.done,
            "energy": float(cell.jumps.energy[k]) / cell.done,
            "share": _share(k, cell),
        }
        for cell in data.cells
        for k in np.flatnonzero(cell.jumps.number).tolist()
    ]
    columns = [
        *key_columns(data),
        TableColumn("kind", "kind", "kind"),
        TableColumn("scale", "scale", "scale"),
        TableColumn("jumps_per_loop", "number", "jumps a loop", number(3)),
        TableColumn(
            "energy_per_loop [J/m^2]", "energy", "drops a loop (mJ/m²)", number(3, unit=1e-3)
        ),
        TableColumn("share_of_drops", "share", "share", percent),
    ]
    return make_table("Jumps by kind", columns, rows)


def shares_by_kind(data: Aggregate) -> Table:
    """Share of each kind in the drops, one row for each cell: :func:`jumps` at a glance."""
    found = np.flatnonzero(np.any([cell.jumps.number for cell in data.cells], axis=0)).tolist()
    kinds = [(k, JUMP_KINDS[k]) for k in found]
    columns = [TableColumn(kind, partial(_share, k), kind, percent) for k, kind in kinds]
    title = "Share of the drops by kind of the jump"
    return make_table(title, [*key_columns(data), *columns], data.cells)


def mechanisms(data: Aggregate) -> Table:
    """Loss by mechanism, largest tension and loss of contact, one row for each cell.

    The largest tension of a loop is reached before the last contact is lost, at another
    penetration.
    """
    columns = [
        *key_columns(data),
        *estimated("small_scale_share", "value ci_low ci_high", "small-scale share", percent),
        *estimated("jump_count", "value", "jumps a loop", number(3)),
        *estimated("pull_off_stress", "value", "largest tension (kPa)", number(3, unit=1e3)),
        TableColumn(
            *("pull_off_stress_sem", "estimates.pull_off_stress.sem", "s.e. (kPa)"),
            number(2, unit=1e3),
        ),
        *estimated("pull_off_penetration", "value", "detached by Δ/h_max", number(3)),
        *estimated("wall_time", "value", "s a loop", lambda s: f"{float(f'{s:.3g}'):g}"),
    ]
    return make_table("Mechanisms and pull-off", columns, data.cells)


def slopes(data: Aggregate, branches: Sequence[str] = BRANCHES) -> Table:
    """Exponent of the deformed surface's spectrum at small wave numbers, state by state."""
    columns = [
        *key_columns(data),
        TableColumn("branch", "branch", "branch"),
        TableColumn("penetration", "penetration", state_sign(data), fixed(2)),
        TableColumn("realisations", "realisations", "n"),
        TableColumn("slope", "slope", "slope", fixed(2)),
        TableColumn("slope_sem", "error", "s.e.", number(1)),
        TableColumn("slope_persson", lambda row: -(2 + row["at"]["hurst"]), "-(2+H)", fixed(2)),
        TableColumn(
            "slope_profile", lambda row: -(2 * row["at"]["hurst"] + 1), "-(2H+1)", fixed(2)
        ),
    ]
    rows = []
    for cell in data.cells:
        for branch in branches:
            b = BRANCHES.index(branch)
            for k in np.flatnonzero(cell.fields.in_contact[b]).tolist():
                slope, error = fitted_slope(cell.plan, cell.fields.psd_displacement[b, k])
                rows.append(
                    {
                        "at": cell.at,
                        "branch": branch,
                        "penetration": float(cell.plan.penetration[k]),
                        "realisations": int(cell.fields.in_contact[b, k]),
                        "slope": slope,
                        "error": error,
                    }
                )
    return make_table("Slope of the spectrum of the deformed surface", columns, rows)
