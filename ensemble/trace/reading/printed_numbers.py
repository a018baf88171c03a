"""Numbers as texts print them: fields of a line, values of fields, delimiter and decimal sign."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

from adhesis.ensemble.errors import InputError, parameter
from adhesis.ensemble.trace.reading.source import Source

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
_FIRST = re.compile(r"[+\-]?\.?\d[\d.eEdD+\-'’_]*")  # of a line
_NUMBER = re.compile(r"[+\-]?(\d+[.,]?\d*|[.,]\d+)([eEdD][+\-]?\d+)?")
_EXPONENT = re.compile(r"(?<=[\d.])\s*[eEdD](?=\s*[+\-]?\d)")
_QUOTED = re.compile(r'"[^"]*"')
_GROUPED = re.compile(r"[+\-]?\d{1,3}([ '’_]\d{3})+([.,]\d*)?")
_WITH_WORD = re.compile(r"[+\-]?(\d+[.,]?\d*|[.,]\d+)([eE][+\-]?\d+)?\s*[^\W\d_]+")


def shown_line(line: str) -> str:
    """Return a line of the file as a message shows it."""
    line = line.strip()
    return repr(line if len(line) <= _SHOWN else f"{line[:_SHOWN]}…")


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
    if is_missing(plain):
        return float("nan")
    if not _NUMBER.fullmatch(plain) or (decimal == "," and "." in plain):
        return None
    if decimal == "." and "," in plain:
        return None
    return float(plain.replace(",", ".").replace("D", "e").replace("d", "e"))


def printed_form(field: str) -> tuple[int, int]:
    """Return the number of decimals of a printed number, and of digits of its exponent."""
    mantissa, _, exponent = re.sub("[eEdD]", "e", field).partition("e")
    decimals = re.split(r"[.,]", mantissa)[1:]
    return len(decimals[0]) if decimals else 0, len(exponent.lstrip("+-"))


def is_without_words(line: str) -> bool:
    """Return whether a line holds digits, and no letters but those of exponents."""
    plain = _EXPONENT.sub("", line)
    return any(map(str.isdigit, plain)) and not any(map(str.isalpha, plain))


def is_grouped(field: str) -> bool:
    """Return whether blanks or apostrophes mark the thousands of a number."""
    return bool(_GROUPED.fullmatch(field))


def flaw_of(fields: Sequence[str]) -> str | None:
    """Return what is wrong with a field that is a number and more than that, if one is."""
    for field in fields:
        if is_grouped(field):
            return f"{field!r}: take the signs of thousands out"
        if _WITH_WORD.fullmatch(field):
            return (
                f"{field!r}, a unit or word within the cell of a number: take it out, and give "
                f"{parameter('unit')}"
            )
    return None


def marks_thousands(field: str, sign: str) -> bool:
    """Return whether a sign may mark the thousands of a number: "1,234" and "-12,345,678"."""
    return bool(re.fullmatch(rf"[+\-]?[1-9]\d{{0,2}}({re.escape(sign)}\d{{3}})+", field))


def has_signs_of_thousands(column: Sequence[str], decimal: str) -> bool:
    """Return whether what is taken for the decimal sign of a column may mark thousands.

    It does if it stands before three digits wherever it stands, never behind a leading nought, and
    numbers below 1000 have none: "500", "1.000".
    """
    marked = 0
    plain = 0
    for field in column:
        if decimal in field:
            if not marks_thousands(field, decimal):
                return False
            marked += 1
        elif re.fullmatch(r"[+\-]?\d{1,3}", field):
            plain += 1
        elif not is_missing(field):
            return False
    return marked > 0 and plain > 0


def find_form(
    source: Source, sample: Sequence[str], delimiter: str | None, decimal: str | None
) -> tuple[str, str]:
    """Return delimiter and decimal sign of lines of numbers; InputError if two fit."""
    if decimal not in (None, ",", "."):
        raise InputError(f"{parameter('decimal')} is {decimal!r}: it must be '.' or ','")
    if delimiter is None:
        delimiter = find_delimiter(source, sample, decimal)
    elif delimiter not in DELIMITERS:
        signs = ", ".join(map(repr, DELIMITERS))
        raise InputError(f"{parameter('delimiter')} is {delimiter!r}: it must be one of {signs}")
    if decimal is None:
        rows = [field for line in sample for field in split(line, delimiter)]
        comma, point = (next((f for f in rows if sign in f), None) for sign in ",.")
        if comma and point:
            both = " and ".join(dict.fromkeys(map(repr, (comma, point))))
            raise InputError(
                f"{source} has fields such as {both}: give {parameter('decimal')} and "
                f"{parameter('delimiter')}, and take signs of thousands, or quotes about whole "
                "rows, out"
            )
        decimal = "," if comma else "."
    return delimiter, decimal


def find_delimiter(source: Source, sample: Sequence[str], decimal: str | None) -> str:
    """Return the delimiter of lines of numbers; InputError if a comma has two meanings."""
    lines = [_QUOTED.sub('"', line.strip()) for line in sample]

    def everywhere(sign: str) -> bool:
        return sum(sign in line for line in lines) >= 0.8 * len(lines)

    for sign in (";", "\t", "|"):
        if everywhere(sign):
            return sign
    spaced = everywhere(" ")
    if not everywhere(","):
        return " "
    if any('",' in line or ',"' in line for line in lines):
        return ","
    if decimal == ",":
        return " "
    if any("." in line for line in lines) or any(re.search(r",\s", line) for line in lines):
        return ","
    if spaced:
        return " "
    commas = Counter(line.count(",") for line in lines).most_common(1)[0][0]
    if commas == 1:
        if any(re.search(r"[eE][+\-]?\d+\s*,", line) for line in lines):
            return ","
        return _one_comma(source, lines)
    if commas == 3:
        raise InputError(
            f"{source} has rows such as {shown_line(lines[0])}, which can be two numbers or four: "
            f"give {parameter('decimal')}"
        )
    return ","


def _one_comma(source: Source, lines: Sequence[str]) -> str:
    """Tell "12,345" as a decimal number from two whole ones."""
    halves = [line.split(",") for line in lines if line.count(",") == 1]
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
        f"{source} has rows such as {shown_line(lines[0])}, which can be one number with a decimal "
        f"comma or two: give {parameter('decimal')}"
    )
