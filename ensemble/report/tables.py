"""The tables of the report, from an aggregate."""

from __future__ import annotations

import numpy as np

from ensemble.aggregate import Aggregate, Cell, stress_scale
from ensemble.aggregate_curves import BRANCHES
from ensemble.aggregate_fields import fitted_slope
from ensemble.report import paper
from ensemble.report.table import Column, Table, Value, fixed, make_table, number, plain
from ensemble.statistics import Estimate, interval_method

_KEY = (
    Column("hurst", "H"),
    Column("work_of_adhesion [J/m^2]", "γ (J/m²)"),
)


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %"


def losses(data: Aggregate) -> Table:
    """One row for each (H, γ), everything that ``losses.csv`` holds."""
    columns = (
        *_KEY,
        Column("n", "n"),
        Column("failed", "failed"),
        Column("pending", "pending"),
        Column("loss_dimensionless_mean", "W~", number()),
        Column("loss_dimensionless_std"),
        Column("loss_dimensionless_sem", "s.e.", number(2)),
        Column("loss_dimensionless_ci_low", "95 % from", number()),
        Column("loss_dimensionless_ci_high", "to", number()),
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
        Column("audit_residual_largest", "audit", _percent),
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


def jumps(data: Aggregate) -> Table:
    """Jumps of one loop by kind: how many, and their share of all drops, over all γ of one H."""
    found = data.jumps
    columns = (
        *_KEY,
        Column("kind", "kind"),
        Column("scale", "scale"),
        Column("jumps_per_loop", "jumps a loop", number(3)),
        Column("energy_per_loop [J/m^2]", "drops a loop (J/m²)", number(3)),
        Column("share_of_drops", "share", _percent),
    )
    rows: list[list[Value]] = []
    for k, cell in enumerate(data.cells):
        total = float(found.energy[k].sum())
        for j, kind in enumerate(found.kinds):
            if not found.number[k, j]:
                continue
            rows.append(
                [
                    cell.hurst,
                    cell.work_of_adhesion,
                    kind,
                    "small" if found.small_scale[j] else "large",
                    float(found.number[k, j] / cell.done),
                    float(found.energy[k, j] / cell.done),
                    float(found.energy[k, j] / total) if total else None,
                ]
            )
    return make_table("Jumps by kind", columns, rows)


def mechanisms(data: Aggregate) -> Table:
    """Loss by mechanism and pull-off, one row for each (H, γ)."""
    columns = (
        *_KEY,
        Column("small_scale_share", "small-scale share", _percent),
        Column("small_scale_share_ci_low", "95 % from", _percent),
        Column("small_scale_share_ci_high", "to", _percent),
        Column("jumps_per_loop", "jumps a loop", number(3)),
        Column("pull_off_stress [Pa]", "pull-off (Pa)", number(3)),
        Column("pull_off_stress_sem [Pa]", "s.e.", number(2)),
        Column("pull_off_penetration", "at Δ/h_max", number(3)),
        Column("wall_time [s]", "s a loop", plain),
    )
    rows: list[list[Value]] = []
    for cell in data.cells:
        share, pull_off = cell.estimates["small_scale_share"], cell.estimates["pull_off_stress"]
        rows.append(
            [
                cell.hurst,
                cell.work_of_adhesion,
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


def slopes(data: Aggregate) -> Table:
    """Exponent of the deformed surface's spectrum at small wave numbers, state by state."""
    columns = (
        *_KEY,
        Column("branch", "branch"),
        Column("penetration", "Δ/h_max", fixed(2)),
        Column("realisations", "n"),
        Column("slope", "slope", fixed(2)),
        Column("slope_sem", "s.e.", number(1)),
        Column("slope_persson", "-(2+H)", fixed(2)),
        Column("slope_profile", "-(2H+1)", fixed(2)),
    )
    fields = data.fields
    rows: list[list[Value]] = []
    for index, cell in enumerate(data.cells):
        for b, branch in enumerate(BRANCHES):
            for k, penetration in enumerate(fields.penetration.tolist()):
                if not fields.in_contact[index, b, k]:
                    continue
                density = fields.psd_displacement[index, b, k]
                slope, error = fitted_slope(data.campaign, fields.wave_number, density)
                rows.append(
                    [
                        cell.hurst,
                        cell.work_of_adhesion,
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
