"""The results file: laying it out, writing rows, reading it.

Knows shapes and units, and no ranks beyond opening. What makes it survive a kill at any moment:

- The file is laid out at full size under another name, flushed to disk and renamed, so that it is
  either there whole or not at all. A full disk is met here, before the first task.
- Datasets are contiguous and allocated, so that writing a row changes no metadata.
- A row is written before its status; a row whose status says "done" is whole.
- A campaign that grew gets a new file with the old rows copied in, renamed over the old one.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from ensemble.campaign.file import parse_campaign
from ensemble.campaign.tables import Campaign
from ensemble.campaign.tasks import Task
from ensemble.errors import InputError, WriteError
from ensemble.results.schema import (
    COLUMNS,
    DONE,
    FAILED,
    FILE_TYPE,
    FILE_VERSION,
    KEPT,
    PENDING,
    RESULT_COLUMNS,
    TASK_COLUMNS,
    Column,
    check_version,
    encode_error,
    file_size,
    scales,
    shape_of,
)
from ensemble.task.compute import TaskResult

_COPY_BYTES = 16 * 2**20  # memory of a growing copy
_KEPT_NAMES = frozenset(c.name for c in COLUMNS if c.dims[0] == KEPT)


class Results:
    """A results file, read with plain h5py, at any moment of a run.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    path : Path
    campaign : Campaign
    attributes : dict
        The root attributes (docs/results-file.md).

    Raises
    ------
    InputError
        If it is missing, foreign, truncated or damaged; one sentence.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        with _damage(self.path):
            self._file = h5py.File(self.path, "r", locking=False)
        try:
            with _damage(self.path):
                self.attributes: dict[str, Any] = dict(self._file.attrs)
                check_version(
                    self.path, self.attributes.get("file_type"), self.attributes["file_version"]
                )
                self.campaign = parse_campaign(self.attributes["campaign"], str(self.path))
                self._check_shapes()
        except BaseException:
            self._file.close()
            raise

    def _check_shapes(self) -> None:
        sizes = {}
        for scale in scales(self.campaign):
            sizes[scale.name] = scale.values.size
            if self._file[scale.name].shape != scale.values.shape:
                raise ValueError(scale.name)
        for column in COLUMNS:
            dataset = self._file[column.name]
            if dataset.shape != shape_of(column, sizes) or dataset.dtype != np.dtype(column.dtype):
                raise ValueError(column.name)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __len__(self) -> int:
        """Number of tasks."""
        return int(self._file["task"].shape[0])

    @property
    def loading_penetration(self) -> NDArray[np.float64]:
        """Δ/h_max of the loading curves."""
        return self.column("loading_penetration")

    @property
    def unloading_penetration(self) -> NDArray[np.float64]:
        """Δ/h_max of the unloading curves, descending."""
        return self.column("unloading_penetration")

    def column(self, name: str, rows: slice | NDArray[np.intp] | None = None) -> NDArray[Any]:
        """Return a dataset, or some rows of it.

        Parameters
        ----------
        name : str
        rows : slice or ascending int array, optional
            All rows if not given. Memory is that of the result.
        """
        with _damage(self.path):
            dataset = self._file[name]
            if rows is None or isinstance(rows, slice):
                return np.asarray(dataset[rows if rows is not None else ()])
            out = np.empty((len(rows), *dataset.shape[1:]), dataset.dtype)
            for place, (first, stop) in _stretches(rows):
                out[place : place + stop - first] = dataset[first:stop]
            return out

    def status(self) -> NDArray[np.uint8]:
        """Return the status of every task: PENDING, DONE or FAILED (ensemble.results.schema)."""
        return self.column("status")

    def tasks(self) -> list[Task]:
        """Return every task, row by row."""
        columns = [self.column(c.name).tolist() for c in TASK_COLUMNS]
        return [Task(*values) for values in zip(*columns, strict=True)]

    def errors(self, rows: NDArray[np.intp]) -> list[str]:
        """Return the error texts of some rows (ascending)."""
        return [text.decode("utf-8", "replace") for text in self.column("error", rows).tolist()]


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
        self._datasets = {c.name: _RowWriter(self._file[c.name]) for c in COLUMNS}
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

    def write_result(self, row: int, result: TaskResult, rank: int = 0) -> None:
        """Write the row of a task that was computed; its status last."""
        values = {c.name: getattr(result, c.name) for c in RESULT_COLUMNS}
        self._write(row, {**values, "rank": rank, "error": b""}, DONE)

    def write_failure(self, row: int, error: str, wall_time: float, rank: int = 0) -> None:
        """Write the row of a task that failed: why, after how many seconds; its status last."""
        values = {"error": encode_error(error), "wall_time": wall_time, "rank": rank}
        self._write(row, values, FAILED)

    def reset(self, rows: Sequence[int]) -> None:
        """Make rows pending again; what they held is lost."""
        cleared = [c for c in COLUMNS if c not in TASK_COLUMNS and c.name != "status"]
        for row in rows:
            self._datasets["status"].write(row, PENDING)
            self._flush()
            self._write(row, {c.name: c.fill for c in cleared}, PENDING)

    def _write(self, row: int, values: Mapping[str, Any], status: int) -> None:
        try:
            for name, value in values.items():
                place = self._kept.get(row) if name in _KEPT_NAMES else row
                if place is not None:
                    self._datasets[name].write(place, value)
            self._flush()
            self._datasets["status"].write(row, status)
            self._flush()
        except (OSError, RuntimeError) as error:
            raise WriteError(
                f"row {row} of {self.path} could not be written: {_reason(error)}"
            ) from error

    def _flush(self) -> None:
        # Parallel HDF5 keeps no data back; the serial driver does, in any order.
        if self._serial:
            self._file.flush()


