"""The tables of losses and profiles, from an aggregate."""

from __future__ import annotations

import numpy as np

from ensemble.aggregate.average import Aggregate
from ensemble.aggregate.cells import Cell, stress_scale
from ensemble.aggregate.companions import difference
from ensemble.aggregate.statistics import Estimate, interval_method
from ensemble.report import paper
from ensemble.report.tables.table import (
    KEY,
    Column,
    Table,
    Value,
    fixed,
    make_table,
    number,
    percent,
)


def losses(data: Aggregate) -> Table:
    """One row for each (H, γ), everything that ``losses.csv`` holds."""
    columns = (
        *KEY,
        Column("n", "n"),
        Column("failed", "failed"),
        Column("pending", "pending"),
        Column("loss_dimensionless_mean", "W~", number()),
        Column("loss_dimensionless_std"),
        Column("loss_dimensionless_sem", "s.e.", number(2)),
        Column("loss_dimensionless_ci_low", "95 % from", number()),
        Column("loss_dimensionless_ci_high", "to", number()),
        Column("loss_dimensionless_error_load_steps", "± steps", number(1)),
        Column("loss_dimensionless_error_resolution", "± grid", number(1)),
        Column("loss_dimensionless_paper", "paper", fixed(2)),
        Column("loss_mean [J/m^2]", "loss (J/m²)", number()),
        Column("loss_std [J/m^2]"),
        Column("loss_sem [J/m^2]"),
        Column("loss_ci_low [J/m^2]"),
        Column("loss_ci_high [J/m^2]"),
        Column("interval"),
        Column("loss_from_drops_mean [J/m^2]"),
        Column("audit_residual_mean"),
        Column("audit_residual_rms"),
        Column("audit_residual_largest", "audit", percent),
        Column("loss_small_scale_mean [J/m^2]"),
        Column("loss_small_scale_sem [J/m^2]"),
        Column("loss_large_scale_mean [J/m^2]"),
        Column("loss_large_scale_sem [J/m^2]"),
        Column("small_scale_share_mean"),
        Column("small_scale_share_ci_low"),
        Column("small_scale_share_ci_high"),
        Column("pull_off_stress_mean [Pa]"),
        Column("pull_off_stress_sem [Pa]"),
        Column("pull_off_stress_ci_low [Pa]"),
        Column("pull_off_stress_ci_high [Pa]"),
        Column("pull_off_stress_dimensionless_mean"),
        Column("pull_off_penetration_mean"),
        Column("pull_off_penetration_sem"),
        Column("h_max_mean [m]"),
        Column("h_rms_mean [m]"),
        Column("m0_mean [m^2]"),
        Column("m2_mean"),
        Column("m4_mean [1/m^2]"),
        Column("m2_paper"),
        Column("wall_time_mean [s]"),
    )
    rows = [_loss_row(data, cell) for cell in data.cells]
    return make_table("Loss of one loop (Table 1)", columns, rows)


def _loss_row(data: Aggregate, cell: Cell) -> list[Value]:
    found = cell.estimates
    audit = cell.values["audit_residual"]
    stress = cell.values["pull_off_stress"] / stress_scale(data.campaign, cell.values["h_max"])
    share = found["small_scale_share"]
    pull_off = found["pull_off_penetration"]
    return [
        cell.hurst,
        cell.work_of_adhesion,
        cell.done,
        cell.failed,
        cell.pending,
        *_five(found["loss_dimensionless"]),
        _error_of_load_steps(data, cell),
        _error_of_resolution(data, cell),
        paper.table_1(cell.hurst, cell.work_of_adhesion),
        *_five(found["loss"]),
        interval_method(cell.done),
        found["loss_from_drops"].mean,
        found["audit_residual"].mean,
        float(np.sqrt(np.mean(audit**2))) if cell.done else None,
        float(np.max(np.abs(audit))) if cell.done else None,
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
        paper.m2(cell.hurst),
        found["wall_time"].mean,
    ]


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
        and (other := companion.cell(cell.hurst, cell.work_of_adhesion)) is not None
        and (pair := difference(cell, other)) is not None
    ]
    return max(found, default=None)


def _five(estimate: Estimate) -> list[float]:
    return [estimate.mean, estimate.std, estimate.sem, estimate.low, estimate.high]


def paired(data: Aggregate) -> Table:
    """How the loss grows from one γ to the next on the same profiles."""
    columns = (
        Column("hurst", "H"),
        Column("work_of_adhesion_from [J/m^2]", "γ from"),
        Column("work_of_adhesion_to [J/m^2]", "to (J/m²)"),
        Column("pairs", "pairs"),
        Column("loss_dimensionless_difference", "W~ grows by", number()),
        Column("loss_dimensionless_difference_sem", "s.e.", number(2)),
        Column("loss_dimensionless_difference_ci_low", "95 % from", number()),
        Column("loss_dimensionless_difference_ci_high", "to", number()),
        Column("loss_difference [J/m^2]", "loss by (J/m²)", number()),
        Column("loss_difference_sem [J/m^2]"),
        Column("loss_difference_ci_low [J/m^2]"),
        Column("loss_difference_ci_high [J/m^2]"),
    )
    rows = [
        [
            pair.hurst,
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
    """Statistics of the profiles of each H, and the slope that the paper quotes."""
    columns = (
        Column("hurst", "H"),
        Column("h_rms [m]", "h_rms (m)", number()),
        Column("h_max [m]", "mean h_max (m)", number()),
        Column("m0 [m^2]", "m0 (m²)", number()),
        Column("m2", "m2", number()),
        Column("m2_paper", "m2, paper", number(2)),
        Column("m4 [1/m^2]", "m4 (1/m²)", number()),
    )
    rows: list[list[Value]] = []
    for hurst in data.hursts:
        cell = max((c for c in data.cells if c.hurst == hurst), key=lambda c: c.done)
        mean = {k: cell.estimates[k].mean for k in ("h_rms", "h_max", "m0", "m2", "m4")}
        rows.append(
            [
                hurst,
                *(mean[name] for name in ("h_rms", "h_max", "m0", "m2")),
                paper.m2(hurst),
                mean["m4"],
            ]
        )
    return make_table("Profiles", columns, rows)


def companions(data: Aggregate) -> Table:
    """Losses of the campaigns beside this one, over the realisations that both have."""
    columns = (
        Column("file", "campaign"),
        Column("differs", "where it differs"),
        *KEY,
        Column("pairs", "pairs"),
        Column("loss_dimensionless_here", "W~ here", number()),
        Column("loss_dimensionless_there", "there", number()),
        Column("difference", "difference", number(3)),
        Column("difference_sem", "s.e.", number(2)),
        Column("difference_ci_low", "95 % from", number(3)),
        Column("difference_ci_high", "to", number(3)),
        Column("loss_dimensionless_paper", "paper", fixed(2)),
    )
    rows: list[list[Value]] = []
    for companion in data.companions:
        for cell in data.cells:
            other = companion.cell(cell.hurst, cell.work_of_adhesion)
            pair = difference(cell, other) if other is not None else None
            if pair is None:
                continue
            rows.append(
                [
                    companion.path.name,
                    "; ".join(companion.differs) or "nothing",
                    cell.hurst,
                    cell.work_of_adhesion,
                    pair.here.n,
                    pair.here.mean,
                    pair.there.mean,
                    *_without_std(pair.difference),
                    paper.table_1(cell.hurst, cell.work_of_adhesion),
                ]
            )
    return make_table("Beside other campaigns", columns, rows)
