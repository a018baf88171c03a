"""Choose the next realisations where a campaign has a ``[stop]``: batch by batch, by cell.

What is computed depends on the campaign alone: a cell's next batch is decided when the one before
is complete, whatever the number of ranks and of restarts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import count

from adhesis.ensemble.campaign.precision import enough, looks
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import Tasks


@dataclass
class _Cell:
    rows: list[int]  # by realisation
    values: dict[int, float] = field(default_factory=dict)  # by realisation; NaN if it failed
    asked: int = 0
    full: bool = False

    def missing(self, first: int, last: int) -> list[int]:
        """Return the rows without a value of some realisations."""
        stretch = enumerate(self.rows[first:last], start=first)
        return [row for realisation, row in stretch if realisation not in self.values]


class Batches:
    """The cells of a campaign with ``[stop]``.

    ``values`` holds the quantity that ``[stop]`` steers, of the rows that have been computed; NaN
    of those that failed.
    """

    def __init__(self, campaign: Campaign, tasks: Tasks, values: Mapping[int, float]) -> None:
        assert campaign.stop.relative_error is not None
        self._wanted = campaign.stop.relative_error
        self._looks = looks(campaign.sweep.realisations, campaign.stop.batch, campaign.stop.most)
        self._tasks = tasks
        self._cells: dict[tuple[float, ...], _Cell] = {}
        for row, task in enumerate(tasks):
            self._cells.setdefault(task.cell, _Cell([])).rows.append(row)
        for row, value in values.items():
            self._keep(row, value)
        for cell in self._cells.values():
            self._advance(cell)

    @property
    def to_do(self) -> list[int]:
        """Rows of the batches that are not complete."""
        return [row for cell in self._cells.values() for row in cell.missing(0, cell.asked)]

    @property
    def not_needed(self) -> list[int]:
        """Rows without a result of the cells that have enough."""
        cells = (cell for cell in self._cells.values() if cell.full)
        return [row for cell in cells for row in cell.missing(0, len(cell.rows))]

    def finished(self, row: int, value: float) -> tuple[list[int], list[int]]:
        """Take in a row's value of the quantity, NaN if it failed.

        Returns the rows of the cell's next batch, if this row has completed one, and those that
        need not be computed, if the cell now has enough.
        """
        cell = self._keep(row, value)  # of a batch that was not complete: the cell is not full
        before = cell.asked
        self._advance(cell)
        further = cell.missing(before, cell.asked)
        return further, cell.missing(0, len(cell.rows)) if cell.full else []

    def _keep(self, row: int, value: float) -> _Cell:
        task = self._tasks[row]
        cell = self._cells[task.cell]
        # Without adhesion nothing is lost: the value is rounding, or NaN.
        cell.values[task.realisation] = value if task.work_of_adhesion > 0 else 0.0 * value
        return cell

    def _advance(self, cell: _Cell) -> None:
        """Ask for batches until one is not complete, or the cell has enough."""
        if cell.missing(0, cell.asked):
            return
        known = next(r for r in count() if r not in cell.values)
        stop = enough([cell.values[r] for r in range(known)], self._looks, self._wanted)
        cell.full = stop is not None
        if stop is None:
            cell.asked = next(look for look in self._looks if look > known)
        else:
            cell.asked = stop