class _RowWriter:
    """Writes rows of one dataset through h5py's low level: faster than ``dataset[row] =``."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._id = dataset.id
        self._shape = dataset.shape[1:]
        self._dtype = dataset.dtype
        self._space = self._id.get_space()
        self._memory = h5py.h5s.create_simple((1, *self._shape))
        self._rest = (0,) * len(self._shape)

    def write(self, row: int, value: Any) -> None:
        block = np.empty((1, *self._shape), self._dtype)
        if not block.size:
            return
        block[0] = value
        self._space.select_hyperslab((row, *self._rest), (1, *self._shape))
        self._id.write(self._memory, self._space, block)


def create(
    path: Path | str,
    campaign: Campaign,
    *,
    versions: Mapping[str, str] | None = None,
    grown_from: Results | None = None,
) -> None:
    """Lay out a results file at full size, by one process; all or nothing.

    Parameters
    ----------
    path : path
        Replaced if it exists.
    campaign : Campaign
    versions : mapping of str, optional
        Root attributes with the versions of what computes (``mpi``, ``hdf5``, ``fftw``, …).
    grown_from : Results, optional
        An older file of a campaign that this one extends; its rows are copied.

    Raises
    ------
    InputError
        If the file cannot be written or the disk is too small.
    """
    path = Path(path)
    part = path.with_name(f"{path.name}.part")
    needed = file_size(campaign)
    try:
        free = shutil.disk_usage(path.parent).free
        if needed > free:
            raise InputError(
                f"{path} needs {needed / 1e6:.0f} MB and the disk has {free / 1e6:.0f} MB free"
            )
        with h5py.File(part, "w", locking=False, track_order=False) as file:
            _lay_out(file, campaign)
            _describe(file, campaign, versions or {}, grown_from)
            if grown_from is not None:
                _copy_rows(grown_from, file, campaign)
        with part.open("rb") as handle:
            os.fsync(handle.fileno())
        part.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {_reason(error)}") from error
    finally:
        part.unlink(missing_ok=True)


def _lay_out(file: h5py.File, campaign: Campaign) -> None:
    sizes = {}
    for scale in scales(campaign):
        sizes[scale.name] = scale.values.size
        dataset = file.create_dataset(scale.name, data=scale.values)
        dataset.make_scale(scale.name)
        dataset.attrs["units"] = scale.unit
        dataset.attrs["long_name"] = scale.meaning
    for column in COLUMNS:
        dataset = _allocate(file, column, shape_of(column, sizes))
        dataset.attrs["units"] = column.unit
        dataset.attrs["long_name"] = column.meaning
        for name, value in column.attributes.items():
            dataset.attrs[name] = value
        for axis, dim in enumerate(column.dims):
            dataset.dims[axis].attach_scale(file[dim])
    tasks = campaign.tasks()
    for column in TASK_COLUMNS:
        file[column.name][...] = [getattr(task, column.name) for task in tasks]


def _allocate(file: h5py.File, column: Column, shape: tuple[int, ...]) -> h5py.Dataset:
    """Create a contiguous dataset, its place on disk taken and filled at once."""
    dtype = np.dtype(column.dtype)
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_layout(h5py.h5d.CONTIGUOUS)
    plist.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plist.set_fill_time(h5py.h5d.FILL_TIME_ALLOC)
    plist.set_fill_value(np.array(column.fill, dtype))
    space = h5py.h5s.create_simple(shape)
    kind = h5py.h5t.py_create(dtype)
    return h5py.Dataset(h5py.h5d.create(file.id, column.name.encode(), kind, space, plist))


def _describe(
    file: h5py.File, campaign: Campaign, versions: Mapping[str, str], old: Results | None
) -> None:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    file.attrs["file_type"] = FILE_TYPE
    file.attrs["file_version"] = np.array(FILE_VERSION, "i4")
    file.attrs["Conventions"] = "CF-1.11"
    file.attrs["title"] = "Loading-unloading hysteresis loops of rough adhesive contacts"
    file.attrs["campaign"] = campaign.text
    file.attrs["seed"] = campaign.sweep.seed
    file.attrs["created"] = now if old is None else old.attributes.get("created", now)
    file.attrs["laid_out"] = now
    for name, text in versions.items():
        file.attrs[name] = text


def _copy_rows(old: Results, file: h5py.File, campaign: Campaign) -> None:
    place = {task: row for row, task in enumerate(campaign.tasks())}
    target = np.array([place[task] for task in old.tasks()])
    # A task that kept its fields does so in the grown campaign: realisations are only added.
    kept = np.searchsorted(file[KEPT][:], target[old.column(KEPT)])
    for column in COLUMNS:
        if column in TASK_COLUMNS:
            continue
        dataset = file[column.name]
        targets = kept if column.name in _KEPT_NAMES else target
        width = max(1, int(np.prod(dataset.shape[1:])) * dataset.dtype.itemsize)
        for first in range(0, len(targets), max(1, _COPY_BYTES // width)):
            block = old.column(column.name, slice(first, first + max(1, _COPY_BYTES // width)))
            rows = targets[first : first + len(block)]
            for i, (start, stop) in _stretches(rows):
                dataset[start:stop] = block[i : i + stop - start]


def _stretches(rows: NDArray[np.intp]) -> Iterator[tuple[int, tuple[int, int]]]:
    """Split row numbers into runs of successive ones: (place in ``rows``, (first, stop))."""
    if len(rows) == 0:
        return
    breaks = np.flatnonzero(np.diff(rows) != 1) + 1
    for i, j in zip([0, *breaks], [*breaks, len(rows)], strict=True):
        yield int(i), (int(rows[i]), int(rows[j - 1]) + 1)


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """Turn what h5py raises over a bad file into one sentence."""
    try:
        yield
    except InputError:
        raise
    except FileNotFoundError as error:
        raise InputError(f"{path} does not exist") from error
    except IsADirectoryError as error:
        raise InputError(f"{path} is a directory, not a results file") from error
    except PermissionError as error:
        raise InputError(f"{path} cannot be read: permission denied") from error
    except Exception as error:  # h5py raises nearly every kind over damaged bytes
        raise InputError(
            f"{path} is not a results file of adhesis, or it is damaged or truncated"
        ) from error


def _reason(error: Exception) -> str:
    """Return the reason of an error in one line, without HDF5's particulars."""
    if isinstance(error, OSError) and error.errno:
        return os.strerror(error.errno)
    told = re.search(r"error message = '([^']*)'", str(error))
    return told.group(1) if told else " ".join(str(error).split("(")[0].split())
