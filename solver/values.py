"""Base of the dataclasses of inputs and results."""

from __future__ import annotations

import math
from dataclasses import Field, fields
from typing import Any, TypeVar

import numpy as np

from adhesis.solver.views import NotebookDisplay

T = TypeVar("T")

_LONGEST_TUPLE = 4  # entries of a tuple that are shown in full


def finite(value: float) -> float | None:
    """Return a number, or None for one that JSON does not have: infinity and NaN."""
    return value if math.isfinite(value) else None


class ByValue(NotebookDisplay):
    """Read-only arrays, equality by value and a short repr, for a frozen dataclass.

    The dataclass is declared with ``eq=False, repr=False``. Two objects are equal if they have the
    same class and agree in all fields without ``compare=False``: arrays in shape and every entry,
    NaN being equal to NaN. Equal objects have equal hashes.
    """

    def __post_init__(self) -> None:
        """Make every array read-only; the owner of its memory may still write to it."""
        for name, value in self.__dict__.items():  # no name is added or removed
            if isinstance(value, np.ndarray) and value.flags.writeable:
                view = value.view()
                view.setflags(write=False)
                self.__dict__[name] = view

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a copy or pickle, with read-only arrays as well."""
        self.__dict__.update(state)
        ByValue.__post_init__(self)

    def __eq__(self, other: object) -> bool:
        """Compare class and fields."""
        if self is other:
            return True
        if type(self) is not type(other):
            return NotImplemented
        return all(
            _equal(getattr(self, entry.name), getattr(other, entry.name))
            for entry in _compared(self)
        )

    def __hash__(self) -> int:
        """Return the hash of the compared fields."""
        return hash((type(self), *(_hashable(getattr(self, e.name)) for e in _compared(self))))

    def __repr__(self) -> str:
        """Return one line, with only the size of arrays and long tuples."""
        shown = (
            f"{entry.name}={brief(getattr(self, entry.name))}"
            for entry in fields(self)  # type: ignore[arg-type]  # every subclass is a dataclass
            if entry.repr
        )
        return f"{type(self).__name__}({', '.join(shown)})"


def with_values(value: T, **changed: Any) -> T:
    """Return a copy with other values of some fields, which need no check."""
    copy = object.__new__(type(value))  # dataclasses.replace() takes ten times as long
    copy.__dict__.update(value.__dict__, **changed)
    return copy


def _compared(value: ByValue) -> list[Field[Any]]:
    return [entry for entry in fields(value) if entry.compare]  # type: ignore[arg-type]


def _equal(one: Any, two: Any) -> bool:
    if isinstance(one, np.ndarray) and isinstance(two, np.ndarray):
        numeric = one.dtype.kind in "fc" and two.dtype.kind in "fc"
        return bool(np.array_equal(one, two, equal_nan=numeric))
    if isinstance(one, float) and isinstance(two, float):
        return one == two or (one != one and two != two)
    return bool(one == two)


def _hashable(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        numeric = value.dtype.kind in "fc"
        return value.shape, (value + 0.0 if numeric else value).tobytes()  # -0.0 is equal to 0.0
    if isinstance(value, float) and value != value:
        return "nan"
    return value


def brief(value: Any) -> str:
    """Return a value as text, of arrays and long tuples only the size."""
    if isinstance(value, np.ndarray):
        return f"<array of {' × '.join(map(str, value.shape))}>"
    if isinstance(value, tuple) and len(value) > _LONGEST_TUPLE:
        return f"<{len(value)} in all>"
    if isinstance(value, float):
        return f"{value:.6g}"
    return repr(value)
