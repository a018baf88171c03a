"""Average over realisations, from a results file alone.

A cell is one point on the axes of the campaign: an (H, γ), and a value of each further list.
Scalars of all tasks fit in memory; curves do not, so they pass through a bounded block of columns
at a time. Only rows whose status is "done" are read: the status byte is written last, so the
averages of a file that a run is still writing are consistent.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from adhesis.ensemble.aggregate.cells import Cell, read_cells, stress_scale
from adhesis.ensemble.aggregate.companions import Companion, read_companion
from adhesis.ensemble.aggregate.jumps import JumpStatistics, aggregate_jumps
from adhesis.ensemble.aggregate.mean_curves import average_curves
from adhesis.ensemble.aggregate.mean_fields import FieldStatistics, aggregate_fields
from adhesis.ensemble.campaign.axes import Axis
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.interval import Estimate, estimates
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import FAILED
from adhesis.solver.method import BRANCHES
from adhesis.solver.model.profile import Array

_MAX_FAILURES = 20


@dataclass(frozen=True)
class PairedDifference:
    """Loss at ``upper`` less loss at ``lower`` γ (J/m²), all else being equal.

    The profiles are the same for all γ, so the mean of the differences is known much better than
    the difference of the two means.
    """

    hurst: float
    others: tuple[tuple[str, float], ...]
    lower: float
    upper: float
    loss: Estimate
    loss_dimensionless: Estimate


@dataclass(frozen=True, eq=False)
class Aggregate:
    """Averages and metadata of a results file that a report needs."""

    path: Path
    campaign: Campaign
    attributes: dict[str, Any]  # root attributes of the file
    cells: tuple[Cell, ...]  # by H, then γ, then further axes, ascending
    paired: tuple[PairedDifference, ...]
    jumps: JumpStatistics  # in the order of the cells
    fields: FieldStatistics  # in the order of the cells
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

        At the last point all further axes have their largest value, if they are combined.
        """
        if not self.further:
            return self
        stacks: dict[tuple[float, float], list[int]] = {}
        for k, cell in enumerate(self.cells):
            stacks.setdefault((cell.hurst, cell.work_of_adhesion), []).append(k)
        layers = list(zip(*stacks.values(), strict=False))
        layer = next(m for m in reversed(layers) if any(self.cells[k].done for k in m))
        return self._part(list(layer))

    def _part(self, indices: list[int]) -> Aggregate:
        cells = tuple(self.cells[k] for k in indices)
        keys = {(cell.hurst, cell.others) for cell in cells}
        return replace(
            self,
            cells=cells,
            paired=tuple(pair for pair in self.paired if (pair.hurst, pair.others) in keys),
            jumps=self.jumps.part(indices),
            fields=self.fields.part(indices),
        )

    def cell(self, hurst: float, work_of_adhesion: float) -> Cell | None:
        """Return the first cell of (H, γ), None if the campaign lacks it; see :attr:`shown`."""
        for cell in self.cells:
            if (cell.hurst, cell.work_of_adhesion) == (hurst, work_of_adhesion):
                return cell
        return None


def aggregate(path: Path | str, beside: Sequence[Path | str] = ()) -> Aggregate:
    """Average a results file over realisations; ``beside`` are files to compare with it.

    InputError if a file cannot be read, is no results file, or holds no finished task.
    """
    with Results(path) as results:
        status = results.status()
        cells = read_cells(results, status)
        rows = [cell.rows for cell in cells]
        for name, scales in _curve_scales(cells).items():
            for branch in BRANCHES:
                for curve, averages in average_curves(results, branch, name, rows, scales).items():
                    for cell, average in zip(cells, averages, strict=True):
                        cell.curves[f"{branch}_{curve}"] = average
        failed = np.flatnonzero(status == FAILED)[:_MAX_FAILURES]
        companions = tuple(read_companion(other, results.campaign) for other in beside)
        return Aggregate(
            path=results.path,
            campaign=results.campaign,
            attributes=results.attributes,
            cells=tuple(cells),
            paired=tuple(_paired(cells)),
            jumps=aggregate_jumps(results, rows),
            fields=aggregate_fields(results, rows),
            failures=tuple(zip(failed.tolist(), results.errors(failed), strict=True)),
            companions=companions,
            doubts=(*results.doubts(), *(d for other in companions for d in other.doubts)),
            damaged=results.damaged().size,
        )


def _curve_scales(cells: Sequence[Cell]) -> dict[str, dict[str, list[Array]]]:
    """Return, by dataset, the curves to average: curve -> factor of each row, cell by cell."""
    ones = [np.ones(cell.done) for cell in cells]
    stress = [1 / stress_scale(cell.campaign, cell.values["h_max"]) for cell in cells]
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
    rows: dict[tuple[Any, ...], list[Cell]] = {}
    for cell in cells:
        rows.setdefault((cell.hurst, cell.others), []).append(cell)
    for lower, upper in chain.from_iterable(map(pairwise, rows.values())):
        _, low, high = np.intersect1d(
            lower.realisation, upper.realisation, assume_unique=True, return_indices=True
        )
        if not low.size:
            continue
        names = ("loss", "loss_dimensionless")
        grown = [upper.values[name][high] - lower.values[name][low] for name in names]
        yield PairedDifference(
            *(lower.hurst, lower.others, lower.work_of_adhesion, upper.work_of_adhesion),
            *estimates(np.array(grown)),
        )
