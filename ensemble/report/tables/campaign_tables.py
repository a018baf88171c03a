"""The tables of a campaign's report, from an aggregate, and the columns that they share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from adhesis.ensemble.aggregate.average import SMALL, Aggregate, AveragedCell, fitted_slope
from adhesis.ensemble.aggregate.cells import Cell, alike, difference
from adhesis.ensemble.campaign.precision import FEWEST_FOR_SKEWNESS, interval_method
from adhesis.ensemble.campaign.tables import Axis
from adhesis.ensemble.escape import printable
from adhesis.ensemble.quantities import UNITS, common_unit, percent, rounded_percent
from adhesis.ensemble.report import paper
from adhesis.ensemble.report.further_axes import state_sign
from adhesis.ensemble.report.tables.table import (
    Format,
    Table,
    TableColumn,
    fixed,
    make_table,
    number,
)
from adhesis.solver.loading.zero_range import ANY_RANGE, RANGES
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.jump import JUMP_KINDS
from adhesis.solver.model.profile import Array
from adhesis.solver.values import finite

_SIGNS = {"hurst": "H", "work_of_adhesion": "γ"}


def axis_column(axis: Axis, cell: str = "", suffix: str = "", heading: str = "") -> TableColumn:
    """Return the column of an axis, for people in the unit of the campaign.

    Of two cells of a row, ``cell`` is the path ("upper."), ``suffix`` and ``heading`` tell them
    apart.
    """
    shown, size = common_unit(axis.name, axis.values)
    unit = UNITS.get(axis.name, "").replace("²", "^2")
    name, heading = f"{axis.name}{suffix}", heading or _SIGNS.get(axis.name, axis.name)
    return TableColumn(
        f"{name} [{unit}]" if unit else name,
        f"{cell}at.{axis.name}",
        f"{heading} ({shown})" if shown else heading,
        lambda value: f"{value / size:g}",
    )


_HEADINGS = {"std": "", "sem": "s.e.", "ci_low": "95 % from", "ci_high": "to"}


def estimated(
    name: str,
    parts: str = "mean",
    heading: str = "",
    show: Format | None = None,
    *,
    of: str = "",
    unit: str = "",
    size: float = 1.0,
    least: bool = False,
    **options: Any,
) -> list[TableColumn]:
    """Return columns of an estimate: "mean sem ci_low", or "value", a mean by the name alone.

    Without a ``heading`` they are for programs. People see multiples of ``size``; with ``least`` no
    end of an interval below 0. ``of`` is the path to the estimate, by default that of the same name
    of a cell. ``options`` are those of the columns.
    """
    formats = {"sem": number(2, unit=size)}
    if least:
        formats["ci_low"] = lambda value: number(unit=size)(value) if value > 0 else "0"
    columns = []
    for part in parts.split():
        attribute = "mean" if part == "value" else part.removeprefix("ci_")
        columns.append(
            TableColumn(
                f"{name}{'' if part == 'value' else f'_{part}'}{unit}",
                f"{of or f'estimates.{name}'}.{attribute}",
                heading and _HEADINGS.get(part, heading),
                formats.get(part, show or number(unit=size)),
                **options,
            )
        )
        options = {**options, "note": ""}
    return columns


_ALL, _DIFFERENCE = "mean std sem ci_low ci_high", "value sem ci_low ci_high"
_MILLI: Any = {"unit": " [J/m^2]", "size": 1e-3}
_FROM_ZERO = ("loss_dimensionless", "loss")  # of which no end of an interval below 0 is shown


def losses(data: Aggregate) -> Table:
    """One row for each cell, everything that ``losses.csv`` holds."""
    cycle, material = data.campaign.cycle, data.campaign.material
    least = f"the least of {ANY_RANGE} of all loops"
    columns = [
        *map(axis_column, data.campaign.axes),
        TableColumn("n", "done", "n"),
        TableColumn("failed", "failed", "failed", only_if_any=True),
        TableColumn("pending", "pending", "pending", only_if_any=True),
    ]
    if cycle.preload is not None:
        columns.append(
            TableColumn(
                *("short_of_preload", "short_of_preload", "short"),
                only_if_any=True,
                note="short: loops that turned before their preload was reached",
            )
        )
    columns += [
        *estimated("loss_dimensionless", _ALL, "W~", least=True, last=True, note=_note(data)),
        TableColumn(
            "loss_dimensionless_error_numerical",
            "estimates.loss_error_dimensionless.mean",
            *("± loop", number(1)),
            only_if_any=True,
            last=True,
            note="± loop: mean of the estimated numerical error of a loop",
        ),
        TableColumn(
            "loss_dimensionless_error_load_steps",
            partial(_error_of_load_steps, data),
            *("± steps", number(1)),
            last=True,
            note=_note_on_load_steps(data),
        ),
        TableColumn(
            "loss_dimensionless_error_resolution",
            partial(_deviation, "resolution", data),
            *("± method", number(1)),
            only_if_any=True,
            last=True,
            note="± method: the difference from the campaign with another accuracy or method "
            "beside it",
        ),
        TableColumn(
            *("loss_dimensionless_paper", paper.table_1, "paper", fixed(2)),
            only_if_any=True,
            last=True,
            note=f"paper: {paper.REFERENCE}, Table 1, – where it gives none",
        ),
        *estimated("loss", _ALL, "loss (mJ/m²)", **_MILLI, least=True),
    ]
    if material.work_of_adhesion_open is not None:
        parts = "friction and instability: parts of the loss, in mJ/m²"
        columns += estimated("friction", "mean", "friction", **_MILLI, note=parts)
        columns += estimated("instability", "mean", "instability", **_MILLI)
    if material.opens:
        zones = "± zones: mean change of the loss by cohesive zones at edges, in mJ/m²"
        columns += estimated("zone_error", "mean", "± zones", number(1, 1e-3), **_MILLI, note=zones)
    columns += [
        TableColumn(
            "loss_over_work_of_adhesion",
            lambda cell: (
                cell.estimates["loss"].mean / cell.work_of_adhesion
                if cell.work_of_adhesion
                else None
            ),
            *("W/γ", number(3)),
            only_if_any=True,
            note="W/γ: loss over work of adhesion",
        ),
        TableColumn("interval", lambda cell: interval_method(cell.done)),
        *estimated("loss_from_drops", **_MILLI),
        *estimated("audit_residual"),
        TableColumn(
            "audit_residual_rms",
            _of_loops("audit_residual", lambda audit: np.sqrt(np.mean(audit**2))),
        ),
        TableColumn(
            "audit_residual_largest",
            _of_loops("audit_residual", lambda audit: np.max(np.abs(audit))),
            *("audit", percent),
            note="audit: largest |loop integral - sum of drops| / loss",
        ),
        TableColumn(
            "races",
            lambda cell: int(cell.values["races"].sum()) if cell.done else None,
            "races",
            only_if_any=True,
            note="races: jumps that other speeds, order or a finer field might end elsewhere",
        ),
        *estimated("energy_at_stake_dimensionless"),
        TableColumn(
            "range_least [m]",
            lambda cell: extreme(np.min, cell.least_range) if cell.work_of_adhesion else None,
            *("range (nm)", number(unit=1e-9)),
            only_if_any=True,
            note=f"range: {least}, to be set beside the range of adhesion that is given"
            if material.opens
            else f"range: range of adhesion below which the zero-range limit holds ({least})",
        ),
        *(TableColumn(f"{name}_least [m]", _of_loops(name, np.min)) for name in RANGES),
        TableColumn("largest_interior_tension [Pa]", _of_loops("largest_interior_tension", np.max)),
        *estimated("loss_small_scale", "mean sem", **_MILLI),
        *estimated("loss_large_scale", "mean sem", **_MILLI),
        *estimated("small_scale_share", "mean ci_low ci_high"),
        *estimated("pull_off_stress", "mean sem ci_low ci_high", unit=" [Pa]"),
        *estimated("pull_off_stress_dimensionless"),
        *estimated("pull_off_penetration", "mean sem"),
        *estimated("h_max", unit=" [m]"),
        *estimated("h_rms", unit=" [m]"),
        *estimated("m0", unit=" [m^2]"),
        *estimated("m2"),
        *estimated("m4", unit=" [1/m^2]"),
        TableColumn("m2_paper", _papers_m2),
        *estimated("wall_time", unit=" [s]"),
    ]
    return make_table("Loss of one loop", columns, data.cells)


def _note(data: Aggregate) -> str:
    """Return what W~ and its errors are, and the method of the interval."""
    student = "by Student's t"
    both = f"{student} and Hall's transformation of it, the further end on each side"
    methods = {interval_method(cell.done) for cell in data.cells} - {"none"}
    interval = f"; 95 % interval of the mean {both if 'transformed' in methods else student}"
    if len(methods) > 1:
        interval += f", for fewer than {FEWEST_FOR_SKEWNESS} realisations {student}"
    if any(cell.estimates[name].low < 0 for cell in data.cells for name in _FROM_ZERO):
        interval += ", an end below 0 shown as 0"
    weight = "; under a weight: closed at the separation of its fall"
    return (
        "W~ = ∮ σ~ dΔ~ with σ~ = 2p̄/(E* q0 h_max) and Δ~ = Δ/h_max, each realisation with its own "
        f"h_max; s.e.: standard error of the mean{interval if methods else ''}"
        f"{weight if data.campaign.cycle.under_load else ''}"
    )


def _note_on_load_steps(data: Aggregate) -> str:
    """Return what the error of the load steps of each cell is; see :func:`_error_of_load_steps`."""
    audit = "mean |loop integral - sum of drops|"
    found = {_deviation("load steps", data, cell) is not None for cell in data.cells if cell.done}
    if found == {False}:
        return f"± steps: {audit}"
    elsewhere = f", {audit} where that lacks a cell" if False in found else ""
    return (
        "± steps: the difference from the campaign with other load steps beside this "
        f"one{elsewhere}"
    )


def extreme(choose: Callable[[Array], Any], values: Array) -> float | None:
    """Return the least or largest of the known values; None if none is finite."""
    known = values[np.isfinite(values)]
    return float(choose(known)) if known.size else None


def _of_loops(name: str, choose: Callable[[Array], Any]) -> Callable[[Cell], float | None]:
    return lambda cell: extreme(choose, cell.values[name])


def _papers_m2(cell: Cell) -> float | None:
    return paper.m2(cell.hurst) if paper.is_cell_of(cell) else None


def precision(data: Aggregate) -> Table:
    """Tabulate the precision of the quantity of ``[stop]``; no rows without ``[stop]``."""
    verdict = {True: "yes", False: "no", None: "not finished"}
    three_digits = partial(percent, digits=3)
    columns = [
        *map(axis_column, data.campaign.axes),
        TableColumn("n", "precision.estimate.n", "n"),
        TableColumn("quantity", "precision.quantity", "quantity"),
        TableColumn("mean", "precision.estimate.mean", "mean", number()),
        TableColumn("ci_low", "precision.estimate.low", "95 % from", number()),
        TableColumn("ci_high", "precision.estimate.high", "to", number()),
        TableColumn(
            "relative_error",
            lambda cell: finite(cell.precision.estimate.relative_error),
            *("±, further side", three_digits),
        ),
        TableColumn("wanted_relative_error", "precision.wanted", "wanted", three_digits),
        TableColumn("met", lambda cell: verdict[cell.precision.met], "met"),
    ]
    steered = [cell for cell in data.cells if cell.precision is not None]
    return make_table("Precision of the mean ([stop])", columns, steered)


def beside_the_paper(data: Aggregate) -> Table:
    """The paper's Table 1, cell by cell; no rows for others than the paper's."""
    columns = [
        *map(axis_column, data.campaign.axes),
        TableColumn("n", "done", "n"),
        *estimated("loss_dimensionless", "value ci_low ci_high", "W~"),
        TableColumn("paper", paper.table_1, "paper", fixed(2)),
        TableColumn(
            *("deviation", off_the_paper),
            *("W~ off the paper by", partial(rounded_percent, sign="+")),
        ),
        TableColumn("inside", inside_interval, "paper in the interval"),
    ]
    cells = [cell for cell in data.cells if cell.done and paper.has_place(cell)]
    return make_table("Beside the paper's Table 1", columns, cells)


def off_the_paper(cell: Cell) -> float | None:
    """Return the relative deviation of the mean loss from the paper's; None without either."""
    value = paper.table_1(cell) if cell.done else None
    return None if value is None else cell.estimates["loss_dimensionless"].mean / value - 1


