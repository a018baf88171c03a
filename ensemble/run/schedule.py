"""Choose the next tasks: round by round, in a round the longest first, by estimates that improve.

Tasks come in groups that take about the same time (a cell of the sweep, say) and in rounds (its
realisations): a round is handed out before the next one begins, so that a run which is interrupted
leaves averages over about as many realisations in every cell. Within a round the longest go first,
so that the ranks end together: a round is put into order when it begins. Before anything is known,
a group's prior says how long its tasks take compared with the others; each measured time corrects
it. Tasks of one group and round share work, and go out together, as one unit.
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass

Unit = tuple[int, ...]
"""Tasks that one worker does, in this order."""


@dataclass
class _Group:
    prior: float
    waiting: int = 0  # tasks
    seconds: float = 0.0  # measured
    count: int = 0  # of measured ones


class Schedule:
    """Tasks that wait, ordered by round and estimated time.

    ``group_of`` and ``round_of`` also hold the tasks that are added later. ``priors`` are relative
    times of a task of each group, positive. Tasks of one group and round that are added at once are
    a unit.
    """

    def __init__(
        self,
        tasks: Iterable[int],
        group_of: Mapping[int, Hashable] | Sequence[Hashable],
        priors: Mapping[Hashable, float],
        round_of: Mapping[int, int] | Sequence[int],
    ) -> None:
        self._groups = {name: _Group(prior) for name, prior in priors.items()}
        self.group_of, self._round_of = group_of, round_of
        self._rounds: dict[int, list[Unit]] = {}
        self._turns: list[int] = []  # these rounds, ascending
        self._ordered: set[int] = set()  # rounds whose units stand in order, the longest last
        self._known_seconds = self._known_prior = 0.0
        self.waiting = 0
        self.add(tasks)

    def add(self, tasks: Iterable[int]) -> None:
        """Let further tasks wait."""
        units: dict[Hashable, list[int]] = {}
        for task in tasks:
            key = (self.group_of[task], self._round_of[task])
            units.setdefault(key, []).append(task)
        for unit in units.values():
            turn = self._round_of[unit[0]]
            if turn not in self._rounds:
                self._rounds[turn] = []
                insort(self._turns, turn)
            self._rounds[turn].append(tuple(unit))
            self._ordered.discard(turn)
            self._count(unit, 1)

    def measured(self, group: Hashable, seconds: float) -> None:
        """Take in that a task of a group took so many seconds."""
        entry = self._groups[group]
        entry.seconds += seconds
        entry.count += 1
        self._known_seconds += seconds
        self._known_prior += entry.prior

    def mean(self, group: Hashable) -> float | None:
        """Return the mean measured time of a task of a group in s; None if none was measured."""
        entry = self._groups[group]
        return entry.seconds / entry.count if entry.count else None

    def estimate(self, group: Hashable) -> float:
        """Return the estimated time of one task of a group in s; its prior before any is known."""
        mean, prior = self.mean(group), self._groups[group].prior
        if mean is not None or not self._known_prior:
            return prior if mean is None else mean
        return prior * self._known_seconds / self._known_prior

    def seconds_left(self, in_flight: Iterable[int], workers: int) -> float | None:
        """Return the estimated time in s until so many workers are done; None if nothing is known.

        The tasks in flight are half done.
        """
        if not self._known_prior:
            return None
        left: dict[Hashable, float] = {n: group.waiting for n, group in self._groups.items()}
        for task in in_flight:
            left[self.group_of[task]] += 0.5
        return sum(count * self.estimate(name) for name, count in left.items()) / workers

    def take(self, time_left: float = math.inf) -> Unit:
        """Return the next unit; an empty one if none waits or fits into ``time_left`` (s)."""
        for turn in self._turns:
            units = self._rounds[turn]
            if turn not in self._ordered:
                self._ordered.add(turn)
                # of units as long as one another the first that was added goes first
                units.reverse()
                units.sort(key=self._length)
            if not self._fits(units[0], time_left):
                continue  # nor does a longer one
            place = next(k for k in reversed(range(len(units))) if self._fits(units[k], time_left))
            unit = units.pop(place)
            if not units:
                del self._rounds[turn]
                self._turns.remove(turn)
            self._count(unit, -1)
            return unit
        return ()

    def _count(self, unit: Iterable[int], by: int) -> None:
        for task in unit:
            self._groups[self.group_of[task]].waiting += by
            self.waiting += by

    def _length(self, unit: Unit) -> float:
        return len(unit) * self.estimate(self.group_of[unit[0]])

    def _fits(self, unit: Unit, time_left: float) -> bool:
        return not self._known_prior or self._length(unit) <= time_left
