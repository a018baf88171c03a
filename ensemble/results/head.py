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
import re
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
