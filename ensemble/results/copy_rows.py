"""Copying rows from one results file into another, dataset by dataset, a block at a time."""

from __future__ import annotations

from collections.abc import Sequence

import h5py
import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import kept_rows
from adhesis.ensemble.task.dataset import KEPT, Dataset

Rows = NDArray[np.intp]
_BLOCK_BYTES = 16 * 2**20


def rows_in(campaign: Campaign, file: Results) -> Rows:
    """Return the row in a whole campaign, from which the file's has grown, of each of its tasks."""
    cells = campaign.tasks().of_cells()
    place = {campaign.identity(task): number for number, task in enumerate(cells)}
    tasks, here = file.tasks(), file.tasks().of_cells()
    there = np.zeros(len(tasks.cells), np.intp)
    there[here.cell_of()] = [place[file.campaign.identity(task)] for task in here]
    rows: Rows = there[tasks.cell_of()] * campaign.realisations + tasks.column("realisation")
    return rows


class Source:
    """A file to take rows from, and where they go in the file of a whole campaign."""

    def __init__(self, results: Results, campaign: Campaign, taken: NDArray[np.bool_]) -> None:
        self.results = results
        self.target = rows_in(campaign, results)  # row of each row, ascending
        self.taken = taken  # rows that this file gives
        self._kept_rows = results.column(KEPT)
        # A task that kept its fields does so in a grown campaign: realisations are only added.
        self._kept = np.searchsorted(kept_rows(campaign), self.target[self._kept_rows])

    def row_of(self, target: int) -> int:
        """Row of a task, by its row in the merged file."""
        return int(np.searchsorted(self.target, target))

    def gives(self, first: int, stop: int) -> bool:
        """Whether it gives any of these rows."""
        low, high = np.searchsorted(self.target, (first, stop))
        return bool(np.any(self.taken[low:high]))

    def places(self, dataset: Dataset) -> tuple[Rows, NDArray[np.bool_]]:
        """Return the places of the rows of a dataset, and which of them are given."""
        if dataset.dims[0] == KEPT:
            return self._kept, self.taken[self._kept_rows]
        return self.target, self.taken


def copy_dataset(
    sources: Sequence[Source], file: h5py.File, dataset: Dataset, first: int, stop: int
) -> None:
    """Take over rows ``first`` … ``stop`` - 1 of one dataset."""
    there = file[dataset.name]
    width = max(1, int(np.prod(there.shape[1:])) * there.dtype.itemsize)
    step = max(1, _BLOCK_BYTES // width)
    for start in range(first, min(stop, there.shape[0]), step):
        end = min(start + step, stop, there.shape[0])
        block = there[start:end]
        for source in sources:
            target, taken = source.places(dataset)
            low, high = np.searchsorted(target, (start, end))
            chosen = taken[low:high]
            if np.any(chosen):
                values = source.results.column(dataset.name, slice(int(low), int(high)))
                block[target[low:high][chosen] - start] = values[chosen]
        there[start:end] = block
