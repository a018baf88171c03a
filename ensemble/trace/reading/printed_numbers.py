"""Numbers as texts print them: fields of a line, values of fields, delimiter and decimal sign."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from itertools import pairwise, product
from typing import NoReturn

from adhesis.ensemble.errors import InputError, parameter
from adhesis.ensemble.quantities import LENGTH
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
_FIRST = re.compile(r"[+\-]?\.?\d[\d.eEdD+\-'’`´٬_]*")  # of a line
_NUMBER = re.compile(r"[+\-]?(\d+[.,]?\d*|[.,]\d+)([eEdD][+\-]?\d+)?")
# "0,5,1,3" and "0,5, 1,3": four numbers, or two
_DECIMALS = r"\d*(?:e[+\-]?\d+)?"
_PAIRS = re.compile(rf'\s*[^,."\s]*,{_DECIMALS}(?:,\s?[^,."\s]*,{_DECIMALS})+\s*', re.IGNORECASE)
# "0.5, 1,234": commas with blanks and without
_MIXED = re.compile(r"\d,\d.*, |, .*\d,\d")
_MOSTLY = 0.8  # share of the lines in which a delimiter stands
_EXPONENT = re.compile(r"(?<=[\d.])\s*[eEdD](?=\s*[+\-]?\d)")


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
        f"{source} has rows such as {shown_line(line)}, whose commas can be decimal signs or "
        f"delimiters: {mend}"
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
