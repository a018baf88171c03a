"""The axes of a campaign: keys that hold several values, and the points that these make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

Value = float
"""A value on an axis: a float, or an int where the key is a whole number."""


@dataclass(frozen=True)
class Axis:
    """One key of a campaign that has several values (H and γ always are axes)."""

    # table, name: where the key stands: "profile", "ratio"
    table: str
    name: str
    # As they are combined: ascending, or, where keys vary together, in the order of the first
    values: tuple[Value, ...]
    unit: str
    meaning: str

    @property
    def key(self) -> str:
        """As "profile.ratio"."""
        return f"{self.table}.{self.name}"


def aligned(axes: Sequence[Axis], zipped: Sequence[Sequence[str]]) -> list[list[Axis]]:
    """Return the axes in groups that vary together, in the order of the axes, values sorted.

    The order of the values in a file does not matter, except that those of keys which vary together
    belong to one another.
    """
    by_name = {axis.name: axis for axis in axes}
    member = {name: tuple(names) for names in zipped for name in names}
    groups: list[list[Axis]] = []
    seen: set[str] = set()
    for axis in axes:
        if axis.name in seen:
            continue
        together = [a for a in axes if a.name in member.get(axis.name, (axis.name,))]
        seen |= {a.name for a in together}
        rows = sorted(zip(*(by_name[a.name].values for a in together), strict=True))
        groups.append(
            [
                Axis(a.table, a.name, tuple(row[i] for row in rows), a.unit, a.meaning)
                for i, a in enumerate(together)
            ]
        )
    return groups


def points(axes: Sequence[Axis], groups: Sequence[Sequence[Axis]]) -> list[tuple[Value, ...]]:
    """Return all combinations of the groups, the last one varying fastest, in the order of axes."""
    rows = [list(zip(*(axis.values for axis in group), strict=True)) for group in groups]
    names = [axis.name for group in groups for axis in group]
    place = [names.index(axis.name) for axis in axes]
    found = []
    for parts in product(*rows):
        flat = [value for part in parts for value in part]
        found.append(tuple(flat[i] for i in place))
    return found