def inside_interval(cell: Cell) -> str | None:
    """Whether the paper's value lies in the interval of the mean; None if either is unknown."""
    value, loss = paper.table_1(cell), cell.estimates["loss_dimensionless"]
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
    companions = [companion for companion in data.companions if companion.kind == kind]
    pairs = [difference(cell, companion.like(cell)) for companion in companions]
    return max((abs(pair.difference.mean) for pair in pairs if pair is not None), default=None)


def paired(data: Aggregate) -> Table:
    """Tabulate the growth of the loss from one γ to the next on the same profiles."""
    scaled, loss = "loss_dimensionless.difference", "loss.difference"
    hurst, gamma, *further = data.campaign.axes
    columns = [
        *(axis_column(axis, "lower.") for axis in (hurst, *further)),
        axis_column(gamma, "lower.", "_from", "γ from"),
        axis_column(gamma, "upper.", "_to", "to"),
        TableColumn("pairs", "loss.difference.n", "pairs"),
        *estimated("loss_dimensionless_difference", _DIFFERENCE, "W~ grows by", of=scaled),
        *estimated("loss_difference", "value", "loss by (mJ/m²)", **_MILLI, of=loss),
        *estimated("loss_difference", "sem ci_low ci_high", **_MILLI, of=loss),
    ]
    return make_table("Growth of the loss with γ, profile by profile", columns, data.paired)


