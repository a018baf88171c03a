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
from adhesis.ensemble.report.tables.key import axis_columns, estimate, gamma_column, key_columns
from adhesis.ensemble.report.tables.table import (
    Format,
    Table,
    TableColumn,
    at_least_0,
    fixed,
    make_table,
    number,
    plain,
)
from adhesis.solver.model.profile import Array
from adhesis.solver.values import finite


def losses(data: Aggregate) -> Table:
    """One row for each cell, everything that ``losses.csv`` holds."""
    columns = (
        *key_columns(data),
        TableColumn("n", attrgetter("done"), "n"),
        TableColumn("failed", attrgetter("failed"), "failed", only_if_any=True),
        TableColumn("pending", attrgetter("pending"), "pending", only_if_any=True),
        _estimated("loss_dimensionless", "mean", "W~", number(), last=True),
        _estimated("loss_dimensionless", "std"),
        _estimated("loss_dimensionless", "sem", "s.e.", number(2), last=True),
        _estimated("loss_dimensionless", "ci_low", "95 % from", at_least_0, last=True),
        _estimated("loss_dimensionless", "ci_high", "to", number(), last=True),
        TableColumn(
            "loss_dimensionless_error_numerical",
            estimate("loss_error_dimensionless"),
            *("± loop", number(1), True, True),
        ),
        TableColumn(
            "loss_dimensionless_error_load_steps",
            partial(_error_of_load_steps, data),
            *("± steps", number(1)),
            last=True,
        ),
        TableColumn(
            "loss_dimensionless_error_resolution",
            partial(_error_of_resolution, data),
            *("± method", number(1), True, True),
        ),
        TableColumn("loss_dimensionless_paper", papers_loss, "paper", fixed(2), True, True),
        _estimated("loss", "mean [J/m^2]", "loss (mJ/m²)", number(unit=1e-3)),
        _estimated("loss", "std [J/m^2]"),
        _estimated("loss", "sem [J/m^2]", "s.e.", number(2, unit=1e-3)),
        _estimated("loss", "ci_low [J/m^2]", "95 % from", partial(at_least_0, unit=1e-3)),
        _estimated("loss", "ci_high [J/m^2]", "to", number(unit=1e-3)),
        *_friction_columns(data),
        TableColumn(
            "loss_over_work_of_adhesion",
            _loss_over_work_of_adhesion,
            *("W/γ", number(3)),
            only_if_any=True,
        ),
        TableColumn("interval", lambda cell: interval_method(cell.done)),
        _estimated("loss_from_drops", "mean [J/m^2]"),
        _estimated("audit_residual", "mean"),
        TableColumn("audit_residual_rms", _if_done(lambda cell: _rms(_audit(cell)))),
        TableColumn(
            "audit_residual_largest",
            _if_done(lambda cell: np.max(np.abs(_audit(cell)))),
            *("audit", percent),
        ),
        TableColumn("races", _races, "races", plain, only_if_any=True),
        _estimated("energy_at_stake_dimensionless", "mean"),
        TableColumn(
            "range_least [m]",
            lambda cell: least(cell.least_range),
            *("range (nm)", number(unit=1e-9)),
            only_if_any=True,
        ),
        TableColumn("valid_range_least [m]", lambda cell: least(cell.values["valid_range"])),
        TableColumn("edge_range_least [m]", lambda cell: least(cell.values["edge_range"])),
        TableColumn("touch_range_least [m]", lambda cell: least(cell.values["touch_range"])),
        TableColumn(
            "largest_interior_tension [Pa]",
            lambda cell: largest(cell.values["largest_interior_tension"]),
        ),
        _estimated("loss_small_scale", "mean [J/m^2]"),
        _estimated("loss_small_scale", "sem [J/m^2]"),
        _estimated("loss_large_scale", "mean [J/m^2]"),
        _estimated("loss_large_scale", "sem [J/m^2]"),
        _estimated("small_scale_share", "mean"),
        _estimated("small_scale_share", "ci_low"),
        _estimated("small_scale_share", "ci_high"),
        _estimated("pull_off_stress", "mean [Pa]"),
        _estimated("pull_off_stress", "sem [Pa]"),
        _estimated("pull_off_stress", "ci_low [Pa]"),
        _estimated("pull_off_stress", "ci_high [Pa]"),
        TableColumn(
            "pull_off_stress_dimensionless_mean",
            _if_done(lambda cell: _pull_off_stress_dimensionless(cell).mean()),
        ),
        _estimated("pull_off_penetration", "mean"),
        _estimated("pull_off_penetration", "sem"),
        _estimated("h_max", "mean [m]"),
        _estimated("h_rms", "mean [m]"),
        _estimated("m0", "mean [m^2]"),
        _estimated("m2", "mean"),
        _estimated("m4", "mean [1/m^2]"),
        TableColumn("m2_paper", _papers_m2),
        _estimated("wall_time", "mean [s]"),
    )
    return make_table("Loss of one loop", columns, data.cells)


def _friction_columns(data: Aggregate) -> tuple[TableColumn, ...]:
    """Return the columns of the two parts of the loss; none for one work of adhesion."""
    if data.campaign.material.work_of_adhesion_open is None:
        return ()
    milli = number(unit=1e-3)
    return (
        _estimated("friction", "mean [J/m^2]", "friction", milli),
        TableColumn(
            "instability_mean [J/m^2]",
            _if_done(lambda cell: np.mean(cell.values["loss"] - cell.values["friction"])),
            *("instability", milli),
        ),
    )


