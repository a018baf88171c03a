"""Streaming a results file that is larger than memory: some rows, or some columns, at once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

# Numbers read at once (8 bytes each): large enough for the disk, small enough for any machine.
READ_AT_ONCE = 2_000_000
# Numbers held at once while quantiles are taken (numpy copies them once more).
HELD_AT_ONCE = 8_000_000


def row_blocks(rows: NDArray[np.intp], width: int) -> Iterator[NDArray[np.intp]]:
    """Split rows of ``width`` numbers, a bounded number of bytes each."""
    step = max(1, READ_AT_ONCE // max(1, width))
    for start in range(0, rows.size, step):
        yield rows[start : start + step]


def column_blocks(rows: int, points: int) -> Iterator[slice]:
    """Split the columns of so many rows: at most :data:`HELD_AT_ONCE` numbers, or one column."""
    width = max(1, HELD_AT_ONCE // max(1, rows))
    for start in range(0, points, width):
        yield slice(start, min(points, start + width))
