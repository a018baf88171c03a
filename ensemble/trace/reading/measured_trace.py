"""A measured trace: equally spaced heights in m, and notes on how they were read."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from adhesis.ensemble.errors import InputError, parameter, reason, refused_as_input
from adhesis.ensemble.quantities import HEIGHT, LENGTH, length_text
from adhesis.ensemble.trace.reading.equal_steps import equal_steps
from adhesis.ensemble.trace.reading.header_units import (
    Column,
    HeaderUnits,
    other_steps,
    parse_units,
    step_of_header,
    units_of_header,
)
from adhesis.ensemble.trace.reading.instrument import HINT, available, check_row, read_scan
from adhesis.ensemble.trace.reading.missing_heights import invalid_rows, without_codes
from adhesis.ensemble.trace.reading.source import Source, source_of
from adhesis.ensemble.trace.reading.text_table import (
    Table,
    looks_like_numbers,
    read_table,
    refuse_uneven_rows,
)
from adhesis.solver import checks
from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array
from adhesis.solver.values import ByValue

MIN_POINTS = 32
_COLUMN = checks.Bounds(1, 1_000_000, whole=True)
_ROW = checks.Bounds(0, 1_000_000, whole=True)
_TIP_RADIUS = checks.Bounds(0.0, checks.LENGTH.high, unit="m")
MAX_POINTS = 5_000_000

# Without a unit, numbers are taken as metres only up to these lengths and steps (m).
_LONGEST_IN_METRES, _WIDEST_STEP_IN_METRES = 0.02, 2e-5
# Beyond these limits (m, m, median slope) the unit is wrong.
_LONGEST, _SHORTEST, _STEEPEST = 1.0, 1e-8, 1.0
# Numbers that differ by less than this share of them are one, but for the last bits.
_SAME = 1e-9
# So many heights of a row or column of a map do not rise or fall throughout by chance.
_NO_CHANCE = 6
_KINDS = ("positions", "heights")
ASSUMED = "assumed: no unit is given"
# Names of a column that counts the points.
_COUNTS = re.compile(
    r"\W*((data|mess|sample|scan)?\W*(no|nr|number|n|i|idx|index|points?|punkt|sample|row|pixels?|px"
    r"|frame|#))?\W*|.*[(\[]\s*(px|pixels?|pts?|points?|samples?|#|-|1)\s*[)\]]\W*",
    re.I,
)


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
    warnings : tuple of str
        What is doubtful about how it was read.

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
    warnings: tuple[str, ...] = ()

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
        good = self.heights[np.isfinite(self.heights)]
        if good.size < MIN_POINTS:
            raise InputError(f"{self.source} holds {good.size} heights: at least {MIN_POINTS}")
        if np.ptp(good) == 0:
            raise InputError(
                f"{self.source}: every height is {good[0]:g} m: a flat trace has no loss"
            )
        if not _SHORTEST <= self.length <= _LONGEST:
            raise InputError(
                f"{self.source} would be {self.length:.3g} m long: are unit and step right "
                f"({parameter('unit')}, {parameter('step')})?"
            )
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
    columns : sequence of int or str, optional
        Columns of positions and heights, shape (2,), or of heights alone, shape (1,): counted from
        1, or names of a DataFrame.
    row, channel : int, optional
        Row of a map (of an instrument file, a text, an array or a table) and channel of an
        instrument file, counted from 0.
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
        if columns is not None and (isinstance(columns, str) or not hasattr(columns, "__iter__")):
            raise TypeError(
                f"{parameter('columns')} is {checks.shown(columns)}: it must be a list, as [1, 2]"
            )
        if unit is not None and not isinstance(unit, str):
            raise TypeError(
                f"{parameter('unit')} is {checks.shown(unit)}: it must be a text, as 'um' or "
                "'mm,um'"
            )
        if columns is not None and hasattr(source, "iloc"):
            columns = _columns_named(source, columns)
        wanted = [checks.whole(parameter("columns"), k, _COLUMN) for k in columns or ()] or None
        row = None if row is None else checks.whole(parameter("row"), row, _ROW)
        channel = None if channel is None else checks.whole(parameter("channel"), channel, _ROW)
    in_memory = _table_of(source, wanted)
    if in_memory is not None:
        if given := _first_given(channel=channel, delimiter=delimiter, decimal=decimal):
            raise InputError(f"{given} belongs to files")
        name, form, table = in_memory
        return _from_table(name, table, unit, step, wanted, row, form)
    source = source_of(source)
    is_text = source.holds_numbers()
    if is_text and channel is not None:
        raise InputError(
            f"{parameter('channel')} is {channel}: {source} holds columns of numbers, and no "
            f"channels ({parameter('columns')} chooses columns)"
        )
    if is_text:
        is_npy = source.is_npy
        table = (
            _columns_of(load_array(source)) if is_npy else read_table(source, delimiter, decimal)
        )
        form = "npy" if is_npy else f"text, {table.form}"
        return _from_table(source.name, table, unit, step, wanted, row, form)
    if given := _first_given(unit=unit, step=step, columns=columns):
        source.refuse(
            f"is no text, and {given} belongs to texts: an instrument's file states its own "
            "lengths (a text that holds zero bytes, as in UTF-16 without a mark, is to be saved as "
            "UTF-8)"
        )
    if not available():
        # Without the extra it is not known whether this is a file of an instrument.
        source.refuse(
            "is no plain text (one that holds zero bytes, as in UTF-16 without a mark, is to be "
            "saved as UTF-8): export the trace as text, or, if it is an instrument's file, install "
            f"the optional package SurfaceTopography, {HINT}"
        )
    positions, heights, description, tip_radius = read_scan(source, row, channel)
    heights, gaps = without_codes(heights)
    heights, step, notes = equal_steps(source.name, positions, 1.0, heights, None)
    length, slope = (heights.size - 1) * step, _slope(heights, step)
    if not _SHORTEST <= length <= _LONGEST or slope > _STEEPEST:
        raise InputError(
            f"{source} would be {length_text(length)} long, and rise by {slope:.3g} times its step "
            "from point to point: its lengths are wrong or damaged, so export it as text with units"
        )
    notes = [description, *([f"{gaps} taken as drop-outs"] if gaps else []), *notes]
    return Trace(heights, step, source.name, tuple(notes), tip_radius)


def _first_given(**options: object) -> str | None:
    """Return the first of these parameters that is given."""
    return next((parameter(name) for name, value in options.items() if value is not None), None)


def load_array(source: Source) -> Array:
    """Load a .npy of real numbers, of one or two dimensions (InputError)."""
    try:
        with source.open() as stream:
            table: Any = np.load(stream, allow_pickle=False)
    except (OSError, ValueError, EOFError, MemoryError, SyntaxError, TypeError) as error:
        raise InputError(f"{source} is no .npy of numbers: {reason(error)}") from None
    return _numbers(source.name, table)


def _numbers(name: str, values: Any) -> Array:
    """Return an array of real numbers as floats; masked ones are NaN."""
    _refuse_units(name, values)
    with refused_as_input():
        checks.check_index(name, values)
    try:
        array = np.ma.asarray(values)
    except ValueError as error:
        raise InputError(f"{name} is no table of numbers: {reason(error)}") from None
    if array.dtype.kind not in "fiu" or array.ndim > 2:
        raise InputError(
            f"{name} holds {array.dtype} of {array.ndim} dimensions: heights are real numbers in "
            "one row or column"
        )
    with np.errstate(over="ignore"):  # a longer float that overflows is refused as not finite
        return np.asarray(np.ma.filled(array.astype(float), np.nan))


def _refuse_units(name: str, values: Any) -> None:
    """Refuse an array that carries a unit, and lists, or lists of lists, of these (TypeError)."""
    entries = [values]
    for _ in range(3):
        if any(map(checks.carries_unit, {type(entry): entry for entry in entries}.values())):
            raise TypeError(f"{name} carries a unit, which would be lost: give plain numbers")
        lists = (entry for entry in entries if isinstance(entry, list | tuple))
        entries = list(itertools.chain.from_iterable(lists))


def _columns_named(table: Any, wanted: Sequence[int | str]) -> list[int | str]:
    """Return the columns of a DataFrame or Series by their numbers, in place of names."""
    names = list(table.columns) if hasattr(table, "columns") else [table.name]
    missing = [name for name in wanted if isinstance(name, str) and names.count(name) != 1]
    if missing:
        known = ", ".join(map(repr, names))
        raise InputError(f"{parameter('columns')} is {missing[0]!r}: the table has {known}")
    return [names.index(name) + 1 if isinstance(name, str) else name for name in wanted]


def _table_of(source: Any, wanted: Sequence[int] | None) -> tuple[str, str, Table] | None:
    """Return name, form and columns of an array or a DataFrame; None for any other source."""
    if isinstance(source, np.ndarray | list | tuple):
        return "array", "array", _columns_of(_numbers("array", source))
    if not hasattr(source, "iloc"):  # which a DataFrame and a Series have
        return None
    if hasattr(source, "to_frame"):  # a Series is a column
        source = source.to_frame()
    all_of_it = range(1, len(source.columns) + 1)
    chosen = all_of_it if wanted is None else [k for k in wanted if k in all_of_it]
    if len(chosen) == 1:
        with refused_as_input():
            checks.check_index("the table", source)
    units = source.attrs.get("units", {})
    if not isinstance(units, Mapping):
        raise InputError(
            f"attrs['units'] of the table is {checks.shown(units)}: it must map the names of the "
            "columns to their units"
        )
    header = [f"{n} ({units[n]})" if units.get(n) else str(n) for n in source.columns]
    values = np.full((len(header), len(source)), np.nan)
    for k, (n, kind) in enumerate(source.dtypes.items(), 1):
        if k not in chosen and kind.kind not in "biuf":
            continue
        if units.get(n) and Column(str(n)).unit not in (None, Column(str(units[n])).unit):
            raise InputError(
                f"column {n!r} of the table has the unit {units[n]} in attrs: correct the wrong one"
            )
        if k in chosen and kind.kind in "bcmM":  # they would get another meaning
            raise InputError(f"column {n!r} of the table holds {kind}: heights are real numbers")
        column = source.iloc[:, k - 1]
        if kind.kind == "O":
            _refuse_units("the table", column.tolist())
        try:
            values[k - 1] = column.to_numpy(dtype=float, na_value=np.nan)
        except (TypeError, ValueError) as error:
            raise InputError(f"the table holds more than numbers: {error}") from None
    # a unit that is given beside the names needs none of them
    names = tuple(str(units.get(n) or name) for n, name in zip(source.columns, header, strict=True))
    lines: Any = np.arange(1, len(source) + 1)
    filled = tuple(range(len(names)))
    form = f"columns {', '.join(header[k - 1] for k in chosen)}"
    index = source.index
    apart = abs(index[1] - index[0]) if len(index) > 1 and index.dtype.kind in "if" else 1
    if len(chosen) == 1 and (apart != 1 or index.dtype.kind == "f"):
        form += f"; their index has steps of {apart:g}, and is not used"
    return "the table", form, Table(values, filled, tuple(header), (names,), lines, " ", ".")


def _columns_of(values: Array) -> Table:
    """Return the columns of an array; two rows are positions and heights, and one row heights."""
    if values.ndim < 2 or values.size == 0 or 1 in values.shape:
        columns = values.reshape(1, -1)
    else:
        columns = values if len(values) == 2 < values.shape[1] else values.T
    lines: Any = np.arange(1, columns.shape[1] + 1)
    filled = tuple(range(len(columns)))
    return Table(columns, filled, (), (), lines, " ", ".")


def _from_table(
    name: str,
    table: Table,
    unit: str | None,
    step: float | None,
    wanted: Sequence[Any] | None,
    row: int | None,
    form: str,
) -> Trace:
    notes = [form]
    names: Sequence[Sequence[str]]
    if row is not None and wanted is None and len(table.filled) > 2:
        columns, names = _row_of_map(name, table, row, notes), ()
        places = table.lines[: row + 1]
        lines = places[-1:].repeat(columns.size)
    else:
        columns, names, lines = _chosen(name, table, wanted, row, notes)
        columns, lines = _scan_line(name, table, columns, lines, row, notes)
        places = lines
    if len(columns) == 1:
        refuse_uneven_rows(name, places, has_others=len(table.filled) > 1)
    if not MIN_POINTS <= columns.shape[1] <= MAX_POINTS:
        raise InputError(
            f"{name} holds {columns.shape[1]} rows of numbers: at least {MIN_POINTS} and at most "
            f"{MAX_POINTS} are needed"
        )
    columns[-1], gaps = without_codes(columns[-1])
    found = units_of_header(table.header, names)
    if len(columns) == 2 and not (found.by_name and found.units[0]):
        # a label beside a number ("Points", "400") names no column
        first = ["=" if looks_like_numbers(row[-1]) else row[0] for row in names]
        given = _step_beside_count(name, table, first, columns[0], unit, step)
        if given is not None:
            step = given
            columns, lines, left_out = _at_counts(columns, places)
            notes.append(f"the first column counts the points{left_out}")
        elif _counts_points(columns[0]):
            asked = f"give {parameter('step')} if it counts the points"
            notes.append(f"the first column is taken as positions: {asked}")
    if len(columns) == 1 and (empty := int(np.sum(np.diff(places) - 1))):
        notes.append(f"{counted(empty, 'empty row')} left out")
    (x_unit, z_unit), given_by = units_of_columns(name, found, unit, columns, step)
    heights = columns[-1] * LENGTH.units[z_unit]
    positions = f"positions in {x_unit}, " if len(columns) == 2 else ""
    notes.append(f"{positions}heights in {z_unit} ({given_by})")
    if found.depth:
        notes.append(
            f"their column is named {found.depth!r}: give {parameter('invert')} if they grow into "
            "the sample"
        )
    if gaps:
        notes.append(f"{gaps} taken as drop-outs")
    if len(columns) == 2:
        if step is not None:
            raise InputError(
                f"{parameter('step')} belongs to heights without positions: {name} has positions"
            )
        heights, step, more = equal_steps(name, columns[0], LENGTH.units[x_unit], heights, lines)
        notes.extend(more)
        begin = float(columns[0].min()) * LENGTH.units[x_unit]
        if abs(begin) > step / 2:
            notes.append(
                f"positions begin at {length_text(begin, 6)}: those named below, and those to "
                "exclude, count from there"
            )
    elif step is None:
        step = step_of_header(name, table.header, table.decimal)
        if step is None:
            raise InputError(
                f"{name} has heights without positions, and no step with its unit is found in its "
                f"header: give {parameter('step')}, as in 0.5um"
            )
        notes.append(f"step {length_text(step, 6)} (header)")
    notes.extend(other_steps(table.header, table.decimal, step))
    if len(columns) == 1 and form.startswith("text"):
        _refuse_length(name, columns[0], step, lines)
    warnings = []
    if given_by == ASSUMED:
        warnings.append(
            f"no unit is given for the numbers of {name}, so they are taken as metres: give "
            f"{parameter('unit')} m if they are, or else their unit"
        )
    trace = Trace(heights, float(step), name, tuple(notes), warnings=tuple(warnings))
    slope = _slope(trace.heights, trace.step)
    if slope > _STEEPEST:
        raise InputError(
            f"{name} would rise by {slope:.3g} times its step from point to point: are positions "
            f"and heights in the same unit ({parameter('unit')} X,Z), and is the step right?"
        )
    return trace


# ---------------------------------------------------------------------- columns and rows


def _chosen(
    name: str, table: Table, wanted: Sequence[Any] | None, row: int | None, notes: list[str]
) -> tuple[Array, Sequence[Sequence[str]], Array]:
    """Return the columns of positions and heights, or of heights, their names, their lines."""
    picked, fields = list(table.filled), table.fields
    if wanted is not None:
        picked = [w - 1 for w in wanted]
        is_known = all(0 <= k < len(table.columns) for k in picked)
        if len(picked) not in (1, 2) or len(set(picked)) < len(picked) or not is_known:
            raise InputError(
                f"{parameter('columns')} is {','.join(map(str, wanted))}: it must name two of the "
                f"{counted(len(table.columns), 'column')} of {name}, those of positions and "
                "heights, as in 1,2, or that of the heights alone"
            )
    elif len(picked) > 2:
        rows = f", or {parameter('row')} K, a row of a map" if len(picked) >= MIN_POINTS else ""
        if not rows and not fields and len(picked) > 3:
            rows = "; heights that go on from row to row are to be written in one column"
        raise InputError(
            f"{name} has {len(picked)} columns: give {parameter('columns')} X,Z, those of "
            f"positions and heights{rows}"
        )
    columns = table.columns[picked]
    # Of columns of unequal length, those chosen end where they do.
    kept = np.arange(columns.shape[1])
    there = np.flatnonzero(np.isfinite(columns).any(axis=0))
    if len(columns) == 2:
        kept = there
    elif wanted is not None and row is None and there.size:
        kept = kept[there[0] : there[-1] + 1]
    if wanted is not None:
        marked, about = invalid_rows(table.columns, fields, picked)
        columns[-1, marked] = np.nan
        notes.extend(about)
    names = [tuple(row[k] for k in picked) for row in fields]
    return columns[:, kept], names, table.lines[kept]


def _row_of_map(name: str, table: Table, row: int, notes: list[str]) -> Array:
    """Return a row of a text whose rows are those of a map."""
    lines = {"row": table.columns.T[:2], "column": table.columns[list(table.filled[:2])]}
    for what, (line, *beside) in lines.items():
        # Beside positions that head the columns, those of the rows have a name or number of theirs.
        for part in line, line[1:]:
            steps = np.diff(part[np.isfinite(part)])
            rises = steps.size >= _NO_CHANCE and (np.all(steps > 0) or np.all(steps < 0))
            if rises or (_is_even(part) and not any(map(_is_even, beside))):
                raise InputError(
                    f"the first {what} of {name} rises or falls throughout, as positions do: "
                    f"remove it, and give {parameter('step')}"
                )
    check_row(name, row, table.columns.shape[1])
    notes.append(f"row {row} of {table.columns.shape[1]}, of {len(table.filled)} heights each")
    return table.columns[list(table.filled), row].reshape(1, -1)


def _is_even(numbers: Array) -> bool:
    """Return whether three numbers or more have equal steps, but for missing ones."""
    steps = np.diff(numbers[np.isfinite(numbers)])
    return bool(steps.size > 1 and np.ptp(steps) <= _SAME * abs(steps[0]) > 0)


def _scan_line(
    name: str, table: Table, columns: Array, lines: Array, row: int | None, notes: list[str]
) -> tuple[Array, Array]:
    """Return one scan line, where the positions of a raster begin anew on each line.

    Beside heights alone they may stand in any other column, and so they may beside positions that
    stand still on each line.
    """
    columns_of_positions, places = columns[:1], lines
    if len(columns) == 1 or (lines.size > 1 and columns[0, 0] == columns[0, 1]):
        # heights may be missing in the first place or the last
        others, places = table.columns[list(table.filled)], table.lines
        columns_of_positions = others[
            (others[:, np.isin(places, lines)] != columns[-1]).any(axis=1)
        ]
    points, count = next(filter(None, map(_raster, columns_of_positions)), (0, 0))
    if row is None and count:
        raise InputError(
            f"the positions of {name} begin anew on line {places[points]}: it is a raster of "
            f"{count} lines of {points} points, of which {parameter('row')} K takes one, 0 to "
            f"{count - 1}"
        )
    if row is None:
        return columns, lines
    if not count:
        raise InputError(
            f"{parameter('row')} is {row}: {name} is no map, as its positions do not begin anew on "
            f"each line, all of one length ({parameter('columns')} chooses columns)"
        )
    check_row(name, row, count)
    notes.append(f"row {row} of {count}, of {points} points each")
    part = slice(row * points, (row + 1) * points)
    return columns[:, part], lines[part]


def _raster(x: Array) -> tuple[int, int] | None:
    """Return numbers of points and of lines, if positions begin anew on each of several lines."""
    again = np.flatnonzero((x[1:] == x[:1]) & (x[:-1] != x[:1])) + 1
    points = int(again[0]) if again.size else max(x.size, 1)
    count, rest = divmod(x.size, points)
    rises = np.sign(np.diff(x[:points]))
    is_raster = count > 1 and not rest and abs(rises.sum()) == points - 1 > 1  # flags have two
    return (points, count) if is_raster and np.array_equal(x, np.tile(x[:points], count)) else None


def _counts_points(x: Array) -> bool:
    """Return whether a column holds ascending whole numbers, as 1, 2, 3 …, few of them left out."""
    steps = np.diff(x)
    counts = np.array_equal(x, np.rint(x)) and np.all(steps > 0) and np.median(steps) == 1
    return bool(counts and np.ptp(x) < 4 * x.size)


def _at_counts(columns: Array, lines: Array) -> tuple[Array, Array, str]:
    """Return the heights at the places that they are counted by, their lines, and a description."""
    place = (columns[0] - columns[0, 0]).astype(int)
    whole = np.full((2, place[-1] + 1), np.nan)
    whole[:, place] = columns[1], lines
    left_out = whole.shape[1] - place.size
    about = f", {left_out} of them left out: taken as drop-outs" if left_out else ""
    return whole[:1], whole[1], about


def _step_beside_count(
    name: str,
    table: Table,
    names: Sequence[str],
    column: Array,
    unit: str | None,
    step: float | None,
) -> float | None:
    """Return the step of heights beside a column that counts the points; None for positions.

    It counts them if it is named so, or a step is given by the option or the header. ``names`` are
    those of the column, of which one may be empty; without any it holds positions.
    """
    is_named = any(_COUNTS.fullmatch(text) for text in names if re.search(r"[\w#]", text))
    is_foreign = bool(names) and not any(Column(text).is_of_positions for text in names)
    may_count, counts = is_named or is_foreign, _counts_points(column)
    if not counts or (not may_count and np.ptp(column) >= column.size):
        # Names are empty where R and pandas write the numbers of rows. Others that skip numbers may
        # be rounded positions as well.
        is_unnamed = names and not any(names) and np.array_equal(column, np.rint(column))
        is_stated = counts and step_of_header(name, table.header, table.decimal) is not None
        if not is_named and not is_unnamed and not is_stated:
            return None
        word = "is named as" if is_named else "may be"
        raise InputError(
            f"the first column of {name} {word} one that counts the points, and does not count 1, "
            f"2, 3 …: give {parameter('columns')} Z, that of the heights, and {parameter('step')}, "
            "if no point is left out"
        )
    if step is None:
        step = step_of_header(name, table.header, table.decimal, counts=may_count)
        is_pair = unit is not None and "," in unit and not is_named
        of_positions = LENGTH.units[parse_units(unit)[0]] if unit and is_pair else None
        if step and of_positions and not np.isclose(step, of_positions, atol=0):
            raise InputError(
                f"the positions of {name} are {length_text(of_positions)} apart by "
                f"{parameter('unit')}, and {length_text(step, 6)} by its header: if the first "
                f"column counts the points, give {parameter('columns')} Z, that of the heights, "
                f"and {parameter('step')}, or else remove the step from the header"
            )
    if step is None and (is_named or (is_foreign and unit is not None)):
        word = "counts" if is_named else f"({names[-1]}) may count" if names[-1] else "may count"
        raise InputError(
            f"the first column of {name} {word} the points: give {parameter('step')}, as in 0.5um"
        )
    return step


def _refuse_length(name: str, column: Array, step: float, lines: Array) -> None:
    """Refuse a step or a length that is among the first heights or the last, in whatever unit."""
    for k in (0, 1, 2, column.size - 1):
        number, others = column[k], column.size - (k + 1 if k < 3 else 1)
        for length in (step, others * step, (others - 1) * step):
            if any(abs(number * size / length - 1) < _SAME for size in LENGTH.units.values()):
                raise InputError(
                    f"line {lines[k]:.0f} of {name} is {number:g}, and the step or the length of "
                    f"the trace is {length_text(length, 6)}: remove it from the heights"
                )


# ---------------------------------------------------------------------- units


def units_of_columns(
    name: str, found: HeaderUnits, unit: str | None, columns: Array, step: float | None
) -> tuple[tuple[str, str], str]:
    """Return the units of positions and heights, or of heights alone, and what states them.

    InputError if header and option do not state them, and the numbers need not be metres.
    """
    kinds = range(2 - len(columns), 2)  # of heights alone the second
    for kind in kinds:
        if found.other[kind]:
            raise InputError(
                f"{found.other[kind]!r} in the header of {name} is no length: the {_KINDS[kind]} "
                "must be lengths, so convert them first"
            )
    stated = found.units if len(columns) == 2 else (found.units[1],) * 2
    if unit is not None:
        given = parse_units(unit)
        source = parameter("unit")
        for kind in kinds:
            if stated[kind] in (None, given[kind]):
                continue
            if found.by_name:
                raise InputError(
                    f"{parameter('unit')} is {given[kind]} for the {_KINDS[kind]}, and the header "
                    f"of {name} has {stated[kind]}: correct the wrong one"
                )
            source += f", against {stated[kind]} in a line of the header"
        return given, source
    if found.unclear:
        raise InputError(
            f"{name} states no unit that is clear, with {found.unclear!r} in its header: give "
            f"{parameter('unit')}, as in {'mm,um' if len(columns) == 2 else 'um'}, if the numbers "
            f"are {' and '.join(_KINDS[2 - len(columns) :])}"
            f"{', in this order' if len(columns) == 2 else ''}"
        )
    if stated[0] is not None and stated[1] is not None:
        return (stated[0], stated[1]), "header"
    if stated[0] is not None or stated[1] is not None:
        known = "positions" if stated[0] else "heights"
        mend = ""
        if _counts_points(columns[0]):
            mend = f", or {parameter('step')} if the first column counts the points"
        elif stated[0] is None:
            mend = ", or take signs of thousands out if all numbers are heights"
        raise InputError(
            f"the header of {name} states the unit of the {known} alone: give {parameter('unit')} "
            f"X,Z, as in mm,um{mend}"
        )
    if _sure_to_be_metres(columns, step):
        return ("m", "m"), ASSUMED
    low, high = np.nanmin(columns[0]), np.nanmax(columns[0])
    raise InputError(
        f"{name} states no unit, and {_KINDS[2 - len(columns)]} from {low:g} to {high:g} need not "
        f"be metres: give {parameter('unit')}, as in um (m, if they are)"
    )


def _sure_to_be_metres(columns: Array, step: float | None) -> bool:
    heights = columns[-1][np.isfinite(columns[-1])]
    if heights.size and np.ptp(np.percentile(heights, [1, 99])) > HEIGHT.largest:
        return False
    if len(columns) == 2:
        x = columns[0][np.isfinite(columns[0])]
        longest = min(_LONGEST_IN_METRES, _WIDEST_STEP_IN_METRES * (x.size - 1))
        step = float(np.ptp(x)) / (x.size - 1) if x.size > 1 and np.ptp(x) <= longest else None
    return step is not None and step > 0 and _slope(heights, step) <= _STEEPEST


def _slope(heights: Array, step: float) -> float:
    """Return the median slope from point to point; 0 if no two neighbours are known."""
    rises = np.abs(np.diff(heights))
    known = rises[np.isfinite(rises)]
    return float(np.median(known)) / step if known.size else 0.0
