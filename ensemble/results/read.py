"""Reading a results file with plain h5py, at any moment of a run."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.campaign.tasks import WHOLE, Part
from adhesis.ensemble.errors import InputError, lack, quoted
from adhesis.ensemble.quantities import bytes_text
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.checksum import HEAD, check_head, empty_checksums, row_checksums
from adhesis.ensemble.task.dataset import KEPT, Dataset
from adhesis.solver.checks import shown

_MOST_BESIDES = 16 * 2**20  # bytes beside the rows; texts and headers take some 100,000
_LONGEST_ATTRIBUTE = 2**16  # bytes of a root attribute, of a text those of a reference to it
_NUMBERS = ("file_version", "seed")  # root attributes that are no texts
# Attributes that may differ between versions of adhesis that write the same file version.
_WORDING = frozenset(("title", "long_name"))
# Attributes by which HDF5 joins datasets to the scales of their dimensions.
_OF_HDF5 = frozenset(("CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "DIMENSION_LABELS"))
# Exponential functions of numpy differ between processors by the last bits.
_SCALE_ROUNDING = 1e-12
_LOOKS = 4
_MOST_NAMED = 10
_OF_THE_PATH = (errno.EACCES, errno.EPERM, errno.ENAMETOOLONG)
_INSTEAD = "restore it from a copy, or compute the campaign again into another file"


class Results(AbstractContextManager["Results"]):
    """A results file, read with plain h5py, at any moment of a run.

    Opening it checks everything but the rows: the root attributes, the shapes and types of the
    datasets, the dimension scales, and that the tasks are those of the campaign. InputError if it
    is missing, foreign, truncated or damaged. The rows are checked by :meth:`status`.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        with _damage(self.path), ExitStack() as stack:
            # HDF5 can crash over damaged bytes of its own: it reads none that are known to be.
            if not check_head(self.path):
                raise InputError(
                    f"{self.path} is damaged or truncated, or another program has changed it: the "
                    f"bytes beside its rows do not have their checksum; {_INSTEAD}"
                )
            try:
                file = h5py.File(self.path, "r", locking=False)
            except OSError:  # this process has it open already, by xarray say: then as it has
                file = h5py.File(self.path, "r")
            self._file = stack.enter_context(file)
            self._check_links()
            found = {d.name: self._file[d.name] for d in schema.DATASETS if d.name in self._file}
            self._check_size(found)
            self.attributes = self._root_attributes()
            version = np.ravel(self.attributes["file_version"])[:4].tolist()
            if self.attributes.get("file_type") != schema.FILE_TYPE:
                raise InputError(f"{self.path} is not a results file of adhesis")
            if version != [schema.FILE_VERSION]:
                raise InputError(
                    f"{self.path} has file version {'.'.join(map(str, version))}, and this adhesis "
                    f"reads version {schema.FILE_VERSION}: read it with the adhesis that wrote it, "
                    "or compute the campaign again into another file"
                )
            text = self.attributes["campaign"]
            self.campaign = parse_campaign(text, str(self.path), is_stored=True)
            self.part = self._part()
            self._check_attributes()
            self._check_members(found)
            self.tasks = self.campaign.tasks(self.part)  # row by row
            stack.pop_all()

    def _check_size(self, found: dict[str, h5py.Dataset]) -> None:
        """Refuse a file with more than a campaign can have beside its rows, before reading.

        HDF5 keeps texts beside the datasets, with no limit to their length.
        """
        size = os.path.getsize(self.path)
        held = sum(min(size, dataset.id.get_storage_size()) for dataset in found.values())
        if size - held > _MOST_BESIDES + held:
            raise InputError(
                f"{self.path} holds {bytes_text(size - held)} beside its rows, more than a "
                "campaign can have there"
            )

    def _check_links(self) -> None:
        """Refuse links to elsewhere, before any member of the root is looked up.

        To look up a link to another file opens that one, for which a pipe lets HDF5 wait.
        """
        for name in self._file:
            if not isinstance(self._file.get(name, getlink=True), h5py.HardLink):
                raise self._damaged(f"{name} is a link, and not in the file itself")

    def _root_attributes(self) -> dict[str, Any]:
        found = {}
        for name in self._file.attrs:
            if name == HEAD:
                continue
            if self._file.attrs.get_id(name).get_storage_size() > _LONGEST_ATTRIBUTE:
                raise ValueError(name)
            value = self._file.attrs[name]
            if isinstance(value, str) == (name in _NUMBERS):
                raise ValueError(name)
            found[name] = value
        return found

    def _part(self) -> Part:
        text = self.attributes.get("part", str(WHOLE))
        try:
            return Part.parse(text)
        except InputError:  # of which it names an option
            rule = "must be K/N with 1 ≤ K ≤ N, as 3/20"
            raise self._damaged(f"attribute part is {quoted(text)}, and {rule}") from None

    def _check_attributes(self) -> None:
        """Compare the root attributes with those that the campaign decides.

        Readers of other programs go by them, as by the seed.
        """
        wanted = {"part": None} | schema.fixed_attributes(self.campaign, self.part)
        for name, value in wanted.items():
            found: Any = self.attributes.get(name)
            if name not in _WORDING and not np.array_equal(found, value):
                raise self._damaged(
                    f"attribute {name} is {shown(found)}, and that of its campaign is "
                    f"{shown(value)}"
                )

    def _check_members(self, found: dict[str, h5py.Dataset]) -> None:
        """Compare scales and datasets with what would be laid out for the campaign.

        Numbers are read when all headers are right: one could promise more of them than memory
        holds, or those of other files.
        """
        wanted = schema.members(self.campaign, self.part)
        names = (member.dataset.name for member in wanted)
        found = {name: found.get(name) or self._file.get(name) for name in names}
        missing = [name for name, dataset in found.items() if dataset is None]
        if missing:
            raise InputError(
                f"{self.path} was written by another state of adhesis, without {missing[0]}: read "
                "it with that one, or compute the campaign again into another file"
            )
        if sum(member.nbytes for member in wanted) > os.path.getsize(self.path):
            raise ValueError("truncated")
        for dataset, shape, _ in wanted:
            here = found[dataset.name]
            along = [list(dim.values()) for dim in here.dims]
            if (
                (here.shape, here.dtype) != (shape, np.dtype(dataset.dtype))
                or (here.is_virtual or here.external)
                or set(here.attrs) - _OF_HDF5 != set(dataset.described)
                or (dataset.dims and along != [[found[name]] for name in dataset.dims])
            ):
                raise ValueError(dataset.name)
            for key, value in dataset.described.items():
                if key not in _WORDING and not np.array_equal(here.attrs[key], value):
                    raise ValueError(dataset.name)
        for dataset, _, values in wanted:
            if values is not None:
                self._check_values(dataset, found[dataset.name][:], values())

    def _check_values(self, dataset: Dataset, found: NDArray[Any], wanted: NDArray[Any]) -> None:
        rounding = 0.0 if dataset.dims else _SCALE_ROUNDING
        wrong = np.flatnonzero(~np.isclose(found, wanted, rtol=rounding, atol=0.0))
        if wrong.size:
            row = int(wrong[0])
            raise self._damaged(
                f"{dataset.name} is not that of its campaign ({found[row]} instead of "
                f"{wanted[row]} in row {row})"
            )

    def _damaged(self, what: str) -> InputError:
        """Return the sentence on what is beside the rows and cannot be computed again."""
        return InputError(f"{self.path} is damaged: its {what}; {_INSTEAD}")

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __len__(self) -> int:
        return int(self._file["task"].shape[0])

    def column(
        self, name: str, rows: slice | NDArray[np.intp] = slice(None), *columns: slice
    ) -> NDArray[Any]:
        """Return a dataset, or some rows of it: a slice, or ascending numbers; and some columns."""
        with _damage(self.path):
            dataset = self._file[name]
            parts = [rows] if isinstance(rows, slice) else stretches(rows)
            pieces = [dataset[(part, *columns)] for part in parts]
            return np.concatenate(pieces) if len(pieces) != 1 else np.asarray(pieces[0])

    def status(self) -> NDArray[np.uint8]:
        """Return the status of every task: PENDING, DONE, … (adhesis.ensemble.results.schema).

        DAMAGED is that of a row which does not have its checksum, or whose status is none. All rows
        with a result are read for it, once.
        """
        return self._checked_status.copy()

    def damaged(self) -> NDArray[np.intp]:
        """Return the rows that are damaged."""
        return np.flatnonzero(self.status() == schema.DAMAGED)

    def damage(self) -> str:
        """Return the sentence that names the damaged rows; empty without any."""
        rows = self.damaged()
        return f"{self.path} is damaged in {named_rows(rows.tolist())}" if rows.size else ""

    def origins(self) -> dict[str, int]:
        """Return the versions and processors that computed the done rows, and how many rows each.

        A text is empty where a program other than a run has written rows.
        """
        done = np.flatnonzero(self.status() == schema.DONE)
        names, counts = np.unique(self.column(schema.ORIGIN.name)[done], return_counts=True)
        texts = (name.decode("utf-8", "replace") for name in names.tolist())
        return dict(zip(texts, counts.tolist(), strict=True))

    def doubts(self) -> tuple[str, ...]:
        """Return a sentence for each reason not to take the rows for sound, whole, and alike."""
        out = []
        if damage := self.damage():
            out.append(f"{damage}; damaged rows are not used")
        if mixed := mixture(self.origins()):
            out.append(f"{self.path} {mixed}")
        return tuple(out)

    @cached_property
    def _checked_status(self) -> NDArray[np.uint8]:
        suspects, status = np.arange(len(self)), np.zeros(len(self), np.uint8)
        # A row that a run computes again at this moment looks damaged, once.
        for _ in range(_LOOKS):
            status[suspects] = self.column(schema.STATUS.name, suspects)
            suspects = suspects[status[suspects] != schema.PENDING]
            suspects = suspects[self._differ(suspects, status[suspects])]
            if not suspects.size:
                break
        status[suspects] = schema.DAMAGED
        return status

    def _differ(self, rows: NDArray[np.intp], status: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Whether rows that are not pending cannot be what was written.

        Of a row that is not needed, only the status is: what else it holds is not read.
        """
        written, spare = self.column(schema.CHECKSUM.name, rows), status == schema.NOT_NEEDED
        held = np.zeros_like(written)
        if spare.any():
            held[spare] = empty_checksums(self._file, schema.NOT_NEEDED, rows[spare])
        held[~spare] = row_checksums(self.column, self.column(KEPT), rows[~spare])
        return np.asarray((status > schema.NOT_NEEDED) | (written != held))

    def errors(self, rows: NDArray[np.intp]) -> list[str]:
        """Return the error texts of some rows (ascending)."""
        return [text.decode("utf-8", "replace") for text in self.column("error", rows).tolist()]


def mixture(origins: Mapping[str, int]) -> str:
    """Return, after the name of a file, that its rows were not all computed alike; or nothing."""
    if len(origins) < 2:
        return ""
    counts = (f"{count} by {text or 'an unknown version'}" for text, count in origins.items())
    return (
        f"has rows of {len(origins)} versions or processors, on which their last bits depend: "
        + "; ".join(counts)
    )


def named_rows(rows: Sequence[int]) -> str:
    """Return "rows 3, 7 and 12", of many the first and how many more."""
    if len(rows) == 1:
        return f"row {rows[0]}"
    shown = [str(row) for row in rows[:_MOST_NAMED]]
    if len(rows) > _MOST_NAMED:
        return f"{len(rows)} rows ({', '.join(shown)}, …)"
    return f"rows {', '.join(shown[:-1])} and {shown[-1]}"


def stretches(rows: NDArray[np.intp]) -> list[slice]:
    """Split ascending row numbers into runs of successive ones; one that is empty for none."""
    runs = np.split(rows, np.flatnonzero(np.diff(rows) != 1) + 1)
    return [slice(int(run[0]), int(run[-1]) + 1) if run.size else slice(0, 0) for run in runs]


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """Turn what h5py raises over a bad file into one sentence."""
    try:
        yield
    except InputError:
        raise
    except FileNotFoundError as error:
        raise InputError(f"{path} does not exist") from error
    except Exception as error:  # h5py raises nearly every kind over damaged bytes
        if isinstance(error.__cause__, KeyboardInterrupt):  # Ctrl-C in Python, inside h5py
            raise error.__cause__ from None
        if isinstance(error, OSError) and lack(error):
            raise  # too many open files, say: nothing is wrong with this one
        if isinstance(error, OSError) and error.errno in _OF_THE_PATH:
            raise InputError(f"{path} cannot be read: {os.strerror(error.errno)}") from error
        raise InputError(
            f"{path} is not a results file of adhesis, or it is damaged or truncated"
        ) from error
