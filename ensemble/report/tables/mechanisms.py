"""The tables of jumps, mechanisms and spectra, from an aggregate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter, itemgetter

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell
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


@dataclass(frozen=True)
class _Kind:
    """The jumps of one kind in all loops of a cell."""

    cell: Cell
    kind: str
    small_scale: bool
    number: float
    energy: float
    of_all_kinds: float

    @property
    def share(self) -> float | None:
        """Share of the kind in all drops; None without any."""
        return self.energy / self.of_all_kinds if self.of_all_kinds else None


def _kinds(data: Aggregate) -> list[tuple[Cell, list[_Kind]]]:
    """Return every kind of jump that any cell has, cell by cell."""
    found = data.jumps
    used = [j for j in range(len(found.kinds)) if found.number[:, j].any()]
    return [
        (
            cell,
            [
                _Kind(
                    *(cell, found.kinds[j], bool(found.small_scale[j])),
                    *(float(found.number[k, j]), float(found.energy[k, j])),
                    float(found.energy[k].sum()),
                )
                for j in used
            ],
        )
        for k, cell in enumerate(data.cells)
    ]


def jumps(data: Aggregate) -> Table:
    """One row for each cell and kind: how many jumps, and their share of all drops."""
    columns = (
        *key_columns(data, attrgetter("cell")),
        TableColumn("kind", attrgetter("kind"), "kind"),
        TableColumn("scale", lambda of: "small" if of.small_scale else "large", "scale"),
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
    rows = [of for _, kinds in _kinds(data) for of in kinds if of.number]
    return make_table("Jumps by kind", columns, rows)


def shares_by_kind(data: Aggregate) -> Table:
    """Share of each kind in the drops, one row for each cell: :func:`jumps` at a glance."""
    rows = _kinds(data)
    columns = (
        *key_columns(data, itemgetter(0)),
        *(
            TableColumn(of.kind, partial(_share, j), of.kind, percent)
            for j, of in enumerate(rows[0][1])
        ),
    )
    return make_table("Share of the drops by kind of the jump", columns, rows)


def _share(j: int, row: tuple[Cell, list[_Kind]]) -> float | None:
    return row[1][j].share


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
    fields = data.fields
    rows = [
        _State(
            *(cell, branch, penetration, int(fields.in_contact[index, b, k])),
            *fitted_slope(cell.plan, fields.psd_displacement[index, b, k]),
        )
        for index, cell in enumerate(data.cells)
        for branch in branches
        for b in (BRANCHES.index(branch),)
        for k, penetration in enumerate(cell.plan.penetration.tolist())
        if fields.in_contact[index, b, k]
    ]
    return make_table("Slope of the spectrum of the deformed surface", columns, rows)
