"""The file that HDF5 writes to: what the disk does not take is reported once, and by us.

HDF5 1.10 keeps what it could not write. It tries again when the file is closed and when the process
ends, prints what h5py makes of that, and ends the process with a segmentation fault. So every write
succeeds in its eyes; the error of the first that did not is raised by :meth:`DiskFile.check`.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from adhesis.solver.runtime.uninterrupted import signals_held


class DiskFile(io.FileIO):
    """A file object for h5py, of a new file on disk ("x+b") or an old one ("r+b")."""

    _error: OSError | None = None

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Close the file; what could not be written comes before an error that followed from it."""
        self.close()
        if kind is None or issubclass(kind, (OSError, RuntimeError)):
            self.check()

    def check(self) -> None:
        """Raise the first error (OSError)."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Close the file, after h5py has closed its own."""
        try:
            super().close()
        except OSError as error:  # some disks report only now that they are full
            self._error = self._error or error

    def write(self, data: Any, /) -> int:
        """Write here."""
        rest = memoryview(data).cast("B")
        length = rest.nbytes
        try:
            while rest.nbytes:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self._error = self._error or error
        return length

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length of the file."""
        try:
            return super().truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Open a new results file to write, by one process.

    Signals are held back while HDF5 opens and closes it: what a handler raises would be an error of
    the disk to HDF5. OSError also at the end, if something could not be written.
    """
    with DiskFile(path, "x+b") as disk:
        with signals_held():
            file = h5py.File(disk, "w")
        try:
            yield file
        finally:
            with signals_held():
                file.close()
