"""Read a text of numbers in columns: its header, and one block of rows.

A line of anything but numbers ends the block, and so does a comment. Numbers outside the block are
refused: where they belong to cannot be known.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, pairwise, product
from math import isfinite, isnan, nan
from typing import NoReturn

import numpy as np

from adhesis.ensemble.errors import InputError, parameter, quoted
from adhesis.ensemble.quantities import LENGTH, in_plain_signs
from adhesis.ensemble.trace.reading.missing_heights import may_be_code
from adhesis.ensemble.trace.reading.source import Source
from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array

DELIMITERS = {";": "semicolons", "\t": "tabs", ",": "commas", " ": "spaces", "|": "bars"}
COMMENT = "#%!*"
_SHOWN = 60  # signs of a line that a message quotes
_MISSING = frozenset(
    ("", "nan", "nanind", "inf", "infinity", "bad", "n/a", "na", "#n/a", "#nv", "null",
     "none", "nil", "invalid", "missing", "masked", "void", "nd", "nodata", "nosignal", "over",
     "overrange", "ovr", "under", "overflow", "underflow", "outofrange", "error", "x", "?")
)  # fmt: skip
_SIGNS = re.compile(r"[-+*.()\s]")  # about such a word, or as wide as the number that is missing
_PROGRAM_ERROR = re.compile(r"#{2,}|#\S+[!?]|[-+]?1\.#[A-Z]+0*", re.IGNORECASE)  # #NAME?, 1.#INF
_FIRST = re.compile(r"[+\-]?\.?\d[\d.eEdD+\-'’`´٬_]*")  # of a line
_NUMBER = re.compile(r"[+\-]?(\d+[.,]?\d*|[.,]\d+)([eEdD][+\-]?\d+)?")
# "0,5,1,3" and "0,5, 1,3": four numbers, or two
_DECIMALS = r"\d*(?:e[+\-]?\d+)?"
_PAIRS = re.compile(rf'\s*[^,."\s]*,{_DECIMALS}(?:,\s?[^,."\s]*,{_DECIMALS})+\s*', re.IGNORECASE)
# "0.5, 1,234": commas with blanks and without
_MIXED = re.compile(r"\d,\d.*, |, .*\d,\d")
_MOSTLY = 0.8  # share of the lines in which a delimiter stands
_EXPONENT = re.compile(r"(?<=[\d.])\s*[eEdD](?=\s*[+\-]?\d)")
_ROWS_TO_BEGIN = 3  # rows of numbers that the numbers begin with, or one that is as long as a trace
_LONG_ROW = 32
_SAMPLE = 400  # lines that the form of a file is judged by
_LONGEST_HEADER_LINE = 1000  # signs; names and units stand within, and searching more takes long
# Numbers at each end that are held to all others; others that it needs; share of one printed form.
_ENDS, _TO_JUDGE, _ONE_FORM = 3, 8, 0.95

_DIGIT = re.compile(r"[+\-]?[.,]?\d")
_PAGE_BREAK = re.compile(r"^\f+\r*\n|\f", re.MULTILINE)
# A power of ten above the numbers, as Matlab prints it
_FACTOR = re.compile(r"\s*(?:[\d.]+[eE][+\-]?\d+|10+(?:\.0*)?|0?\.0*1)\s*[*×x]\s*")
# Words of a column that marks rows, as numbers
_MARKS = dict.fromkeys(("true", "yes", "ja", "ok", "good"), 1.0)
_MARKS |= dict.fromkeys(("false", "no", "nein", "ng"), 0.0)
# What people and programs write for the minus sign.
_MARK = "\ufeff"  # of a text in UTF-8
_MINUS = str.maketrans(dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2212", "-"))
# Bytes that are no UTF-8. One between ASCII is a sign of Western Europe (µ, Å, ö); several in a row
# may be a sign of any other code, and are none that is known.
_FOREIGN = re.compile(rb"[\x80-\xff]{2,}")
_UNKNOWN = b"\x81"  # which the code page leaves open
# A name and its unit, in brackets or behind a stroke or "in"; what follows is the next name.
_NAME_AND_UNIT = re.compile(
    r"[^(\[<{/]*?(?:\([^)]*\)|\[[^\]]*\]|<[^>]*>|\{[^}]*\}|\s*/\s*[^\W\d]+|\sin\s+[^\W\d]+)(?=[\s,]|$)[\s,]*"
)


@dataclass(frozen=True, eq=False)
class Table:
    """The numbers of a text file."""

    columns: Array  # shape (k, n); NaN where a number is missing
    filled: tuple[int, ...]  # columns that are not empty from top to bottom
    header: tuple[str, ...]  # lines before the numbers, without their comment signs
    # Those header lines that have as many fields as the numbers, split up
    fields: tuple[tuple[str, ...], ...]
    lines: Array  # shape (n,); line of the file that each row stands on, from 1
    delimiter: str
    decimal: str

    @property
    def form(self) -> str:
        """Description of how the numbers are written."""
        count = len(self.filled)
        form = "one column" if count == 1 else f"{count} columns, {DELIMITERS[self.delimiter]}"
        return form + (", decimal commas" if self.decimal == "," else "")


def read_table(
    source: Source,
    delimiter: str | None = None,
    decimal: str | None = None,
    *,
    may_be_row: bool = False,
) -> Table:
    """Read a text of numbers in columns, whatever its header, delimiter and decimal sign.

    ``may_be_row``: the numbers of one column may stand in one row. InputError if the file cannot be
    read, is no text, holds no columns of numbers or several blocks of them, or can be read in two
    ways; the sentence says which line, and what would settle it.
    """
    lines = _lines(source)
    sample = [line for line in lines if looks_like_numbers(line)]
    if may_be_row and len(sample) == 1:
        parts = split(sample[0], find_form(source, sample, delimiter, decimal)[0])
        if len(parts) > 1:
            place = lines.index(sample[0])
            lines[place : place + 1] = parts
            sample = [part for part in parts if looks_like_numbers(part)]
            delimiter = "|"  # none is left
    if not sample:
        place = max(range(len(lines)), key=lambda k: sum(sign.isdigit() for sign in lines[k]))
        raise InputError(
            f"{source} holds no line of numbers: most digits stand on line {place + 1}, "
            f"{quoted(lines[place].strip(), _SHOWN)}; take words, brackets and quotes about the "
            "numbers out"
        )
    spread = sample[:: max(1, len(sample) // _SAMPLE)]
    is_given = decimal is not None
    above = "".join(lines[: lines.index(sample[0])][-1:])
    delimiter, decimal = find_form(source, spread, delimiter, decimal, above)
    count = Counter(len(split(line, delimiter)) for line in spread).most_common(1)[0][0]
    reader = _Reader(source, lines, delimiter, decimal, count)
    start = _first_row(reader)
    if start is None:
        _refuse_no_rows(reader, len(sample))
    places = _block(reader, start)
    _refuse_numbers_outside(reader, start, places[-1])
    filled = tuple(k for k in range(count) if any(reader.rows[p].fields[k] for p in places))
    rows = [reader.rows[place] for place in places]
    columns = [[row.fields[k] for row in rows] for k in filled]
    if not is_given:
        refuse_thousands(source, columns, decimal)
    for k, column in zip(filled, columns, strict=True):
        numbers = [row.values[k] for row in rows]
        words = [n for n, field in enumerate(column) if field.lower() in _MARKS]
        if words and not all(f.lower() in _MARKS or is_missing(f) for f in column):
            reader.refuse(places[words[0]], ": write NaN for a number that is missing, and no word")
        _refuse_odd_ends(source, column, numbers, places, str(k), is_lone=len(filled) == 1)
        if len(filled) == 1:
            _refuse_dashes(reader, column, places)
    header = [line[:_LONGEST_HEADER_LINE].strip(" \r\n").lstrip(COMMENT) for line in lines[:start]]
    # Of one column, a line of the header is a name as a whole.
    names = [
        (line.strip(),) if count == 1 else _names(line, delimiter, count, filled) for line in header
    ]
    return Table(
        columns=np.array([row.values for row in rows]).T.reshape(count, -1),
        filled=filled,
        header=tuple(filter(None, map(str.strip, header))),
        fields=tuple(row for row in names if len(row) == count and any(row)),
        lines=np.array(places) + 1,
        delimiter=delimiter,
        decimal=decimal,
    )


def _lines(source: Source) -> list[str]:
    data = source.read()
    if data[:4] in (b"\xff\xfe\0\0", b"\0\0\xfe\xff"):
        text = data.decode("utf-32", errors="replace")
    elif data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            known = _FOREIGN.sub(lambda found: _UNKNOWN * len(found[0]), data)
            text = known.decode("cp1252", errors="replace")
    text = text.replace(_MARK, "")  # one of a second file that was appended is no sign of a row
    if not text.isascii():
        text = in_plain_signs(text).translate(_MINUS)
    # A page break is no end of a line: an empty one may be a missing height.
    text = _PAGE_BREAK.sub("", text)
    return re.split(r"\r*\n|\r", text.removesuffix("\n"))


# ---------------------------------------------------------------------- printed numbers


def looks_like_numbers(line: str) -> bool:
    """Return whether a line begins as a row of numbers, or of gaps and numbers, does."""
    begin = line.strip()
    if not begin or begin[0] in COMMENT:
        return False
    first = re.split(r"[;\t |,]", begin.lstrip("; \t|,"), maxsplit=1)[0]
    return bool(_FIRST.fullmatch(first.replace('"', "")))


def split(line: str, delimiter: str) -> list[str]:
    """Split a line into its fields; a delimiter within quotes is none."""
    line = line.strip("\r\n ") if delimiter == "\t" else line.strip()
    if '"' in line:
        if delimiter == " ":
            return [field.strip('"') for field in re.findall(r'"[^"]*"|[^\s"]+', line)]
        try:
            (fields,) = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
        except (csv.Error, ValueError):
            return [line]
        return [field.strip() for field in fields]
    if delimiter == " ":
        return line.split()
    return [field.strip() for field in line.split(delimiter)]


def is_missing(field: str) -> bool:
    """Return whether a field stands for a missing number."""
    return _SIGNS.sub("", field.lower()) in _MISSING or bool(_PROGRAM_ERROR.fullmatch(field))


def value(field: str, decimal: str) -> float | None:
    """Return the number of a field: NaN for a gap, None for a word."""
    plain = field.strip()
    if not _NUMBER.fullmatch(plain):
        return float("nan") if is_missing(plain) else None
    if ("." if decimal == "," else ",") in plain:
        return None
    return float(plain.replace(",", ".").replace("D", "e").replace("d", "e"))


def printed_form(field: str) -> tuple[int, int]:
    """Return the number of decimals of a printed number, and of digits of its exponent."""
    mantissa, _, exponent = field.lower().replace("d", "e").partition("e")
    return len(mantissa.replace(",", ".").partition(".")[2]), len(exponent.lstrip("+-"))


def is_without_words(line: str) -> bool:
    """Return whether a line holds digits, and no letters but those of exponents."""
    plain = _EXPONENT.sub("", line)
    return any(map(str.isdigit, plain)) and not any(map(str.isalpha, plain))


def refuse_thousands(source: Source, columns: Sequence[Sequence[str]], decimal: str) -> None:
    """Refuse numbers whose decimal sign may mark thousands wherever it stands: "1,234".

    Points do so only where numbers below 1000 of the same column have none.
    """
    pattern = re.compile(rf"[+\-]?[1-9]\d{{0,2}}({re.escape(decimal)}\d{{3}})+")
    together = [[field for column in columns for field in column]]
    for column in together if decimal == "," else columns:
        marked = [field for field in column if decimal in field]
        others = [field for field in column if decimal not in field and not is_missing(field)]
        is_plain = [bool(re.fullmatch(r"[+\-]?\d{1,3}", field)) for field in others]
        may_mark = decimal == "," or (any(is_plain) and all(is_plain))
        if marked and may_mark and all(map(pattern.fullmatch, marked)):
            raise InputError(
                f"{source} has numbers such as {marked[0]!r}, and none whose {decimal!r} is a "
                f"decimal sign for certain: give {parameter('decimal')}, or take signs of "
                "thousands out"
            )


def find_form(
    source: Source,
    sample: Sequence[str],
    delimiter: str | None,
    decimal: str | None,
    names: str = "",
) -> tuple[str, str]:
    """Return delimiter and decimal sign by which most lines are rows of numbers.

    InputError if two ways of reading them differ. ``names`` is the line above the numbers.
    """
    known = {sign: sign for sign in DELIMITERS} | {"\\t": "\t", "tab": "\t", "space": " "}
    if delimiter is not None and delimiter not in known:
        rule = f"{', '.join(DELIMITERS.values())} (; tab , space |)"
        raise InputError(f"{parameter('delimiter')} is {delimiter!r}: it must be one of {rule}")
    if decimal not in (None, ".", ","):
        raise InputError(f"{parameter('decimal')} is {decimal!r}: it must be one of '.', ','")
    # No number holds one of these; a comma and a blank may stand in or behind a number.
    sure = [s for s in ";\t|" if sum(s in line for line in sample) >= _MOSTLY * len(sample)][:1]
    some = [sign for sign in ";\t|," if any(sign in line for line in sample)]
    signs = [known[delimiter]] if delimiter else sure or [*some, " "]
    read = {}
    # Without quotes a comma is one of both.
    is_quoted = any('"' in line for line in sample)
    forms = [form for form in product(signs, decimal or ".,") if is_quoted or form[0] != form[1]]
    if not forms:
        raise InputError(f"{parameter('delimiter')} is the decimal sign: omit it, or quote fields")
    for form in forms:
        rows = [[value(field, form[1]) for field in split(line, form[0])] for line in sample]
        whole = [tuple(map(repr, row)) for row in rows if None not in row]
        read[form] = (len(whole), sum(v is not None for row in rows for v in row), whole)
    best = max(read, key=lambda form: read[form][:2])
    most = read[best][0]
    others = [form for form in read if read[form][0] == most and read[form][2] != read[best][2]]
    delimits = ("," in some and not most) or _one_comma(sample) == (",", ".")
    if decimal == "," and best[0] == " " and not delimiter and delimits:
        _refuse_two_ways(source, sample[0], f"leave out {parameter('decimal')}")
    if most and others and best[0] in ", ":
        return _one_comma(sample) or _refuse_two_ways(source, sample[0])
    # A name stands above each of the numbers; "x, mm, z, um" names two.
    fields, numbers = (split(line.rstrip(" ,\r\n"), ",") for line in (names, sample[0]))
    is_named = len(fields) == len(numbers) and not LENGTH.spellings.keys() & set(fields)
    is_doubtful = decimal is None and best[0] == "," and not (is_named or is_quoted)
    # Fewer names than whole numbers, and enough for decimal ones
    is_short = 1 < len(fields) < len(numbers) <= 2 * len(fields) and "." not in "".join(sample)
    is_mixed = 2 * sum(bool(_MIXED.search(line)) for line in sample) > len(sample)
    if is_doubtful and (is_short or is_mixed or all(map(_PAIRS.fullmatch, sample))):
        _refuse_two_ways(source, sample[0], f"give {parameter('decimal')} . if they are delimiters")
    return best


def _refuse_two_ways(source: Source, line: str, mend: str = "") -> NoReturn:
    both = ", or save it with semicolons between the numbers if they are both"
    mend = f"{mend}{both}" if mend else f"give {parameter('decimal')}"
    raise InputError(
        f"{source} has rows such as {quoted(line.strip(), _SHOWN)}, whose commas can be decimal "
        f"signs or delimiters: {mend}"
    )


def _one_comma(lines: Sequence[str]) -> tuple[str, str] | None:
    """Tell "12,345" as a decimal number from two whole ones; None if it may be either."""
    halves = [line.split(",") for line in lines if line.count(",") == 1]
    if any(" " in half.strip() for line in halves for half in line):
        return None
    whole = [int(left) if re.fullmatch(r"[+\-]?\d+", left) else None for left, _ in halves]
    steps = {b - a for a, b in pairwise(whole) if a is not None and b is not None}
    if len(whole) > 3 and len(steps) == 1 and steps != {0}:
        return ",", "."
    decimals = [right for _, right in halves]
    has_one_length = len(set(map(len, decimals))) == 1 and len(decimals[0]) > 1
    if has_one_length or any(len(d) > 1 and d[0] == "0" for d in decimals):
        return " ", ","
    return None


# ---------------------------------------------------------------------- block


@dataclass
class _Row:
    """A row of numbers; of a row of empty fields ``values`` holds NaN alone."""

    fields: list[str]
    values: list[float]
    is_whole: bool  # whether it has as many fields as there are columns

    @property
    def is_empty(self) -> bool:
        return all(map(isnan, self.values))


@dataclass(frozen=True)
class _Reader:
    """What a line of a file holds, once delimiter and decimal sign are known."""

    source: Source
    lines: Sequence[str]
    delimiter: str
    decimal: str
    count: int

    @cached_property
    def rows(self) -> dict[int, _Row]:
        """The rows by their lines, without words, comments, and lines of too many fields."""
        found = ((place, self._row(place, line)) for place, line in enumerate(self.lines))
        return {place: row for place, row in found if row is not None}

    def _row(self, place: int, line: str) -> _Row | None:
        plain = line.strip()
        # "***" may be a missing number, "#N/A" is one, and "###" rules a comment off
        is_comment = plain[:1] in COMMENT and not (is_missing(plain) and plain.strip("#"))
        if (plain and is_comment) or _FACTOR.fullmatch(line):
            return None
        parts = split(line, self.delimiter)
        fields = [plain] if is_missing(plain) else parts
        while len(fields) > self.count and not fields[-1]:
            fields.pop()
        if not any(fields[:1]) and self.holds_names(place):
            return None
        values = [value(field, self.decimal) for field in fields]
        if 2 < self.count < _LONG_ROW:  # beside positions and heights one may mark rows
            values = [_MARKS.get(f.lower(), v) for f, v in zip(fields, values, strict=True)]
        numbers = [v for v in values if v is not None]
        if len(fields) > self.count or len(numbers) < len(fields):
            return None
        lacking = self.count - len(fields)
        return _Row(fields + [""] * lacking, numbers + [nan] * lacking, len(parts) >= self.count)

    def holds_row(self, place: int) -> bool:
        """Return whether a row holds a number, or a word for a missing one in its columns.

        Of one column, quotes about nothing are such a word: pandas writes them.
        """
        row = self.rows[place]
        held = self.lines[place].strip() if self.count == 1 else any(row.fields)
        return not row.is_empty or (row.is_whole and bool(held))

    def may_be_row(self, place: int, adjoins: bool) -> bool:
        """Return whether a line holds a row of numbers, or what may be a damaged one.

        One that ``adjoins`` the rows may be one if it begins with a number or has no word.
        """
        if place in self.rows:
            return adjoins or self.rows[place].is_whole
        line = self.lines[place].strip(' "')
        if not line or line[0] in COMMENT or self.holds_names(place):
            return False
        return adjoins and (_DIGIT.match(line) is not None or is_without_words(line))

    def holds_names(self, place: int) -> bool:
        """Return whether pandas names the columns beside an index so: ",0,1" above row 0."""
        fields, *below = (split(line, self.delimiter) for line in self.lines[place : place + 2])
        is_named = fields == ["", *map(str, range(len(fields) - 1))] != [""]
        return is_named and any(row[:1] == ["0"] for row in below)

    def refuse(self, place: int, sentence: str) -> NoReturn:
        """Raise InputError about a line."""
        line = quoted(self.lines[place].strip(), _SHOWN)
        raise InputError(f"line {place + 1} of {self.source} is {line}{sentence}")


def _first_row(reader: _Reader) -> int | None:
    """Return the line on which the rows begin: the first of three that are whole."""
    found: list[int] = []
    needed = 1 if reader.count >= _LONG_ROW else _ROWS_TO_BEGIN
    for place in range(len(reader.lines)):
        row = reader.rows.get(place)
        if row is None or (not row.is_empty and not row.is_whole):
            found = []
        elif not row.is_empty:
            found.append(place)
        if len(found) == needed:
            return found[0]
    return None


def _refuse_no_rows(reader: _Reader, numbers: int) -> NoReturn:
    source = reader.source
    for place, line in enumerate(reader.lines):
        fields = split(line, reader.delimiter) if looks_like_numbers(line) else []
        word = next((field for field in fields if value(field, reader.decimal) is None), None)
        if word is not None:
            raise InputError(
                f"line {place + 1} of {source} has {word!r}, which is no number with a decimal "
                f"{'comma' if reader.decimal == ',' else 'point'}: take signs of thousands, units "
                "within cells, remarks and quotes about rows out, write all numbers with one "
                f"decimal sign, or give {parameter('decimal')} and {parameter('delimiter')}"
            )
    raise InputError(
        f"{source} holds {counted(numbers, 'row')} of numbers: at least {_ROWS_TO_BEGIN} of one "
        "length are needed, one after the other"
    )


def _block(reader: _Reader, start: int) -> list[int]:
    """Return the lines of the block, from 0, without those of empty rows."""
    places: list[int] = []
    for place in range(start, len(reader.lines)):
        row = reader.rows.get(place)
        if row is None:
            break
        lacks = not row.is_empty and not row.is_whole
        if lacks and reader.delimiter == " " and reader.count > 2:
            reader.refuse(
                place,
                f": which of the {reader.count} columns are missing cannot be seen between spaces, "
                "so save it with another delimiter",
            )
        if reader.holds_row(place):
            places.append(place)
    while (end := "".join(reader.rows[places[-1]].fields)) and not any(map(str.isalnum, end)):
        places.pop()  # a rule of dashes below the rows
    return places


def _refuse_numbers_outside(reader: _Reader, start: int, last: int) -> None:
    """Refuse rows of numbers above the block and below it."""
    source, lines = reader.source, reader.lines
    held = "one number" if reader.count == 1 else f"{reader.count} numbers"
    for outside in range(start - 1, -1, -1), range(last + 1, len(lines)):
        adjoins = True  # nothing but empty rows has come in between
        for place in outside:
            if _FACTOR.fullmatch(lines[place]):
                reader.refuse(place, ": multiply the numbers by this factor, and remove it")
            if place in reader.rows and reader.rows[place].is_empty:
                continue
            is_below = place > last  # where a short row is one, too
            if reader.may_be_row(place, adjoins or (is_below and place in reader.rows)):
                mend = (
                    "correct it if it is one of the rows, with an empty field for a number that is "
                    "missing, or else remove it"
                )
                if not is_below:
                    reader.refuse(place, f", above the numbers from line {start + 1} on: {mend}")
                after = (k for k in range(last + 1, place + 1) if k not in reader.rows)
                end = next(after, last + 1)
                if end != place:  # removing it would join two blocks
                    mend = (
                        f"numbers follow on line {place + 1}, so keep one trace in a file, and "
                        "write NaN where a height is missing"
                    )
                reader.refuse(
                    end, f": it ends the rows of {held} on lines {start + 1} to {last + 1}; {mend}"
                )
            adjoins = False
    # Lines beside the block that differ in their digits alone are rows of another form.
    n = _ROWS_TO_BEGIN
    for others in reversed(lines[:start]), iter(lines[last + 1 :]):
        beside = list(islice((line for line in others if line.strip()), n))
        forms = {re.sub(r"[\d.,+\-\s]+", " ", line) for line in beside}
        if len(beside) == n and len(forms) == 1 < len(set(beside)):
            raise InputError(
                f"{source} has lines such as {quoted(beside[-1].strip(), _SHOWN)} beside the rows "
                "of numbers, which differ in their digits alone: remove them if they are none of "
                "the rows, and correct them if they are"
            )


def _refuse_odd_ends(
    source: Source,
    column: Sequence[str],
    numbers: Sequence[float],
    places: Sequence[int],
    name: str,
    is_lone: bool,
) -> None:
    """Refuse counts, steps and checksums at the ends of a lone column, and a number cut off.

    They are printed otherwise than all numbers between, or count the others. Of
    several columns only the last row is judged, in which the file may end too early, and the number
    that pandas gives to a column as its ``name``.
    """
    n = len(column)
    rises = np.abs(np.diff(numbers))
    may_be_name = column[0] == name and n > 2 and rises[0] > 1.1 * np.fmax.reduce(rises[1:])
    # Noughts and codes of missing heights are written as they please.
    forms = {
        k: printed_form(column[k])
        for k in range(n)
        if isfinite(numbers[k])
        and (numbers[k] or k == n - 1 or (k == 0 and may_be_name))
        and not may_be_code(numbers[k])
    }
    inner = [form for k, form in forms.items() if _ENDS <= k < n - _ENDS]
    if len(inner) < _TO_JUDGE:
        return
    usual, times = Counter(inner).most_common(1)[0]
    has_one_form = times >= (_ONE_FORM if is_lone else 1.0) * len(inner)
    fewest, shortest = (min(counts) for counts in zip(*inner, strict=True))
    for k, form in forms.items():
        is_name = k == 0 and may_be_name and fewest > 0
        if k < n - 1 and not is_name and (not is_lone or _ENDS <= k < n - _ENDS):
            continue
        # Of numbers whose trailing noughts are left out one has two decimals less by chance.
        is_cut = 0 < form[1] < shortest or (not form[1] and form[0] <= fewest - 2)
        is_odd = form != usual if has_one_form else is_cut
        is_count = numbers[k] == (n - k - 1 if k < _ENDS else n - 1)
        if is_name or is_odd or (is_lone and is_count and (k < _ENDS or k == n - 1)):
            raise InputError(
                f"line {places[k] + 1} of {source} has {column[k]!r}, at the end of a column: "
                "remove it if it is a name, a count, a length, a step or a checksum, or was cut "
                "off; the numbers of a column have as many decimals"
            )


def _refuse_dashes(reader: _Reader, column: Sequence[str], places: Sequence[int]) -> None:
    """Refuse a lone column that a line of dashes divides, or lines of dashes into equal parts.

    Others stand for missing heights.
    """
    dashes = [k for k, field in enumerate(column) if field and not any(map(str.isalnum, field))]
    is_even = bool(dashes) and np.ptp(np.diff([-1, *dashes, len(column)])) == 0
    if len(dashes) == 1 or is_even:
        reader.refuse(
            places[dashes[0]],
            ", which may divide two profiles: write NaN if a height is missing, or keep one "
            "profile in a file, without other numbers",
        )


def refuse_uneven_rows(name: object, lines: Array, has_others: bool = False) -> None:
    """Refuse empty lines here and there between heights that have their places by their order.

    ``has_others``: there are columns beside that of the heights.
    """
    apart = np.diff(lines)
    usual = np.bincount(apart, minlength=1).argmax()
    odd = np.flatnonzero(apart != usual)
    if odd.size:
        line = lines[odd[0]] + min(usual, apart[odd[0]])
        mend = f", or give {parameter('columns')} X,Z, if there are positions" if has_others else ""
        raise InputError(
            f"the rows of {name} have no positions, and empty lines divide them unevenly at "
            f"{counted(odd.size, 'place')}, the first on line {line}: write NaN where one is a "
            f"row, remove the others, and keep one profile in a file{mend}"
        )


# ---------------------------------------------------------------------- header


def _names(line: str, delimiter: str, count: int, filled: Sequence[int]) -> tuple[str, ...]:
    """Split a line of the header into fields, which need not be set apart as the numbers are.

    ``count`` is the number of columns, ``filled`` are those that are not empty.
    """
    fields = _split_names(line, delimiter)
    while fields and not fields[-1]:
        fields.pop()
    if filled[-1] < len(fields) <= count:
        return tuple(fields + [""] * (count - len(fields)))
    if len(fields) == count - 1 and '"' in line:  # R names no column of the numbers of rows
        return ("", *fields)
    # A line that the delimiter divides has no other one: "X resolution,0.5,um" are no two names.
    is_divided = delimiter != " " and delimiter in line
    for sign in delimiter if is_divided else DELIMITERS:
        fields = _split_names(line, sign)
        if len(fields) == count:
            return tuple(fields)
    # "x (mm) h (um)": a name ends where its unit does.
    named = _NAME_AND_UNIT.findall(line)
    if "".join(named).split() == line.split():
        return tuple(field.strip(" ,") for field in named)
    return ()


def _split_names(line: str, delimiter: str) -> list[str]:
    if delimiter == " " and '"' not in line:
        if re.search(r"\s{2}|\t", line):
            return re.split(r"\s{2,}|\t", line)
        if re.search(r" in |: ", line):  # "Data in mm" has no inch, "Value units: mm" no names
            return [line]
    return split(line, delimiter)
