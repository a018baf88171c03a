"""Checksums of a results file: of every row, and of all bytes that belong to none.

The checksum of a row is the CRC-32 of what it holds, in the order that ``docs/results-file.md``
states. It finds every damage of up to 32 successive bits, and any other with a chance of all but
one in 4·10⁹. Damage is an accident here, not an attack, so that no cryptographic digest is needed:
readers compute the checksum of every row, and BLAKE2b takes more than four times as long.

A run changes rows alone: what HDF5 keeps about the datasets, the root attributes, the dimension
scales and the tasks never change after the file is laid out. Their checksum stands, together with
the places of the rows, in the text of the root attribute ``head``. It is found by its first words
and compared before HDF5 reads the file, because HDF5 can crash over damaged bytes of its own.

The text is 8192 characters long: its name, the CRC-32 as eight hexadecimal digits, the size of the
file, and ranges of bytes, each as first byte + length. The CRC-32 is that of the text from the size
on, and then of all bytes outside the ranges: those of the rows, of this text, and of four bytes
that HDF5 sets while it writes.
"""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.files import open_regular
from adhesis.ensemble.results.schema import CHECKSUM, ROW_DATASETS, STATUS
from adhesis.ensemble.task.dataset import KEPT, Dataset

_BLOCK_BYTES = 16 * 2**20

_ORDERED = sorted((d for d in ROW_DATASETS if d is not CHECKSUM), key=lambda d: d.name)
# The datasets that the checksum of a row covers, in its order: what a run writes, not what the task
# is. A row thus keeps its checksum when the campaign grows by an axis. The tasks never change, and
# the checksum of the head covers them.
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


def row_checksums(
    read: Callable[[str, slice], NDArray[Any]], kept: NDArray[np.intp], rows: NDArray[np.intp]
) -> NDArray[np.uint32]:
    """Compute the checksums of some rows from what they hold; a block is in memory at a time.

    ``read`` returns some rows of a dataset, by its name; ``kept`` are the rows that keep their
    fields; both they and ``rows`` ascend.
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


# ---------------------------------------------------------------------- the head

HEAD = "head"
_MARK = b"adhesis head 1: "
_LENGTH = 8192  # of the attribute: eighty places of rows and more
# The attribute is the first thing that is written: it lies within so many bytes.
_NEAR = 2**16
_PIECE = 2**20
# HDF5 marks these bytes of its superblock (version 0) while a file is open for writing.
_FLAGS = (20, 4)


def reserve_head(file: h5py.File) -> None:
    """Make the attribute, before anything else, in a file that is laid out."""
    file.attrs.create(HEAD, np.bytes_(_MARK.ljust(_LENGTH, b".")))


def write_head(path: Path) -> None:
    """Fill the attribute of a file that is laid out."""
    with h5py.File(path, "r", locking=False) as file:
        found = [file[d.name].id for d in ROW_DATASETS]
        rows = [(d.get_offset(), d.get_storage_size()) for d in found if d.get_offset() is not None]
    with path.open("r+b") as handle:
        place = handle.read(_NEAR).index(_MARK)
        text = _text(handle, sorted([_FLAGS, (place, _LENGTH), *rows]))
        handle.seek(place)
        handle.write(text)


def check_head(path: Path) -> bool:
    """Return whether a file has the checksum of its head (OSError, InputError).

    ValueError if it has no head: it is no results file.
    """
    with open_regular(path) as handle:
        place = handle.read(_NEAR).index(_MARK)
        handle.seek(place)
        text = handle.read(_LENGTH)
        found = re.findall(rb"(\d{1,18})\+(\d{1,18})", text)
        ranges = [(int(first), int(length)) for first, length in found]
        return (place, _LENGTH) in ranges and _text(handle, ranges) == text


def _text(handle: BinaryIO, ranges: Sequence[tuple[int, int]]) -> bytes:
    """Return the text of the attribute for a file with rows at these places."""
    size = os.fstat(handle.fileno()).st_size
    table = f"{size} {' '.join(f'{first}+{length}' for first, length in ranges)} ".encode()
    place, value = 0, zlib.crc32(table)
    for first, length in [*ranges, (size, 0)]:
        handle.seek(place)
        while place < first and (piece := handle.read(min(_PIECE, first - place))):
            value = zlib.crc32(piece, value)
            place += len(piece)
        place = max(place, first + length)
    return (_MARK + f"{value:08x} ".encode() + table).ljust(_LENGTH, b".")
