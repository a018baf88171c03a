"""The heights of ``adhesis loop --heights``: one period, read as traces are, and its closure."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.trace.containers import container
from adhesis.ensemble.trace.read import holds_numbers, load_array
from adhesis.ensemble.trace.text import Table, read_column
from adhesis.ensemble.trace.units import METRES, length_text, parse_units, units_of_header
from adhesis.solver.model.profile import Array

# A word in brackets, as long as a unit is: "z [æm]" after a wrong conversion.
_PERHAPS_A_UNIT = re.compile(r"[(\[<{]\s*([^\W\d_]{1,3})\s*[)\]>}]")

# The ends do not meet where the step from the last height to the first is so many times the
# largest step within. Over a period the steps add up to zero, so steps of the other sign make up
# for that at the ends: of a profile that is resolved, or has a jump elsewhere, some of them are
# about as large, while a trace that is cut out of a surface returns over its whole length. Among
# fewer points than _FEWEST a steep flank cannot be distinguished from a jump.
_TIMES_LARGEST, _FEWEST = 3.0, 8
# A straight line with no roughness at all is a saw of one tooth, not a trace.
_STRAIGHT = 1e-3


def read_heights(
    path: Path,
    *,
    unit: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Array:
    """Read the heights of one period from a .npy or a text of one column (or one row).

    Parameters
    ----------
    path : Path
    unit : str, optional
        Unit of the heights; without it that of the header, and without that metres.
    delimiter, decimal : str, optional
        Where a text can be read in two ways.

    Returns
    -------
    array, shape (n,)
        In m.

    Raises
    ------
    InputError
        With one sentence, if the file holds anything but one column of finite numbers, or its
        header does not make clear which unit they have.
    """
    given = None if unit is None else _unit(unit)
    if not holds_numbers(path):
        raise InputError(
            container(path)
            or f"{path} is neither text nor .npy: --trace reads files of instruments, as adhesis "
            "trace does"
        )
    if path.suffix.lower() == ".npy":
        array = load_array(path)
        if array.ndim == 2 and 1 not in array.shape:
            raise InputError(_not_one_column(path, *array.shape))
        return np.asarray(array.reshape(-1) * METRES[given or "m"])
    table = read_column(path, delimiter, decimal)
    if len(table.columns) > 1:
        raise InputError(_not_one_column(path, table.columns.shape[1], len(table.columns)))
    heights: Array = table.columns[0] * METRES[_unit_of(path, table, given)]
    missing = np.flatnonzero(~np.isfinite(heights))
    if missing.size:
        raise InputError(
            f"{path} has no finite height on line {table.lines[missing[0]]}: --heights needs every "
            "height of the period (adhesis trace fills gaps)"
        )
    return heights


def _not_one_column(path: Path, rows: int, columns: int) -> str:
    return (
        f"{path} holds {rows} × {columns} numbers: --heights takes one column (or one row), the "
        "heights of one period; adhesis trace reads positions and heights"
    )


def _unit(text: str) -> str:
    if "," in text:
        raise InputError(f"--unit is {text!r}: with --heights it is one unit, that of the heights")
    return parse_units(text)[1]


def _unit_of(path: Path, table: Table, given: str | None) -> str:
    """Unit of the heights: of the option, the header, or metres where neither names one."""
    found = units_of_header(table.header, table.fields)[-1]
    if given is not None:
        if found not in (None, given):
            raise InputError(
                f"--unit is {given} and the header of {path} has heights in {found}: take the "
                "wrong one out"
            )
        return given
    if found is not None:
        return found
    for line in table.header:
        word = _PERHAPS_A_UNIT.search(line)
        if word is not None:
            raise InputError(
                f"the header of {path} has {word[0]!r}, from which the unit of the heights is not "
                "clear: give --unit, as in --unit um"
            )
    return "m"


def closure_warning(heights: Array, name: str) -> str | None:
    """Return a sentence where the ends of one period do not meet, or None.

    Parameters
    ----------
    heights : array, shape (n,)
        In m, equally spaced; the period goes on with the first of them.
    name : str
        What the heights are called in the sentence.
    """
    if heights.size < _FEWEST:
        return None
    # The median of three keeps edges and takes out single spikes, which would hide the jump.
    middle = np.median([np.roll(heights, k) for k in (1, 0, -1)], axis=0)
    largest = float(np.abs(np.diff(middle)).max())
    jump = abs(float(middle[0] - middle[-1]))
    steps = np.diff(heights)
    is_line = np.ptp(steps) <= _STRAIGHT * np.abs(steps).max()
    if is_line or not jump > _TIMES_LARGEST * largest:
        return None
    return (
        f"the ends of {name} do not meet: from its last height to its first it is "
        f"{length_text(jump)}, and no step within exceeds {length_text(largest)}, so it is no "
        "period of a profile and the jump counts as roughness; adhesis trace makes a period of a "
        "measured trace"
    )

