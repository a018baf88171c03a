"""Average over realisations, from a results file alone.

A cell is one point on the axes of the campaign: an (H, γ), and a value of each further list.
Scalars of all tasks fit in memory; curves, fields and jumps do not, so they pass through a bounded
block at a time. Only rows whose status is "done" are read: the status byte is written last, so the
averages of a file that a run is still writing are consistent.

A state without contact is not deformed and left out of the averages of fields, so each has its own
number of realisations. The catalogue of jumps (task × jump) has of a task with more jumps than it
holds those with the largest drops; ``truncated`` counts such tasks. The jump at which a weight
falls off is not counted: its drop depends on where the loop is closed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.aggregate.cells import (
    Cell,
    Companion,
    LossDifference,
    alike,
    difference,
    finished_cells,
    read_companion,
    stress_scale,
)
from adhesis.ensemble.campaign.tables import Axis, Campaign
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import FAILED
from adhesis.ensemble.task.dataset import KEPT
from adhesis.ensemble.task.fields import FieldPlan
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.jump import JUMP_KINDS, SMALL_SCALE
from adhesis.solver.model.profile import Array

_MAX_FAILURES = 20
_H_AND_GAMMA = frozenset(("hurst", "work_of_adhesion"))


# Numbers read at once (8 bytes each): large enough for the disk, small enough for any machine.
READ_AT_ONCE = 2_000_000
# Numbers held at once while quantiles are taken (numpy copies them once more).
HELD_AT_ONCE = 8_000_000
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_AVERAGED = ("psd_height", "height_density", "psd_displacement", "gap_density")
_OF_SHAPE = ("field_height", "field_displacement")
BINS_PER_DECADE = 2
# From 1e-16 to 100 J/m²; energy drops beyond are counted in the outermost bin.
BIN_EDGES: Array = np.logspace(-16, 2, 1 + 18 * BINS_PER_DECADE)
SMALL = np.array([kind in SMALL_SCALE for kind in JUMP_KINDS])
"""Whether jumps of a kind only move edges inside existing patches, shape (kinds,)."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity on the penetration axis of one branch, over the realisations of a cell."""

    # mean, std: shape (points,); std has n - 1 in the denominator; NaN for one realisation. A
    # realisation that has detached is counted, as zero.
    mean: Array
    std: Array
    quantiles: Array  # shape (len(QUANTILES), points)


def average_curves(
    results: Results, name: str, rows: NDArray[np.intp], scales: Mapping[str, Array]
) -> dict[str, Curve]:
    """Average a dataset over the rows of a cell; NaN for a cell without rows.

    ``scales`` holds the factor of each row, by curve to make of the dataset.
    """
    points = results.column(name, slice(0, 1)).shape[1]
    shapes = (points, points, (len(QUANTILES), points))
    out = {curve: Curve(*(np.full(shape, np.nan) for shape in shapes)) for curve in scales}
    for columns in _blocks(points, rows.size, HELD_AT_ONCE) if rows.size else ():
        raw = results.column(name, rows, columns).astype(float)
        if name.endswith("patches"):  # -1 beyond the turning point of a load: not known
            raw[raw < 0] = np.nan
        for curve, factors in scales.items():
            values = raw * factors[:, None]
            out[curve].mean[columns] = values.mean(axis=0)
            if rows.size > 1:
                out[curve].std[columns] = values.std(axis=0, ddof=1)
            out[curve].quantiles[:, columns] = np.quantile(
                values, QUANTILES, axis=0, overwrite_input=True
            )
    return out


@dataclass(frozen=True, eq=False)
class FieldStatistics:
    """Averages of one cell; NaN without finished tasks.

    Penetrations, wave numbers, and positions of the nodes of shapes are in the plan of the cell.
    """

    psd_height: Array  # shape (wave numbers,), in m³
    height_density: Array  # shape (height bins,)
    # Shape (2, penetrations, wave numbers), in m³, first axis loading and unloading
    psd_displacement: Array
    gap_density: Array  # shape (2, penetrations, gap bins)
    # Shape (2, penetrations); number of realisations averaged in the last two
    in_contact: NDArray[np.int64]
    # Of the first finished realisation whose fields are stored: rigid profile h in m, shape
    # (nodes,), and deformed surface v in m on loading and unloading, shape (2, penetrations,
    # nodes), NaN where there is no contact
    shape: tuple[Array, Array] | None


def average_fields(
    results: Results, rows: NDArray[np.intp], kept: NDArray[np.intp]
) -> FieldStatistics:
    """Average the rows of a cell; ``kept`` are the rows of the file that keep their fields."""
    averages = {name: _average(results, name, rows) for name in _AVERAGED}
    slots = np.flatnonzero(np.isin(kept, rows))[:1]
    height, surface = (results.column(name, slots).astype(float) for name in _OF_SHAPE)
    return FieldStatistics(
        in_contact=averages["psd_displacement"][1],
        shape=(height[0], surface[0]) if slots.size else None,
        **{name: mean for name, (mean, _) in averages.items()},
    )


