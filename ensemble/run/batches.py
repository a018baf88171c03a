"""Which realisations are computed next where a campaign has a ``[stop]``: batch by batch, by cell.

What is computed depends on the campaign alone: a cell's next batch is decided when the one before
is complete, whatever the number of ranks and of restarts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from adhesis.ensemble.campaign.precision import enough, looks
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import Task


@dataclass
class _Cell:
    rows: list[int]  # by realisation
    losses: dict[int, float] = field(default_factory=dict)  # by realisation; NaN if it failed
    asked: int = 0
    full: bool = False


class Batches:
    """The cells of a campaign with ``[stop]``.

    Parameters
    ----------
    campaign : Campaign
    tasks : sequence of Task
        Row by row.
    losses : mapping of int to float
        Of the rows that have been computed; NaN of those that failed.
    """

    def __init__(
        self, campaign: Campaign, tasks: Sequence[Task], losses: Mapping[int, float]
    ) -> None:
        assert campaign.stop.relative_error is not None
        self._wanted = campaign.stop.relative_error
        self._looks = looks(campaign.sweep.realisations, campaign.stop.batch, campaign.stop.most)
        self._tasks = tasks
        self._cells: dict[tuple[float, ...], _Cell] = {}
        for row, task in enumerate(tasks):
            self._cells.setdefault(task.cell, _Cell([])).rows.append(row)
        for row, loss in losses.items():
            self._cells[tasks[row].cell].losses[tasks[row].realisation] = loss
        for cell in self._cells.values():
            self._advance(cell)

    @property
    def to_do(self) -> list[int]:
        """Rows of the batches that are not complete."""
        return [
            row
            for cell in self._cells.values()
            for realisation, row in enumerate(cell.rows[: cell.asked])
            if realisation not in cell.losses
        ]

    @property
    def not_needed(self) -> list[int]:
        """Rows without a result of the cells that have enough."""
        return [row for cell in self._cells.values() if cell.full for row in self._left(cell)]

    def finished(self, row: int, loss: float) -> tuple[list[int], list[int]]:
        """Take in a row's loss, NaN if it failed.

        Returns
        -------
        further : list of int
            Rows of the cell's next batch, if this row has completed one.
        not_needed : list of int
            Rows that need not be computed, if the cell now has enough.
        """
        cell = self._cells[self._tasks[row].cell]
        before = cell.asked
        cell.losses[self._tasks[row].realisation] = loss
        if cell.full:
            return [], []
        self._advance(cell)
        further = [
            r
            for realisation, r in enumerate(cell.rows[before : cell.asked], start=before)
            if realisation not in cell.losses
        ]
        return further, self._left(cell) if cell.full else []

    @staticmethod
    def _left(cell: _Cell) -> list[int]:
        return [row for r, row in enumerate(cell.rows) if r not in cell.losses]

    def _advance(self, cell: _Cell) -> None:
        """Ask for batches until one is not complete, or the cell has enough."""
        known = 0
        if any(r not in cell.losses for r in range(cell.asked)):
            return
        while known in cell.losses:
            known += 1
        stop = enough([cell.losses[r] for r in range(known)], self._looks, self._wanted)
        cell.full = stop is not None
        if stop is None:
            cell.asked = next(look for look in self._looks if look > known)
        else:
            cell.asked = stop
