"""Find units of length in headers of texts, and parse the parameter ``unit``."""

from __future__ import annotations

import re
from collections.abc import Sequence

from adhesis.ensemble.errors import InputError, parameter
from adhesis.ensemble.lengths import METRES, OTHER_NAMES, unit_named

# Units that are recognised in running text; "m", "in" and "A" are ambiguous and need brackets.
_UNAMBIGUOUS = [n for n in (*METRES, *OTHER_NAMES) if n.lower() not in ("m", "in", "a")]
_WORD = "|".join(sorted(map(re.escape, _UNAMBIGUOUS), key=len, reverse=True))
_IN_TEXT = re.compile(rf"(?<![^\W\d_])({_WORD})(?![^\W_])(?!\s*[/^²])", re.IGNORECASE)
_IN_BRACKETS = re.compile(r"(?:[(\[<{/=:]|\bin\s)\s*(m|in|a)\s*(?=[)\]>}]|$)", re.IGNORECASE)

_X = re.compile(
    r"\b(x|pos(ition)?s?|lateral|horizontal|distances?|length|lengths|weg|abstand|länge)\b", re.I
)
_Z = re.compile(
    r"\b(z|y|h|heights?|höhe|vertical|depth|profile?|amplitude|deflection|topography|data)\b", re.I
)
_BOTH = re.compile(r"\b(units?|einheit(en)?|unité?s?)\b", re.I)

_VALUE = re.compile(
    rf"\d\s*[(\[]?\s*({_WORD})(?![^\W_])", re.IGNORECASE
)  # "0.5 µm" names no column

_STEP = re.compile(
    r"\b(step|step ?size|spacing|increment|interval|sampling|pitch|dx|delta ?x|pixel ?size|"
    r"schrittweite|punktabstand|x[- ]?scale)\b[^\d+\-.]*([+\-]?[\d.,]+(?:e[+\-]?\d+)?)"
    r"\s*[(\[]?\s*(\w+)?",
    re.IGNORECASE,
)


def parse_units(text: str) -> tuple[str, str]:
    """Parse the parameter ``unit``: "um" for positions and heights, or "mm,um"."""
    words = text.split(",")
    if len(words) > 2:
        raise InputError(
            f"{parameter('unit')} is {text!r}: one unit for both columns, or two as in mm,um"
        )
    return unit_named(words[0]), unit_named(words[-1])


def _units_in(text: str) -> list[str]:
    plain = text.replace("_", " ")
    if plain.strip().lower() in ("m", "in"):
        return [unit_named(plain)]
    names = [match[1] for match in _IN_TEXT.finditer(plain)]
    names += [match[1] for match in _IN_BRACKETS.finditer(plain)]
    return [unit_named(name) for name in names]


def units_of_header(header: Sequence[str], fields: Sequence[Sequence[str]]) -> list[str | None]:
    """Find the units of two columns (or of one, twice) in a header; None where it has none.

    Parameters
    ----------
    header : sequence of str
        Its lines.
    fields : sequence of sequence of str
        Fields of those of its lines that have as many fields as the data.
    """
    names = [row for row in fields if not any(_VALUE.search(field) for field in row)]
    for row in reversed(names):
        found = [_units_in(field) for field in row]
        if all(len(set(units)) == 1 for units in found):
            return [units[0] for units in found]
    for row in reversed(names):
        found = [_units_in(field) for field in row]
        if any(found) and not any(re.search(r"[\d:=]", field) for field in row):
            return [units[0] if len(set(units)) == 1 else None for units in found]
    columns = len(fields[0]) if fields else 2
    known: list[set[str]] = [set(), set()]
    for line in header:
        if re.search(r"[=:]\s*[-+]?[\d.,]+\s*\S*\s*$", line):
            continue  # a length with its value ("Length: 2 mm") is not about the columns
        units = set(_units_in(line))
        if len(units) != 1:
            continue
        plain = re.sub(r"[_\-.]|(?<=[a-z])(?=[A-Z])", " ", line)
        x, z, both = (bool(name.search(plain)) for name in (_X, _Z, _BOTH))
        compact = re.search(r"\b([xyz]) ?units?\b", plain.lower())
        if compact:
            x, z = compact[1] == "x", compact[1] != "x"
        for place, named in enumerate((x, z)):
            if (named and not (x and z)) or (both and not (x or z)):
                known[place] |= units
    picked = [next(iter(units)) if len(units) == 1 else None for units in known]
    return picked if columns > 1 else [picked[1], picked[1]]


def step_of_header(header: Sequence[str], decimal: str) -> float | None:
    """Find a step with its unit in a header; return it in m, None if there is none."""
    for line in header:
        found = _STEP.search(line.replace("_", " "))
        if found and found[3]:
            try:
                unit = unit_named(found[3])
                value = float(found[2].replace(",", ".") if decimal == "," else found[2])
            except (InputError, ValueError):
                continue
            if value > 0:
                return value * METRES[unit]
    return None
