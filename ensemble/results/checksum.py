"""Checksums of the rows of a results file.

The checksum of a row is the CRC-32 of what it holds, in the order that ``docs/results-file.md``
states. It finds every damage of up to 32 successive bits, and any other with a chance of all but
one in 4·10⁹. Damage is an accident here, not an attack, so that no cryptographic digest is needed:
readers compute the checksum of every row, and BLAKE2b takes more than four times as long.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.results.schema import CHECKSUM, ROW_DATASETS, STATUS
from adhesis.ensemble.task.dataset import KEPT, Dataset

_BLOCK_BYTES = 16 * 2**20

Read = Callable[[str, slice], NDArray[Any]]
"""Returns some rows of a dataset, by its name."""


_ORDERED = sorted((d for d in ROW_DATASETS if d is not CHECKSUM), key=lambda d: d.name)
# The datasets that the checksum of a row covers, in its order: what a run writes, not what the task
# is. A row thus keeps its checksum when the campaign grows by an axis. The tasks never change, and
# the checksum of the head covers them (adhesis.ensemble.results.head).
OF_TASKS = tuple(d for d in _ORDERED if d.dims[0] != KEPT)
OF_KEPT = tuple(d for d in _ORDERED if d.dims[0] == KEPT)


def checksum(parts: Iterable[NDArray[Any]], start: int = 0) -> int:
    """Return the checksum of arrays as little-endian bytes, after ``start``, of those before."""
    for part in parts:
        start = zlib.crc32(_bytes(part).data, start)
    return start


def _bytes(rows: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the little-endian bytes of rows, a line for each."""
    little = rows.astype(rows.dtype.newbyteorder("<"), copy=False)
    return np.ascontiguousarray(little).reshape(len(rows), -1).view(np.uint8)


def row_checksums(read: Read, kept: NDArray[np.intp], rows: NDArray[np.intp]) -> NDArray[np.uint32]:
    """Compute the checksums of some rows from what they hold; a block is in memory at a time.

    ``kept`` are the rows that keep their fields; both they and ``rows`` ascend.
    """
    out = np.zeros(rows.size, np.uint32)
    places = dict(zip(kept.tolist(), range(kept.size), strict=True))
    done, step = 0, 1  # the first row shows how long one is
    while done < rows.size:
        first = int(rows[done])
        last = done + int(np.searchsorted(rows[done:], first + step))
        stretch = slice(first, int(rows[last - 1]) + 1)
        block = np.concatenate([_bytes(read(d.name, stretch)) for d in OF_TASKS], axis=1)
        step = max(1, _BLOCK_BYTES // block.shape[1])
        for number, row in enumerate(rows[done:last].tolist(), done):
            value = zlib.crc32(block[row - first].data)
            if row in places:
                here = slice(places[row], places[row] + 1)
                value = checksum((read(d.name, here) for d in OF_KEPT), value)
            out[number] = value
        done = last
    return out


def empty_checksums(file: h5py.File, status: int, rows: NDArray[np.intp]) -> NDArray[np.uint32]:
    """Return the checksums that rows have if they hold nothing but a status."""

    def empty(dataset: Dataset) -> NDArray[Any]:
        here, fill = file[dataset.name], status if dataset is STATUS else dataset.fill
        return np.full((1, *here.shape[1:]), fill, here.dtype)

    of_tasks = checksum(map(empty, OF_TASKS))
    of_kept = checksum(map(empty, OF_KEPT), of_tasks)
    return np.where(np.isin(rows, file[KEPT][:]), of_kept, of_tasks).astype(np.uint32)
