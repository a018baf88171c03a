"""A text of one or two columns: its delimiter, its decimal sign, its header, its gaps."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from adhesis.ensemble.errors import InputError, parameter
from adhesis.ensemble.trace.reading.source import Source
from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array

_ROWS_TO_BEGIN = 3  # rows of numbers that the numbers begin with
_SAMPLE = 400  # lines that the form of a file is judged by
_LONGEST_HEADER_LINE = 1000  # signs; names and units stand within, and searching more takes long
_SHOWN = 60  # signs of a line that a message quotes

DELIMITERS = {";": "semicolons", "\t": "tabs", ",": "commas", " ": "spaces", "|": "bars"}
_COMMENT = "#%!*"
_MISSING = frozenset(
    ("", "nan", "-nan", "nan(ind)", "-1.#ind", "1.#qnan", "inf", "-inf", "+inf",
     "bad", "n/a", "na", "#n/a", "null", "none", "nil", "invalid",
     "missing", "nd", "overflow", "underflow", "x", "?")
)  # fmt: skip
_STARS = re.compile(r"[-*]+|#{2,}")  # as wide as the number that is missing
_FIRST = re.compile(r"[+\-]?[.,]?\d[\d.,eEdD+\-]*")  # of a line: perhaps several, with commas
_NUMBER = re.compile(r"[+\-]?(\d+[.,]?\d*|[.,]\d+)([eEdD][+\-]?\d+)?")
# A name and its unit, in brackets or behind a stroke or "in"; what follows is the next name.
_NAME_AND_UNIT = re.compile(
    r"[^(\[<{/]*?(?:\([^)]*\)|\[[^\]]*\]|<[^>]*>|\{[^}]*\}|\s*/\s*[^\W\d]+|\sin\s+[^\W\d]+)(?=[\s,]|$)[\s,]*"
)


@dataclass(frozen=True, eq=False)
class Table:
    """The numbers of a text file.

    Attributes
    ----------
    columns : array, shape (k, n)
        NaN where a number is missing.
    header : tuple of str
        Lines before the numbers, without their comment signs.
    fields : tuple of tuple of str
        Those header lines that have as many fields as the numbers, split up.
    lines : int array, shape (n,)
        Line of the file that each row stands on, from 1.
    delimiter, decimal : str
    """

    columns: Array
    header: tuple[str, ...]
    fields: tuple[tuple[str, ...], ...]
    lines: Array
    delimiter: str
    decimal: str

    @property
    def form(self) -> str:
        """Description of how the numbers are written."""
        count = len(self.columns)
        form = "one column" if count == 1 else f"{count} columns, {DELIMITERS[self.delimiter]}"
        return form + (", decimal commas" if self.decimal == "," else "")


def read_table(source: Source, delimiter: str | None = None, decimal: str | None = None) -> Table:
    """Read a text of numbers in columns, whatever its header, delimiter and decimal sign.

    Raises
    ------
    InputError
        If the file cannot be read, is no text, holds no columns of numbers, or can be read in two
        ways; the sentence says which line, and which option would settle it.
    """
    return _table(source, _lines(source), delimiter, decimal)


def read_column(source: Source, delimiter: str | None = None, decimal: str | None = None) -> Table:
    """Read a text of one column, as :func:`read_table` does; its numbers may stand in one row.

    Raises
    ------
    InputError
        As :func:`read_table`, and if a number stands among the lines of the header.
    """
    lines = _lines(source)
    rows = [place for place, line in enumerate(lines) if _looks_like_numbers(line)]
    if len(rows) == 1:
        row = lines[rows[0]]
        sign = delimiter or _delimiter(source, [row], decimal)
        words = _split(row, sign)
        if len(words) > 1:
            lines[rows[0] : rows[0] + 1] = words
            delimiter = "|"  # none is left
    table = _table(source, lines, delimiter, decimal)
    for place, line in enumerate(lines[: int(table.lines[0]) - 1]):
        if _looks_like_numbers(line) and _value(line, table.decimal) is not None:
            raise InputError(
                f"line {place + 1} of {source} is {_quoted(line)}, above the numbers that begin on "
                f"line {table.lines[0]}: mark it with # if it is none of them"
            )
    return table


def _table(source: Source, lines: list[str], delimiter: str | None, decimal: str | None) -> Table:
    """Find header and columns in the lines of a file."""
    sample = [line for line in lines if _looks_like_numbers(line)]
    if not sample:
        raise InputError(f"{source} holds no line of numbers")
    spread = sample[:: max(1, len(sample) // _SAMPLE)]
    delimiter, decimal = _form(source, spread, delimiter, decimal)
    split = [_split(line, delimiter) if _looks_like_numbers(line) else None for line in lines]
    count = Counter(len(row) for row in split if row is not None).most_common(1)[0][0]
    start = _first_row(split, count, decimal)
    if start is None and len(sample) < _ROWS_TO_BEGIN:
        raise InputError(
            f"{source} holds {counted(len(sample), 'row')} of numbers: at least {_ROWS_TO_BEGIN} "
            "are needed"
        )
    if start is None:
        raise InputError(f"{source} holds no rows of numbers of one length")
    header = [
        line[:_LONGEST_HEADER_LINE].strip().lstrip(_COMMENT).strip() for line in lines[:start]
    ]
    rows, places = _rows(source, lines, start, count, delimiter, decimal)
    # Of one column, a line of the header is a name as a whole.
    fields = [(line,) if count == 1 else _names(line, delimiter, count) for line in header]
    return Table(
        columns=np.array(rows).T.reshape(count, -1),
        header=tuple(line for line in header if line),
        fields=tuple(row for row in fields if len(row) == count),
        lines=np.array(places),
        delimiter=delimiter,
        decimal=decimal,
    )


def _lines(source: Source) -> list[str]:
    data = source.read()
    if not data.strip():
        raise InputError(f"{source} is empty")
    if data[:4] in (b"\xff\xfe\0\0", b"\0\0\xfe\xff"):
        text = data.decode("utf-32", errors="replace")
    elif data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", errors="replace")
    else:
        if b"\0" in data:
            raise InputError(
                f"{source} is neither text nor an instrument format that can be read: it holds "
                "zero bytes (UTF-16 without a mark is to be saved as UTF-8)"
            )
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")  # one byte a sign: µ and Å are where they should be
    return text.splitlines()


def _quoted(line: str) -> str:
    """A line of the file as a message shows it."""
    line = line.strip()
    return repr(line if len(line) <= _SHOWN else f"{line[:_SHOWN]}…")


# ---------------------------------------------------------------------- form


def _looks_like_numbers(line: str) -> bool:
    """Whether a line begins as a row of numbers, or of numbers and gaps, does."""
    begin = line.strip()
    if not begin or begin[0] in _COMMENT:
        return False
    return bool(_FIRST.fullmatch(re.split(r"[;\t |]", begin, maxsplit=1)[0].strip('"')))


def _form(
    source: Source, sample: Sequence[str], delimiter: str | None, decimal: str | None
) -> tuple[str, str]:
    """Delimiter and decimal sign, given or found out."""
    if delimiter is None:
        delimiter = _delimiter(source, sample, decimal)
    if decimal is None:
        rows = [field for line in sample for field in _split(line, delimiter)]
        comma, point = any("," in f for f in rows), any("." in f for f in rows)
        if comma and point:
            raise InputError(
                f"{source} has commas and points within its numbers: give "
                f"{parameter('decimal')} and {parameter('delimiter')}, "
                "and take signs of thousands out"
            )
        decimal = "," if comma else "."
    return delimiter, decimal


def _delimiter(source: Source, sample: Sequence[str], decimal: str | None) -> str:
    def everywhere(sign: str) -> bool:
        return sum(sign in line.strip() for line in sample) >= 0.8 * len(sample)

    for sign in (";", "\t", "|"):
        if everywhere(sign):
            return sign
    spaced = everywhere(" ")
    if not everywhere(","):
        return " "
    if decimal == ",":
        return " "
    if any("." in line for line in sample) or any(re.search(r",\s", line) for line in sample):
        return ","
    if spaced:
        return " "
    commas = Counter(line.count(",") for line in sample).most_common(1)[0][0]
    if commas == 1:
        if any(re.search(r"[eE][+\-]?\d+\s*,", line) for line in sample):
            return ","
        return _one_comma(source, sample)
    if commas == 3:
        raise InputError(
            f"{source} has rows such as {_quoted(sample[0])}, which can be two numbers or four: "
            f"give {parameter('decimal')}"
        )
    return ","


def _one_comma(source: Source, sample: Sequence[str]) -> str:
    """Tell "12,345" as a decimal number from two whole ones."""
    halves = [line.strip().split(",") for line in sample if line.count(",") == 1]
    whole = [int(left) if re.fullmatch(r"[+\-]?\d+", left) else None for left, _ in halves]
    steps = {b - a for a, b in pairwise(whole) if a is not None and b is not None}
    if len(whole) > 3 and len(steps) == 1 and steps != {0}:
        return ","
    decimals = [right for _, right in halves]
    if len({len(d) for d in decimals}) == 1 and len(decimals[0]) > 1:
        return " "
    if any(len(d) > 1 and d[0] == "0" for d in decimals):
        return " "
    raise InputError(
        f"{source} has rows such as {_quoted(sample[0])}, which can be one number with a decimal "
        f"comma or two: give {parameter('decimal')}"
    )


def _names(line: str, delimiter: str, count: int) -> tuple[str, ...]:
    """Fields of a line of the header, which need not be set apart as the numbers are."""
    fields = _split(line, delimiter, True)
    for sign in DELIMITERS:
        if len(fields) == count:
            break
        fields = _split(line, sign, True)
    if len(fields) != count:
        # "x (mm) h (um)": a name ends where its unit does.
        named = _NAME_AND_UNIT.findall(line)
        if "".join(named).split() == line.split():
            fields = [field.strip(" ,") for field in named]
    return tuple(fields)


def _split(line: str, delimiter: str, header: bool = False) -> list[str]:
    line = line.strip("\r\n ") if delimiter == "\t" else line.strip()
    if delimiter == " ":
        return (
            re.split(r"\s{2,}|\t", line)
            if header and re.search(r"\s{2}|\t", line)
            else line.split()
        )
    fields = [field.strip() for field in line.split(delimiter)]
    if len(fields) > 1 and fields[-1] == "" and not header and len(fields) > 2:
        fields.pop()  # a delimiter at the end of each row
    return fields


# ---------------------------------------------------------------------- numbers


def _is_missing(field: str) -> bool:
    return field.lower() in _MISSING or bool(_STARS.fullmatch(field))


def _value(field: str, decimal: str) -> float | None:
    """Number of a field: NaN for a gap, None for a word."""
    plain = field.strip().strip('"').strip()
    if _is_missing(plain):
        return float("nan")
    if not _NUMBER.fullmatch(plain) or (decimal == "," and "." in plain):
        return None
    if decimal == "." and "," in plain:
        return None
    try:
        return float(plain.replace(",", ".").replace("D", "e").replace("d", "e"))
    except ValueError:
        return None


def _first_row(split: Sequence[list[str] | None], count: int, decimal: str) -> int | None:
    """Line on which the rows begin: the first of three that hold so many numbers."""
    found = []
    for place, row in enumerate(split):
        good = row is not None and len(row) == count
        if good and row is not None and all(_value(field, decimal) is not None for field in row):
            found.append(place)
            if len(found) == _ROWS_TO_BEGIN:
                return found[0]
        elif row is not None or found:
            found = []
    return None


def _rows(
    source: Source, lines: Sequence[str], start: int, count: int, delimiter: str, decimal: str
) -> tuple[list[list[float]], list[int]]:
    rows: list[list[float]] = []
    places: list[int] = []
    foreign: int | None = None
    for place in range(start, len(lines)):
        line = lines[place]
        begin = line.strip()[:1]
        if begin and begin in _COMMENT and (begin == "#" or not _is_missing(line.strip())):
            continue
        if not line.strip() and count > 1:
            continue  # of one column, an empty line is a gap: it has its place
        fields = _split(line, delimiter) or [""]
        if len(fields) < count and _looks_like_numbers(line):
            fields = fields + [""] * (count - len(fields))
        values = [_value(field, decimal) for field in fields]
        if len(fields) != count or None in values:
            foreign = place if foreign is None else foreign
            continue
        if foreign is not None:
            held = "one number" if count == 1 else f"{count} numbers"
            raise InputError(
                f"line {foreign + 1} of {source} is {_quoted(lines[foreign])}: it must hold "
                f"{held}; remove the line or begin it with #"
            )
        rows.append([float("nan") if v is None else v for v in values])
        places.append(place + 1)
    while count == 1 and rows and not lines[places[-1] - 1].strip():
        rows.pop()
        places.pop()
    return rows, places
