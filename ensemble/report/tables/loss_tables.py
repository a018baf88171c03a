"""The tables of losses and profiles, from an aggregate."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell, stress_scale
from adhesis.ensemble.aggregate.companions import difference
from adhesis.ensemble.aggregate.statistics import Estimate
from adhesis.ensemble.campaign.precision import as_percent
from adhesis.ensemble.interval import interval_method
from adhesis.ensemble.report import paper
from adhesis.ensemble.report.tables.key import axis_columns, key, key_columns
from adhesis.ensemble.report.tables.table import (
    Table,
    TableColumn,
    Value,
    at_least_0,
    fixed,
    make_table,
    number,
    percent,
    plain,
    signed_percent,
)
from adhesis.solver.model.profile import Array


def losses(data: Aggregate) -> Table:
    """One row for each cell, everything that ``losses.csv`` holds."""
    columns = (
        *key_columns(data),
        TableColumn("n", "n"),
        TableColumn("failed", "failed", only_if_any=True),
        TableColumn("pending", "pending", only_if_any=True),
        TableColumn("loss_dimensionless_mean", "W~", number(), last=True),
        TableColumn("loss_dimensionless_std"),
        TableColumn("loss_dimensionless_sem", "s.e.", number(2), last=True),
        TableColumn("loss_dimensionless_ci_low", "95 % from", at_least_0, last=True),
        TableColumn("loss_dimensionless_ci_high", "to", number(), last=True),
        TableColumn("loss_dimensionless_error_numerical", "± loop", number(1), True, True),
        TableColumn("loss_dimensionless_error_load_steps", "± steps", number(1), last=True),
        TableColumn("loss_dimensionless_error_resolution", "± method", number(1), True, True),
        TableColumn("loss_dimensionless_paper", "paper", fixed(2), True, True),
        TableColumn("loss_mean [J/m^2]", "loss (mJ/m²)", number(unit=1e-3)),
        TableColumn("loss_std [J/m^2]"),
        TableColumn("loss_sem [J/m^2]", "s.e.", number(2, unit=1e-3)),
        TableColumn("loss_ci_low [J/m^2]", "95 % from", partial(at_least_0, unit=1e-3)),
        TableColumn("loss_ci_high [J/m^2]", "to", number(unit=1e-3)),
        TableColumn("loss_over_work_of_adhesion", "W/γ", number(3), only_if_any=True),
        TableColumn("interval"),
        TableColumn("loss_from_drops_mean [J/m^2]"),
        TableColumn("audit_residual_mean"),
        TableColumn("audit_residual_rms"),
        TableColumn("audit_residual_largest", "audit", percent),
        TableColumn("races", "races", plain, only_if_any=True),
        TableColumn("energy_at_stake_dimensionless_mean"),
        TableColumn("range_least [m]", "range (nm)", number(unit=1e-9), only_if_any=True),
        TableColumn("valid_range_least [m]"),
        TableColumn("edge_range_least [m]"),
        TableColumn("touch_range_least [m]"),
        TableColumn("largest_interior_tension [Pa]"),
        TableColumn("loss_small_scale_mean [J/m^2]"),
        TableColumn("loss_small_scale_sem [J/m^2]"),
        TableColumn("loss_large_scale_mean [J/m^2]"),
        TableColumn("loss_large_scale_sem [J/m^2]"),
        TableColumn("small_scale_share_mean"),
        TableColumn("small_scale_share_ci_low"),
        TableColumn("small_scale_share_ci_high"),
        TableColumn("pull_off_stress_mean [Pa]"),
        TableColumn("pull_off_stress_sem [Pa]"),
        TableColumn("pull_off_stress_ci_low [Pa]"),
        TableColumn("pull_off_stress_ci_high [Pa]"),
        TableColumn("pull_off_stress_dimensionless_mean"),
        TableColumn("pull_off_penetration_mean"),
        TableColumn("pull_off_penetration_sem"),
        TableColumn("h_max_mean [m]"),
        TableColumn("h_rms_mean [m]"),
        TableColumn("m0_mean [m^2]"),
        TableColumn("m2_mean"),
        TableColumn("m4_mean [1/m^2]"),
        TableColumn("m2_paper"),
        TableColumn("wall_time_mean [s]"),
    )
    rows = [_loss_row(data, cell) for cell in data.cells]
    return make_table("Loss of one loop", columns, rows)


def precision(data: Aggregate) -> Table:
    """Tabulate the precision of the quantity of ``[stop]``; no rows without ``[stop]``."""
    columns = (
        *key_columns(data),
        TableColumn("n", "n"),
        TableColumn("quantity", "quantity"),
        TableColumn("mean", "mean", number()),
        TableColumn("ci_low", "95 % from", number()),
        TableColumn("ci_high", "to", number()),
        TableColumn("relative_error", "±, further side", as_percent),
        TableColumn("wanted_relative_error", "wanted", as_percent),
        TableColumn("met", "met"),
    )
    verdict = {True: "yes", False: "no", None: "not finished"}
    rows: list[list[Value]] = [
        [
            *key(cell),
            known.count,
            known.quantity,
            known.mean,
            known.low,
            known.high,
            known.relative_error if math.isfinite(known.relative_error) else None,
            known.wanted,
            verdict[known.met],
        ]
        for cell in data.cells
        if (known := cell.precision) is not None
    ]
    return make_table("Precision of the mean ([stop])", columns, rows)


def _loss_row(data: Aggregate, cell: Cell) -> list[Value]:
    found = cell.estimates
    audit = cell.values["audit_residual"]
    stress = cell.values["pull_off_stress"] / stress_scale(cell.campaign, cell.values["h_max"])
    share = found["small_scale_share"]
    pull_off = found["pull_off_penetration"]
    return [
        *key(cell),
        cell.done,
        cell.failed,
        cell.pending,
        *_five(found["loss_dimensionless"]),
        found["loss_error_dimensionless"].mean,
        _error_of_load_steps(data, cell),
        _error_of_resolution(data, cell),
        papers_loss(cell),
        *_five(found["loss"]),
        _in_works_of_adhesion(found["loss"].mean, cell.work_of_adhesion),
        interval_method(cell.done),
        found["loss_from_drops"].mean,
        found["audit_residual"].mean,
        float(np.sqrt(np.mean(audit**2))) if cell.done else None,
        float(np.max(np.abs(audit))) if cell.done else None,
        _sum(cell.values["races"]),
        found["energy_at_stake_dimensionless"].mean,
        least(cell.least_range),
        least(cell.values["valid_range"]),
        least(cell.values["edge_range"]),
        least(cell.values["touch_range"]),
        largest(cell.values["largest_interior_tension"]),
        found["loss_small_scale"].mean,
        found["loss_small_scale"].sem,
        found["loss_large_scale"].mean,
        found["loss_large_scale"].sem,
        share.mean,
        share.low,
        share.high,
        found["pull_off_stress"].mean,
        found["pull_off_stress"].sem,
        found["pull_off_stress"].low,
        found["pull_off_stress"].high,
        float(stress.mean()) if cell.done else None,
        pull_off.mean,
        pull_off.sem,
        *(found[name].mean for name in ("h_max", "h_rms", "m0", "m2", "m4")),
        paper.m2(cell.hurst) if paper.is_cell_of(cell) else None,
        found["wall_time"].mean,
    ]


def _in_works_of_adhesion(loss: float, work_of_adhesion: float) -> float | None:
    """Return the loss over the work of adhesion; None without adhesion."""
    return loss / work_of_adhesion if work_of_adhesion > 0 else None


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


def _sum(values: Array) -> int | None:
    return int(values.sum()) if values.size and not np.isnan(values).any() else None


def beside_the_paper(data: Aggregate) -> Table:
    """The paper's Table 1, cell by cell; no rows for others than the paper's."""
    columns = (
        *key_columns(data),
        TableColumn("n", "n"),
        TableColumn("loss_dimensionless", "W~", number()),
        TableColumn("ci_low", "95 % from", number()),
        TableColumn("ci_high", "to", number()),
        TableColumn("paper", "paper", fixed(2)),
        TableColumn("deviation", "W~ off the paper by", signed_percent),
        TableColumn("inside", "paper in the interval"),
    )
    rows: list[list[Value]] = []
    for cell in data.cells:
        value = papers_loss(cell)
        place = (cell.hurst, cell.work_of_adhesion)
        if not (cell.done and paper.is_cell_of(cell) and paper.has_cell(*place)):
            continue
        loss = cell.estimates["loss_dimensionless"]
        known = value is not None and not np.isnan(loss.low)
        rows.append(
            [
                *key(cell),
                cell.done,
                loss.mean,
                loss.low,
                loss.high,
                value,
                loss.mean / value - 1 if value is not None else None,
                ("yes" if loss.low <= (value or 0) <= loss.high else "no") if known else None,
            ]
        )
    return make_table("Beside the paper's Table 1", columns, rows)


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


def _five(estimate: Estimate) -> list[float]:
    return [estimate.mean, estimate.std, estimate.sem, estimate.low, estimate.high]


def paired(data: Aggregate) -> Table:
    """Tabulate the growth of the loss from one γ to the next on the same profiles."""
    columns = (
        TableColumn("hurst", "H"),
        *axis_columns(data.further),
        TableColumn("work_of_adhesion_from [J/m^2]", "γ from"),
        TableColumn("work_of_adhesion_to [J/m^2]", "to (J/m²)"),
        TableColumn("pairs", "pairs"),
        TableColumn("loss_dimensionless_difference", "W~ grows by", number()),
        TableColumn("loss_dimensionless_difference_sem", "s.e.", number(2)),
        TableColumn("loss_dimensionless_difference_ci_low", "95 % from", number()),
        TableColumn("loss_dimensionless_difference_ci_high", "to", number()),
        TableColumn("loss_difference [J/m^2]", "loss by (mJ/m²)", number(unit=1e-3)),
        TableColumn("loss_difference_sem [J/m^2]"),
        TableColumn("loss_difference_ci_low [J/m^2]"),
        TableColumn("loss_difference_ci_high [J/m^2]"),
    )
    rows = [
        [
            pair.hurst,
            *(value for _, value in pair.others),
            pair.lower,
            pair.upper,
            pair.loss.n,
            *_without_std(pair.loss_dimensionless),
            *_without_std(pair.loss),
        ]
        for pair in data.paired
    ]
    return make_table("Growth of the loss with γ, profile by profile", columns, rows)


def _without_std(estimate: Estimate) -> list[float]:
    return [estimate.mean, estimate.sem, estimate.low, estimate.high]


def profiles(data: Aggregate) -> Table:
    """Statistics of the profiles of each H (and further key of the profile), the paper's slope."""
    further = [k for k, axis in enumerate(data.further) if axis.table == "profile"]
    columns = (
        TableColumn("hurst", "H"),
        *axis_columns(data.further[k] for k in further),
        TableColumn("h_rms [m]", "h_rms (µm)", number(unit=1e-6)),
        TableColumn("h_max [m]", "mean h_max (µm)", number(unit=1e-6)),
        TableColumn("m0 [m^2]", "m0 (µm²)", number(unit=1e-12)),
        TableColumn("m2", "m2", number()),
        TableColumn("m2_paper", "m2, paper", number(2), only_if_any=True),
        TableColumn("m4 [1/m^2]", "m4 (1/µm²)", number(unit=1e12)),
    )
    rows: list[list[Value]] = []
    kinds: dict[tuple[float, ...], list[Cell]] = {}
    for cell in data.cells:
        at = (cell.hurst, *(cell.others[k][1] for k in further))
        kinds.setdefault(at, []).append(cell)
    for at, alike in kinds.items():
        cell = max(alike, key=lambda c: c.done)
        mean = {k: cell.estimates[k].mean for k in ("h_rms", "h_max", "m0", "m2", "m4")}
        rows.append(
            [
                *at,
                *(mean[name] for name in ("h_rms", "h_max", "m0", "m2")),
                paper.m2(cell.hurst) if paper.is_cell_of(cell) else None,
                mean["m4"],
            ]
        )
    return make_table("Profiles", columns, rows)