def profiles(data: Aggregate) -> Table:
    """Statistics of the profiles of each H (and further key of the profile), the paper's slope."""
    hurst, _, *further = data.campaign.axes
    of_profiles = [hurst, *(axis for axis in further if axis.table == "profile")]
    columns = [
        *map(axis_column, of_profiles),
        *estimated("h_rms", "mean", "mean h_rms (µm)", size=1e-6),
        *estimated("h_max", "mean", "mean h_max (µm)", size=1e-6),
        *estimated("m0", "mean", "m0 (µm²)", size=1e-12),
        *estimated("m2", "mean", "mean m2"),
        TableColumn("m2_paper", _papers_m2, "m2, paper", number(2), only_if_any=True),
        *estimated("m4", "mean", "m4 (1/µm²)", size=1e12),
    ]
    same_profiles = alike(data.cells, {a.name for a in data.campaign.axes if a not in of_profiles})
    best = (max(cells, key=lambda cell: cell.done) for cells in same_profiles.values())
    return make_table("Profiles", columns, best)


def companions(data: Aggregate) -> Table:
    """Losses of the campaigns beside this one, over the realisations that both have."""
    columns = [
        TableColumn("file", lambda row: printable(row["companion"].path.name), "campaign"),
        TableColumn(
            "differs",
            lambda row: "; ".join(row["companion"].differs) or "nothing",
            "where it differs",
        ),
        *map(axis_column, data.campaign.axes),
        TableColumn("pairs", "loss.difference.n", "pairs"),
        TableColumn("loss_dimensionless_here", "loss.here.mean", "W~ here", number()),
        TableColumn("loss_dimensionless_there", "loss.there.mean", "there", number()),
        *estimated("difference", _DIFFERENCE, "difference", number(3), of="loss.difference"),
        TableColumn("loss_dimensionless_paper", "paper", "paper", fixed(2), only_if_any=True),
    ]
    rows = []
    for companion in data.companions:
        for cell in data.cells:
            other = companion.like(cell)
            if other is not None and (loss := difference(cell, other)) is not None:
                value = paper.table_1(cell) if paper.is_cell_of(other) else None
                rows.append({"companion": companion, "at": cell.at, "loss": loss, "paper": value})
    return make_table("Beside other campaigns", columns, rows)


