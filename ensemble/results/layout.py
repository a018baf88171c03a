"""Laying a results file out: at full size, all or nothing, rows of other files copied in.

It is made under another name, flushed to disk and renamed: a kill leaves the old one. Datasets are
contiguous and allocated, so that writing a row changes no metadata (docs/results-file.md, "How it
is written"). The rows are those of an older file of the campaign, or of parts that were computed
apart, whatever their number and size: memory is bounded by a block of rows.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import combinations
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.tables import Campaign, growth
from adhesis.ensemble.campaign.tasks import WHOLE, Part
from adhesis.ensemble.errors import InputError, parameter, reason, refusal
from adhesis.ensemble.files import irregular, target_of
from adhesis.ensemble.quantities import bytes_text
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.checksum import reserve_head, write_head
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.write import opened
from adhesis.ensemble.task.dataset import KEPT, Dataset
from adhesis.ensemble.task.row import RESULT_DATASETS, TIMES
from adhesis.solver.runtime.uninterrupted import signals_held

_BLOCK_BYTES = 16 * 2**20
# Times may differ between two computations of one task; nothing else may, and fields follow.
_COMPARED = tuple(d for d in RESULT_DATASETS if d not in TIMES and d.dims[0] != KEPT)
# By status, how much a row is worth: one that failed gives way to one that did not.
_WORTH = np.array([0, 2, 1, 1, 0])

Rows = NDArray[np.intp]


def check_results_file(path: Path) -> None:
    """Refuse what is no regular file, and a new file that does not end in .h5 (InputError)."""
    option = parameter("out")
    try:
        kind = irregular(path.stat().st_mode)
    except FileNotFoundError:
        if path.suffix != ".h5":
            raise InputError(
                f"{option} is {path}: the name of a new results file must end in .h5"
            ) from None
        folder = target_of(path).parent
        if not folder.is_dir():
            raise InputError(f"{path} cannot be written: there is no folder {folder}") from None
        return
    except OSError as error:
        raise InputError(f"{option} is {path}: it cannot be written ({error.strerror})") from None
    if kind is not None:
        raise InputError(f"{option} is {path}: it is {kind}, not a results file")


def check_space(path: Path, campaign: Campaign, part: Part = WHOLE) -> None:
    """Refuse a file that the disk has no room for (InputError), before its tasks are made."""
    needed = schema.file_size(campaign, part)
    free = shutil.disk_usage(path.parent).free
    if needed > free:
        raise InputError(
            f"{path} needs {bytes_text(needed)} and the disk has {bytes_text(free)} free"
        )


def create(
    path: Path | str,
    campaign: Campaign,
    *,
    part: Part = WHOLE,
    attributes: Mapping[str, Any] | None = None,
    sources: Sequence[Source] = (),
) -> None:
    """Lay out a results file at full size, by one process; all or nothing.

    It is replaced if it exists; of a symbolic link, the file that it leads to. ``attributes`` are
    root attributes beside those that the campaign decides. InputError if the file cannot be written
    or the disk is too small, WriteError if the disk does not take it.
    """
    path = target_of(path)
    unfinished = path.with_name(f"{path.name}.part")
    if unfinished.is_dir() and not unfinished.is_symlink():
        raise InputError(f"{path} cannot be written: there is a directory {unfinished}, remove it")
    now = datetime.now(UTC).isoformat(timespec="seconds")
    try:
        check_space(path, campaign, part)
        # Made anew, so that a link of that name is removed and not followed.
        unfinished.unlink(missing_ok=True)
        with opened(unfinished) as file:
            with signals_held():  # h5py would drop what their handlers raise
                reserve_head(file)
                _lay_out(file, campaign, part)
                file.attrs.update(schema.fixed_attributes(campaign, part))
                file.attrs.update({"created": now, "laid_out": now} | dict(attributes or {}))
            copy_rows(sources, file)
        write_head(unfinished)
        with unfinished.open("rb") as handle:
            os.fsync(handle.fileno())
        unfinished.replace(path)
    except OSError as error:
        raise refusal(error)(f"{path} cannot be written: {reason(error)}") from error
    finally:
        with suppress(OSError):  # what another user has put there meanwhile
            unfinished.unlink(missing_ok=True)


def _lay_out(file: h5py.File, campaign: Campaign, part: Part) -> None:
    """Create the datasets, contiguous, their places on disk taken and filled at once."""
    made: dict[str, h5py.Dataset] = {}
    for column, shape, values in schema.members(campaign, part):
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        # texts are filled with zeros; h5py hands a text over as garbage
        fill = None if column.dtype.startswith("S") else column.fill
        dataset = made[column.name] = file.create_dataset(
            *(column.name, shape, column.dtype), fillvalue=fill, fill_time="alloc", dcpl=plist
        )
        if not column.dims:
            dataset.make_scale(column.name)
        dataset.attrs.update(column.described)
        for axis, dim in enumerate(column.dims):
            dataset.dims[axis].attach_scale(made[dim])
        if values is not None:
            dataset[...] = values()


# ---------------------------------------------------------------------- rows of other files


def rows_in(campaign: Campaign, file: Results) -> Rows:
    """Return the row in a whole campaign, from which the file's has grown, of each of its tasks."""
    cells = campaign.tasks().of_cells()
    place = {campaign.identity(task): number for number, task in enumerate(cells)}
    tasks, here = file.tasks, file.tasks.of_cells()
    there = np.zeros(len(tasks.cells), np.intp)
    there[here.cell_of()] = [place[file.campaign.identity(task)] for task in here]
    rows: Rows = there[tasks.cell_of()] * campaign.realisations + tasks.column("realisation")
    return rows


