"""Average over realisations, from a results file alone.

A cell is one point on the axes of the campaign: an (H, γ), and a value of each further list.
Scalars of all tasks fit in memory; curves do not, so they pass through a bounded block of columns
at a time. Only rows whose status is "done" are read: the status byte is written last, so the
averages of a file that a run is still writing are consistent.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.aggregate.by_blocks import (
    Curve,
    FieldStatistics,
    JumpStatistics,
    average_curves,
    average_fields,
    count_jumps,
)
from adhesis.ensemble.aggregate.cells import Cell, alike, finished_cells, stress_scale
from adhesis.ensemble.aggregate.companions import (
    Companion,
    LossDifference,
    difference,
    read_companion,
)
from adhesis.ensemble.campaign.tables import Axis, Campaign
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import FAILED
from adhesis.ensemble.task.dataset import KEPT
from adhesis.solver.method import BRANCHES

_MAX_FAILURES = 20
_H_AND_GAMMA = frozenset(("hurst", "work_of_adhesion"))


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
