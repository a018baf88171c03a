"""The tables of jumps, mechanisms and spectra, from an aggregate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter

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


@dataclass(frozen=True)
class _Kind:
    """The jumps of one kind in all loops of a cell."""

    cell: AveragedCell
    place: int  # in JUMP_KINDS

    @property
    def number(self) -> float:
        """Number of jumps."""
        return float(self.cell.jumps.number[self.place])

    @property
    def energy(self) -> float:
        """Their drops together, J/m²."""
        return float(self.cell.jumps.energy[self.place])

    @property
    def share(self) -> float | None:
        """Share of the kind in all drops; None without any."""
        of_all_kinds = float(self.cell.jumps.energy.sum())
        return self.energy / of_all_kinds if of_all_kinds else None


def _kinds(data: Aggregate) -> list[int]:
    """Return the kinds of jumps that any cell has."""
    return np.flatnonzero(np.any([cell.jumps.number for cell in data.cells], axis=0)).tolist()


def jumps(data: Aggregate) -> Table:
    """One row for each cell and kind: how many jumps, and their share of all drops."""
    columns = (
        *key_columns(data, attrgetter("cell")),
        TableColumn("kind", lambda of: JUMP_KINDS[of.place], "kind"),
        TableColumn("scale", lambda of: "small" if SMALL[of.place] else "large", "scale"),
        TableColumn(
            "jumps_per_loop", lambda of: of.number / of.cell.done, "jumps a loop", number(3)
        ),
        TableColumn(
            "energy_per_loop [J/m^2]",
            lambda of: of.energy / of.cell.done,
            *("drops a loop (mJ/m²)", number(3, unit=1e-3)),
        ),
        TableColumn("share_of_drops", attrgetter("share"), "share", percent),
    )
    every = (_Kind(cell, place) for cell in data.cells for place in _kinds(data))
    return make_table("Jumps by kind", columns, (of for of in every if of.number))


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


def _share(place: int, cell: AveragedCell) -> float | None:
    return _Kind(cell, place).share


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
