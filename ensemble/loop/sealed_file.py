"""A netCDF file with its checksum behind it, which is compared before HDF5 reads a byte.

HDF5 can crash over damaged bytes of its own, and takes those of its data as they are. Behind the
end of a netCDF file, where its readers do not look, stands the SHA-256 of all bytes before. Another
program that changes the file leaves the checksum wrong or cuts it off.
"""

from __future__ import annotations

import hashlib
import io
import os
from pathlib import Path
from typing import Any

import h5py
import xarray as xr

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.regular_file import open_regular

_MARK = b"\nadhesis SHA-256 "
_LENGTH = len(_MARK) + 2 * hashlib.sha256().digest_size + 1
_MOST_BYTES = 2**31  # a path of a million states has a tenth of it


def sealed(content: bytes) -> bytes:
    """Return the bytes of a file with their checksum behind them."""
    return content + _seal(content)


def _seal(content: bytes) -> bytes:
    return _MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"


def read_sealed(path: Path) -> xr.Dataset:
    """Read a netCDF file that was sealed, as it stands there: nothing is scaled or decoded.

    InputError without its checksum, or if it holds anything but datasets of its own.
    """
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        stream.seek(max(0, size - _LENGTH))
        if not stream.read(len(_MARK)) == _MARK:
            raise InputError(
                f"path is {path}: it has no checksum at its end, so it was not saved by adhesis, "
                "was cut off, or another program has changed it"
            )
        if size > _MOST_BYTES:
            raise InputError(f"path is {path}: it has {size / 1e6:.0f} MB, more than any loop")
        stream.seek(0)
        content = stream.read(size)
    content, seal = content[:-_LENGTH], content[-_LENGTH:]
    if seal != _seal(content):
        raise InputError(
            f"path is {path}: it is damaged, as its bytes do not have their checksum; take a copy "
            "of it, or compute the loop again"
        )
    with h5py.File(io.BytesIO(content), "r") as file:
        _check_members(path, file, len(content))
    as_stored: Any = dict.fromkeys(("mask_and_scale", "decode_times", "decode_coords"), False)
    with xr.open_dataset(io.BytesIO(content), engine="h5netcdf", **as_stored) as found:
        return found.load()


def _check_members(path: Path, file: h5py.File, size: int) -> None:
    """Refuse what would be read from elsewhere, or is larger than the file, before it is read."""
    for name in file:
        own = isinstance(file.get(name, getlink=True), h5py.HardLink)
        found = file[name] if own else None
        if (
            not isinstance(found, h5py.Dataset)
            or found.is_virtual
            or found.external
            or (found.size or 0) * found.dtype.itemsize > size
        ):
            raise InputError(
                f"path is {path}: it holds {name!r} otherwise than adhesis saves a loop or path"
            )
