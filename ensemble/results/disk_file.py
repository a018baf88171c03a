"""The file that HDF5 writes to: what the disk does not take is reported once, and by us.

HDF5 1.10 keeps what it could not write. It tries again when the file is closed and when the process
ends, prints what h5py makes of that, and ends the process with a segmentation fault. So every write
succeeds in its eyes; the error of the first that did not is raised by :meth:`DiskFile.check`.
"""

from __future__ import annotations

import errno
import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import h5py

from adhesis.ensemble.errors import InputError, WriteError
from adhesis.solver.runtime.uninterrupted import signals_held

# The disk or a limit is at fault, and not the name or its permissions.
_OF_THE_SYSTEM = {*(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO), errno.EMFILE, errno.ENFILE}


def refusal(error: OSError) -> type[InputError | WriteError]:
    """Return the kind of error by which a file that cannot be written is reported."""
    return WriteError if error.errno in _OF_THE_SYSTEM else InputError


class DiskFile(io.RawIOBase):
    """A file object for h5py, of a new file on disk ("x+b") or an old one ("r+b")."""

    def __init__(self, path: Path, mode: Literal["x+b", "r+b"]) -> None:
        self._file = path.open(mode, buffering=0)
        self._error: OSError | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file; what could not be written comes before an error that followed from it."""
        self.close()
        if error is None or isinstance(error, (OSError, RuntimeError)):
            self.check()

    def check(self) -> None:
        """Raise the first error (OSError)."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Close the file, after h5py has closed its own."""
        try:
            if hasattr(self, "_file"):  # Python closes the object also if it could not be opened
                self._file.close()
        except OSError as error:  # some disks report only now that they are full
            self._error = self._error or error
        super().close()

    def seek(self, offset: int, whence: int = 0) -> int:
        """Move to a place."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Return the place."""
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        """Read from here."""
        return self._file.readinto(buffer) or 0

    def write(self, data: Any) -> int:
        """Write here."""
        rest = memoryview(data).cast("B")
        length = rest.nbytes
        try:
            while rest.nbytes:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self._error = self._error or error
        return length

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0

    def flush(self) -> None:
        """Do nothing: nothing is held back."""


@contextmanager
def opened(path: Path, mode: Literal["x+b", "r+b"]) -> Iterator[tuple[h5py.File, DiskFile]]:
    """Open a results file to write, new or old, by one process.

    Signals are held back while HDF5 opens and closes it: what a handler raises would be an error of
    the disk to HDF5. OSError also at the end, if something could not be written.
    """
    with DiskFile(path, mode) as disk:
        with signals_held():
            file = h5py.File(disk, "w" if mode == "x+b" else "r+")
        try:
            yield file, disk
        finally:
            with signals_held():
                file.close()
