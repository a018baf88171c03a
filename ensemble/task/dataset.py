"""Describe a dataset of the results, and a dimension: names, units, meanings, shapes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

FLOAT, COUNT, FLAG = "f8", "i4", "i1"
FIELD = "f4"  # fields are looked at and averaged; seven digits are plenty

# First dimension of the datasets that only the first realisations have rows of.
KEPT = "field_task"


@dataclass(frozen=True)
class Dataset:
    """One dataset, a row for each task; or one dimension of such datasets (:func:`scale`)."""

    name: str
    unit: str  # as UDUNITS reads it; "1" if there is none
    meaning: str  # for the attribute ``long_name``
    dtype: str = FLOAT  # numpy's name of the type
    dims: tuple[str, ...] = ("task",)  # names of the dimensions, ``task`` or ``field_task`` first
    attributes: Mapping[str, Any] = field(default_factory=dict)  # further attributes
    # How its row is taken from a loop (:mod:`adhesis.ensemble.task.row`); None where it is not
    value: Callable[..., Any] | None = field(default=None, compare=False)
    numbers: Any = field(default=None, compare=False)  # of a dimension, which has none itself

    @property
    def fill(self) -> Any:
        """Value of rows that hold no result: NaN, -1, 0 for the status, empty for texts."""
        kind = np.dtype(self.dtype).kind
        return {"f": np.nan, "i": -1, "u": 0, "S": b""}[kind]

    @property
    def described(self) -> dict[str, Any]:
        """The attributes that it has in a file."""
        return {"units": self.unit, "long_name": self.meaning, **self.attributes}


def scale(name: str, numbers: NDArray[Any], unit: str, meaning: str) -> Dataset:
    """Return one dimension: its numbers, with unit and meaning."""
    return Dataset(name, unit, meaning, numbers.dtype.str, (), numbers=numbers)


def sizes_of(scales: Iterable[Dataset]) -> dict[str, int]:
    """Return the length of each dimension."""
    return {scale.name: scale.numbers.size for scale in scales}


def row_shape(dataset: Dataset, sizes: Mapping[str, int]) -> tuple[int, ...]:
    """Return the shape of one row of a dataset, from the lengths of the dimensions."""
    return tuple(sizes[dim] for dim in dataset.dims[1:])


def flags(names: tuple[str, ...], dtype: str) -> dict[str, Any]:
    """Return the attributes that say what the numbers of a dataset stand for (CF conventions)."""
    return {
        "flag_values": np.arange(len(names), dtype=dtype),
        "flag_meanings": " ".join(name.replace(" ", "_") for name in names),
    }
