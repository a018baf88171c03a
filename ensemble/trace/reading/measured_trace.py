"""A measured trace: equally spaced heights in m, and notes on how they were read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from adhesis.ensemble.errors import InputError, parameter, refused_as_input
from adhesis.ensemble.lengths import HIGHEST_IN_METRES, METRES, length_text
from adhesis.ensemble.trace.reading.header_units import (
    parse_units,
    step_of_header,
    units_of_header,
)
from adhesis.ensemble.trace.reading.instrument import HINT, UnknownFormatError, available, read_scan
from adhesis.ensemble.trace.reading.source import Source, source_of
from adhesis.ensemble.trace.reading.text_table import Table, read_table
from adhesis.solver import checks
from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array
from adhesis.solver.values import ByValue

MIN_POINTS = 32
_COLUMN = checks.Bounds(1, 1_000_000, whole=True)
_TIP_RADIUS = checks.Bounds(0.0, checks.LENGTH.high, unit="m")
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
    """A measured trace with equal steps, of any source.

    Immutable; two traces are equal if all fields are. :func:`adhesis.read_trace` makes one of a
    file, a stream, an array or a table; heights in m with a known step need no reading.

    Parameters
    ----------
    heights : array, shape (n,)
        In m; NaN or masked where not measured. At least 32.
    step : float
        Distance of two heights, in m.
    source : str
        Path or name of what was read.
    notes : tuple of str
        How it was read, line by line.
    tip_radius : float, optional
        Of the stylus or probe, in m, if it is known.

    Raises
    ------
    InputError
        If it is no trace of a rough surface in m: too few heights, all of them equal, a length
        below 10 nm or above 1 m.
    TypeError
        If a value is of the wrong type.

    References
    ----------
    docs/measured-profile.md, "Reading"

    Examples
    --------
    >>> import numpy as np
    >>> from adhesis import Trace
    >>> trace = Trace(1e-6 * np.sin(np.arange(200)), step=5e-6)
    >>> trace
    Trace(array: 200 points, step 5 µm, length 995 µm, range 2 µm, 0 drop-outs)
    """

    heights: Array
    step: float
    source: str = "array"
    notes: tuple[str, ...] = ()
    tip_radius: float | None = None

    def __post_init__(self) -> None:
        heights = _numbers(self.source, self.heights)
        if heights.ndim != 1:
            raise InputError(
                f"{self.source} holds numbers of {heights.ndim} dimensions: heights are one row"
            )
        object.__setattr__(self, "heights", np.where(np.isfinite(heights), heights, np.nan))
        with refused_as_input():
            step = checks.real(parameter("step"), self.step, checks.LENGTH)
            object.__setattr__(self, "step", step)
            if self.tip_radius is not None:
                checks.real(parameter("tip_radius"), self.tip_radius, _TIP_RADIUS)
        self._check()
        super().__post_init__()

    def __repr__(self) -> str:
        """Return one line with source, size and gaps."""
        return f"Trace({self.source}: {self.summary})"

    @property
    def summary(self) -> str:
        """Number of points, step, length, range of heights and number of drop-outs."""
        return (
            f"{self.points} points, step {length_text(self.step, 5)}, "
            f"length {length_text(self.length, 5)}, range {length_text(self.height_range, 4)}, "
            f"{counted(self.drop_outs, 'drop-out')}"
        )

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

    def _check(self) -> None:
        """Raise unless it can be a trace of a rough surface, in m."""
        good = self.heights[np.isfinite(self.heights)]
        if good.size < MIN_POINTS:
            raise InputError(f"{self.source} holds {good.size} heights: at least {MIN_POINTS}")
        if np.ptp(good) == 0:
            raise InputError(
                f"{self.source}: every height is {good[0]:g} m: a flat trace has no loss"
            )
        if not _SHORTEST <= self.length <= _LONGEST:
            raise InputError(
                f"{self.source} would be {self.length:.3g} m long: is its unit right "
                f"({parameter('unit')})?"
            )


def read_trace(
    source: Any,
    *,
    unit: str | None = None,
    step: float | None = None,
    columns: Sequence[int | str] | None = None,
    row: int | None = None,
    channel: int | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Trace:
    """Read a measured trace from a file, a stream, an array or a table.

    Parameters
    ----------
    source : path, stream, array or DataFrame
        A path, or an open file or other stream, of a text of two columns (positions, heights) or
        of one (heights), of a .npy of that shape, or of an instrument's file (extra
        ``instruments``). Or an array of that shape; or a pandas DataFrame or Series, whose columns
        are named as those of a text ("x (mm)", "z (um)"), or have units in ``attrs["units"]``.
    unit : str, optional
        Unit of both columns ("um"), or of positions and heights ("mm,um"). Without it, the header
        must have them, or the numbers can only be metres.
    step : float, optional
        Step in m, for heights without positions.
    columns : sequence of two int or str, optional
        Columns of positions and heights, shape (2,): counted from 1, or names of a DataFrame.
    row, channel : int, optional
        Row of a map and channel of an instrument file, counted from 0.
    delimiter, decimal : str, optional
        Delimiter and decimal sign, where a text can be read in two ways.

    Raises
    ------
    InputError
        If it cannot be read, or can be understood in several ways.
    TypeError
        If the source is none of them.

    References
    ----------
    docs/measured-profile.md, "Reading"

    Examples
    --------
    >>> import numpy as np
    >>> from adhesis import read_trace
    >>> x = np.arange(200)
    >>> read_trace(np.column_stack([x, np.sin(x / 9)]), unit="um")
    Trace(array: 200 points, step 1 µm, length 199 µm, range 2 µm, 0 drop-outs)
    """
    with refused_as_input():
        if step is not None:
            step = checks.real(parameter("step"), step, checks.LENGTH)
        named = hasattr(source, "to_numpy") and _are_names(columns)
        if columns is not None and not named:
            columns = [checks.whole(parameter("columns"), k, _COLUMN) for k in columns]
    in_memory = _table_of(source, columns if named else None)
    if in_memory is not None:
        _refuse_options("files", row=row, channel=channel, delimiter=delimiter, decimal=decimal)
        name, table = in_memory
        form = f"columns {', '.join(table.header)}" if table.header else name
        return _from_table(name, table, unit, step, None if named else columns, form)
    source = source_of(source)
    is_text = holds_numbers(source)
    for name, number in ((parameter("row"), row), (parameter("channel"), channel)):
        if is_text and number is not None:
            raise InputError(
                f"{name} is {number}: {source} holds columns of numbers, no map and no channels "
                f"({parameter('columns')} chooses columns)"
            )
    if is_text and source.is_npy:
        table = _columns_of(source.name, load_array(source))
        return _from_table(source.name, table, unit, step, columns, "npy")
    if is_text:
        table = read_table(source, delimiter, decimal)
        return _from_table(source.name, table, unit, step, columns, f"text, {table.form}")
    _refuse_options(
        "texts: an instrument's file states its own lengths", unit=unit, step=step, columns=columns
    )
    if not available():
        # Without the extra it is not known whether this is a file of an instrument.
        raise InputError(
            source.container()
            or f"{source} is no text: export the trace as text, or, if it is an instrument's file, "
            f"install the optional package SurfaceTopography, {HINT}"
        )
    try:
        scan = read_scan(source, row, channel)
    except UnknownFormatError as error:
        raise InputError(source.container() or str(error)) from None
    heights, step, notes = _even(source.name, scan.positions, scan.heights, None)
    notes = [scan.description, *notes]
    return _in_metres(Trace(heights, step, source.name, tuple(notes), scan.tip_radius))


def _are_names(columns: Sequence[int | str] | None) -> bool:
    return columns is not None and all(isinstance(name, str) for name in columns)


def _refuse_options(to_what: str, **options: object) -> None:
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{parameter(name)} belongs to {to_what}")


def holds_numbers(source: Source) -> bool:
    """Return whether a file is a text or a .npy, and no instrument's file.

    Raises
    ------
    InputError
        If it cannot be read, or has to be unpacked or exported first.
    """
    begin, suffix = source.beginning(), source.suffix
    if source.is_npy or begin[:2] in (b"\xff\xfe", b"\xfe\xff"):
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


def load_array(source: Source) -> Array:
    """Load a .npy of real numbers, of one or two dimensions.

    Raises
    ------
    InputError
        If it holds anything else.
    """
    try:
        with source.open() as stream:
            table: Any = np.load(stream, allow_pickle=False)
            is_array = isinstance(table, np.ndarray)
    except (OSError, ValueError, EOFError, MemoryError, SyntaxError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{source} is no .npy of numbers: {reason}") from None
    if not is_array:
        raise InputError(f"{source} is an archive of arrays: save the one of the heights as .npy")
    return _numbers(source.name, table)


def _numbers(name: str, values: Any) -> Array:
    """Return an array of real numbers as floats; masked ones are NaN."""
    array = np.ma.asarray(values)
    if array.dtype.kind not in "fiu" or array.ndim > 2:
        raise InputError(
            f"{name} holds {array.dtype} of {array.ndim} dimensions: heights are real numbers in "
            "one row or column"
        )
    with np.errstate(over="ignore"):  # a longer float that overflows is refused as not finite
        return np.asarray(np.ma.filled(array.astype(float), np.nan))


def _table_of(source: Any, names: Sequence[int | str] | None) -> tuple[str, Table] | None:
    """Return name and columns of an array or a DataFrame; None for any other source."""
    if isinstance(source, np.ndarray | list | tuple):
        return "array", _columns_of("array", _numbers("array", source))
    if not hasattr(source, "to_numpy"):
        return None
    if hasattr(source, "to_frame"):  # a Series is a column
        source = source.to_frame()
    if names is not None:
        missing = [name for name in names if name not in source.columns]
        if missing:
            known = ", ".join(map(repr, source.columns))
            raise InputError(f"{parameter('columns')} is {missing[0]!r}: the table has {known}")
        source = source[list(names)]
    units = source.attrs.get("units", {})
    header = [f"{n} ({units[n]})" if units.get(n) else str(n) for n in source.columns]
    try:
        values = source.to_numpy(dtype=float, na_value=np.nan)
    except (TypeError, ValueError) as error:
        raise InputError(f"the table holds more than numbers: {error}") from None
    table = _columns_of("the table", values, tuple(header))
    return "the table", table


def _columns_of(name: str, values: Array, header: tuple[str, ...] = ()) -> Table:
    values = np.atleast_1d(values)
    if header:
        columns = values.T
    elif values.ndim == 2 and 2 in values.shape:
        columns = values if values.shape[0] == 2 else values.T
    elif values.ndim == 1 or 1 in values.shape:
        columns = values.reshape(1, -1)
    else:
        shape = " × ".join(map(str, values.shape))
        raise InputError(f"{name} holds {shape} numbers: a trace has one column or two")
    lines = np.arange(1, columns.shape[1] + 1)
    return Table(columns, header, (header,) if header else (), lines, " ", ".")


def _from_table(
    name: str,
    table: Table,
    unit: str | None,
    step: float | None,
    wanted: Sequence[Any] | None,
    form: str,
) -> Trace:
    columns, fields = table.columns, list(table.fields)
    if wanted is not None:
        if len(wanted) != 2 or not all(1 <= w <= len(columns) for w in wanted):
            raise InputError(
                f"{parameter('columns')} is {','.join(map(str, wanted))}: it must name two of the "
                f"{len(columns)} columns of {name}, those of positions and heights, as in 1,2"
            )
        columns = columns[[w - 1 for w in wanted]]
        fields = [tuple(row[w - 1] for w in wanted) for row in fields]
    elif len(columns) > 2:
        raise InputError(
            f"{name} has {len(columns)} columns: give {parameter('columns')} X,Z, those of "
            "positions and heights"
        )
    if columns.shape[1] < MIN_POINTS:
        raise InputError(f"{name} holds {columns.shape[1]} rows of numbers: at least {MIN_POINTS}")
    if columns.shape[1] > MAX_POINTS:
        raise InputError(f"{name} holds {columns.shape[1]} rows of numbers: at most {MAX_POINTS}")
    notes = [form]
    heights, gaps = _without_sentinels(columns[-1])
    columns = np.vstack([columns[:-1], heights])
    (x_unit, z_unit), given_by = _units(name, table, fields, unit, columns, step)
    heights = heights * METRES[z_unit]
    positions = f"positions in {x_unit}, " if len(columns) == 2 else ""
    notes.append(f"{positions}heights in {z_unit} ({given_by})")
    if gaps:
        notes.append(gaps)
    if len(columns) == 2:
        if step is not None:
            raise InputError(
                f"{parameter('step')} belongs to heights without positions: {name} has positions"
            )
        heights, step, more = _even(name, columns[0] * METRES[x_unit], heights, table.lines)
        notes.extend(more)
    elif step is None:
        step = step_of_header(table.header, table.decimal)
        if step is None:
            raise InputError(
                f"{name} has heights without positions, and its header states no step: "
                f"give {parameter('step')}, as in 0.5um"
            )
        notes.append(f"step {length_text(step, 6)} (header)")
    return _in_metres(Trace(heights, float(step), name, tuple(notes)))


# ---------------------------------------------------------------------- units


def _units(
    name: str,
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
        for kind, known, wanted in zip(("positions", "heights"), found, given, strict=True):
            if known not in (None, wanted) and not (len(columns) == 1 and kind == "positions"):
                raise InputError(
                    f"{parameter('unit')} is {wanted} for the {kind}, and the header of {name} "
                    f"has {known}: correct the wrong one"
                )
        return given, parameter("unit")
    if found[0] is not None and found[1] is not None:
        return (found[0], found[1]), "header"
    if found[0] is not None or found[1] is not None:
        known = "positions" if found[0] else "heights"
        raise InputError(
            f"the header of {name} states the unit of the {known} alone: give {parameter('unit')} "
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
        f"{name} states no unit, and {size} need not be metres: give {parameter('unit')}, as in um"
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
    name: str, x: Array, heights: Array, lines: Array | None
) -> tuple[Array, float, list[str]]:
    """Return heights at equal steps, the step in m, and a description of what was done."""
    notes: list[str] = []
    where = "point {} of {}" if lines is None else "line {} of {}"

    def place(k: int) -> str:
        return where.format(k if lines is None else int(lines[k]), name)

    if not np.all(np.isfinite(x)):
        raise InputError(f"{place(int(np.argmin(np.isfinite(x))))} has no position")
    steps = np.diff(x)
    if np.all(steps < 0):
        x, heights, steps = x[::-1], heights[::-1], -steps[::-1]
        notes.append("positions ran backwards: turned round")
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
            notes.append(
                f"unequal steps ({100 * np.abs(steps / step - 1).max():.1f} %) put on equal "
                "ones, linearly"
            )
            return np.interp(even, x, heights), step, notes
        far = int(np.argmax(off))
        raise InputError(
            f"the steps of the positions are unequal: {step:.4g} m on average, and "
            f"{place(far)} is {off[far] / step:.2g} steps away from where it should be"
        )
    if index[-1] + 1 > x.size:
        whole = np.full(index[-1] + 1, np.nan)
        whole[index] = heights
        notes.append(f"{counted(whole.size - x.size, 'position')} left out: taken as drop-outs")
        heights = whole
    return heights, step, notes


def _in_metres(trace: Trace) -> Trace:
    """Refuse a trace so steep that the unit of one of its columns must be another."""
    slope = float(np.nanmedian(np.abs(np.diff(trace.heights))) / trace.step)
    if slope > _STEEPEST:
        raise InputError(
            f"{trace.source} would rise by {slope:.3g} times its step from point to point: are "
            f"positions and heights in the same unit ({parameter('unit')} X,Z)?"
        )
    return trace
