"""The axes of a campaign: keys that hold several values, and the points that these make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, product

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
    member = {name: tuple(names) for names in zipped for name in names}
    groups: dict[tuple[str, ...], list[Axis]] = {}
    for axis in axes:
        groups.setdefault(member.get(axis.name, (axis.name,)), []).append(axis)
    out = []
    for group in groups.values():
        rows = sorted(zip(*(axis.values for axis in group), strict=True))
        columns = zip(*rows, strict=True)
        out.append([replace(a, values=values) for a, values in zip(group, columns, strict=True)])
    return out


def points(axes: Sequence[Axis], groups: Sequence[Sequence[Axis]]) -> list[tuple[Value, ...]]:
    """Return all combinations of the groups, the last one varying fastest, in the order of axes."""
    rows = [list(zip(*(axis.values for axis in group), strict=True)) for group in groups]
    names = [axis.name for group in groups for axis in group]
    place = [names.index(axis.name) for axis in axes]
    flat = (list(chain.from_iterable(parts)) for parts in product(*rows))
    return [tuple(values[i] for i in place) for values in flat]
