"""Joining results files of one campaign: parts that were computed apart become one file.

What is joined is a results file like any other: it can be resumed, merged into again, and grown.
Memory is bounded by a block of rows, whatever the number and size of the parts. The file is written
anew and renamed: a kill leaves the old one.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.tables import Campaign, growth
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.layout import Source, create
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.task.dataset import KEPT
from adhesis.ensemble.task.row import RESULT_DATASETS, TIMES

# Times may differ between two computations of one task; nothing else may, and fields follow.
_COMPARED = tuple(d for d in RESULT_DATASETS if d not in TIMES and d.dims[0] != KEPT)
# By status, how much a row is worth: one that failed gives way to one that did not.
_WORTH = np.array([0, 2, 1, 1, 0])


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
                f"{one.results.tasks()[here.item()]}, and their {dataset.name} differs"
            )
