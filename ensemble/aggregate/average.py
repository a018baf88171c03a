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

from ensemble.aggregate.cells import Cell, read_cells, stress_scale
from ensemble.aggregate.companions import Companion, read_companion
from ensemble.aggregate.curves import average_curves
from ensemble.aggregate.fields import FieldStatistics, aggregate_fields
from ensemble.aggregate.jumps import JumpStatistics, aggregate_jumps
from ensemble.aggregate.statistics import Estimate, estimates
from ensemble.campaign.tables import Campaign
from ensemble.errors import InputError
from ensemble.results.read import Results, Slice
from ensemble.results.schema import FAILED
from solver.method import BRANCHES
from solver.profile import Array

_MOST_FAILURES = 20


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
    companions : tuple of Companion
        Other campaigns that the report sets beside this one.
    """

    path: Path
    campaign: Campaign
    attributes: dict[str, Any]
    cells: tuple[Cell, ...]
    paired: tuple[PairedDifference, ...]
    jumps: JumpStatistics
    fields: FieldStatistics
    failures: tuple[tuple[int, str], ...]
    companions: tuple[Companion, ...] = ()

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


def aggregate(
    path: Path | str,
    beside: Sequence[Path | str] = (),
    others: tuple[tuple[str, float], ...] = (),
) -> Aggregate:
    """Average a results file over realisations; ``beside`` are files to set beside it.

    A campaign on further axes than H and γ is averaged point by point of these: ``others`` is one
    of :func:`ensemble.results.read.slices`.

    Raises
    ------
    InputError
        If a file cannot be read, is no results file, or holds no finished task.
    """
    with Slice(path, others) if others else Results(path) as results:
        if results.campaign.axes[2:]:
            names = ", ".join(axis.name for axis in results.campaign.axes[2:])
            raise InputError(
                f"{path} has further axes ({names}): its averages are taken at one point of them"
            )
        status = results.status()
        cells = read_cells(results, status)
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
            companions=tuple(read_companion(other, results.campaign) for other in beside),
        )


def _curve_scales(campaign: Campaign, cells: Sequence[Cell]) -> dict[str, dict[str, list[Array]]]:
    """Datasets to average, and what to make of each: curve -> factor per row, cell by cell."""
    ones = [np.ones(cell.done) for cell in cells]
    stress = [1 / stress_scale(campaign, cell.values["h_max"]) for cell in cells]
    slope = [s / np.sqrt(cell.values["m2"]) for s, cell in zip(stress, cells, strict=True)]
    return {
        "mean_stress": {
            "mean_stress": ones,
            "mean_stress_dimensionless": stress,
            "mean_stress_over_slope": slope,
        },
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
