"""Which task next: the longest first, by estimates that improve while the run goes on.

Tasks come in groups that take about the same time (one H and γ, say). Before anything is known, a
group's prior says how long its tasks take compared with the others; each measured time corrects it.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field


@dataclass
class _Group:
    prior: float
    waiting: deque[int] = field(default_factory=deque)
    seconds: float = 0.0
    count: int = 0


class Schedule:
    """Tasks that wait, ordered by estimated time.

    Parameters
    ----------
    tasks : sequence of int
        Ids of the tasks to do.
    group_of : mapping of int to hashable
        Group of each task.
    priors : mapping of hashable to float
        Relative time of a task of each group, positive.

    Attributes
    ----------
    waiting : int
        Tasks not handed out.
    """

    def __init__(
        self,
        tasks: Sequence[int],
        group_of: Mapping[int, Hashable],
        priors: Mapping[Hashable, float],
    ) -> None:
        self._groups = {name: _Group(prior) for name, prior in priors.items()}
        self._group_of = group_of
        for task in tasks:
            self._groups[group_of[task]].waiting.append(task)
        self.waiting = len(tasks)
        self._known_seconds = 0.0
        self._known_prior = 0.0
        self._names = list(self._groups)
        self._index = {name: i for i, name in enumerate(self._names)}
        # Groups not yet measured, by prior; measured ones, by mean time (entries go stale).
        self._unknown = [(-g.prior, i) for i, g in enumerate(self._groups.values())]
        heapq.heapify(self._unknown)
        self._known: list[tuple[float, int]] = []

    def measured(self, group: Hashable, seconds: float, count: int = 1) -> None:
        """Take in that ``count`` tasks of a group took ``seconds`` altogether."""
        entry = self._groups.get(group)
        if entry is None or count < 1 or not seconds >= 0:
            return
        entry.seconds += seconds
        entry.count += count
        self._known_seconds += seconds
        self._known_prior += entry.prior * count
        heapq.heappush(self._known, (-entry.seconds / entry.count, self._index[group]))

    def estimate(self, group: Hashable) -> float | None:
        """Return the estimated time of one task of a group in s; None if nothing is known yet."""
        mean, scale = self.mean(group), self._scale
        if mean is not None or scale is None:
            return mean
        return self._groups[group].prior * scale

    def mean(self, group: Hashable) -> float | None:
        """Return the mean measured time of a task of a group in s; None if none was measured."""
        entry = self._groups[group]
        return entry.seconds / entry.count if entry.count else None

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
        name = self._longest()
        if time_left is not None and not self._fits(name, time_left):
            fitting = [n for n, g in self._groups.items() if g.waiting and self._fits(n, time_left)]
            if not fitting:
                return None
            name = max(fitting, key=lambda n: self.estimate(n) or 0.0)
        self.waiting -= 1
        return self._groups[name].waiting.popleft()

    def _longest(self) -> Hashable:
        unknown, known = self._top_unknown(), self._top_known()
        if unknown is None or known is None:
            name = unknown if known is None else known
            assert name is not None
            return name
        return max(known, unknown, key=lambda n: self.estimate(n) or 0.0)

    def _top_unknown(self) -> Hashable | None:
        heap = self._unknown
        while heap and (self._at(heap[0][1]).count or not self._at(heap[0][1]).waiting):
            heapq.heappop(heap)
        return self._names[heap[0][1]] if heap else None

    def _top_known(self) -> Hashable | None:
        heap = self._known
        while heap:
            mean, i = heap[0]
            group = self._at(i)
            if group.waiting and mean == -group.seconds / group.count:
                return self._names[i]
            heapq.heappop(heap)
        return None

    def _at(self, index: int) -> _Group:
        return self._groups[self._names[index]]

    @property
    def _scale(self) -> float | None:
        return self._known_seconds / self._known_prior if self._known_prior else None

    def _fits(self, name: Hashable, time_left: float) -> bool:
        seconds = self.estimate(name)
        return seconds is None or seconds <= time_left
