"""Read the heights of ``adhesis loop --heights``, and check that the ends of the period meet."""

from __future__ import annotations

import os

import numpy as np

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.quantities import HEIGHT, LENGTH, length_text
from adhesis.ensemble.trace.reading.header_units import parse_units, units_of_header
from adhesis.ensemble.trace.reading.measured_trace import load_array
from adhesis.ensemble.trace.reading.missing_heights import without_codes
from adhesis.ensemble.trace.reading.source import Source, source_of
from adhesis.ensemble.trace.reading.text_table import Table, read_column, refuse_uneven_rows
from adhesis.solver.model.profile import Array

# The ends do not meet where the step from the last height to the first is more than this many times
# the largest step within. Over a period the steps add up to zero: a profile that is resolved, or
# has a jump elsewhere, has other steps about as large, while a trace that is cut out of a surface
# returns over its whole length. With fewer points than _MIN_POINTS a steep flank looks like a jump.
_CLOSURE_FACTOR, _MIN_POINTS = 3.0, 8
# Steps that differ by less than this share of the largest one are a straight line, which is taken
# as a saw of one tooth.
_STRAIGHT = 1e-3


def read_heights(
    path: str | os.PathLike[str],
    *,
    unit: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Array:
    """Read the heights of one period in m from a .npy or a text of one column (or one row).

    Without ``unit`` the header's counts. Without either they are in metres if they range over at
    most 1 mm, and otherwise refused. InputError for anything but one column of finite numbers.
    """
    given = None if unit is None else _unit(unit)
    source = source_of(path)
    if not source.holds_numbers():
        raise InputError(
            source.container()
            or f"{path} is neither text nor .npy: --trace reads files of instruments, and a text "
            "that holds zero bytes (UTF-16 without a mark) is to be saved as UTF-8"
        )
    if source.is_npy:
        array = load_array(source)
        if array.ndim == 2 and 1 not in array.shape:
            raise InputError(_not_one_column(source, *array.shape))
        return _in_metres(source, array.reshape(-1), given)
    table = read_column(source, delimiter, decimal)
    if len(table.filled) > 1:
        raise InputError(_not_one_column(source, table.columns.shape[1], len(table.filled)))
    refuse_uneven_rows(source, table.lines)
    unit = _unit_of(source, table, given)
    heights = table.columns[table.filled[0]]
    missing = np.flatnonzero(~np.isfinite(heights))
    if missing.size:
        raise InputError(
            f"{path} has no finite height on line {table.lines[missing[0]]}: --heights needs every "
            "height of the period (adhesis trace fills gaps)"
        )
    return _in_metres(source, heights, unit)


def _not_one_column(source: Source, rows: int, columns: int) -> str:
    return (
        f"{source} holds {rows} × {columns} numbers: --heights takes one column (or one row), the "
        "heights of one period; adhesis trace reads positions and heights"
    )


def _unit(text: str) -> str:
    if "," in text:
        raise InputError(f"--unit is {text!r}: with --heights it is one unit, that of the heights")
    return parse_units(text)[1]


def _in_metres(source: Source, heights: Array, unit: str | None) -> Array:
    """Convert heights to m; without a unit they are taken as metres, if they can be.

    InputError for numbers that instruments write for missing heights.
    """
    codes = without_codes(heights, known_alone=True)[1]
    if codes:
        raise InputError(
            f"{source} has {codes.removesuffix(' taken as drop-outs')}, which instruments write "
            "for missing ones: --heights needs every height of the period (adhesis trace fills "
            "gaps; give them in another unit if they are heights)"
        )
    if unit is not None:
        return np.asarray(heights * LENGTH.units[unit])
    size = float(np.ptp(heights)) if heights.size else 0.0
    if HEIGHT.largest < size < np.inf:
        raise InputError(
            f"{source} states no unit, and its heights would range over {length_text(size, 4)}: "
            "give --unit, as in --unit um (--unit m, if metres are meant)"
        )
    return heights


def _unit_of(source: Source, table: Table, given: str | None) -> str | None:
    """Return the unit of the heights, of the option or of the header; None without either."""
    stated = units_of_header(table.header, table.fields)
    found = stated.units[-1]
    if stated.other[-1]:
        raise InputError(
            f"{stated.other[-1]!r} in the header of {source} is no length: heights must be"
        )
    if given is not None:
        if found not in (None, given):
            raise InputError(
                f"--unit is {given} and the header of {source} has heights in {found}: correct the "
                "wrong one"
            )
        return given
    if stated.unclear and found != "m":
        raise InputError(
            f"the header of {source} has {stated.unclear!r}, from which the unit of the heights is "
            "not clear: give --unit, as in --unit um"
        )
    return found


def heights_warning(heights: Array, name: str) -> str | None:
    """Return a warning if heights (m) are too few for a profile, or no period of one; else None."""
    if heights.size < _MIN_POINTS:
        return (
            f"{name} holds {heights.size} heights only: fewer than {_MIN_POINTS} make a profile of "
            "a few waves, so check the file"
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
