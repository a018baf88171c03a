"""Read the heights of ``adhesis loop --heights``, and check that the ends of the period meet."""

from __future__ import annotations

import math
import os
from dataclasses import replace

import numpy as np

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.quantities import HEIGHT, LENGTH, length_text
from adhesis.ensemble.trace.reading.header_units import HeaderUnits, other_steps, units_of_header
from adhesis.ensemble.trace.reading.measured_trace import load_array, units_of_columns
from adhesis.ensemble.trace.reading.missing_heights import without_codes
from adhesis.ensemble.trace.reading.source import source_of
from adhesis.ensemble.trace.reading.text_table import read_table, refuse_uneven_rows
from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array

# The ends do not meet where the step from the last height to the first is more than this many times
# the largest step within. Over a period the steps add up to zero: a profile that is resolved, or
# has a jump elsewhere, has other steps about as large, while a trace that is cut out of a surface
# returns over its whole length. With fewer points than _MIN_POINTS a steep flank looks like a jump.
_CLOSURE_FACTOR, _MIN_POINTS = 3.0, 8
# Steps that differ by less than this share of the largest one are a straight line, which is taken
# as a saw of one tooth.
_STRAIGHT = 1e-3
# Heights that differ by less than this share of their range are equal; where more than so many
# neighbours are, as in steps, it is by chance that first and last one are.
_SAME, _FEW = 1e-9, 2


def read_heights(
    path: str | os.PathLike[str],
    *,
    period: float = math.inf,
    unit: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> tuple[Array, str]:
    """Read the heights of one period in m from a .npy or a text of one column (or one row).

    Returns them, and a text on how they were read. Without ``unit`` the header's counts. Without
    either they are in metres if they range over at most 1 mm, and in the middle rise by no more
    than a step of the ``period`` in m from point to point; else they are refused. InputError for
    anything but one column of finite numbers.
    """
    if unit is not None and "," in unit:
        raise InputError(f"--unit is {unit!r}: with --heights it is one unit, that of the heights")
    source = source_of(path)
    if not source.holds_numbers():
        source.refuse(
            "is neither text nor .npy: --trace reads files of instruments, and a text that holds "
            "zero bytes (UTF-16 without a mark) is to be saved as UTF-8"
        )
    table = None if source.is_npy else read_table(source, delimiter, decimal, may_be_row=True)
    columns = table.columns[list(table.filled)] if table else np.atleast_2d(load_array(source)).T
    if 1 not in columns.shape:
        raise InputError(
            f"{source} holds {columns.shape[1]} × {columns.shape[0]} numbers: --heights takes one "
            "column (or one row), the heights of one period; adhesis trace reads positions and "
            "heights"
        )
    found, heights = HeaderUnits(), columns.reshape(-1)
    if table:
        refuse_uneven_rows(source, table.lines)
        found = units_of_header(table.header, table.fields)
    heights, codes = without_codes(heights, known_alone=True)
    missing = np.flatnonzero(~np.isfinite(heights))
    if missing.size:
        where = f"on line {table.lines[missing[0]]}" if table else f"at index {missing[0]}"
        if codes:
            where += f" ({codes}, which instruments write for missing ones)"
        raise InputError(
            f"{path} has no finite height {where}: --heights needs every height of the period "
            "(adhesis trace fills gaps)"
        )
    # No note says that the option overruled a line of the header, so it is refused as a name is;
    # metres are assumed in any case.
    found = replace(found, by_name=True, unclear="" if found.units[-1] == "m" else found.unclear)
    is_high = heights.size and np.ptp(heights) > HEIGHT.largest  # all heights count
    step = None if is_high else period / max(heights.size, 1)
    (_, of_heights), given_by = units_of_columns(f"{source}", found, unit, heights[None], step)
    said = [f"{counted(heights.size, 'height')} in {of_heights} ({given_by})"]
    if found.depth:
        said.append(
            f"they are named {found.depth!r}: change their sign if they grow into the sample"
        )
    if codes := without_codes(heights)[1]:
        said.append(f"{codes} may stand for missing ones, which adhesis trace fills")
    if table:
        said.extend(other_steps(table.header, table.decimal, period / heights.size))
    return np.asarray(heights * LENGTH.units[of_heights]), "; ".join(said)


def heights_warning(heights: Array, name: str) -> str | None:
    """Return a warning if heights (m) are too few for a profile, or no period of one; else None."""
    if heights.size < _MIN_POINTS:
        return (
            f"{name} holds {heights.size} heights only: fewer than {_MIN_POINTS} make a profile of "
            "a few waves, so check the file"
        )
    if _repeats_its_beginning(heights):
        return (
            f"the last height of {name} is its first one: if the end of the period is written "
            "twice, leave it out, as the next period begins with it; if a trace was levelled "
            "through its ends, it is no period of a profile, and adhesis trace makes one of it"
        )
    # A median of three keeps edges and removes single spikes, which would hide the jump.
    smoothed = np.median([np.roll(heights, k) for k in (1, 0, -1)], axis=0)
    largest = float(np.abs(np.diff(smoothed)).max())
    jump = abs(float(smoothed[0] - smoothed[-1]))
    steps = np.diff(heights)
    is_line = np.ptp(steps) <= _STRAIGHT * np.abs(steps).max()
    if is_line or not jump > _CLOSURE_FACTOR * largest:
        return None
    return (
        f"the ends of {name} do not meet: from its last height to its first it is "
        f"{length_text(jump)}, and no step within exceeds {length_text(largest)}, so it is no "
        "period of a profile and the jump counts as roughness; adhesis trace makes a period of a "
        "measured trace"
    )


def _repeats_its_beginning(heights: Array) -> bool:
    """Return whether the last height is the first one again, and not its mirror image."""
    same = _SAME * np.ptp(heights)
    if abs(heights[-1] - heights[0]) > same or np.sum(np.diff(heights) == 0) > _FEW:
        return False
    if abs(heights[-2] - heights[1]) > same:
        return True
    # Where both sides are alike the period closes more smoothly without a height too many.
    ends = heights[-3:], heights[-4:-1]
    bends = [np.abs(np.diff([*end, *heights[:3]], 3)).sum() for end in ends]
    return bool(bends[1] < bends[0])
