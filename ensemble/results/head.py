"""The checksum of all bytes of a results file that belong to no row.

A run changes rows alone: what HDF5 keeps about the datasets, the root attributes, the dimension
scales and the tasks never change after the file is laid out. Their checksum stands before HDF5's
own bytes, in the user block, together with the places of the rows. It is compared before HDF5 reads
the file, because HDF5 can crash over damaged bytes of its own.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import h5py

from ensemble.results.schema import ROW_DATASETS

SIZE = 4096  # of the user block: a power of two of at least 512
_MARK = b"adhesis head 1\n\0"
# After the mark: checksum, number of ranges of rows, size of the file; then (first byte, bytes) of
# each range, ascending.
_START, _RANGE = struct.Struct("<16sIIQ"), struct.Struct("<QQ")
_PIECE = 2**20
# HDF5 marks its first bytes (version 0 of its superblock) while a file is open for writing.
_FLAGS = (SIZE + 20, 4)


def write_head(path: Path) -> None:
    """Write the user block of a file that is laid out."""
    with h5py.File(path, "r", locking=False) as file:
        found = [file[d.name].id for d in ROW_DATASETS if d.name in file]
        ranges = sorted(
            (place, dataset.get_storage_size())
            for dataset in found
            if (place := dataset.get_offset()) is not None
        )
    ranges.insert(0, _FLAGS)
    table = b"".join(_RANGE.pack(*entry) for entry in ranges)
    size = path.stat().st_size
    with path.open("r+b") as handle:
        handle.write((_START.pack(_MARK, 0, len(ranges), size) + table).ljust(SIZE, b"\0"))
        checksum = _checksum(handle, ranges, size)
        handle.seek(0)
        handle.write(_START.pack(_MARK, checksum, len(ranges), size))


def check_head(path: Path) -> bool | None:
    """Return whether a file has the checksum of its head; None if there is none to compare.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with path.open("rb") as handle:
        mark, checksum, count, size = _START.unpack(handle.read(_START.size).ljust(_START.size))
        if mark != _MARK:
            return None
        if count > (SIZE - _START.size) // _RANGE.size or size != os.fstat(handle.fileno()).st_size:
            return False
        table = handle.read(count * _RANGE.size)
        found = _checksum(handle, list(_RANGE.iter_unpack(table)), size)
        return bool(found == checksum)


def _checksum(handle: BinaryIO, ranges: list[tuple[int, int]], size: int) -> int:
    """Return the CRC-32 of a file, without the ranges, its own four bytes taken for zero."""
    place, value = 0, 0
    for first, length in [*ranges, (size, 0)]:
        for piece in _pieces(handle, place, first):
            if place == 0:
                start, place = len(_MARK), 1
                piece = piece[:start] + b"\0\0\0\0" + piece[start + 4 :]
            value = zlib.crc32(piece, value)
        place = max(place, first + length)
    return value


def _pieces(handle: BinaryIO, first: int, stop: int) -> Iterator[bytes]:
    handle.seek(first)
    while first < stop:
        piece = handle.read(min(_PIECE, stop - first))
        if not piece:
            return
        first += len(piece)
        yield piece
