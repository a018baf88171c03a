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

from adhesis.ensemble.campaign.compare import growth
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.results import schema
from adhesis.ensemble.results.layout import Source, create
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.task.dataset import KEPT
from adhesis.ensemble.task.row import RESULT_DATASETS, TIMES

# Times may differ between two computations of one task; nothing else may, and fields follow.
_COMPARED = tuple(d for d in RESULT_DATASETS if d not in TIMES and d.dims[0] != KEPT)


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
        campaign = opened[0].campaign if there is None else there.campaign
        for part in opened:
            _check_campaign(part, campaign, opened[0].path if there is None else out)
        status = np.zeros(campaign.task_count, np.uint8) if there is None else there.status()
        if status.size != campaign.task_count:
            raise InputError(f"{out} is part {there.part if there else ''} of its campaign itself")
        doubts = [doubt for file in opened for doubt in file.doubts()]
        sources = _assign(opened, campaign, status, there)
        of_file = {*schema.fixed_attributes(campaign), "part", "laid_out"}
        if there is None:
            of_file.add("created")
        known = (opened[0] if there is None else there).attributes.items()
        attributes = {name: value for name, value in known if name not in of_file}
        taken = sum(int(source.taken.sum()) for source in sources)
        if there is None:
            create(out, campaign, attributes=attributes, sources=sources)
        elif taken and not os.access(out, os.W_OK):
            raise InputError(f"{out} cannot be written: permission denied")
        elif taken:
            stays = there.status() != schema.DAMAGED
            for source in sources:
                stays[source.target[source.taken]] = False
            old = Source(there, campaign, stays)
            create(out, campaign, attributes=attributes, sources=[old, *sources])
    return Merged(
        total=status.size,
        done=int(np.sum(status == schema.DONE)),
        failed=int(np.sum(status == schema.FAILED)),
        taken=taken,
        doubts=tuple(doubts),
    )


def _check_campaign(part: Results, campaign: Campaign, of: Path) -> None:
    """Refuse a file of another campaign, or of one whose rows have other shapes."""
    growth(part.path, part.campaign, campaign, of)
    if not schema.same_rows(part.campaign, campaign):
        raise InputError(
            f"{part.path} cannot be merged into {of}: the bins of its spectra differ (they follow "
            "the highest n0 · ratio of the campaign)"
        )


def _assign(
    opened: Sequence[Results], campaign: Campaign, status: NDArray[np.uint8], there: Results | None
) -> list[Source]:
    """Decide which file gives which row; ``status`` becomes that of the merged file."""
    sources: list[Source] = []
    giver = np.full(status.size, -1)  # source of each row that is not there yet
    for part in opened:
        own = part.status()
        source = Source(part, campaign, own == schema.DONE)
        target = source.target
        for row in np.flatnonzero((own == schema.DONE) & (status[target] == schema.DONE)).tolist():
            other = giver[target[row]]
            if other >= 0:
                _compare(source, row, sources[other].results, sources[other].row_of(target[row]))
            elif there is not None:
                _compare(source, row, there, int(target[row]))
        # A row that failed elsewhere, in time or place, gives way to one that did not.
        better = (own == schema.DONE) & (status[target] != schema.DONE)
        better |= (own == schema.FAILED) & np.isin(status[target], (schema.PENDING, schema.DAMAGED))
        for row in np.flatnonzero(better & (giver[target] >= 0)).tolist():
            loser = sources[giver[target[row]]]
            loser.taken[loser.row_of(target[row])] = False
        source.taken[:] = better
        giver[target[better]] = len(sources)
        status[target[better]] = own[better]
        sources.append(source)
    return sources


def _compare(source: Source, row: int, other: Results, there: int) -> None:
    """Refuse a row that two files hold with different bits."""
    for dataset in _COMPARED:
        one = source.results.column(dataset.name, slice(row, row + 1))
        two = other.column(dataset.name, slice(there, there + 1))
        if one.tobytes() != two.tobytes():
            raise InputError(
                f"{source.results.path} and {other.path} both hold {source.results.tasks()[row]}, "
                f"and their {dataset.name} differs"
            )