def fitted_slope(plan: FieldPlan, density: Array) -> tuple[float, float]:
    """Fit a power law to a spectrum at small wave numbers: exponent and its standard error.

    Least squares in the logarithms over the lowest decade of the profile's spectrum (over its lower
    half if it is shorter than two decades). NaN if fewer than three bins lie there.
    """
    wave_number = plan.wave_number
    profile = plan.campaign.profile
    lowest = profile.n0 * 2 * np.pi / plan.period
    span = min(10.0, float(np.sqrt(profile.ratio)))
    chosen = plan.filled & (wave_number <= lowest * span) & (density > 0)
    if np.sum(chosen) < 3:
        return float("nan"), float("nan")
    x, y = np.log(wave_number[chosen]), np.log(density[chosen])
    x = x - x.mean()
    slope = float(x @ y / (x @ x))
    residual = y - y.mean() - slope * x
    return slope, float(np.sqrt(residual @ residual / max(1, x.size - 2) / (x @ x)))


def _average(
    results: Results, name: str, rows: NDArray[np.intp]
) -> tuple[Array, NDArray[np.int64]]:
    """Average the rows that hold finite numbers; return mean and count.

    The count has the shape of the mean without its last axis.
    """
    shape = results.column(name, slice(0, 1)).shape[1:]
    total, count = np.zeros(shape), np.zeros(shape[:-1], dtype=np.int64)
    for block in _blocks(rows.size, int(np.prod(shape)), READ_AT_ONCE):
        values = results.column(name, rows[block]).astype(float)
        held = np.isfinite(values).all(axis=-1)
        total += np.where(held[..., None], values, 0.0).sum(axis=0)
        count += held.sum(axis=0)
    with np.errstate(invalid="ignore"):
        return total / count[..., None], count


@dataclass(frozen=True, eq=False)
class JumpStatistics:
    """Jumps of all tasks of a cell together, by kind."""

    number: NDArray[np.int64]  # shape (kinds,)
    energy: Array  # shape (kinds,); their drops, J/m² of nominal area
    # Shape (kinds, bins); number of jumps by energy drop, between :data:`BIN_EDGES`
    histogram: NDArray[np.int64]
    truncated: int  # number of tasks that made more jumps than the catalogue holds


def count_jumps(results: Results, rows: NDArray[np.intp]) -> JumpStatistics:
    """Count the jumps of the rows of a cell."""
    slots, bins = results.campaign.output.jumps, BIN_EDGES.size - 1
    number, energy = np.zeros(len(JUMP_KINDS), dtype=np.int64), np.zeros(len(JUMP_KINDS))
    histogram = np.zeros((len(JUMP_KINDS), bins), dtype=np.int64)
    for part in _blocks(rows.size, slots, READ_AT_ONCE):
        block = rows[part]
        flags = results.column("jump_kind", block)
        used = flags >= 0
        if results.campaign.cycle.under_load:
            used &= results.column("jump_patches_after", block) > 0
        kind = flags[used].astype(np.intp)
        drop = results.column("jump_energy_drop", block)[used]
        bin_of_drop = np.clip(np.searchsorted(BIN_EDGES, drop, side="right") - 1, 0, bins - 1)
        np.add.at(number, kind, 1)
        np.add.at(energy, kind, drop)
        np.add.at(histogram, (kind, bin_of_drop), 1)
    truncated = int(np.sum(results.column("jump_count", rows) > slots))
    return JumpStatistics(number, energy, histogram, truncated)


