"""Writing rows of a results file: a row and its checksum before its status.

So a row whose status is not "pending" is a whole one, and its checksum is that of what it holds.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.errors import WriteError, reason
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.checksum import OF_KEPT, OF_TASKS, checksum
from adhesis.ensemble.results.disk_file import DiskFile
from adhesis.ensemble.task.dataset import KEPT, Dataset
from adhesis.ensemble.task.row import RESULT_DATASETS, Row
from adhesis.solver.runtime.uninterrupted import signals_held

_KEPT_NAMES = frozenset(d.name for d in OF_KEPT)
_NAMES = frozenset(d.name for d in RESULT_DATASETS)

# Bytes: Open MPI 4.1 ends every rank where a path with its own additions has more than 255.
_LONGEST_NAME = 200
_DESCRIPTORS = Path("/proc/self/fd")  # of Linux


class Writer:
    """Writes rows of a results file that exists.

    With a communicator every rank of it opens the file together (parallel HDF5) and writes rows on
    its own; opening and closing are collective. Without one this process is the only writer.
    ``origin`` returns versions and processor of what computes a row, by the rank that does.
    """

    def __init__(
        self,
        path: Path | str,
        comm: Any = None,
        origin: Callable[[int], str] = lambda rank: "",
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
            self._kept = {int(row): place for place, row in enumerate(self._file[KEPT][:])}
        self._origin = origin

    def __enter__(self) -> Self:
        return self

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
        if wanted - result.keys() or result.keys() - _NAMES:
            raise ValueError(f"a row of {sorted(result)} where {sorted(wanted)} is wanted")
        return self._write(row, {**result, "rank": rank, **self._origin_of(rank)}, schema.DONE)

    def write_failure(self, row: int, error: str, wall_time: float, rank: int = 0) -> int:
        """Write the row of a task that failed: why, after how many s; see :meth:`write_result`."""
        values = {"error": schema.encode_text(error), "wall_time": wall_time, "rank": rank}
        return self._write(row, values | self._origin_of(rank), schema.FAILED)

    def reset(self, rows: Iterable[int], status: int = schema.PENDING) -> None:
        """Empty rows, which are to be computed, or need not be; what they held is lost."""
        for row in rows:
            # First the status: a row that is being emptied must not be taken for a whole one.
            with self._writing(row):
                self._put(schema.STATUS, row, schema.PENDING)
            self._write(row, {}, status)

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
            covered = schema.CHECKSUM.fill if status == schema.PENDING else checksum(blocks)
            self._put(schema.CHECKSUM, row, covered)
            self._put(schema.STATUS, row, status)
        return covered

    def _put(self, dataset: Dataset, row: int, value: int) -> None:
        """Write one number of a row, and hand all that was written to the operating system."""
        rows_of = self._datasets[dataset.name]
        rows_of.write(row, rows_of.block(value))
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
        self._dtype = dataset.dtype
        self._space = self._id.get_space()
        self._memory = h5py.h5s.create_simple((1, *self.shape))
        self._rest = (0,) * len(self.shape)

    def block(self, value: Any) -> NDArray[Any]:
        """Return the bytes that a value of a row has in the file, shape (1, …)."""
        if np.shape(value) != self.shape:
            raise ValueError(
                f"{self._id.name!r} has rows of shape {self.shape}, not {np.shape(value)}"
            )
        block = np.empty((1, *self.shape), self._dtype)
        block[0] = value
        return block

    def write(self, row: int, block: NDArray[Any]) -> None:
        """Write a row that :meth:`block` has made."""
        if not block.size:
            return
        self._space.select_hyperslab((row, *self._rest), (1, *self.shape))
        self._id.write(self._memory, self._space, block)
