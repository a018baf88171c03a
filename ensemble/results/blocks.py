"""Streaming a results file that is larger than memory: blocks of rows, blocks of columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.results.read import Results

# Numbers read at once (8 bytes each): large enough for the disk, small enough for any machine.
READ_AT_ONCE = 2_000_000
# Numbers held at once while quantiles are taken (numpy copies them once more).
HELD_AT_ONCE = 8_000_000


def row_blocks(rows: int, width: int) -> Iterator[slice]:
    """Slices that cover ``rows`` rows of ``width`` numbers, a bounded number of bytes each."""
    step = max(1, READ_AT_ONCE // max(1, width))
    for start in range(0, rows, step):
        yield slice(start, min(rows, start + step))


def cells_of_rows(rows: Sequence[NDArray[np.intp]], count: int) -> NDArray[np.int64]:
    """Return the cell of each of ``count`` rows, from the rows of each cell; -1 for none."""
    out = np.full(count, -1)
    for k, mine in enumerate(rows):
        out[mine] = k
    return out


def column_blocks(
    results: Results, name: str, rows: NDArray[np.intp], points: int
) -> Iterator[tuple[slice, NDArray[np.float64]]]:
    """Yield the values of ascending ``rows`` of a dataset (task × points), a few columns at a time.

    At most :data:`HELD_AT_ONCE` numbers, at least one column.
    """
    width = max(1, min(points, HELD_AT_ONCE // max(1, rows.size)))
    for start in range(0, points, width):
        columns = slice(start, min(points, start + width))
        values = np.empty((rows.size, columns.stop - start))
        for block in row_blocks(len(results), points):
            low, high = np.searchsorted(rows, (block.start, block.stop))
            if low < high:
                values[low:high] = results.column(name, block)[
                    rows[low:high] - block.start, columns
                ]
        yield columns, values