def works(data: Aggregate) -> Table:
    """What approach gains and separation spends: docs/theory.md, section 8."""
    columns = [
        *map(axis_column, data.campaign.axes),
        TableColumn("n", "done", "n"),
        *estimated("work_gained", "mean", "gained on approach (mJ/m²)", **_MILLI),
        *estimated("work_spent", "mean", "spent on separation (mJ/m²)", **_MILLI),
        *estimated("largest_contact_fraction", "mean", "largest A/A0"),
        *estimated("largest_contact_fraction", "ci_low ci_high"),
    ]
    for name, heading in (
        ("effective_work_of_approach", "per contact: approach (mJ/m²)"),
        ("effective_work_of_separation", "separation (mJ/m²)"),
        ("loss_per_contact", "loss (mJ/m²)"),
    ):
        columns += estimated(name, "mean", heading, **_MILLI)
        columns += estimated(name, "ci_low ci_high", **_MILLI)
    columns += estimated("full_contact_energy", "mean", "full contact (mJ/m²)", **_MILLI)
    return make_table("Work of approach and separation", columns, data.cells)


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
        *map(axis_column, data.campaign.axes),
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
    return make_table(title, [*map(axis_column, data.campaign.axes), *columns], data.cells)


def mechanisms(data: Aggregate) -> Table:
    """Loss by mechanism, largest tension and loss of contact, one row for each cell.

    The largest tension of a loop is reached before the last contact is lost, at another
    penetration.
    """
    columns = [
        *map(axis_column, data.campaign.axes),
        *estimated("small_scale_share", "value ci_low ci_high", "small scale a loop", percent),
        *estimated("jump_count", "value", "jumps a loop", number(3)),
        *estimated(
            *("pull_off_stress", "value sem", "largest tension (kPa)", number(3, 1e3)), size=1e3
        ),
        *estimated("pull_off_penetration", "value", "detached by Δ/h_max", number(3)),
        *estimated("wall_time", "value", "s a loop", lambda s: f"{float(f'{s:.3g}'):g}"),
    ]
    return make_table("Mechanisms and pull-off", columns, data.cells)


def slopes(data: Aggregate, branches: Sequence[str] = BRANCHES) -> Table:
    """Exponent of the deformed surface's spectrum at small wave numbers, state by state."""
    columns = [
        *map(axis_column, data.campaign.axes),
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
