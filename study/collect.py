"""Results files of the study's campaigns, reduced to two small tables."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DONE, FAILED, axis_datasets
from adhesis.solver.model.jump import BRANCHES, JUMP_KINDS
from study.data import Array

AXES = ("max_penetration", "max_stress", "ratio", "stiffness")
NUMBERS = (
    *("h_max", "h_rms", "m2", "loss", "loss_dimensionless", "loss_error", "audit_residual"),
    *("loss_small_scale", "loss_large_scale", "work_gained", "work_spent"),
    *("largest_contact_fraction", "pull_off_stress", "pull_off_penetration"),
    *("energy_at_stake", "cpu_time"),
)
COLUMNS = (
    *("campaign", "hurst", "work_of_adhesion", "realisation", *AXES, "status", *NUMBERS),
    *("jump_count", "stress_at_turn", "contact_at_turn", "loss_curve", "loss_curve_above"),
    *("patches_at_turn", "loss_in_contact"),
)
JUMP_COLUMNS = ("hurst", "realisation", "branch", "kind", "energy_drop", "area")
# Of the jumps only those of one campaign, γ and turning point are kept.
JUMPS_OF = ("turns", 0.04, 0.9)
# Campaigns whose loops are compared one by one. Of all others, realisations that some cells lack
# are left out: the loops that take long would be missing.
ONE_BY_ONE = ("amplitude_same",)
# The campaigns whose stored curves reach detachment.
WHOLE_CURVES = ("curves", "curves001")


def collect_all(folder: Path, study: Path) -> None:
    """Write data/loops.csv and data/jumps.csv from the results files ``NAME.h5`` of the campaigns.

    A campaign without a results file keeps its rows.
    """
    kept = _rows_by_campaign(study / "data" / "loops.csv")
    loops: list[list[str]] = []
    jumps: list[list[str]] | None = None
    for campaign in sorted((study / "campaigns").glob("*.toml")):
        path = folder / f"{campaign.stem}.h5"
        if not path.exists():
            rows = kept.get(campaign.stem, [])
            print(f"{path} does not exist: {len(rows)} rows of {campaign.stem} are kept")
            loops += rows
            continue
        with Results(path) as results:
            loops += _loops(campaign.stem, results)
            if campaign.stem == JUMPS_OF[0]:
                jumps = _jumps(results)
    _write(study / "data" / "loops.csv", COLUMNS, loops)
    if jumps is not None:
        _write(study / "data" / "jumps.csv", JUMP_COLUMNS, jumps)


def _rows_by_campaign(path: Path) -> dict[str, list[list[str]]]:
    """Rows of an earlier table by campaign; columns that it lacks are empty."""
    rows: dict[str, list[list[str]]] = {}
    if path.exists():
        with path.open(encoding="utf-8") as stream:
            for row in csv.DictReader(stream):
                rows.setdefault(row["campaign"], []).append([row.get(n, "") for n in COLUMNS])
    return rows


def _loops(name: str, results: Results) -> list[list[str]]:
    status = results.status()
    column = {n: results.column(n) for n in (*NUMBERS, "jump_count", "hurst", "realisation")}
    column["work_of_adhesion"] = results.column("work_of_adhesion")
    for dataset in axis_datasets(results.campaign):
        column[dataset.name] = results.column(dataset.name)
    tasks = results.tasks
    curves = {
        key: results.column(key)
        for branch in BRANCHES
        for key in (f"{branch}_mean_stress", f"{branch}_contact_fraction", f"{branch}_patches")
    }
    rows = []
    chosen = _chosen(results, name)
    for row in chosen:
        here = results.campaign.at(tasks[row])
        asked = {
            "max_penetration": here.cycle.max_penetration,
            "max_stress": here.cycle.max_stress,
            "ratio": here.profile.ratio,
            "stiffness": here.cycle.stiffness,
        }
        values: list[Any] = [name]
        values += [column[n][row] for n in ("hurst", "work_of_adhesion", "realisation")]
        values += [asked[n] for n in AXES]
        if status[row] == FAILED:
            values += ["failed", *[None] * (len(COLUMNS) - len(values) - 1)]
        else:
            values += ["done", *(column[n][row] for n in (*NUMBERS, "jump_count"))]
            values += _turn(
                results, tasks[row], {k: v[row] for k, v in curves.items()}, column, row
            )
        rows.append([_text(value) for value in values])
    if name in WHOLE_CURVES:
        found = _losses_in_contact(results, column, curves, chosen)
        for line, row in zip(rows, chosen, strict=True):
            line[COLUMNS.index("loss_in_contact")] = _text(found.get(row))
    return rows


def _chosen(results: Results, name: str) -> list[int]:
    """Rows that are kept: done or failed, of realisations that no cell lacks."""
    status = results.status()
    ended = (status == DONE) | (status == FAILED)
    if name not in ONE_BY_ONE:
        realisation = results.column("realisation")
        ended &= ~np.isin(realisation, realisation[~ended])
    return np.flatnonzero(ended).tolist()


def _losses_in_contact(
    results: Results, column: dict[str, Any], curves: dict[str, Any], chosen: list[int]
) -> dict[int, float]:
    """W~ without detached realisations, by row, of the chosen loops that are done."""
    status, tasks = results.status(), results.tasks
    cells: dict[tuple[float, ...], list[int]] = {}
    for row in chosen:
        if status[row] == DONE:
            cells.setdefault(tasks[row].cell, []).append(row)
    found: dict[int, float] = {}
    for rows in cells.values():
        here = results.campaign.at(tasks[rows[0]])
        axes = results.campaign.curve_axes(tasks[rows[0]])
        modulus = here.material.young / (1 - here.material.poisson**2)
        scale = 0.5 * modulus * (2 * np.pi / here.profile.period) * column["h_max"][rows]
        values = without_detached(
            axes["loading"],
            curves["loading_mean_stress"][rows] / scale[:, None],
            axes["unloading"],
            curves["unloading_mean_stress"][rows] / scale[:, None],
            curves["unloading_contact_fraction"][rows] > 0,
        )
        found.update(zip(rows, values.tolist(), strict=True))
    return found


def without_detached(
    down: Array, load: Array, up: Array, unload: Array, in_contact: NDArray[np.bool_]
) -> Array:
    """W~ of curves averaged over the realisations in contact, with its spread by the jackknife.

    Parameters
    ----------
    down, up : array, shape (places,)
        Δ~ of the loading branch, ascending, and of the unloading branch, descending.
    load, unload : array, shape (realisations, places)
        σ~.
    in_contact : bool array, shape (realisations, places)
        Of the unloading branch.

    Returns
    -------
    array, shape (realisations,)
        Their mean is W~ of the averaged curves; their covariance over realisations is that of the
        jackknife, times the number of realisations.
    """
    if in_contact[:, -1].any():
        raise ValueError("a stored curve ends before its realisation has detached")

    def averaged(kept: NDArray[np.bool_]) -> float:
        there = in_contact & kept[:, None]
        mean = (unload * there).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
        return float(np.trapezoid(load[kept].mean(axis=0), down) + np.trapezoid(mean, up))

    count = len(load)
    whole = averaged(np.ones(count, bool))
    left = np.array([averaged(np.arange(count) != k) for k in range(count)])
    return np.asarray(whole + (count - 1) * (left.mean() - left))


def _turn(
    results: Results, task: Any, curve: dict[str, Any], column: dict[str, Any], row: int
) -> list[Any]:
    """State at the turning point, and W~ by the stored curves: of the loop, and where Δ ≥ 0.

    Then the number of patches at the turning point, and a place for the loss without detached
    realisations.
    """
    campaign = results.campaign
    if campaign.at(task).cycle.under_load:
        return [campaign.at(task).cycle.max_stress, None, None, None, None, None]
    axes = campaign.curve_axes(task)
    down = axes["unloading"]
    load, unload = curve["loading_mean_stress"], curve["unloading_mean_stress"]
    h_max = column["h_max"][row]
    here = campaign.at(task)
    modulus = here.material.young / (1 - here.material.poisson**2)
    scale = 0.5 * modulus * (2 * np.pi / here.profile.period) * h_max  # σ~ = p̄/scale
    gained = np.trapezoid(load, axes["loading"]) / scale
    whole = gained - np.trapezoid(unload[::-1], down[::-1]) / scale
    # down to Δ = 0, where the axis need not have a place
    last = int(np.argmax(down <= 0))
    x = np.append(0.0, down[:last][::-1])
    y = np.append(np.interp(0.0, down[::-1], unload[::-1]), unload[:last][::-1])
    above = gained - np.trapezoid(y, x) / scale
    contact, patches = curve["loading_contact_fraction"][-1], curve["loading_patches"][-1]
    return [load[-1], contact, whole, above, patches, None]


def _jumps(results: Results) -> list[list[str]]:
    _, gamma, turn = JUMPS_OF
    chosen = np.flatnonzero(
        (results.status() == DONE)
        & (results.column("work_of_adhesion") == gamma)
        & (results.column("max_penetration") == turn)
    )
    names = ("branch", "kind", "energy_drop", "contact_before", "contact_after")
    column = {n: results.column(f"jump_{n}") for n in names}
    hurst, realisation = results.column("hurst"), results.column("realisation")
    rows = []
    for row in chosen.tolist():
        for k in np.flatnonzero(column["kind"][row] >= 0).tolist():
            area = column["contact_after"][row, k] - column["contact_before"][row, k]
            values = [
                *(hurst[row], realisation[row], BRANCHES[column["branch"][row, k]]),
                JUMP_KINDS[column["kind"][row, k]],
                *(column["energy_drop"][row, k], area),
            ]
            rows.append([_text(value) for value in values])
    return rows


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    return f"{float(value):.6g}"


def _write(path: Path, columns: tuple[str, ...], rows: list[list[str]]) -> None:
    lines = [",".join(columns), *(",".join(row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{path}: {len(rows)} rows, {path.stat().st_size / 1e3:.0f} kB")
