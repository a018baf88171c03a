"""Writing rows of a results file: a row and its checksum before its status.

So a row whose status is not "pending" is a whole one, and its checksum is that of what it holds.

HDF5 1.10 keeps what it could not write. It tries again when the file is closed and when the process
ends, prints what h5py makes of that, and ends the process with a segmentation fault. So every write
succeeds in its eyes; the error of the first that did not is raised by :meth:`DiskFile.check`.
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from adhesis.ensemble.errors import WriteError, reason
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.checksum import OF_KEPT, OF_TASKS, checksum, empty_checksums
from adhesis.ensemble.results.read import stretches
from adhesis.ensemble.task.dataset import KEPT, Dataset
from adhesis.ensemble.task.row import RESULT_DATASETS, Row
from adhesis.solver.runtime.uninterrupted import signals_held

_NAMES = frozenset(d.name for d in RESULT_DATASETS)
_KEPT_NAMES = frozenset(d.name for d in OF_KEPT)

# Bytes: Open MPI 4.1 ends every rank where a path with its own additions has more than 255.
_LONGEST_NAME = 200
_DESCRIPTORS = Path("/proc/self/fd")  # of Linux


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

    @contextmanager
    def _kept(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._error = self._error or error

    def close(self) -> None:
        """Close the file, after h5py has closed its own."""
        with self._kept():  # some disks report only now that they are full
            super().close()

    def write(self, data: Any, /) -> int:
        """Write here."""
        rest = memoryview(data).cast("B")
        length = rest.nbytes
        with self._kept():
            while rest.nbytes:
                rest = rest[super().write(rest) :]
        return length

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length of the file."""
        with self._kept():
            return super().truncate(size)
        return size or 0


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Open a new results file to write, by one process.

    Signals are held back while HDF5 opens and closes it: what a handler raises would be an error of
    the disk to HDF5. OSError also at the end, if something could not be written.
    """
    with DiskFile(path, "x+b") as disk, ExitStack() as closing:
        with signals_held():
            file = h5py.File(disk, "w")
            closing.callback(signals_held()(file.close))
        yield file


class Writer(AbstractContextManager["Writer"]):
    """Writes rows of a results file that exists.

    With a communicator every rank of it opens the file together (parallel HDF5) and writes rows on
    its own; opening and closing are collective. Without one this process is the only writer.
    ``origin`` returns versions and processor of what computes a row, by the rank that does.
    """

    def __init__(
        self, path: Path | str, comm: Any = None, origin: Callable[[int], str] = lambda rank: ""
    ) -> None:
        self.path = Path(path)
        # HDF5's own lock would refuse readers; two writers are refused by
        # adhesis.ensemble.run.lock.
        self._names = ExitStack()
        with signals_held():
            try:
                self._disk = DiskFile(self.path, "r+b") if comm is None else None
                if self._disk is not None:
                    self._file = h5py.File(self._disk, "r+")
                else:
                    name = self._names.enter_context(_short_name(self.path))
                    self._file = h5py.File(name, "r+", driver="mpio", comm=comm)
                self._opened = os.stat(self.path)
            except OSError as error:  # it was there when the run was prepared
                raise WriteError(f"{self.path} could not be opened: {reason(error)}") from error
            self._datasets = {d.name: DatasetRows(self._file[d.name]) for d in schema.ROW_DATASETS}
            self._kept = {row: place for place, row in enumerate(self._file[KEPT][:].tolist())}
        self._origin = origin

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # Closing is collective: a rank that failed alone must not wait here for the others. And
        # HDF5 1.10 crashes when all ranks close a file that it cannot write to.
        if kind is None or self._disk is not None:
            with suppress(WriteError) if kind else nullcontext():  # the first error is raised
                self.close()

    def close(self) -> None:
        """Close the file (collectively, if it was opened so; WriteError)."""
        with signals_held():
            try:
                self._file.close()
                if self._disk is not None:
                    self._disk.close()
                    self._disk.check()
            except (OSError, RuntimeError) as error:
                raise WriteError(f"{self.path} could not be closed: {reason(error)}") from error
        self._names.close()

    def write_result(self, row: int, result: Row, rank: int = 0) -> int:
        """Write the row of a task that was computed, its status last; return its checksum.

        WriteError if the disk does not take it.
        ValueError if the row has other datasets than the schema, or one has another shape.
        """
        wanted = _NAMES if row in self._kept else _NAMES - _KEPT_NAMES
        if not wanted <= result.keys() <= _NAMES:
            raise ValueError(f"a row of {sorted(result)} where {sorted(wanted)} is wanted")
        return self._write(row, {**result, "rank": rank, **self._origin_of(rank)}, schema.DONE)

    def write_failure(self, row: int, error: str, wall_time: float, rank: int = 0) -> int:
        """Write the row of a task that failed: why, after how many s; see :meth:`write_result`."""
        values = {"error": schema.encode_text(error), "wall_time": wall_time, "rank": rank}
        return self._write(row, values | self._origin_of(rank), schema.FAILED)

    def mark(self, rows: Iterable[int], status: int) -> None:
        """Mark rows (ascending) as pending, or those without a result as not needed.

        What else they hold is not touched: nothing, a result that is computed again, or what a run
        that was killed has left.
        """
        for stretch in stretches(np.fromiter(rows, np.intp)):
            here = np.arange(stretch.start, stretch.stop)
            if not here.size:  # most tasks that finish leave none over
                continue
            with self._writing(stretch.start):
                self._put(schema.STATUS, stretch.start, np.full(here.size, schema.PENDING))
                if status == schema.NOT_NEEDED:
                    covered = empty_checksums(self._file, status, here)
                    self._put(schema.CHECKSUM, stretch.start, covered)
                self._put(schema.STATUS, stretch.start, np.full(here.size, status))

    def _write(self, row: int, values: Mapping[str, Any], status: int) -> int:
        """Write a row, its checksum (returned), and its status; what has no value is left empty.

        All of a row is written: a run that was killed may have left a part of it.
        """
        with self._writing(row):
            values, blocks = {**values, schema.STATUS.name: status}, []
            kept = self._kept.get(row)
            held = [(d, row) for d in OF_TASKS] + [(d, kept) for d in OF_KEPT if kept is not None]
            for dataset, place in held:
                rows_of, given = self._datasets[dataset.name], dataset.name in values
                value = values[dataset.name] if given else np.full(rows_of.shape, dataset.fill)
                blocks.append(rows_of.block(value))
                if dataset is not schema.STATUS:
                    rows_of.write(place, blocks[-1])
            covered = checksum(blocks)
            self._put(schema.CHECKSUM, row, [covered])
            self._put(schema.STATUS, row, [status])
        return covered

    def _put(self, dataset: Dataset, first: int, values: ArrayLike) -> None:
        """Write one number of successive rows, and hand all to the operating system."""
        rows_of = self._datasets[dataset.name]
        rows_of.write(first, np.asarray(values, rows_of.dtype))
        self.flush()

    def _origin_of(self, rank: int) -> dict[str, bytes]:
        return {schema.ORIGIN.name: schema.encode_text(self._origin(rank), schema.ORIGIN_LENGTH)}

    @contextmanager
    def _writing(self, row: int) -> Iterator[None]:
        """Name the row in an error of the disk; what a signal handler raises comes afterwards."""
        with signals_held():
            try:
                self._check_place()
                yield
            except (OSError, RuntimeError) as error:
                raise WriteError(
                    f"row {row} of {self.path} could not be written: {reason(error)}"
                ) from error

    def _check_place(self) -> None:
        """Refuse to fill a file that is not at its path any more, or was cut or copied over."""
        try:
            found = os.stat(self.path)
            same_size = found.st_size == self._opened.st_size
            moved = not (same_size and os.path.samestat(found, self._opened))
        except (FileNotFoundError, NotADirectoryError):
            moved = True
        if moved:
            raise WriteError(
                f"{self.path} was moved, replaced or removed while a run wrote to it: put the old "
                "file back"
            )

    def flush(self) -> None:
        """Hand what was written to the operating system."""
        # Parallel HDF5 keeps no data back; the serial driver does, in any order.
        if self._disk is not None:
            self._file.flush()
            self._disk.check()


@contextmanager
def _short_name(path: Path) -> Iterator[Path]:
    """Give a file with a long path a short name in this process, as long as it is open."""
    if len(os.fsencode(path)) <= _LONGEST_NAME or not os.path.isdir(_DESCRIPTORS):
        yield path
        return
    descriptor = os.open(path, os.O_RDWR)
    try:
        yield _DESCRIPTORS / str(descriptor)
    finally:
        os.close(descriptor)


class DatasetRows:
    """Writes rows of one dataset through h5py's low level: faster than ``dataset[row] =``."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._id = dataset.id
        self.shape = dataset.shape[1:]
        self.dtype = dataset.dtype
        self._space = self._id.get_space()
        self._rest = (0,) * len(self.shape)

    def block(self, value: Any) -> NDArray[Any]:
        """Return the bytes that a value of a row has in the file, shape (1, …)."""
        if np.shape(value) != self.shape:
            raise ValueError(
                f"{self._id.name!r} has rows of shape {self.shape}, not {np.shape(value)}"
            )
        block = np.empty((1, *self.shape), self.dtype)
        block[0] = value
        return block

    def write(self, first: int, block: NDArray[Any]) -> None:
        """Write successive rows, of the type that they have in the file."""
        if not block.size:
            return
        self._space.select_hyperslab((first, *self._rest), block.shape)
        self._id.write(h5py.h5s.create_simple(block.shape), self._space, block)
