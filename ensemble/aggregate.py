"""Averages over realisations, from a results file alone.

A cell is one (H, γ) of the sweep. Scalars of all tasks fit in memory; curves do not, so they pass
through a bounded block of columns at a time. Only rows whose status is "done" are read: the status
byte is written last, so a file that a run is still writing gives a consistent answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ensemble.aggregate_curves import BRANCHES, Curve, average_curves
from ensemble.aggregate_fields import FieldStatistics, aggregate_fields
from ensemble.aggregate_jumps import JumpStatistics, aggregate_jumps
from ensemble.campaign import Campaign
from ensemble.errors import InputError
from ensemble.schema import DONE, FAILED
from ensemble.statistics import Estimate, estimates
from ensemble.store import Results
from solver.material import HalfSpace

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

_PER_TASK = (
    *("h_max", "h_rms", "m0", "m2", "m4"),
    *("loss", "loss_dimensionless", "loss_from_drops", "loss_small_scale", "loss_large_scale"),
    *("audit_residual", "pull_off_penetration", "pull_off_stress"),
    *("wall_time", "cpu_time", "states", "jump_count"),
)
_WITH_INTERVAL = (
    "loss",
    "loss_dimensionless",
    "loss_small_scale",
    "loss_large_scale",
    "small_scale_share",
    "pull_off_stress",
    "pull_off_penetration",
)
_MOST_FAILURES = 20


@dataclass(frozen=True, eq=False)
class Cell:
    """All tasks of one (H, γ).

    Attributes
    ----------
    hurst, work_of_adhesion : float
        H; γ in J/m².
    done, failed, pending : int
        Tasks.
    rows : int array, shape (done,)
        Rows of the done tasks in the file, by realisation.
    realisation : int array, shape (done,)
    values : dict of array, each of shape (done,)
        Per-task numbers under the names of the results file, and ``small_scale_share``
        (loss_small_scale / loss_from_drops).
    estimates : dict of Estimate
        The same, averaged. Only losses and pull-off have an interval.
    curves : dict of Curve
        ``loading_…`` and ``unloading_…`` with: ``mean_stress`` (Pa), ``stress`` (σ~),
        ``stress_slope`` (σ~/sqrt(m2)), ``contact_fraction``, ``patches``, ``energy`` (J/m).
    """

    hurst: float
    work_of_adhesion: float
    done: int
    failed: int
    pending: int
    rows: Rows
    realisation: NDArray[np.int64]
    values: dict[str, Array]
    estimates: dict[str, Estimate]
    curves: dict[str, Curve]


@dataclass(frozen=True)
class PairedDifference:
    """Loss at ``upper`` minus loss at ``lower`` γ (J/m²), on the same profiles.

    The profiles are the same across γ, so the difference of each realisation is known much better
    than the difference of the two means.
    """

    hurst: float
    lower: float
    upper: float
    loss: Estimate
    loss_dimensionless: Estimate


@dataclass(frozen=True, eq=False)
class Aggregate:
    """What a report needs of a results file.

    Attributes
    ----------
    path : Path
    campaign : Campaign
    attributes : dict
        Root attributes of the file.
    cells : tuple of Cell
        By H, then γ, ascending.
    paired : tuple of PairedDifference
    jumps : JumpStatistics
        In the order of the cells.
    fields : FieldStatistics
        In the order of the cells.
    failures : tuple of (int, str)
        Row and error text of the first failed tasks.
    """

    path: Path
    campaign: Campaign
    attributes: dict[str, Any]
    cells: tuple[Cell, ...]
    paired: tuple[PairedDifference, ...]
    jumps: JumpStatistics
    fields: FieldStatistics
    failures: tuple[tuple[int, str], ...]

    @property
    def done(self) -> int:
        """Finished tasks."""
        return sum(cell.done for cell in self.cells)

    @property
    def failed(self) -> int:
        """Failed tasks."""
        return sum(cell.failed for cell in self.cells)

    @property
    def pending(self) -> int:
        """Tasks that wait, or are being computed."""
        return sum(cell.pending for cell in self.cells)

    @property
    def hursts(self) -> tuple[float, ...]:
        """Hurst exponents, ascending."""
        return tuple(sorted({cell.hurst for cell in self.cells}))

    @property
    def works_of_adhesion(self) -> tuple[float, ...]:
        """γ in J/m², ascending."""
        return tuple(sorted({cell.work_of_adhesion for cell in self.cells}))

    def cell(self, hurst: float, work_of_adhesion: float) -> Cell | None:
        """Return the cell of (H, γ), None if the campaign lacks it."""
        for cell in self.cells:
            if (cell.hurst, cell.work_of_adhesion) == (hurst, work_of_adhesion):
                return cell
        return None


def aggregate(path: Path | str) -> Aggregate:
    """Average a results file over realisations.

    Raises
    ------
    InputError
        If the file cannot be read, is no results file, or holds no finished task.
    """
    with Results(path) as results:
        status = results.status()
        cells = _cells(results, status)
        if not any(cell.done for cell in cells):
            raise InputError(
                f"{path} holds no finished task yet ({np.sum(status == FAILED)} failed, of "
                f"{status.size}): there is nothing to report"
            )
        rows = [cell.rows for cell in cells]
        for name, scales in _curve_scales(results.campaign, cells).items():
            for branch in BRANCHES:
                for curve, averages in average_curves(results, branch, name, rows, scales).items():
                    for cell, average in zip(cells, averages, strict=True):
                        cell.curves[f"{branch}_{curve}"] = average
        failed = np.flatnonzero(status == FAILED)[:_MOST_FAILURES]
        return Aggregate(
            path=results.path,
            campaign=results.campaign,
            attributes=results.attributes,
            cells=tuple(cells),
            paired=tuple(_paired(cells)),
            jumps=aggregate_jumps(results, rows),
            fields=aggregate_fields(results, rows),
            failures=tuple(zip(failed.tolist(), results.errors(failed), strict=True)),
        )


def _cells(results: Results, status: NDArray[np.uint8]) -> list[Cell]:
    hurst, gamma = results.column("hurst"), results.column("work_of_adhesion")
    realisation = results.column("realisation")
    columns = {name: results.column(name) for name in _PER_TASK}
    cells = []
    for h, g in sorted(set(zip(hurst.tolist(), gamma.tolist(), strict=True))):
        mine = np.flatnonzero((hurst == h) & (gamma == g))
        rows = mine[status[mine] == DONE]
        rows = rows[np.argsort(realisation[rows], kind="stable")]
        values = {name: column[rows].astype(float) for name, column in columns.items()}
        drops = values["loss_from_drops"]
        values["small_scale_share"] = np.divide(
            values["loss_small_scale"], drops, out=np.zeros_like(drops), where=drops > 0
        )
        failed = int(np.sum(status[mine] == FAILED))
        cells.append(
            Cell(
                hurst=h,
                work_of_adhesion=g,
                done=rows.size,
                failed=failed,
                pending=mine.size - rows.size - failed,
                rows=rows,
                realisation=realisation[rows].astype(np.int64),
                values=values,
                estimates=_estimates(values),
                curves={},
            )
        )
    return cells


def _estimates(values: dict[str, Array]) -> dict[str, Estimate]:
    with_interval = np.array([values[name] for name in _WITH_INTERVAL])
    found = dict(zip(_WITH_INTERVAL, estimates(with_interval), strict=True))
    rest = [name for name in values if name not in found]
    plain = estimates(np.array([values[name] for name in rest]), with_interval=False)
    return found | dict(zip(rest, plain, strict=True))


def stress_scale(campaign: Campaign, h_max: Array) -> Array:
    """E* q0 h_max / 2 in Pa, for every h_max in m: σ~ is the mean stress over this."""
    half_space = HalfSpace(campaign.material.young, campaign.material.poisson)
    return 0.5 * half_space.modulus * (2 * np.pi / campaign.profile.period) * h_max


def _curve_scales(campaign: Campaign, cells: Sequence[Cell]) -> dict[str, dict[str, list[Array]]]:
    """Datasets to average, and what to make of each: curve -> factor per row, cell by cell."""
    ones = [np.ones(cell.done) for cell in cells]
    stress = [1 / stress_scale(campaign, cell.values["h_max"]) for cell in cells]
    slope = [s / np.sqrt(cell.values["m2"]) for s, cell in zip(stress, cells, strict=True)]
    return {
        "mean_stress": {"mean_stress": ones, "stress": stress, "stress_slope": slope},
        "contact_fraction": {"contact_fraction": ones},
        "patches": {"patches": ones},
        "energy": {"energy": ones},
    }


def _paired(cells: Sequence[Cell]) -> Iterator[PairedDifference]:
    for lower, upper in pairwise(cells):
        if lower.hurst != upper.hurst:
            continue
        _, low, high = np.intersect1d(
            lower.realisation, upper.realisation, assume_unique=True, return_indices=True
        )
        if not low.size:
            continue
        loss, dimensionless = estimates(
            np.array(
                [
                    upper.values[name][high] - lower.values[name][low]
                    for name in ("loss", "loss_dimensionless")
                ]
            )
        )
        yield PairedDifference(
            lower.hurst, lower.work_of_adhesion, upper.work_of_adhesion, loss, dimensionless
        )
