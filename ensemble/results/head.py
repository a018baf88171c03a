"""The checksum of all bytes of a results file that belong to no row.

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
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import h5py
import numpy as np

from adhesis.ensemble.regular_file import open_regular
from adhesis.ensemble.results.schema import ROW_DATASETS

HEAD = "head"
_MARK = b"adhesis head 1: "
_LENGTH = 8192  # of the attribute: eighty places of rows and more
# The attribute is the first thing that is written: it lies within so many bytes.
_NEAR = 2**16
_PIECE = 2**20
# HDF5 marks these bytes of its superblock (version 0) while a file is open for writing.
_FLAGS = (20, 4)

_Ranges = Sequence[tuple[int, int]]


def reserve_head(file: h5py.File) -> None:
    """Make the attribute, before anything else, in a file that is laid out."""
    file.attrs.create(HEAD, np.bytes_(_MARK.ljust(_LENGTH, b".")))


def write_head(path: Path) -> None:
    """Fill the attribute of a file that is laid out."""
    with h5py.File(path, "r", locking=False) as file:
        found = [file[d.name].id for d in ROW_DATASETS]
        rows = [
            (place, dataset.get_storage_size())
            for dataset in found
            if (place := dataset.get_offset()) is not None
        ]
    size = path.stat().st_size
    with path.open("r+b") as handle:
        place = handle.read(_NEAR).index(_MARK)
        ranges = sorted([_FLAGS, (place, _LENGTH), *rows])
        table = f"{size} " + " ".join(f"{first}+{length}" for first, length in ranges) + " "
        checksum = _checksum(handle, table.encode(), ranges, size)
        handle.seek(place)
        handle.write((_MARK + f"{checksum:08x} ".encode() + table.encode()).ljust(_LENGTH, b"."))


def check_head(path: Path) -> bool:
    """Return whether a file has the checksum of its head (OSError, InputError).

    ValueError if it has no head: it is no results file.
    """
    with open_regular(path) as handle:
        place = handle.read(_NEAR).index(_MARK)
        handle.seek(place)
        text = handle.read(_LENGTH).removeprefix(_MARK)
        try:
            checksum, table = int(text[:8], 16), text[9:].rstrip(b".")
            size, *words = table.split()
            ranges = [(int(a), int(b)) for a, b in (word.split(b"+") for word in words)]
            known = os.fstat(handle.fileno()).st_size
            whole = (_MARK + text[:8] + b" " + table).ljust(_LENGTH, b".") == _MARK + text
            if int(size) != known or not whole or (place, _LENGTH) not in ranges:
                return False
        except ValueError:
            return False
        return _checksum(handle, table, ranges, known) == checksum


def _checksum(handle: BinaryIO, table: bytes, ranges: _Ranges, size: int) -> int:
    """Return the CRC-32 of the places of the rows, and of a file without them."""
    place, value = 0, zlib.crc32(table)
    for first, length in [*ranges, (size, 0)]:
        handle.seek(place)
        while place < first and (piece := handle.read(min(_PIECE, first - place))):
            value = zlib.crc32(piece, value)
            place += len(piece)
        place = max(place, first + length)
    return value
