"""The tables of losses and profiles, from an aggregate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell, stress_scale
from adhesis.ensemble.aggregate.companions import Companion, LossDifference, difference
from adhesis.ensemble.interval import interval_method
from adhesis.ensemble.quantities import percent, rounded_percent
from adhesis.ensemble.report import paper
from adhesis.ensemble.report.tables.key import (
    axis_columns,
    estimate,
    estimated,
    gamma_column,
    key_columns,
)
from adhesis.ensemble.report.tables.table import (
    Table,
    TableColumn,
    fixed,
    make_table,
    number,
    plain,
)
from adhesis.solver.loading.zero_range import RANGES
from adhesis.solver.model.profile import Array
from adhesis.solver.values import finite

_ALL, _DIFFERENCE = "mean std sem ci_low ci_high", "value sem ci_low ci_high"
_MILLI: Any = {"unit": " [J/m^2]", "size": 1e-3}


def losses(data: Aggregate) -> Table:
    """One row for each cell, everything that ``losses.csv`` holds."""
    columns = (
        *key_columns(data),
        TableColumn("n", attrgetter("done"), "n"),
        TableColumn("failed", attrgetter("failed"), "failed", only_if_any=True),
        TableColumn("pending", attrgetter("pending"), "pending", only_if_any=True),
        *_preload_columns(data),
        *estimated("loss_dimensionless", _ALL, "W~", least=True, last=True),
        TableColumn(
            "loss_dimensionless_error_numerical",
            estimate("loss_error_dimensionless"),
            *("± loop", number(1)),
            only_if_any=True,
            last=True,
        ),
        TableColumn(
            "loss_dimensionless_error_load_steps",
            partial(_error_of_load_steps, data),
            *("± steps", number(1)),
            last=True,
        ),
        TableColumn(
            "loss_dimensionless_error_resolution",
            partial(_deviation, "resolution", data),
            *("± method", number(1)),
            only_if_any=True,
            last=True,
        ),
        TableColumn(
            "loss_dimensionless_paper", papers_loss, "paper", fixed(2), only_if_any=True, last=True
        ),
        *estimated("loss", _ALL, "loss (mJ/m²)", **_MILLI, least=True),
        *_friction_columns(data),
        *(
            estimated("zone_error", "mean", "± zones", **_MILLI)
            if data.campaign.material.opens
            else ()
        ),
        TableColumn("loss_over_work_of_adhesion", _over_gamma, "W/γ", number(3), only_if_any=True),
        TableColumn("interval", lambda cell: interval_method(cell.done)),
        *estimated("loss_from_drops", **_MILLI),
        *estimated("audit_residual"),
        TableColumn("audit_residual_rms", _of_audit(lambda audit: np.sqrt(np.mean(audit**2)))),
        TableColumn(
            "audit_residual_largest",
            _of_audit(lambda audit: np.max(np.abs(audit))),
            *("audit", percent),
        ),
        TableColumn(
            "races",
            lambda cell: int(cell.values["races"].sum()) if cell.done else None,
            *("races", plain),
            only_if_any=True,
        ),
        *estimated("energy_at_stake_dimensionless"),
        TableColumn(
            "range_least [m]",
            lambda cell: extreme(np.min, cell.least_range),
            *("range (nm)", number(unit=1e-9)),
            only_if_any=True,
        ),
        *(TableColumn(f"{name}_least [m]", partial(_least_of, name)) for name in RANGES),
        TableColumn(
            "largest_interior_tension [Pa]",
            lambda cell: extreme(np.max, cell.values["largest_interior_tension"]),
        ),
        *estimated("loss_small_scale", "mean sem", **_MILLI),
        *estimated("loss_large_scale", "mean sem", **_MILLI),
        *estimated("small_scale_share", "mean ci_low ci_high"),
        *estimated("pull_off_stress", "mean sem ci_low ci_high", unit=" [Pa]"),
        TableColumn("pull_off_stress_dimensionless_mean", _if_done(_pull_off_stress)),
        *estimated("pull_off_penetration", "mean sem"),
        *estimated("h_max", unit=" [m]"),
        *estimated("h_rms", unit=" [m]"),
        *estimated("m0", unit=" [m^2]"),
        *estimated("m2"),
        *estimated("m4", unit=" [1/m^2]"),
        TableColumn("m2_paper", _papers_m2),
        *estimated("wall_time", unit=" [s]"),
    )
    return make_table("Loss of one loop", columns, data.cells)


def _preload_columns(data: Aggregate) -> tuple[TableColumn, ...]:
    """Return the column of loops that turned before their preload; none without a preload."""
    if data.campaign.cycle.preload is None:
        return ()
    name = "short_of_preload"
    return (TableColumn(name, attrgetter(name), "short", plain, only_if_any=True),)


def _friction_columns(data: Aggregate) -> tuple[TableColumn, ...]:
    """Return the columns of the two parts of the loss; none for one work of adhesion."""
    if data.campaign.material.work_of_adhesion_open is None:
        return ()
    return (
        *estimated("friction", "mean", "friction", **_MILLI),
        TableColumn(
            "instability_mean [J/m^2]",
            _if_done(lambda cell: np.mean(cell.values["loss"] - cell.values["friction"])),
            *("instability", number(unit=1e-3)),
        ),
    )


def _if_done(value: Callable[[Cell], Any]) -> Callable[[Cell], float | None]:
    """Take a number from the cells that have a finished task."""
    return lambda cell: float(value(cell)) if cell.done else None


def _of_audit(value: Callable[[Array], Any]) -> Callable[[Cell], float | None]:
    return _if_done(lambda cell: value(cell.values["audit_residual"]))


def _pull_off_stress(cell: Cell) -> float:
    scale = stress_scale(cell.campaign, cell.values["h_max"])
    return float((cell.values["pull_off_stress"] / scale).mean())


def _papers_m2(cell: Cell) -> float | None:
    return paper.m2(cell.hurst) if paper.is_cell_of(cell) else None


def _over_gamma(cell: Cell) -> float | None:
    """Return the mean loss over the work of adhesion; None without adhesion."""
    gamma = cell.work_of_adhesion
    return cell.estimates["loss"].mean / gamma if gamma > 0 else None


def precision(data: Aggregate) -> Table:
    """Tabulate the precision of the quantity of ``[stop]``; no rows without ``[stop]``."""
    verdict = {True: "yes", False: "no", None: "not finished"}
    three_digits = partial(percent, digits=3)
    columns = (
        *key_columns(data),
        TableColumn("n", attrgetter("precision.estimate.n"), "n"),
        TableColumn("quantity", attrgetter("precision.quantity"), "quantity"),
        TableColumn("mean", attrgetter("precision.estimate.mean"), "mean", number()),
        TableColumn("ci_low", attrgetter("precision.estimate.low"), "95 % from", number()),
        TableColumn("ci_high", attrgetter("precision.estimate.high"), "to", number()),
        TableColumn(
            "relative_error",
            lambda cell: finite(cell.precision.relative_error),
            *("±, further side", three_digits),
        ),
        TableColumn(
            "wanted_relative_error", attrgetter("precision.wanted"), "wanted", three_digits
        ),
        TableColumn("met", lambda cell: verdict[cell.precision.met], "met"),
    )
    steered = [cell for cell in data.cells if cell.precision is not None]
    return make_table("Precision of the mean ([stop])", columns, steered)


def papers_loss(cell: Cell) -> float | None:
    """Value of the paper's Table 1, None where it gives none or the cell is not its own."""
    if not paper.is_cell_of(cell):
        return None
    return paper.table_1(cell.hurst, cell.work_of_adhesion)