class Source:
    """A file to take rows from, and where they go in the file of a whole campaign."""

    def __init__(self, results: Results, campaign: Campaign, taken: NDArray[np.bool_]) -> None:
        self.results = results
        self.target = rows_in(campaign, results)  # row of each row, ascending
        self.taken = taken  # rows that this file gives
        self._kept_rows = results.column(KEPT)
        # A task that kept its fields does so in a grown campaign: realisations are only added.
        self._kept = np.searchsorted(schema.kept_rows(campaign), self.target[self._kept_rows])

    def places(self, dataset: Dataset) -> tuple[Rows, NDArray[np.bool_]]:
        """Return the places of the rows of a dataset, and which of them are given."""
        if dataset.dims[0] == KEPT:
            return self._kept, self.taken[self._kept_rows]
        return self.target, self.taken


def copy_rows(sources: Sequence[Source], file: h5py.File) -> None:
    """Copy what each source gives; signals are held back during a block."""
    for dataset in schema.ROW_DATASETS if sources else ():
        there = file[dataset.name]
        width = max(1, int(np.prod(there.shape[1:])) * there.dtype.itemsize)
        step = max(1, _BLOCK_BYTES // width)
        for start in range(0, there.shape[0], step):
            with signals_held():
                block: NDArray[Any] | None = None
                for source in sources:
                    target, taken = source.places(dataset)
                    part = slice(*np.searchsorted(target, (start, start + step)).tolist())
                    if np.any(chosen := taken[part]):
                        block = there[start : start + step] if block is None else block
                        values = source.results.column(dataset.name, part)
                        block[target[part][chosen] - start] = values[chosen]
                if block is not None:
                    there[start : start + step] = block


# ---------------------------------------------------------------------- one file of several


@dataclass(frozen=True)
class Merged:
    """Result of a merge: rows by status, how many it took over, and what it left out."""

    total: int
    done: int
    failed: int
    taken: int
    # A sentence about each file with damaged rows, which are left out, or with rows of several
    # versions or processors
    doubts: tuple[str, ...] = ()


def merge(parts: Sequence[Path | str], out: Path | str) -> Merged:
    """Take over the finished rows of several results files of one campaign.

    ``out`` is made, or is a file of the same campaign, or of one that grew from it; the caller
    holds its lock. InputError before anything is written, if a file is damaged or foreign, or if
    two hold a row with different bits; WriteError if the disk does not take it.
    """
    out = Path(out)
    with ExitStack() as stack:
        opened = [stack.enter_context(Results(part)) for part in parts]
        there = stack.enter_context(Results(out)) if out.exists() else None
        for one, other in combinations(opened, 2):
            if one.path.samefile(other.path):
                raise InputError(f"{other.path} is named twice: give each file once")
        for part in opened:
            if there is not None and part.path.samefile(out):
                raise InputError(f"{part.path} is to be merged into itself")
        first, of = (opened[0], opened[0].path) if there is None else (there, out)
        campaign = first.campaign
        for part in opened:
            growth(part.path, part.campaign, campaign, of)
            refused = f"{part.path} cannot be merged into {of}"
            schema.check_same_rows(part.campaign, campaign, refused)
        if there is not None and len(there) != campaign.task_count:
            raise InputError(f"{out} is part {there.part} of its campaign itself")
        files = opened if there is None else [there, *opened]
        doubts = [doubt for part in opened for doubt in part.doubts()]
        sources, status = _assign(files, campaign, there)
        of_file = {*schema.fixed_attributes(campaign), "part", "laid_out"}
        if there is None:
            of_file.add("created")
        known = first.attributes.items()
        attributes = {name: value for name, value in known if name not in of_file}
        taken = sum(int(source.taken.sum()) for source in sources if source.results is not there)
        if there is not None and taken and not os.access(out, os.W_OK):
            raise InputError(f"{out} cannot be written: permission denied")
        if there is None or taken:
            create(out, campaign, attributes=attributes, sources=sources)
    with Results(out) as made:
        doubts += made.doubts()
    return Merged(
        total=status.size,
        done=int(np.sum(status == schema.DONE)),
        failed=int(np.sum(status == schema.FAILED)),
        taken=taken,
        doubts=tuple(doubts),
    )


def _assign(
    files: Sequence[Results], campaign: Campaign, there: Results | None
) -> tuple[list[Source], NDArray[np.uint8]]:
    """Decide which file gives which row; return also the status of each row of the merged file.

    The file that is ``there`` comes first: what it has stays, unless another file has better.
    """
    status = np.zeros(campaign.task_count, np.uint8)
    giver = np.full(status.size, -1)  # source of each row that is not pending
    sources: list[Source] = []
    for number, file in enumerate(files):
        own = file.status()
        if file is not there:  # how many realisations are needed is decided by a run
            own[own == schema.NOT_NEEDED] = schema.PENDING
        source = Source(file, campaign, np.zeros(own.size, bool))
        sources.append(source)
        target = source.target
        for row in target[(own == schema.DONE) & (status[target] == schema.DONE)].tolist():
            _compare(source, sources[giver[row]], row)
        better = _WORTH[own] > _WORTH[status[target]]
        giver[target[better]] = number
        status[target[better]] = own[better]
    for number, source in enumerate(sources):
        source.taken[:] = giver[source.target] == number
    return sources, status


def _compare(one: Source, other: Source, row: int) -> None:
    """Refuse a row of the merged file that two files hold with different bits."""
    here, there = (np.searchsorted(source.target, [row]) for source in (one, other))
    for dataset in _COMPARED:
        mine = one.results.column(dataset.name, here)
        if mine.tobytes() != other.results.column(dataset.name, there).tobytes():
            raise InputError(
                f"{one.results.path} and {other.results.path} both hold "
                f"{one.results.tasks[here.item()]}, and their {dataset.name} differs"
            )
