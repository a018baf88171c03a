"""The shape of a results file: one table that lays it out, reads it and documents it.

Columns of a loop are defined in :mod:`adhesis.ensemble.task.row`; here the columns of its task and
its status are added. ``docs/results-file.md`` describes the same datasets for people; a test
compares the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import WHOLE, Part
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.task.dataset import (
    COUNT,
    FLOAT,
    KEPT,
    Dataset,
    flags,
    scale,
    sizes_of,
)
from adhesis.ensemble.task.row import RESULT_DATASETS, row_scales

FILE_TYPE = "adhesis-results"
FILE_VERSION = 1
# Versions, beside that of adhesis, on which the last bits of a loop depend.
_COMPUTING = ("numpy", "scipy", "kernels", "fftw", "processor")

PENDING, DONE, FAILED, NOT_NEEDED = 0, 1, 2, 3
_STATES = ("pending", "done", "failed", "not needed")
# Never stored: the status that readers get of a row that is not what was written.
DAMAGED = 4
ERROR_LENGTH = 512
ORIGIN_LENGTH = 160


# What the task is, known before it runs.
TASK_DATASETS: tuple[Dataset, ...] = (
    Dataset("hurst", "1", "Hurst exponent H"),
    Dataset("work_of_adhesion", "J m-2", "work of adhesion"),
    Dataset("realisation", "1", "realisation of the profile", COUNT),
    Dataset("seed", "1", "seed of the profile's phases", "i8"),
)
STATUS = Dataset("status", "1", "state of the task", "u1", attributes=flags(_STATES, "u1"))
CHECKSUM = Dataset("checksum", "1", "CRC-32 of the row; not of a pending one", "u4")
_ORIGIN = "versions and processor that computed the task (UTF-8)"
ORIGIN = Dataset("computed_by", "1", _ORIGIN, f"S{ORIGIN_LENGTH}")
# How it went; the status is written last.
RUN_DATASETS: tuple[Dataset, ...] = (
    STATUS,
    Dataset("error", "1", "why the task failed (UTF-8)", f"S{ERROR_LENGTH}"),
    Dataset("rank", "1", "rank that computed the task", COUNT),
    ORIGIN,
    CHECKSUM,
)
# What a run writes; everything else in the file never changes.
ROW_DATASETS: tuple[Dataset, ...] = RUN_DATASETS + RESULT_DATASETS
# The datasets of every campaign; one for each further axis comes to them.
DATASETS: tuple[Dataset, ...] = TASK_DATASETS + RUN_DATASETS + RESULT_DATASETS
_NAMES = frozenset(dataset.name for dataset in DATASETS)


def axis_datasets(campaign: Campaign) -> tuple[Dataset, ...]:
    """Return the datasets of the axes besides H and γ, by the names of their keys.

    A key that a result is called after ("h_rms") has "wanted" before its name.
    """
    return tuple(
        Dataset(
            axis.name if axis.name not in _NAMES else f"wanted_{axis.name}",
            axis.unit,
            axis.meaning,
            COUNT if all(isinstance(value, int) for value in axis.values) else FLOAT,
        )
        for axis in campaign.axes[2:]
    )


def kept_rows(campaign: Campaign, part: Part = WHOLE) -> NDArray[np.intp]:
    """Return the rows of the tasks that keep their fields, in the file of a part."""
    realisation = campaign.rows(part) % campaign.realisations
    return np.flatnonzero(realisation < campaign.output.field_realisations)


def scales(campaign: Campaign, part: Part = WHOLE) -> tuple[Dataset, ...]:
    """Return the dimensions of the results file of a campaign, or of a part of it."""
    return (
        scale("task", campaign.rows(part), "1", "row of the task in the whole campaign"),
        *row_scales(campaign),
        scale(KEPT, kept_rows(campaign, part), "1", "row of a task that keeps its fields"),
    )


def check_same_rows(one: Campaign, two: Campaign, refused: str) -> None:
    """Raise InputError if rows of two campaigns differ in dimensions; ``refused`` names what is."""
    pairs = zip(row_scales(one), row_scales(two), strict=True)
    if not all(a.name == b.name and np.array_equal(a.numbers, b.numbers) for a, b in pairs):
        raise InputError(
            f"{refused}: the bins of its spectra would change (they follow the highest n0 · ratio "
            "of the campaign, and the period)"
        )


class Member(NamedTuple):
    """A scale or dataset in the file of one campaign, as it is laid out and as readers want it."""

    dataset: Dataset
    shape: tuple[int, ...]
    # Returns the numbers that the campaign decides; None where a run writes them
    values: Callable[[], NDArray[Any]] | None

    @property
    def nbytes(self) -> int:
        """Bytes of its numbers."""
        return np.dtype(self.dataset.dtype).itemsize * math.prod(self.shape)


def members(campaign: Campaign, part: Part = WHOLE) -> list[Member]:
    """Return the scales and then the datasets of the file of a campaign, or of a part of it."""
    laid_out, tasks = scales(campaign, part), campaign.tasks(part)
    sizes, further = sizes_of(laid_out), axis_datasets(campaign)
    known = {d.name: partial(np.asarray, d.numbers) for d in laid_out}
    known |= {d.name: partial(tasks.column, d.name) for d in TASK_DATASETS}
    for dataset, axis in zip(further, tasks.names, strict=True):
        known[dataset.name] = partial(tasks.column, axis)
    return [
        Member(d, tuple(sizes[dim] for dim in d.dims or (d.name,)), known.get(d.name))
        for d in (*laid_out, *TASK_DATASETS, *further, *RUN_DATASETS, *RESULT_DATASETS)
    ]


def file_size(campaign: Campaign, part: Part = WHOLE) -> int:
    """Bytes of a campaign's results file, without headers."""
    return sum(member.nbytes for member in members(campaign, part))


def fixed_attributes(campaign: Campaign, part: Part = WHOLE) -> dict[str, Any]:
    """Return the root attributes that a campaign decides, and the same for every file of it."""
    return {
        "file_type": FILE_TYPE,
        "file_version": np.int32(FILE_VERSION),
        "Conventions": "CF-1.11",
        "title": "Loading-unloading hysteresis loops of rough adhesive contacts",
        "campaign": campaign.text,
        "seed": campaign.sweep.seed,
        **({} if part == WHOLE else {"part": str(part)}),
    }


def encode_text(text: str, length: int = ERROR_LENGTH) -> bytes:
    """Return a text as it is stored: UTF-8, whole characters, at most ``length`` bytes."""
    return text.encode("utf-8", "replace")[:length].decode("utf-8", "ignore").encode("utf-8")


def origin_of(versions: Mapping[str, Any]) -> str:
    """Return in one text what the bits of a row depend on: versions and processor."""
    commit = str(versions.get("commit", "unknown"))
    by = f"adhesis {versions.get('adhesis_version', 'unknown')}"
    if commit != "unknown":
        by += f" ({commit[:12]})"
    others = (f"{name} {versions[name]}" for name in _COMPUTING if versions.get(name))
    return ", ".join((by, *others))
