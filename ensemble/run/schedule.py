"""Choose the next task: by rounds, in a round the longest first, by estimates that improve.

Tasks come in groups that take about the same time (a cell of the sweep, say) and in rounds (its
realisations): a round is handed out before the next one begins, so that a run which is interrupted
leaves averages over about as many realisations in every cell. Within a round the longest go first,
so that the ranks end together. Before anything is known, a group's prior says how long its tasks
take compared with the others; each measured time corrects it.
"""

from __future__ import annotations

import heapq
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field


@dataclass
class _Group:
    prior: float
    waiting: list[tuple[int, int]] = field(default_factory=list)  # heap of (round, task)
    seconds: float = 0.0
    count: int = 0

    @property
    def mean(self) -> float:
        return self.seconds / self.count


class Schedule:
    """Tasks that wait, ordered by round and estimated time.

    ``group_of`` and ``round_of`` also hold the tasks that are added later; without ``round_of`` all
    are of one round. ``priors`` are relative times of a task of each group, positive.
    """

    def __init__(
        self,
        tasks: Iterable[int],
        group_of: Mapping[int, Hashable],
        priors: Mapping[Hashable, float],
        round_of: Mapping[int, int] | None = None,
    ) -> None:
        self._groups = {name: _Group(prior) for name, prior in priors.items()}
        self._group_of = group_of
        self._round_of = round_of
        self._names = list(self._groups)
        self._index = {name: i for i, name in enumerate(self._names)}
        self._known_seconds = 0.0
        self._known_prior = 0.0
        self.waiting = 0
        # Entries (round, -time, group), of groups not yet measured by prior, of measured ones by
        # mean time. An entry that no longer says what its group is like is stale, and dropped.
        self._unknown: list[tuple[int, float, int]] = []
        self._known: list[tuple[int, float, int]] = []
        self.add(tasks)

    def add(self, tasks: Iterable[int]) -> None:
        """Let further tasks wait."""
        touched = set()
        for task in tasks:
            name = self._group_of[task]
            turn = 0 if self._round_of is None else self._round_of[task]
            heapq.heappush(self._groups[name].waiting, (turn, task))
            touched.add(name)
            self.waiting += 1
        for name in touched:
            self._enter(name)

    def measured(self, group: Hashable, seconds: float, count: int = 1) -> None:
        """Take in that ``count`` tasks of a group took ``seconds`` altogether."""
        entry = self._groups.get(group)
        if entry is None or count < 1 or not seconds >= 0:
            return
        entry.seconds += seconds
        entry.count += count
        self._known_seconds += seconds
        self._known_prior += entry.prior * count
        self._enter(group)

    def estimate(self, group: Hashable) -> float | None:
        """Return the estimated time of one task of a group in s; None if nothing is known yet."""
        mean, scale = self.mean(group), self._scale
        if mean is not None or scale is None:
            return mean
        return self._groups[group].prior * scale

    def mean(self, group: Hashable) -> float | None:
        """Return the mean measured time of a task of a group in s; None if none was measured."""
        entry = self._groups[group]
        return entry.mean if entry.count else None

    @property
    def mean_estimate(self) -> float | None:
        """Mean measured time of a task in s."""
        count = sum(g.count for g in self._groups.values())
        return self._known_seconds / count if count else None

    @property
    def seconds_waiting(self) -> float | None:
        """Estimated time of all waiting tasks, one after the other, in s."""
        if self._scale is None:
            return None
        return sum(
            len(g.waiting) * (self.estimate(name) or 0.0) for name, g in self._groups.items()
        )

    def take(self, time_left: float | None = None) -> int | None:
        """Return the next task, or None if none waits or fits into ``time_left`` (s)."""
        if not self.waiting:
            return None
        name = self._next()
        if time_left is not None and not self._fits(name, time_left):
            fitting = [n for n, g in self._groups.items() if g.waiting and self._fits(n, time_left)]
            if not fitting:
                return None
            name = min(
                fitting, key=lambda n: (self._groups[n].waiting[0][0], -(self.estimate(n) or 0.0))
            )
        self.waiting -= 1
        _, task = heapq.heappop(self._groups[name].waiting)
        self._enter(name)
        return task

    def _enter(self, name: Hashable) -> None:
        """Note where a group stands now."""
        group = self._groups[name]
        if group.waiting:
            turn = group.waiting[0][0]
            if group.count:
                heapq.heappush(self._known, (turn, -group.mean, self._index[name]))
            else:
                heapq.heappush(self._unknown, (turn, -group.prior, self._index[name]))

    def _next(self) -> Hashable:
        """Return the group whose task is next: of the first round that waits, the longest."""
        unknown, known = self._top(self._unknown), self._top(self._known)
        if unknown is None or known is None:
            top = unknown or known
            assert top is not None
            return top[1]
        if unknown[0] != known[0]:
            return min(unknown, known, key=lambda entry: entry[0])[1]
        return max(known[1], unknown[1], key=lambda n: self.estimate(n) or 0.0)

    def _top(self, heap: list[tuple[int, float, int]]) -> tuple[int, Hashable] | None:
        while heap:
            turn, value, i = heap[0]
            group = self._groups[self._names[i]]
            if group.waiting and group.waiting[0][0] == turn:
                now = group.mean if group.count else group.prior
                if (heap is self._known) == bool(group.count) and -value == now:
                    return turn, self._names[i]
            heapq.heappop(heap)
        return None

    @property
    def _scale(self) -> float | None:
        return self._known_seconds / self._known_prior if self._known_prior else None

    def _fits(self, name: Hashable, time_left: float) -> bool:
        seconds = self.estimate(name)
        return seconds is None or seconds <= time_left
