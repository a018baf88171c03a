"""Read a trace: equally spaced heights in m, and a description of how the file was read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from adhesis.ensemble.errors import InputError, parameter, refused_as_input
from adhesis.ensemble.lengths import HIGHEST_IN_METRES, METRES, length_text
from adhesis.ensemble.trace.containers import beginning, container
from adhesis.ensemble.trace.instrument import HINT, UnknownFormatError, available, read_scan
from adhesis.ensemble.trace.text import Table, read_table
from adhesis.ensemble.trace.units import parse_units, step_of_header, units_of_header
from adhesis.solver import checks
from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array
from adhesis.solver.values import ByValue

MIN_POINTS = 32
_COLUMN = checks.Bounds(1, 1_000_000, whole=True)
MAX_POINTS = 5_000_000
TEXT = frozenset(("txt", "csv", "tsv", "dat", "asc", "prn", "xy", "xyz", "tab", "text", "prf"))

# Positions may scatter about equal steps by this share of a step; heights are then interpolated.
_UNEVEN = 0.10
# Without a unit, numbers are taken as metres only up to these lengths and steps (m).
_LONGEST_IN_METRES, _WIDEST_STEP_IN_METRES = 0.02, 2e-5
# Beyond these limits (m, m, median slope) the unit is wrong.
_LONGEST, _SHORTEST, _STEEPEST = 1.0, 1e-8, 1.0
# A repeated height that lies this many ranges of the other heights outside them stands for a
# missing one. For numbers that instruments write for missing heights the second value holds, and
# once is enough.
_BEYOND, _BEYOND_KNOWN = 5.0, 0.2
_SENTINELS = (9999, 99999, 999999, 9999999, 32767, 32768, 65535, 2147483647, 2147483648)


@dataclass(frozen=True, eq=False, repr=False)
class Trace(ByValue):
    """Measured trace with equal steps.

    Attributes
    ----------
    path : Path
    heights : array, shape (n,)
        In m; NaN where not measured.
    step : float
        In m.
    said : tuple of str
        How the file was read, line by line.
    tip_radius : float or None
        In m, if the file holds it.
    """

    path: Path
    heights: Array
    step: float
    said: tuple[str, ...] = ()
    tip_radius: float | None = None

    @property
    def points(self) -> int:
        """Number of heights."""
        return int(self.heights.size)

    @property
    def length(self) -> float:
        """Distance from the first to the last point, in m."""
        return (self.points - 1) * self.step

    @property
    def drop_outs(self) -> int:
        """Number of missing heights."""
        return int(np.isnan(self.heights).sum())

    @property
    def height_range(self) -> float:
        """Highest less lowest height, in m."""
        return float(np.nanmax(self.heights) - np.nanmin(self.heights))


def read_trace(
    path: str | Path,
    *,
    unit: str | None = None,
    step: float | None = None,
    columns: Sequence[int] | None = None,
    row: int | None = None,
    channel: int | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Trace:
    """Read a measured trace from a text or an instrument file.

    Parameters
    ----------
    path : path
        Text of two columns (positions, heights) or of one (heights), a .npy of that shape, or an
        instrument's file (extra ``instruments``).
    unit : str, optional
        Unit of both columns of a text ("um"), or of positions and heights ("mm,um"). Without it,
        the header must have them, or the numbers can only be metres.
    step : float, optional
        Step in m, for heights without positions.
    columns : sequence of two int, optional
        Columns of positions and heights in a text, counted from 1; shape (2,).
    row, channel : int, optional
        Row of a map and channel of an instrument file, counted from 0.
    delimiter, decimal : str, optional
        Delimiter and decimal sign, where a text can be read in two ways.

    Raises
    ------
    InputError
        If the file cannot be read, or can be understood in several ways.

    References
    ----------
    docs/measured-profile.md, "Reading"
    """
    path = checks.path("path", path)
    with refused_as_input():
        if step is not None:
            step = checks.real(parameter("step"), step, checks.LENGTH)
        if columns is not None:
            columns = [checks.whole(parameter("columns"), k, _COLUMN) for k in columns]
    is_text = holds_numbers(path)
    for name, number in ((parameter("row"), row), (parameter("channel"), channel)):
        if is_text and number is not None:
            raise InputError(
                f"{name} is {number}: {path} holds columns of numbers, no map and no channels "
                f"({parameter('columns')} chooses columns)"
            )
    if is_text and path.suffix.lower() == ".npy":
        return _from_array(path, unit, step)
    if is_text:
        table = read_table(path, delimiter, decimal)
        return _from_table(path, table, unit, step, columns)
    for name, value in (("unit", unit), ("step", step), ("columns", columns)):
        if value is not None:
            raise InputError(
                f"{parameter(name)} belongs to texts: an instrument's file states its own lengths"
            )
    if not available():
        # Without the extra it is not known whether this is a file of an instrument.
        raise InputError(
            container(path)
            or f"{path} is no text: export the trace as text, or, if it is an instrument's file, "
            f"install the optional package SurfaceTopography, {HINT}"
        )
    try:
        scan = read_scan(path, row, channel)
    except UnknownFormatError as error:
        raise InputError(container(path) or str(error)) from None
    heights, step, said = _even(path, scan.positions, scan.heights, None)
    return _checked(Trace(path, heights, step, (scan.said, *said), scan.tip_radius))


def holds_numbers(path: Path) -> bool:
    """Return whether a file is a text or a .npy, and no instrument's file.

    Raises
    ------
    InputError
        If it cannot be read, or has to be unpacked or exported first.
    """
    begin, suffix = beginning(path), path.suffix.lower()
    if suffix == ".npy" or begin[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return True
    # Text formats of instruments, whose numbers are not two columns.
    if begin[:8] in (b"aISO-1.0", b"aBCR-1.0", b"aISO-2.0") or begin[:7] in (
        b"fileFor",
        b"bISO-1.",
    ):
        return False
    if suffix.lstrip(".") in TEXT:
        return True
    return b"\0" not in begin and not begin.startswith((b"PK\x03\x04", b"\x89HDF", b"CDF"))


def load_array(path: Path) -> Array:
    """Load a .npy of real numbers, of one or two dimensions.

    Raises
    ------
    InputError
        If it holds anything else.
    """
    try:
        table: Any = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError, MemoryError, SyntaxError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path} is no .npy of numbers: {reason}") from None
    if not isinstance(table, np.ndarray):
        raise InputError(f"{path} is an archive of arrays: save the one of the heights as .npy")
    if table.dtype.kind not in "fiu" or table.ndim > 2:
        raise InputError(
            f"{path} holds {table.dtype} of {table.ndim} dimensions: heights are real numbers in "
            "one row or column"
        )
    with np.errstate(over="ignore"):  # a longer float that overflows is refused as not finite
        return np.asarray(table, dtype=float)


def _from_array(path: Path, unit: str | None, step: float | None) -> Trace:
    table = np.atleast_1d(load_array(path))
    if table.ndim == 2 and 2 in table.shape:
        columns = table if table.shape[0] == 2 else table.T
    elif table.ndim == 1 or 1 in table.shape:
        columns = table.reshape(1, -1)
    else:
        shape = " × ".join(map(str, table.shape))
        raise InputError(f"{path} holds {shape} numbers: a trace has one column or two")
    lines = np.arange(1, columns.shape[1] + 1)
    return _from_table(path, Table(columns, (), (), lines, " ", "."), unit, step, None)


def _from_table(
    path: Path, table: Table, unit: str | None, step: float | None, wanted: Sequence[int] | None
) -> Trace:
    columns, fields = table.columns, list(table.fields)
    if wanted is not None:
        if len(wanted) != 2 or not all(1 <= w <= len(columns) for w in wanted):
            raise InputError(
                f"{parameter('columns')} is {','.join(map(str, wanted))}: it must name two of the "
                f"{len(columns)} columns of {path}, those of positions and heights, as in 1,2"
            )
        columns = columns[[w - 1 for w in wanted]]
        fields = [tuple(row[w - 1] for w in wanted) for row in fields]
    elif len(columns) > 2:
        raise InputError(
            f"{path} has {len(columns)} columns: give {parameter('columns')} X,Z, those of "
            "positions and heights"
        )
    if columns.shape[1] < MIN_POINTS:
        raise InputError(
            f"{path} holds {columns.shape[1]} rows of numbers: at least {MIN_POINTS}"
        )
    if columns.shape[1] > MAX_POINTS:
        raise InputError(f"{path} holds {columns.shape[1]} rows of numbers: at most {MAX_POINTS}")
    said = [
        f"text, {table.said}" if table.fields or table.header or path.suffix != ".npy" else "npy"
    ]
    heights, gaps = _without_sentinels(columns[-1])
    columns = np.vstack([columns[:-1], heights])
    (x_unit, z_unit), source = _units(path, table, fields, unit, columns, step)
    heights = heights * METRES[z_unit]
    positions = f"positions in {x_unit}, " if len(columns) == 2 else ""
    said.append(f"{positions}heights in {z_unit} ({source})")
    if gaps:
        said.append(gaps)
    if len(columns) == 2:
        if step is not None:
            raise InputError(
                f"{parameter('step')} belongs to heights without positions: {path} has positions"
            )
        heights, step, more = _even(path, columns[0] * METRES[x_unit], heights, table.lines)
        said.extend(more)
    elif step is None:
        step = step_of_header(table.header, table.decimal)
        if step is None:
            raise InputError(
                f"{path} has heights without positions, and its header states no step: "
                f"give {parameter('step')}, as in 0.5um"
            )
        said.append(f"step {length_text(step, 6)} (header)")
    return _checked(Trace(path, heights, float(step), tuple(said)))


# ---------------------------------------------------------------------- units


def _units(
    path: Path,
    table: Table,
    fields: Sequence[Sequence[str]],
    unit: str | None,
    columns: Array,
    step: float | None,
) -> tuple[tuple[str, str], str]:
    found = units_of_header(table.header, fields)
    found = [*found, *found][:2] if len(columns) == 1 else found
    if unit is not None:
        given = parse_units(unit)
        for name, known, wanted in zip(("positions", "heights"), found, given, strict=True):
            if known not in (None, wanted) and not (len(columns) == 1 and name == "positions"):
                raise InputError(
                    f"{parameter('unit')} is {wanted} for the {name}, and the header of {path} "
                    f"has {known}: correct the wrong one"
                )
        return given, parameter("unit")
    if found[0] is not None and found[1] is not None:
        return (found[0], found[1]), "header"
    if found[0] is not None or found[1] is not None:
        known = "positions" if found[0] else "heights"
        raise InputError(
            f"the header of {path} states the unit of the {known} alone: give {parameter('unit')} "
            "X,Z, as in mm,um"
        )
    if _sure_to_be_metres(columns, step):
        return ("m", "m"), "numbers"
    x = columns[0]
    size = (
        f"positions from {np.nanmin(x):g} to {np.nanmax(x):g}"
        if len(columns) > 1
        else (f"heights from {np.nanmin(x):g} to {np.nanmax(x):g}")
    )
    raise InputError(
        f"{path} states no unit, and {size} need not be metres: give {parameter('unit')}, as in um"
    )


def _sure_to_be_metres(columns: Array, step: float | None) -> bool:
    heights = columns[-1][np.isfinite(columns[-1])]
    if (
        heights.size == 0
        or np.percentile(heights, 99) - np.percentile(heights, 1) > HIGHEST_IN_METRES
    ):
        return False
    if len(columns) == 1:
        return step is not None
    x = columns[0][np.isfinite(columns[0])]
    if x.size < 2:
        return False
    length = float(x.max() - x.min())
    return length <= _LONGEST_IN_METRES and length / (x.size - 1) <= _WIDEST_STEP_IN_METRES


# ---------------------------------------------------------------------- gaps and steps


def _without_sentinels(heights: Array) -> tuple[Array, str]:
    """Replace numbers that stand for missing heights by NaN; return heights and a description."""
    good = heights[np.isfinite(heights)]
    for value in (good.min(), good.max()) if good.size else ():
        others = good[good != value]
        if others.size < 2:
            continue
        width = max(float(np.ptp(others)), 1e-300)
        away = min(abs(value - others.min()), abs(value - others.max()))
        times = int(np.sum(good == value))
        known = _is_sentinel(float(value))
        if away > (_BEYOND_KNOWN if known else _BEYOND) * width and (times >= 3 or known):
            found = np.where(heights == value, np.nan, heights)
            return (
                found,
                f"{counted(times, 'height')} of {value:g} taken as drop-outs: far out of the range",
            )
    return np.where(np.isfinite(heights), heights, np.nan), ""


def _is_sentinel(value: float) -> bool:
    return abs(value) >= 1e20 or any(abs(abs(value) - s) <= 1.0 for s in _SENTINELS)


def _even(
    path: Path, x: Array, heights: Array, lines: Array | None
) -> tuple[Array, float, list[str]]:
    """Return heights at equal steps, the step in m, and a description of what was done."""
    said: list[str] = []
    where = "point {} of {}" if lines is None else "line {} of {}"

    def place(k: int) -> str:
        return where.format(k if lines is None else int(lines[k]), path)

    if not np.all(np.isfinite(x)):
        raise InputError(f"{place(int(np.argmin(np.isfinite(x))))} has no position")
    steps = np.diff(x)
    if np.all(steps < 0):
        x, heights, steps = x[::-1], heights[::-1], -steps[::-1]
        said.append("positions ran backwards: turned round")
    elif np.any(steps <= 0):
        back = int(np.argmax(steps <= 0)) + 1
        word = "stand still" if steps[back - 1] == 0 else "turn back"
        raise InputError(
            f"the positions {word} at {place(back)}: they must rise or fall throughout"
        )
    middle = float(np.median(steps))
    apart = np.rint(steps / middle).astype(int)
    if apart.sum() > 4 * heights.size or apart.min() < 1:
        far = int(np.argmax(np.abs(steps - middle)))
        raise InputError(
            f"the steps of the positions are unequal: {middle:.4g} m mostly, {steps[far]:.4g} m at "
            f"{place(far + 1)}"
        )
    index = np.concatenate([[0], np.cumsum(apart)])
    step = float((x[-1] - x[0]) / index[-1])
    off = np.abs(x - x[0] - index * step)
    if off.max() > _UNEVEN * step:
        # Drift of the scanner: the number of steps is right, the positions are not.
        if np.all(apart == 1) and np.abs(steps / step - 1).max() <= _UNEVEN:
            even = np.linspace(x[0], x[-1], x.size)
            said.append(
                f"unequal steps ({100 * np.abs(steps / step - 1).max():.1f} %) put on equal "
                "ones, linearly"
            )
            return np.interp(even, x, heights), step, said
        far = int(np.argmax(off))
        raise InputError(
            f"the steps of the positions are unequal: {step:.4g} m on average, and "
            f"{place(far)} is {off[far] / step:.2g} steps away from where it should be"
        )
    if index[-1] + 1 > x.size:
        whole = np.full(index[-1] + 1, np.nan)
        whole[index] = heights
        said.append(f"{counted(whole.size - x.size, 'position')} left out: taken as drop-outs")
        heights = whole
    return heights, step, said


def _checked(trace: Trace) -> Trace:
    """Check that the trace is one of a rough surface, in the units that were found."""
    good = trace.heights[np.isfinite(trace.heights)]
    if good.size < MIN_POINTS:
        raise InputError(f"{trace.path} holds {good.size} heights: at least {MIN_POINTS}")
    if np.ptp(good) == 0:
        raise InputError(
            f"every height of {trace.path} is {good[0]:g} m: a flat trace has no loss"
        )
    if not _SHORTEST <= trace.length <= _LONGEST:
        raise InputError(
            f"{trace.path} would be {trace.length:.3g} m long: is its unit right "
            f"({parameter('unit')})?"
        )
    steps = np.abs(np.diff(trace.heights))
    slope = float(np.nanmedian(steps) / trace.step)
    if slope > _STEEPEST:
        raise InputError(
            f"{trace.path} would rise by {slope:.3g} times its step from point to point: are "
            f"positions and heights in the same unit ({parameter('unit')} X,Z)?"
        )
    return trace