def companions(data: Aggregate) -> Table:
    """Losses of the campaigns beside this one, over the realisations that both have."""
    columns = (
        TableColumn("file", "campaign"),
        TableColumn("differs", "where it differs"),
        *key_columns(data),
        TableColumn("pairs", "pairs"),
        TableColumn("loss_dimensionless_here", "W~ here", number()),
        TableColumn("loss_dimensionless_there", "there", number()),
        TableColumn("difference", "difference", number(3)),
        TableColumn("difference_sem", "s.e.", number(2)),
        TableColumn("difference_ci_low", "95 % from", number(3)),
        TableColumn("difference_ci_high", "to", number(3)),
        TableColumn("loss_dimensionless_paper", "paper", fixed(2), only_if_any=True),
    )
    rows: list[list[Value]] = []
    for companion in data.companions:
        for cell in data.cells:
            other = companion.like(cell)
            pair = difference(cell, other) if other is not None else None
            if pair is None:
                continue
            rows.append(
                [
                    companion.path.name,
                    "; ".join(companion.differs) or "nothing",
                    *key(cell),
                    pair.here.n,
                    pair.here.mean,
                    pair.there.mean,
                    *_without_std(pair.difference),
                    papers_loss(cell) if other is not None and paper.is_cell_of(other) else None,
                ]
            )
    return make_table("Beside other campaigns", columns, rows)
