"""Tasks that are handed out together, since they share work; each is answered on its own.

The unit is known by its first task: that one is scheduled, and the others follow it to its rank.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass


@dataclass
class _Unit:
    tasks: tuple[int, ...]
    left: int
    seconds: float = 0.0
    whole: bool = True  # nothing failed or was given up


class Units:
    """Units of tasks: those with the same key; a task without a key is one of its own."""

    def __init__(self, key_of: Mapping[int, Hashable] | None = None) -> None:
        self._key_of = key_of or {}
        self._units: dict[int, _Unit] = {}  # by first task
        self._first: dict[int, int] = {}

    def form(self, tasks: Iterable[int]) -> list[int]:
        """Join tasks into units; returns the first task of each, in the order of the tasks."""
        found: dict[Hashable, list[int]] = {}
        for task in tasks:
            key = self._key_of.get(task)
            found.setdefault(("alone", task) if key is None else ("shared", key), []).append(task)
        for together in found.values():
            if len(together) > 1:
                self._units[together[0]] = _Unit(tuple(together), len(together))
                self._first |= dict.fromkeys(together, together[0])
        return [together[0] for together in found.values()]

    def tasks(self, first: int) -> tuple[int, ...]:
        """Return the tasks of a unit, to be done in this order."""
        return self._units[first].tasks if first in self._units else (first,)

    def answered(self, task: int, seconds: float | None) -> tuple[int, float] | None:
        """Take in that a task took ``seconds``, or None if it has no result.

        Returns first task and time of its unit, if that is now done as a whole.
        """
        if task not in self._first:
            return None if seconds is None else (task, seconds)
        first = self._first.pop(task)
        unit = self._units[first]
        unit.left -= 1
        if seconds is None:
            unit.whole = False
        else:
            unit.seconds += seconds
        if unit.left:
            return None
        del self._units[first]
        return (first, unit.seconds) if unit.whole else None