def extreme(choose: Callable[[Array], Any], values: Array) -> float | None:
    """Return the least or largest of the known values; None if none is finite."""
    known = values[np.isfinite(values)]
    return float(choose(known)) if known.size else None


def _least_of(name: str, cell: Cell) -> float | None:
    return extreme(np.min, cell.values[name])


def beside_the_paper(data: Aggregate) -> Table:
    """The paper's Table 1, cell by cell; no rows for others than the paper's."""
    columns = (
        *key_columns(data),
        TableColumn("n", attrgetter("done"), "n"),
        *estimated("loss_dimensionless", "value ci_low ci_high", "W~"),
        TableColumn("paper", papers_loss, "paper", fixed(2)),
        TableColumn(
            *("deviation", off_the_paper),
            *("W~ off the paper by", partial(rounded_percent, sign="+")),
        ),
        TableColumn("inside", inside_interval, "paper in the interval"),
    )
    cells = [
        cell
        for cell in data.cells
        if cell.done
        and paper.is_cell_of(cell)
        and paper.has_cell(cell.hurst, cell.work_of_adhesion)
    ]
    return make_table("Beside the paper's Table 1", columns, cells)


def off_the_paper(cell: Cell) -> float | None:
    """Return the relative deviation of the mean loss from the paper's; None without either."""
    value = papers_loss(cell) if cell.done else None
    return None if value is None else cell.estimates["loss_dimensionless"].mean / value - 1


def inside_interval(cell: Cell) -> str | None:
    """Whether the paper's value lies in the interval of the mean; None if either is unknown."""
    value, loss = papers_loss(cell), cell.estimates["loss_dimensionless"]
    if value is None or np.isnan(loss.low):
        return None
    return "yes" if loss.low <= value <= loss.high else "no"


def _error_of_load_steps(data: Aggregate, cell: Cell) -> float | None:
    """From a campaign with other load steps if there is one, else from the energy audit.

    The audit compares loop integral and sum of drops, of which the load steps are the only
    difference.
    """
    found = _deviation("load steps", data, cell)
    if found is None and cell.done:
        audit = cell.values["audit_residual"] * cell.values["loss_dimensionless"]
        found = float(np.mean(np.abs(audit)))
    return found


def _deviation(kind: str, data: Aggregate, cell: Cell) -> float | None:
    """Largest mean difference of the loss from a companion of that kind."""
    found = [
        abs(pair.difference.mean)
        for companion in data.companions
        if companion.kind == kind
        and (other := companion.like(cell)) is not None
        and (pair := difference(cell, other)) is not None
    ]
    return max(found, default=None)


