"""The tables of jumps, mechanisms and spectra, from an aggregate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter, itemgetter

import numpy as np

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.aggregate.jumps import SMALL
from adhesis.ensemble.aggregate.mean_fields import fitted_slope
from adhesis.ensemble.quantities import percent
from adhesis.ensemble.report.tables.key import estimate, estimated, key_columns
from adhesis.ensemble.report.tables.table import (
    Table,
    TableColumn,
    fixed,
    make_table,
    number,
    plain,
)
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.jump import JUMP_KINDS


def _kinds(data: Aggregate) -> list[int]:
    return np.flatnonzero(np.any([cell.jumps.number for cell in data.cells], axis=0)).tolist()


def _share(kind: int, cell: AveragedCell) -> float | None:
    """Return the share of a kind in the drops of a cell; None without any."""
    drops = float(cell.jumps.energy.sum())
    return float(cell.jumps.energy[kind]) / drops if drops else None


def jumps(data: Aggregate) -> Table:
    """One row for each cell and kind: how many jumps, and their share of all drops."""
    rows = [(cell, int(k)) for cell in data.cells for k in np.flatnonzero(cell.jumps.number)]
    columns = (
        *key_columns(data, itemgetter(0)),
        TableColumn("kind", lambda row: JUMP_KINDS[row[1]], "kind"),
        TableColumn("scale", lambda row: "small" if SMALL[row[1]] else "large", "scale"),
        TableColumn(
            "jumps_per_loop",
            lambda row: float(row[0].jumps.number[row[1]]) / row[0].done,
            *("jumps a loop", number(3)),
        ),
        TableColumn(
            "energy_per_loop [J/m^2]",
            lambda row: float(row[0].jumps.energy[row[1]]) / row[0].done,
            *("drops a loop (mJ/m²)", number(3, unit=1e-3)),
        ),
        TableColumn("share_of_drops", lambda row: _share(row[1], row[0]), "share", percent),
    )
    return make_table("Jumps by kind", columns, rows)


def shares_by_kind(data: Aggregate) -> Table:
    """Share of each kind in the drops, one row for each cell: :func:`jumps` at a glance."""
    columns = (
        *key_columns(data),
        *(
            TableColumn(JUMP_KINDS[k], partial(_share, k), JUMP_KINDS[k], percent)
            for k in _kinds(data)
        ),
    )
    return make_table("Share of the drops by kind of the jump", columns, data.cells)


def mechanisms(data: Aggregate) -> Table:
    """Loss by mechanism, largest tension and loss of contact, one row for each cell.

    The largest tension of a loop is reached before the last contact is lost, at another
    penetration.
    """
    columns = (
        *key_columns(data),
        *estimated(
            *("small_scale_share", "value ci_low ci_high", "small-scale share", percent),
        ),
        TableColumn("jumps_per_loop", estimate("jump_count"), "jumps a loop", number(3)),
        TableColumn(
            "pull_off_stress [Pa]",
            estimate("pull_off_stress"),
            *("largest tension (kPa)", number(3, unit=1e3)),
        ),
        TableColumn(
            "pull_off_stress_sem [Pa]",
            estimate("pull_off_stress", "sem"),
            *("s.e. (kPa)", number(2, unit=1e3)),
        ),
        *estimated(
            *("pull_off_penetration", "value", "last contact lost at Δ/h_max", number(3)),
        ),
        TableColumn(
            "wall_time [s]",
            lambda cell: float(f"{cell.estimates['wall_time'].mean:.3g}"),
            *("s a loop", plain),
        ),
    )
    return make_table("Mechanisms and pull-off", columns, data.cells)


@dataclass(frozen=True)
class _State:
    """A state with fields: where it is, how many loops are in contact, and the slope there."""

    cell: Cell
    branch: str
    penetration: float
    realisations: int
    slope: float
    error: float


def slopes(data: Aggregate, branches: Sequence[str] = BRANCHES) -> Table:
    """Exponent of the deformed surface's spectrum at small wave numbers, state by state."""
    depth = "p̄/p̄_max" if data.campaign.cycle.turns_at_stress else "Δ/h_max"
    columns = (
        *key_columns(data, attrgetter("cell")),
        TableColumn("branch", attrgetter("branch"), "branch"),
        TableColumn("penetration", attrgetter("penetration"), depth, fixed(2)),
        TableColumn("realisations", attrgetter("realisations"), "n"),
        TableColumn("slope", attrgetter("slope"), "slope", fixed(2)),
        TableColumn("slope_sem", attrgetter("error"), "s.e.", number(1)),
        TableColumn("slope_persson", lambda of: -(2 + of.cell.hurst), "-(2+H)", fixed(2)),
        TableColumn("slope_profile", lambda of: -(2 * of.cell.hurst + 1), "-(2H+1)", fixed(2)),
    )
    rows = [
        _State(
            *(cell, branch, penetration, int(cell.fields.in_contact[b, k])),
            *fitted_slope(cell.plan, cell.fields.psd_displacement[b, k]),
        )
        for cell in data.cells
        for branch in branches
        for b in (BRANCHES.index(branch),)
        for k, penetration in enumerate(cell.plan.penetration.tolist())
        if cell.fields.in_contact[b, k]
    ]
    return make_table("Slope of the spectrum of the deformed surface", columns, rows)
