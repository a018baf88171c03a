"""The 95 % interval of a mean, and when a cell has enough realisations: the rule of ``[stop]``.

For ten values or more the interval, which tables print, too, reaches as far on each side as the
further of Student's interval and Hall's transformation of it, for fewer it is Student's:
docs/theory.md, "Interval", says why, with the measured coverage of all three. Nothing is drawn at
random: a run with ``[stop]`` looks at its intervals as it goes, on complete batches alone.

Realisations are looked at after the first ones and after every batch. A cell has enough when, at
:data:`LOOKS_IN_A_ROW` looks in a row, the interval of the mean of the steered quantity reaches no
further from it than wanted, over at least :data:`LEAST` values.

What a run computes depends on the campaign alone: a cell's next batch is decided when the one
before is complete, whatever the number of ranks and of restarts.

:class:`Precision` is the only judge of a cell: the rule, ``adhesis status``, the closing lines of a
run and the report all have interval and verdict from it.

A rule that stops as soon as an interval looks narrow stops by luck, and its intervals cover the
mean less often than they say (Anscombe 1953, J. R. Stat. Soc. B 15, 1; Glynn & Whitt 1992, Ann.
Appl. Probab. 2, 180; Singham & Schruben 2012, INFORMS J. Comput. 24, 624). A least number and
several looks keep such luck small. To wait until the sample's skewness is small would do harm: that
picks the samples without a tail.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.quantities import percent
from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array

CONFIDENCE = 0.95
FEWEST_FOR_SKEWNESS = 10
LEAST = 32
LOOKS_IN_A_ROW = 4
MOST_LISTED = 20  # cells in the closing lines of a run and among the findings of a report


def interval_method(n: int) -> str:
    """Return the method of the interval of ``n`` values: "transformed", "student" or "none"."""
    return "transformed" if n >= FEWEST_FOR_SKEWNESS else "student" if n >= 2 else "none"


def interval(values: ArrayLike) -> tuple[Array, Array]:
    """Return low and high ends of the interval of the mean over the last axis of finite values.

    NaN for fewer than two values; both the mean where all values are equal.
    """
    values = np.asarray(values, dtype=np.float64)
    n = values.shape[-1]
    if n < 2:
        nothing = np.full(values.shape[:-1], np.nan)
        return nothing, nothing.copy()
    mean = values.mean(axis=-1)
    away = values - mean[..., np.newaxis]
    square = np.mean(away * away, axis=-1)
    # Of equal values the spread is rounding, and its skewness anything.
    spread = np.max(np.abs(away), axis=-1) > 1e-14 * np.abs(mean)
    std = np.where(spread, np.sqrt(square * n / (n - 1)), 0.0)
    from scipy.special import stdtrit  # here: most commands have no use for it, and it takes long

    t = float(stdtrit(n - 1, 0.5 + CONFIDENCE / 2)) / np.sqrt(n)
    low, high = mean - std * t, mean + std * t
    if n < FEWEST_FOR_SKEWNESS:
        return low, high
    cube = np.mean(away * away * away, axis=-1)
    skewness = np.where(spread, cube, 0.0) / np.where(spread, square, 1.0) ** 1.5
    above, below = untransformed(t, skewness, n), untransformed(-t, skewness, n)
    return np.minimum(low, mean - std * above), np.maximum(high, mean - std * below)


def untransformed(x: float, skewness: Array, n: int) -> Array:
    """Return (mean - true mean)/std where Hall's cubic of it is ``x``.

    The cubic is w + g w²/3 + g² w³/27 + g/(6n), of skewness g: monotonic, and solved in closed form
    (Hall 1992, eq. 2.2).
    """
    g = np.where(np.abs(skewness) < 1e-6, 1e-6, skewness)
    solved: Array = 3 / g * (np.cbrt(1 + g * (x - g / (6 * n))) - 1)
    return solved


@dataclass(frozen=True)
class Estimate:
    """A mean over realisations and how well it is known; NaN where n is too small."""

    n: int  # realisations
    mean: float
    std: float  # standard deviation of one realisation (n - 1 in the denominator)
    sem: float  # standard error of the mean, std/sqrt(n)
    low: float  # and high: the interval of the mean at :data:`CONFIDENCE`
    high: float

    @property
    def relative_error(self) -> float:
        """Distance of the further end of the interval over the mean; infinite without one."""
        furthest = max(self.mean - self.low, self.high - self.mean)
        if furthest == 0:
            return 0.0
        known = bool(self.mean) and not np.isnan(furthest)
        return furthest / abs(self.mean) if known else float("inf")


def estimates(values: Array, with_interval: bool = True) -> list[Estimate]:
    """One :class:`Estimate` for each row of ``values``, shape (quantities, n)."""
    values = np.atleast_2d(np.asarray(values, dtype=float))
    count, n = values.shape
    nothing = np.full(count, np.nan)
    mean = values.mean(axis=1) if n else nothing
    std = values.std(axis=1, ddof=1) if n > 1 else nothing
    low, high = interval(values) if with_interval and n else (nothing, nothing)
    sem = std / np.sqrt(max(n, 1))
    return [Estimate(n, *map(float, row)) for row in zip(mean, std, sem, low, high, strict=True)]


# ---------------------------------------------------------------------- the rule of [stop]


def looks(first: int, batch: int, most: int) -> list[int]:
    """Return the numbers of realisations at which a cell is looked at, ascending."""
    return sorted({*range(first, most, batch), most})


def fewest(at: Sequence[int], narrow_from: float = LEAST) -> int:
    """Return after how many realisations a cell has enough, by its looks.

    Its interval is narrow enough from so many realisations on; by default, from the first look on.
    """
    least = max(narrow_from, LEAST)
    first = next((place for place, count in enumerate(at) if count >= least), len(at) - 1)
    return at[min(first + LOOKS_IN_A_ROW, len(at)) - 1]


@dataclass(frozen=True)
class Precision:
    """Precision of the mean of a cell, and whether it is the wanted one."""

    quantity: str  # column of the results file that ``[stop]`` steers
    wanted: float  # how far the interval may reach from the mean, over the mean
    # The mean and both ends of its interval, in the unit of the quantity; NaN where unknown
    estimate: Estimate
    finished: bool = True  # whether no realisation of the cell is still to be computed

    @property
    def narrow(self) -> bool:
        """Whether the interval is narrow enough, over enough realisations."""
        return self.estimate.n >= LEAST and self.estimate.relative_error <= self.wanted

    @property
    def met(self) -> bool | None:
        """Whether the cell has met the wanted precision; None while realisations are missing."""
        return self.narrow if self.finished else None

    def __str__(self) -> str:
        known = f"{self.quantity}: interval unknown"
        if np.isfinite(self.estimate.relative_error):
            unit = " J/m²" if self.quantity == "loss" else ""
            known = (
                f"{self.quantity} {self.estimate.low:.4g} to {self.estimate.high:.4g}{unit} "
                f"(± {percent(self.estimate.relative_error, digits=3)})"
            )
        verdict = {True: "met", False: "not met", None: "not finished"}[self.met]
        if self.met is False and self.estimate.n < LEAST:
            verdict += f", as it takes at least {LEAST} realisations"
        return (
            f"{known} of {counted(self.estimate.n, 'realisation')}, wanted ± "
            f"{percent(self.wanted, digits=3)}: {verdict}"
        )


def precision(
    values: Sequence[float] | Array, wanted: float, quantity: str = "", *, finished: bool = True
) -> Precision:
    """Return how well the mean of a cell is known; values that are not finite are left out."""
    known = np.asarray(values, np.float64)
    (estimate,) = estimates(known[np.isfinite(known)])
    return Precision(quantity, wanted, estimate, finished)


def enough(values: Sequence[float] | Array, at: Sequence[int], wanted: float) -> int | None:
    """Return after how many realisations a cell has enough, None if it has not yet.

    ``values`` are those of realisations without a gap, NaN where a task failed; ``at`` is of
    :func:`looks`.
    """
    row = 0
    for count in at:
        if count > len(values):
            return None
        # fewer than the least number are never narrow enough, and cost as much to look at
        row = row + 1 if count >= LEAST and precision(values[:count], wanted).narrow else 0
        if row == LOOKS_IN_A_ROW or count == at[-1]:
            return count
    return None


def precision_lines(cells: Sequence[tuple[str, Precision]]) -> list[str]:
    """Return lines on which cells (name, precision) have met the wanted precision.

    Of many cells only those are listed that have not met it, and of these the first.
    """
    if not cells:
        return []
    met = sum(bool(known.met) for _, known in cells)
    lines = [f"[stop]: {met} of {counted(len(cells), 'cell')} met the wanted precision"]
    listed = [entry for entry in cells if not entry[1].met] if len(cells) > MOST_LISTED else cells
    lines += [f"  {name}: {known}" for name, known in listed[:MOST_LISTED]]
    if len(listed) > MOST_LISTED:
        lines.append(f"  … and {len(listed) - MOST_LISTED} more (adhesis status --json lists all)")
    return lines


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
            self._advance(self._cells[-1])

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