def paired(data: Aggregate) -> Table:
    """Tabulate the growth of the loss from one γ to the next on the same profiles."""
    scaled, loss = attrgetter("loss_dimensionless"), attrgetter("loss")
    columns = (
        TableColumn("hurst", attrgetter("hurst"), "H"),
        *axis_columns(data.further),
        gamma_column(data, "_from", attrgetter("lower"), "γ from"),
        gamma_column(data, "_to", attrgetter("upper"), "to"),
        TableColumn("pairs", attrgetter("loss.n"), "pairs"),
        *estimated("loss_dimensionless_difference", _DIFFERENCE, "W~ grows by", of=scaled),
        *estimated("loss_difference", "value", "loss by (mJ/m²)", **_MILLI, of=loss),
        *estimated("loss_difference", "sem ci_low ci_high", **_MILLI, of=loss),
    )
    return make_table("Growth of the loss with γ, profile by profile", columns, data.paired)


def profiles(data: Aggregate) -> Table:
    """Statistics of the profiles of each H (and further key of the profile), the paper's slope."""
    further = [k for k, axis in enumerate(data.further) if axis.table == "profile"]
    columns = (
        TableColumn("hurst", attrgetter("hurst"), "H"),
        *axis_columns([data.further[k] for k in further]),
        TableColumn("h_rms [m]", estimate("h_rms"), "mean h_rms (µm)", number(unit=1e-6)),
        TableColumn("h_max [m]", estimate("h_max"), "mean h_max (µm)", number(unit=1e-6)),
        TableColumn("m0 [m^2]", estimate("m0"), "m0 (µm²)", number(unit=1e-12)),
        TableColumn("m2", estimate("m2"), "mean m2", number()),
        TableColumn("m2_paper", _papers_m2, "m2, paper", number(2), only_if_any=True),
        TableColumn("m4 [1/m^2]", estimate("m4"), "m4 (1/µm²)", number(unit=1e12)),
    )
    alike: dict[tuple[float, ...], list[Cell]] = {}
    for cell in data.cells:
        at = (cell.hurst, *(cell.others[k][1] for k in further))
        alike.setdefault(at, []).append(cell)
    best = [max(cells, key=lambda cell: cell.done) for cells in alike.values()]
    return make_table("Profiles", columns, best)


@dataclass(frozen=True)
class _Beside:
    """A cell, the companion's like it, and the difference of their losses."""

    companion: Companion
    cell: Cell
    other: Cell
    loss: LossDifference


def companions(data: Aggregate) -> Table:
    """Losses of the campaigns beside this one, over the realisations that both have."""
    columns = (
        TableColumn("file", attrgetter("companion.path.name"), "campaign"),
        TableColumn(
            "differs",
            lambda pair: "; ".join(pair.companion.differs) or "nothing",
            "where it differs",
        ),
        *key_columns(data, attrgetter("cell")),
        TableColumn("pairs", attrgetter("loss.here.n"), "pairs"),
        TableColumn("loss_dimensionless_here", attrgetter("loss.here.mean"), "W~ here", number()),
        TableColumn("loss_dimensionless_there", attrgetter("loss.there.mean"), "there", number()),
        *estimated(
            *("difference", _DIFFERENCE, "difference", number(3)), of=attrgetter("loss.difference")
        ),
        TableColumn(
            "loss_dimensionless_paper",
            lambda pair: papers_loss(pair.cell) if paper.is_cell_of(pair.other) else None,
            *("paper", fixed(2)),
            only_if_any=True,
        ),
    )
    pairs = [
        _Beside(companion, cell, other, pair)
        for companion in data.companions
        for cell in data.cells
        if (other := companion.like(cell)) is not None
        and (pair := difference(cell, other)) is not None
    ]
    return make_table("Beside other campaigns", columns, pairs)


def works(data: Aggregate) -> Table:
    """What approach gains and separation spends: docs/theory.md, section 8."""
    per_contact = {
        "effective_work_of_approach": "per contact: approach (mJ/m²)",
        "effective_work_of_separation": "separation (mJ/m²)",
        "loss_per_contact": "loss (mJ/m²)",
    }
    columns = [
        *key_columns(data),
        TableColumn("n", attrgetter("done"), "n"),
        *estimated("work_gained", "mean", "gained on approach (mJ/m²)", **_MILLI),
        *estimated("work_spent", "mean", "spent on separation (mJ/m²)", **_MILLI),
        *estimated("largest_contact_fraction", "mean", "largest A/A0"),
        *estimated("largest_contact_fraction", "ci_low ci_high"),
    ]
    for name, heading in per_contact.items():
        columns += estimated(name, "mean", heading, **_MILLI)
        columns += estimated(name, "ci_low ci_high", **_MILLI)
    columns += estimated("full_contact_energy", "mean", "full contact (mJ/m²)", **_MILLI)
    return make_table("Work of approach and separation", columns, data.cells)
