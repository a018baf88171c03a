"""Choose the next realisations where a campaign has a ``[stop]``: batch by batch, by cell.

What is computed depends on the campaign alone: a cell's next batch is decided when the one before
is complete, whatever the number of ranks and of restarts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.precision import enough, looks
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.interval import Array


@dataclass
class _Cell:
    # By realisation: its row, the value of the quantity, and whether there is one
    rows: NDArray[np.int64]
    values: Array
    known: NDArray[np.bool_]
    factor: float  # 0 without adhesion, where nothing is lost and a value is rounding, or NaN
    asked: int = 0
    full: bool = False

    def missing(self, first: int, last: int | None = None) -> list[int]:
        """Return the rows without a value of some realisations."""
        found: list[int] = self.rows[first:last][~self.known[first:last]].tolist()
        return found


class Batches:
    """The cells of a whole campaign with ``[stop]``.

    ``values`` holds the quantity that ``[stop]`` steers, of all rows, NaN of those that failed;
    ``known`` which of them have been computed.
    """

    def __init__(self, campaign: Campaign, values: Array, known: NDArray[np.bool_]) -> None:
        assert campaign.stop.relative_error is not None
        self._wanted = campaign.stop.relative_error
        self._looks = looks(campaign.sweep.realisations, campaign.stop.batch, campaign.stop.most)
        self._realisations = campaign.realisations
        self._cells = []
        for task, rows in campaign.tasks().by_cell():
            factor = float(task.work_of_adhesion > 0)
            self._cells.append(_Cell(rows, factor * values[rows], known[rows], factor))
        for cell in self._cells:
            self._advance(cell)

    @property
    def to_do(self) -> list[int]:
        """Rows of the batches that are not complete."""
        return [row for cell in self._cells for row in cell.missing(0, cell.asked)]

    @property
    def not_needed(self) -> list[int]:
        """Rows without a result of the cells that have enough."""
        return [row for cell in self._cells if cell.full for row in cell.missing(0)]

    def finished(self, row: int, value: float) -> tuple[list[int], list[int]]:
        """Take in a row's value of the quantity, NaN if it failed.

        Returns the rows of the cell's next batch, if this row has completed one, and those that
        need not be computed, if the cell now has enough.
        """
        number, realisation = divmod(row, self._realisations)
        cell = self._cells[number]  # of a batch that was not complete: the cell is not full
        cell.values[realisation], cell.known[realisation] = cell.factor * value, True
        before = cell.asked
        self._advance(cell)
        return cell.missing(before, cell.asked), cell.missing(0) if cell.full else []

    def _advance(self, cell: _Cell) -> None:
        """Ask for batches until one is not complete, or the cell has enough."""
        if cell.missing(0, cell.asked):
            return
        known = int(np.append(cell.known, False).argmin())  # without a gap
        stop = enough(cell.values[:known], self._looks, self._wanted)
        cell.full = stop is not None
        cell.asked = stop or next(look for look in self._looks if look > known)
