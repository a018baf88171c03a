"""Reading a results file with plain h5py, at any moment of a run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from ensemble.campaign.file import parse_campaign
from ensemble.campaign.tasks import WHOLE, Part, Task
from ensemble.errors import InputError
from ensemble.results.schema import (
    TASK_DATASETS,
    axis_datasets,
    check_version,
    datasets,
    scales,
    shape_of,
)
from ensemble.task.dataset import sizes_of


class Results:
    """A results file, read with plain h5py, at any moment of a run.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    path : Path
    campaign : Campaign
    part : Part
        Which rows of the campaign it holds; part 1 of 1 is the whole.
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
                self.part = Part.parse(self.attributes.get("part", str(WHOLE)))
                self._check_shapes()
        except BaseException:
            self._file.close()
            raise

    def _check_shapes(self) -> None:
        wanted = scales(self.campaign, self.part)
        names = [scale.name for scale in wanted] + [d.name for d in datasets(self.campaign)]
        missing = [name for name in names if name not in self._file]
        if missing:
            by = str(self.attributes.get("adhesis_version", "an unknown version"))
            commit = str(self.attributes.get("commit", "unknown"))
            if commit != "unknown":
                by += f" (commit {commit[:12]})"
            more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
            raise InputError(
                f"{self.path} was written by adhesis {by}, whose results files do not hold "
                f"{', '.join(missing[:3])}{more}: read it with that version, or compute the "
                "campaign again into another file"
            )
        for scale in wanted:
            if self._file[scale.name].shape != scale.values.shape:
                raise ValueError(scale.name)
        sizes = sizes_of(wanted)
        for known in datasets(self.campaign):
            found = self._file[known.name]
            if found.shape != shape_of(known, sizes) or found.dtype != np.dtype(known.dtype):
                raise ValueError(known.name)

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
            for place, (first, stop) in stretches(rows):
                out[place : place + stop - first] = dataset[first:stop]
            return out

    def status(self) -> NDArray[np.uint8]:
        """Return the status of every task: PENDING, DONE or FAILED (ensemble.results.schema)."""
        return self.column("status")

    def tasks(self) -> list[Task]:
        """Return every task, row by row."""
        columns = [self.column(d.name).tolist() for d in TASK_DATASETS]
        names = [axis.name for axis in self.campaign.axes[2:]]
        axes = [self.column(d.name).tolist() for d in axis_datasets(self.campaign)]
        return [
            Task(hurst, gamma, realisation, seed, tuple(zip(names, others, strict=True)))
            for hurst, gamma, realisation, seed, *others in zip(*columns, *axes, strict=True)
        ]

    def errors(self, rows: NDArray[np.intp]) -> list[str]:
        """Return the error texts of some rows (ascending)."""
        return [text.decode("utf-8", "replace") for text in self.column("error", rows).tolist()]


def stretches(rows: NDArray[np.intp]) -> Iterator[tuple[int, tuple[int, int]]]:
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
