"""Laying a results file out: at full size, all or nothing, rows of an older file copied in.

What makes it survive a kill at any moment:

- The file is laid out at full size under another name, flushed to disk and renamed, so that it is
  either there whole or not at all. A full disk is met here, before the first task.
- Datasets are contiguous and allocated, so that writing a row changes no metadata.
- A row is written before its status; a row whose status says "done" is whole.
- A campaign that grew gets a new file with the old rows copied in, renamed over the old one.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np

from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import WHOLE, Part
from adhesis.ensemble.errors import InputError, reason
from adhesis.ensemble.outputs import target_of
from adhesis.ensemble.quantities import bytes_text
from adhesis.ensemble.regular_file import irregular
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.copy_rows import Source, copy_dataset
from adhesis.ensemble.results.disk_file import opened, refusal
from adhesis.ensemble.results.head import reserve_head, write_head
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.task.dataset import Dataset, sizes_of
from adhesis.solver.runtime.uninterrupted import signals_held


def check_results_file(option: str, path: Path) -> None:
    """Refuse what is no regular file, and a new file that does not end in .h5 (InputError)."""
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
    versions: Mapping[str, str] | None = None,
    grown_from: Results | None = None,
) -> None:
    """Lay out a results file at full size, by one process; all or nothing.

    It is replaced if it exists; of a symbolic link, the file that it leads to. Of ``grown_from``, a
    file of a campaign that this one extends, the rows are copied. Signals are held back meanwhile:
    h5py would drop what their handlers raise. InputError if the file cannot be written or the disk
    is too small, WriteError if the disk does not take it.
    """
    path = target_of(path)
    unfinished = path.with_name(f"{path.name}.part")
    if unfinished.is_dir() and not unfinished.is_symlink():
        raise InputError(f"{path} cannot be written: there is a directory {unfinished}, remove it")
    with signals_held():
        try:
            check_space(path, campaign, part)
            # Made anew, so that a link of that name is removed and not followed.
            unfinished.unlink(missing_ok=True)
            with opened(unfinished, "x+b") as (file, _):
                reserve_head(file)
                _lay_out(file, campaign, part)
                _describe(file, campaign, part, versions or {}, grown_from)
                if grown_from is not None:
                    _copy_rows(grown_from, file, campaign)  # a part does not grow
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
    laid_out = schema.scales(campaign, part)
    sizes = sizes_of(laid_out)
    for scale in laid_out:
        dataset = file.create_dataset(scale.name, data=scale.values)
        dataset.make_scale(scale.name)
        dataset.attrs.update(schema.description(scale))
    for column in schema.datasets(campaign):
        dataset = _allocate(file, column, schema.shape_of(column, sizes))
        dataset.attrs.update(schema.description(column))
        for axis, dim in enumerate(column.dims):
            dataset.dims[axis].attach_scale(file[dim])
    tasks = campaign.tasks(part)
    for column in schema.TASK_DATASETS:
        file[column.name][...] = tasks.column(column.name)
    for name, column in zip(tasks.names, schema.axis_datasets(campaign), strict=True):
        file[column.name][...] = tasks.column(name)


def _allocate(file: h5py.File, column: Dataset, shape: tuple[int, ...]) -> h5py.Dataset:
    """Create a contiguous dataset, its place on disk taken and filled at once."""
    dtype = np.dtype(column.dtype)
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_layout(h5py.h5d.CONTIGUOUS)
    plist.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plist.set_fill_time(h5py.h5d.FILL_TIME_ALLOC)
    if dtype.kind != "S":  # texts are filled with zeros; h5py hands a text over as garbage
        plist.set_fill_value(np.array(column.fill, dtype))
    space = h5py.h5s.create_simple(shape)
    kind = h5py.h5t.py_create(dtype)
    return h5py.Dataset(h5py.h5d.create(file.id, column.name.encode(), kind, space, plist))


def _describe(
    file: h5py.File,
    campaign: Campaign,
    part: Part,
    versions: Mapping[str, str],
    old: Results | None,
) -> None:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    file.attrs.update(
        {
            **schema.fixed_attributes(campaign, part),
            "created": now if old is None else old.attributes.get("created", now),
            "laid_out": now,
            **versions,
        }
    )


def _copy_rows(old: Results, file: h5py.File, campaign: Campaign) -> None:
    """Copy every row but those that are damaged: in the new file they are pending."""
    source = Source(old, campaign, old.status() != schema.DAMAGED)
    for column in schema.DATASETS:
        if column not in schema.TASK_DATASETS:
            copy_dataset([source], file, column, 0, file[column.name].shape[0])