def _estimated(
    quantity: str, part: str, heading: str = "", show: Format = plain, *, last: bool = False
) -> TableColumn:
    """Return the column of a part of a cell's estimate: "mean", or "ci_low [J/m^2]"."""
    which = part.split(" ")[0].removeprefix("ci_")
    return TableColumn(f"{quantity}_{part}", estimate(quantity, which), heading, show, last=last)


def _if_done(value: Callable[[Cell], Any]) -> Callable[[Cell], float | None]:
    """Take a number from the cells that have a finished task."""
    return lambda cell: float(value(cell)) if cell.done else None


def _audit(cell: Cell) -> Array:
    return cell.values["audit_residual"]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _races(cell: Cell) -> int | None:
    return int(cell.values["races"].sum()) if cell.done else None


def _pull_off_stress_dimensionless(cell: Cell) -> Array:
    return cell.values["pull_off_stress"] / stress_scale(cell.campaign, cell.values["h_max"])


def _papers_m2(cell: Cell) -> float | None:
    return paper.m2(cell.hurst) if paper.is_cell_of(cell) else None


def _loss_over_work_of_adhesion(cell: Cell) -> float | None:
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


def least(values: Array) -> float | None:
    """Return the least of the known values; None if none is finite."""
    known = values[np.isfinite(values)]
    return float(known.min()) if known.size else None


def largest(values: Array) -> float | None:
    """Return the largest of the known values; None if none is finite."""
    known = values[np.isfinite(values)]
    return float(known.max()) if known.size else None


def beside_the_paper(data: Aggregate) -> Table:
    """The paper's Table 1, cell by cell; no rows for others than the paper's."""
    columns = (
        *key_columns(data),
        TableColumn("n", attrgetter("done"), "n"),
        TableColumn("loss_dimensionless", estimate("loss_dimensionless"), "W~", number()),
        TableColumn("ci_low", estimate("loss_dimensionless", "low"), "95 % from", number()),
        TableColumn("ci_high", estimate("loss_dimensionless", "high"), "to", number()),
        TableColumn("paper", papers_loss, "paper", fixed(2)),
        TableColumn(
            "deviation",
            _off_the_paper,
            *("W~ off the paper by", partial(rounded_percent, sign="+")),
        ),
        TableColumn("inside", _inside, "paper in the interval"),
    )
    cells = [
        cell
        for cell in data.cells
        if cell.done
        and paper.is_cell_of(cell)
        and paper.has_cell(cell.hurst, cell.work_of_adhesion)
    ]
    return make_table("Beside the paper's Table 1", columns, cells)


def _off_the_paper(cell: Cell) -> float | None:
    """Return the relative deviation of the mean loss from the paper's."""
    value = papers_loss(cell)
    return None if value is None else cell.estimates["loss_dimensionless"].mean / value - 1


def _inside(cell: Cell) -> str | None:
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
    found = _deviation(data, cell, "load steps")
    if found is None and cell.done:
        audit = cell.values["audit_residual"] * cell.values["loss_dimensionless"]
        found = float(np.mean(np.abs(audit)))
    return found


def _error_of_resolution(data: Aggregate, cell: Cell) -> float | None:
    """From a campaign that differs in its solver alone; None if there is none beside."""
    return _deviation(data, cell, "resolution")


def _deviation(data: Aggregate, cell: Cell, kind: str) -> float | None:
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
    milli = number(unit=1e-3)
    columns = (
        TableColumn("hurst", attrgetter("hurst"), "H"),
        *axis_columns(data.further),
        gamma_column(data, "_from", attrgetter("lower"), "γ from"),
        gamma_column(data, "_to", attrgetter("upper"), "to"),
        TableColumn("pairs", attrgetter("loss.n"), "pairs"),
        *_differences("loss_dimensionless_difference", "loss_dimensionless", "W~ grows by"),
        TableColumn("loss_difference [J/m^2]", attrgetter("loss.mean"), "loss by (mJ/m²)", milli),
        TableColumn("loss_difference_sem [J/m^2]", attrgetter("loss.sem")),
        TableColumn("loss_difference_ci_low [J/m^2]", attrgetter("loss.low")),
        TableColumn("loss_difference_ci_high [J/m^2]", attrgetter("loss.high")),
    )
    return make_table("Growth of the loss with γ, profile by profile", columns, data.paired)


def _differences(
    name: str, estimate_: str, heading: str, digits: int = 4
) -> tuple[TableColumn, ...]:
    """Return the columns of a difference with its error and interval, from an estimate."""
    return (
        TableColumn(name, attrgetter(f"{estimate_}.mean"), heading, number(digits)),
        TableColumn(f"{name}_sem", attrgetter(f"{estimate_}.sem"), "s.e.", number(2)),
        TableColumn(f"{name}_ci_low", attrgetter(f"{estimate_}.low"), "95 % from", number(digits)),
        TableColumn(f"{name}_ci_high", attrgetter(f"{estimate_}.high"), "to", number(digits)),
    )


def profiles(data: Aggregate) -> Table:
    """Statistics of the profiles of each H (and further key of the profile), the paper's slope."""
    further = [k for k, axis in enumerate(data.further) if axis.table == "profile"]
    columns = (
        TableColumn("hurst", attrgetter("hurst"), "H"),
        *axis_columns([data.further[k] for k in further]),
        TableColumn("h_rms [m]", estimate("h_rms"), "h_rms (µm)", number(unit=1e-6)),
        TableColumn("h_max [m]", estimate("h_max"), "mean h_max (µm)", number(unit=1e-6)),
        TableColumn("m0 [m^2]", estimate("m0"), "m0 (µm²)", number(unit=1e-12)),
        TableColumn("m2", estimate("m2"), "m2", number()),
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
        *_differences("difference", "loss.difference", "difference", 3),
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