def _blocks(count: int, width: int, most: int) -> Iterator[slice]:
    """Split so many rows or columns of ``width`` numbers: at most ``most`` numbers, or one line."""
    step = max(1, most // max(1, width))
    for start in range(0, count, step):
        yield slice(start, start + step)


@dataclass(frozen=True, eq=False)
class PairedDifference:
    """Loss at the next γ beside that at one γ, in J/m² and in W~, all else being equal.

    The profiles are the same for all γ, so the mean of the differences is known much better than
    the difference of the two means.
    """

    lower: Cell
    upper: Cell
    loss: LossDifference
    loss_dimensionless: LossDifference


@dataclass(frozen=True, eq=False)
class AveragedCell(Cell):
    """A cell with what is averaged over its rows a block at a time."""

    # ``loading_…`` and ``unloading_…`` with: ``mean_stress`` (Pa), ``mean_stress_dimensionless``
    # (σ~), ``mean_stress_over_slope`` (σ~/sqrt(m2)), ``contact_fraction``, ``patches``, ``energy``
    # (J/m)
    curves: dict[str, Curve]
    jumps: JumpStatistics
    fields: FieldStatistics


@dataclass(frozen=True, eq=False)
class Aggregate:
    """Averages and metadata of a results file that a report needs."""

    path: Path
    campaign: Campaign
    attributes: dict[str, Any]  # root attributes of the file
    cells: tuple[AveragedCell, ...]  # by H, then γ, then further axes, ascending
    failures: tuple[tuple[int, str], ...]  # row and error text of the first failed tasks
    companions: tuple[Companion, ...] = ()  # other campaigns that the report compares with this one
    # One sentence for each file, this one or a companion, that has damaged rows (left out), or no
    # checksums
    doubts: tuple[str, ...] = ()
    damaged: int = 0  # number of damaged rows of this file

    @property
    def done(self) -> int:
        """Number of finished tasks."""
        return sum(cell.done for cell in self.cells)

    @property
    def failed(self) -> int:
        """Number of failed tasks."""
        return sum(cell.failed for cell in self.cells)

    @property
    def pending(self) -> int:
        """Number of tasks that wait, or are being computed."""
        return sum(cell.pending for cell in self.cells)

    @property
    def total(self) -> int:
        """Number of tasks, without those that are not needed."""
        return self.done + self.failed + self.pending + self.damaged

    @property
    def hursts(self) -> tuple[float, ...]:
        """Hurst exponents, ascending."""
        return tuple(sorted({cell.hurst for cell in self.cells}))

    @property
    def works_of_adhesion(self) -> tuple[float, ...]:
        """γ in J/m², ascending."""
        return tuple(sorted({cell.work_of_adhesion for cell in self.cells}))

    @property
    def further(self) -> tuple[Axis, ...]:
        """The axes of the campaign beside H and γ."""
        return self.campaign.axes[2:]

    @cached_property
    def shown(self) -> Aggregate:
        """One cell for each (H, γ), all at the last finished point of the further axes.

        At the last point all further axes have their largest value, if they are combined. Keys that
        vary together with H or γ are where these are. A part of a campaign may lack some cells.
        """
        if not self.further:
            return self
        groups = [names for names in self.campaign.sweep.zip if _H_AND_GAMMA.intersection(names)]
        following = _H_AND_GAMMA.union(*groups)
        layers = alike(self.cells, following)
        last = max(point for point, layer in layers.items() if any(cell.done for cell in layer))
        return replace(self, cells=tuple(layers[last]))

    @cached_property
    def paired(self) -> list[PairedDifference]:
        """Each step from one γ to the next, where both have realisations in common."""
        found = []
        rows = alike(self.cells, {"work_of_adhesion"}).values()
        for lower, upper in chain.from_iterable(map(pairwise, rows)):
            loss = difference(lower, upper, "loss")
            scaled = difference(lower, upper, "loss_dimensionless")
            if loss is not None and scaled is not None:
                found.append(PairedDifference(lower, upper, loss, scaled))
        return found

    def finished(
        self, hursts: Collection[float], works_of_adhesion: Collection[float]
    ) -> list[AveragedCell]:
        """Return the cells at some H and γ that have finished tasks."""
        cells = (cell for cell in self.cells if cell.done and cell.hurst in hursts)
        return [cell for cell in cells if cell.work_of_adhesion in works_of_adhesion]


def aggregate(path: Path | str, beside: Sequence[Path | str] = ()) -> Aggregate:
    """Average a results file over realisations; ``beside`` are files to compare with it.

    InputError if a file cannot be read, is no results file, or holds no finished task.
    """
    with Results(path) as results:
        kept = results.column(KEPT)
        cells = tuple(_averaged(results, cell, kept) for cell in finished_cells(results))
        failed = np.flatnonzero(results.status() == FAILED)[:_MAX_FAILURES]
        errors = (text or "no reason given" for text in results.errors(failed))
        companions = tuple(read_companion(other, results.campaign) for other in beside)
        return Aggregate(
            path=results.path,
            campaign=results.campaign,
            attributes=results.attributes,
            cells=cells,
            failures=tuple(zip(failed.tolist(), errors, strict=True)),
            companions=companions,
            doubts=(*results.doubts(), *(d for other in companions for d in other.doubts)),
            damaged=results.damaged().size,
        )


def _averaged(results: Results, cell: Cell, kept: NDArray[np.intp]) -> AveragedCell:
    ones = np.ones(cell.done)
    stress = 1 / stress_scale(cell.campaign, cell.values["h_max"])
    # by dataset, the curves to make of it, with the factor of each row
    scales = {name: {name: ones} for name in ("contact_fraction", "patches", "energy")}
    scales["mean_stress"] = {
        "mean_stress": ones,
        "mean_stress_dimensionless": stress,
        "mean_stress_over_slope": stress / np.sqrt(cell.values["m2"]),
    }
    curves: dict[str, Curve] = {}
    for branch in BRANCHES:
        for name, factors in scales.items():
            found = average_curves(results, f"{branch}_{name}", cell.rows, factors)
            curves |= {f"{branch}_{curve}": average for curve, average in found.items()}
    return AveragedCell(
        **{entry.name: getattr(cell, entry.name) for entry in fields(Cell)},
        curves=curves,
        jumps=count_jumps(results, cell.rows),
        fields=average_fields(results, cell.rows, kept),
    )
