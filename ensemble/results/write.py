"""Writing rows of a results file: a row before its status, so that a done row is a whole one."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np

from ensemble.errors import WriteError
from ensemble.results.schema import (
    DATASETS,
    DONE,
    FAILED,
    NOT_NEEDED,
    PENDING,
    TASK_DATASETS,
    encode_error,
)
from ensemble.task.dataset import KEPT
from ensemble.task.row import RESULT_DATASETS, Row

_KEPT_NAMES = frozenset(d.name for d in DATASETS if d.dims[0] == KEPT)
_NAMES = frozenset(d.name for d in RESULT_DATASETS)


class Writer:
    """Writes rows of a results file that exists.

    Parameters
    ----------
    path : path
    comm : MPI communicator, optional
        If given, every rank of it opens the file together (parallel HDF5) and writes rows on its
        own; opening and closing are collective. If not, this process is the only writer.
    """

    def __init__(self, path: Path | str, comm: Any = None) -> None:
        self.path = Path(path)
        self._serial = comm is None
        # HDF5's own lock would refuse readers; two writers are refused by ensemble.run.lock.
        options = {"locking": False} if comm is None else {"driver": "mpio", "comm": comm}
        self._file = h5py.File(self.path, "r+", **options)
        self._datasets = {c.name: DatasetRows(self._file[c.name]) for c in DATASETS}
        self._kept = {int(row): place for place, row in enumerate(self._file[KEPT][:])}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # Closing is collective: a rank that failed alone must not wait here for the others. And
        # HDF5 1.10 crashes when it closes a file that it cannot write to.
        if error is None or (self._serial and not isinstance(error, WriteError)):
            self.close()

    def close(self) -> None:
        """Close the file (collectively, if it was opened so)."""
        self._file.close()

    def write_result(self, row: int, result: Row, rank: int = 0) -> None:
        """Write the row of a task that was computed; its status last.

        Raises
        ------
        ValueError
            If the row has other datasets than the schema, or one has another shape.
        WriteError
            If the disk does not take it.
        """
        wanted = _NAMES if row in self._kept else _NAMES - _KEPT_NAMES
        if wanted - result.keys() or result.keys() - _NAMES:
            raise ValueError(f"a row of {sorted(result)} where {sorted(wanted)} is wanted")
        self._write(row, {**result, "rank": rank, "error": b""}, DONE)

    def write_failure(self, row: int, error: str, wall_time: float, rank: int = 0) -> None:
        """Write the row of a task that failed: why, after how many seconds; its status last."""
        values = {"error": encode_error(error), "wall_time": wall_time, "rank": rank}
        self._write(row, values, FAILED)

    def reset(self, rows: Sequence[int]) -> None:
        """Make rows pending again; what they held is lost."""
        cleared = [d for d in DATASETS if d not in TASK_DATASETS and d.name != "status"]
        for row in rows:
            with self._telling(row):
                # First the status: a row that is being emptied must not be taken for a whole one.
                self._datasets["status"].write(row, PENDING)
                self.flush()
                for dataset in cleared:
                    place = self._place(dataset.name, row)
                    if place is not None:
                        self._datasets[dataset.name].clear(place, dataset.fill)
                self.flush()

    def mark(self, rows: Iterable[int], *, needed: bool) -> None:
        """Say of rows without a result that they are to be computed, or that they need not be."""
        for row in rows:
            with self._telling(row):
                self._datasets["status"].write(row, PENDING if needed else NOT_NEEDED)
        self.flush()

    def _write(self, row: int, values: Mapping[str, Any], status: int) -> None:
        with self._telling(row):
            for name, value in values.items():
                place = self._place(name, row)
                if place is not None:
                    self._datasets[name].write(place, value)
            self.flush()
            self._datasets["status"].write(row, status)
            self.flush()

    def _place(self, name: str, row: int) -> int | None:
        """Where the row of a task stands in a dataset; None where it has none."""
        return self._kept.get(row) if name in _KEPT_NAMES else row

    @contextmanager
    def _telling(self, row: int) -> Iterator[None]:
        try:
            yield
        except (OSError, RuntimeError) as error:
            raise WriteError(
                f"row {row} of {self.path} could not be written: {reason(error)}"
            ) from error

    def flush(self) -> None:
        """Hand what was written to the operating system."""
        # Parallel HDF5 keeps no data back; the serial driver does, in any order.
        if self._serial:
            self._file.flush()


class DatasetRows:
    """Writes rows of one dataset through h5py's low level: faster than ``dataset[row] =``."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._id = dataset.id
        self._shape = dataset.shape[1:]
        self._dtype = dataset.dtype
        self._space = self._id.get_space()
        self._memory = h5py.h5s.create_simple((1, *self._shape))
        self._rest = (0,) * len(self._shape)

    def clear(self, row: int, fill: Any) -> None:
        """Fill a row with one value."""
        self.write(row, np.full(self._shape, fill, self._dtype))

    def write(self, row: int, value: Any) -> None:
        """Write a row, of the dataset's own shape."""
        if np.shape(value) != self._shape:
            raise ValueError(
                f"{self._id.name!r} has rows of shape {self._shape}, not {np.shape(value)}"
            )
        block = np.empty((1, *self._shape), self._dtype)
        if not block.size:
            return
        block[0] = value
        self._space.select_hyperslab((row, *self._rest), (1, *self._shape))
        self._id.write(self._memory, self._space, block)


def reason(error: Exception) -> str:
    """Return the reason of an error in one line, without HDF5's particulars."""
    if isinstance(error, OSError) and error.errno:
        return os.strerror(error.errno)
    told = re.search(r"error message = '([^']*)'", str(error))
    return told.group(1) if told else " ".join(str(error).split("(")[0].split())
