"""Find units of length and the step in headers of texts, and parse the parameter ``unit``."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Iterator, Sequence

from adhesis.ensemble.errors import InputError, parameter
from adhesis.ensemble.quantities import LENGTH, length_text

# Units that are words or parts of names, too, need brackets.
_AMBIGUOUS = ("m", "in", "a", "å", "mil", "mils", "thou")
_UNAMBIGUOUS = [name for name in LENGTH.spellings if name.lower() not in _AMBIGUOUS]
_ANY = [*_UNAMBIGUOUS, *_AMBIGUOUS]


def _one_of(names: Sequence[str]) -> str:
    return "|".join(sorted(map(re.escape, names), key=len, reverse=True))


_WORD = _one_of(_UNAMBIGUOUS)
_IN_TEXT = re.compile(rf"(?<![^\W\d_])({_WORD})(?![^\W_])(?!\s*[/^²])", re.IGNORECASE)
_IN_BRACKETS = re.compile(
    rf"(?:[(\[<{{/=:]|\bin\s)\s*({_one_of(_AMBIGUOUS)})\s*(?=[)\]>}}]|$)", re.IGNORECASE
)

# Words of a line that states the unit of an axis; of others it is not known what they measure.
_X = frozenset(
    ("x", "xunit", "xunits", "pos", "position", "positions", "lateral", "horizontal", "distance",
     "distances", "length", "lengths", "weg", "abstand", "länge")
)  # fmt: skip
_Z = frozenset(
    ("z", "zunit", "zunits", "y", "yunit", "yunits", "h", "height", "heights", "höhe", "vertical",
     "depth", "profile", "profil", "amplitude", "deflection", "topography", "data")
)  # fmt: skip
_BOTH = frozenset(("unit", "units", "einheit", "einheiten", "unité", "unités"))
_BESIDE_AXIS = frozenset(
    ("axis", "achse", "direction", "label", "value", "values", "column", "of", "in", "the", "all",
     "are")
)  # fmt: skip

# A number that stands for itself: not that of "X1" or "Ra2".
_NUMBER = r"(?<![^\W_])[+\-]?(?:\d+(?:[.,]\d+)?|[.,]\d+)(?:e[+\-]?\d+)?"
# A field with a value names no column: "0.5 µm", "(x10 nm)", "Cut-off (mm): 0.8". "Channel 1 (µm)"
# names one.
_VALUE = re.compile(
    rf"(?<![^\W_])(?:\d+|\d*[.,]\d+\s*[(\[]?)\s*({_WORD})(?![^\W_])"
    # A factor, a power or a quotient: "x10", "10^3", "z/10", "1/nm", "nm-1".
    rf"|[×*·⋅^]|\bx\s?10+\b|\b10+\s?x\b|/\s*\d|\d\s*/|\bper\b|({_WORD})-\d"
    rf"|[:=]\s*[+\-]?[.,]?\d|(?:^|[\s;,]){_NUMBER}\s*$",
    re.IGNORECASE,
)
_HAS_NUMBER = re.compile(r"(?<![^\W_])\d|[:=]")

# The step is named by words for the distance of two points, and by nothing else: a "step height" or
# a "sampling length" is another length. Of two words it has both together.
_STEP = frozenset(
    ("step", "stepsize", "spacing", "increment", "pitch", "interval", "dx", "δx", "deltax",
     "xstep", "xspacing", "xpitch", "xincrement", "pixelsize", "schrittweite",
     "punktabstand", "messpunktabstand", "samplinginterval", "sampleinterval", "pointinterval",
     "datainterval", "samplespacing", "sampledistance", "samplingdistance", "pointdistance",
     "messschrittweite", "messschritt", "abtastschritt", "abtastschrittweite", "abtastintervall",
     "pas", "paso", "passo", "шаг", "ピッチ", "測定ピッチ", "サンプリングピッチ", "測定間隔",
     "サンプリング間隔", "データ間隔", "간격", "측정간격", "피치", "측정피치",
     "步长", "采样间隔", "采样步长")
)  # fmt: skip
_BESIDE_STEP = frozenset(
    ("x", "in", "of", "the", "size", "sampling", "measuring", "measurement",
     "lateral", "horizontal", "point", "points", "data", "between", "scan", "axis", "direction",
     "de", "d", "mesure", "échantillonnage", "muestreo", "campionamento")
)  # fmt: skip
_FIRST_NUMBER = re.compile(_NUMBER, re.IGNORECASE)
# "about 0.4 um", and points per length.
_NOT_THE_STEP = re.compile(r"[~≈≤≥±]|<\s*$|\bpoints?\s*/")
_LENGTH = re.compile(r"[\s,;:=()\[\]<>{}/]*([^\W\d]*)[\s)\]>},;.]*")
_PER_POINT = re.compile(r"\s*/\s*(px|pixel|pt|pts|point|points|sample|step)\b", re.IGNORECASE)


def parse_units(text: str) -> tuple[str, str]:
    """Parse the parameter ``unit``: "um" for positions and heights, or "mm,um"."""
    words = text.split(",")
    if len(words) > 2:
        raise InputError(
            f"{parameter('unit')} is {text!r}: one unit for both columns, or two as in mm,um"
        )
    return LENGTH.unit_named(words[0]), LENGTH.unit_named(words[-1])


def _units_in(text: str) -> list[str]:
    plain = unicodedata.normalize("NFKC", text).replace("_", " ")
    names = [match[1] for match in _IN_TEXT.finditer(plain)]
    names += [match[1] for match in _IN_BRACKETS.finditer(plain) if match[1] != "a"]
    return [LENGTH.unit_named(name) for name in names]


def units_of_header(header: Sequence[str], fields: Sequence[Sequence[str]]) -> list[str | None]:
    """Find the units of two columns (or of one, twice) in a header; None where it has none.

    ``fields`` are those of its lines that have as many fields as the data.
    """
    names = [row for row in fields if not any(_VALUE.search(field) for field in row)]
    if fields and len(fields[0]) == 1:
        names = [row for row in names if _names_heights(row[0], row is fields[-1])]
    whole = set()
    for row in names:
        # "m", "in" and "A" without brackets are units in a row of nothing else.
        is_bare = all(field.lower() in _ANY for field in row) and row not in (("A",), ("a",))
        found = [[LENGTH.unit_named(f)] if is_bare else _units_in(f) for f in row]
        if all(len(set(units)) == 1 for units in found):
            whole.add(tuple(units[0] for units in found))
    if whole:  # of two that differ it is not known which
        return [units[0] if len(set(units)) == 1 else None for units in zip(*whole, strict=True)]
    for row in reversed(names):
        found = [_units_in(field) for field in row]
        if any(found) and not any(_HAS_NUMBER.search(field) for field in row):
            return [units[0] if len(set(units)) == 1 else None for units in found]
    columns = len(fields[0]) if fields else 2
    known: list[set[str]] = [set(), set()]
    for line in header:
        if re.search(_NUMBER + r"(?![^\W_])", line, re.IGNORECASE):
            continue  # a length with its value ("Length: 2 mm") is not about the columns
        units = set(_units_in(line))
        if len(units) != 1:
            continue
        words = set(_words(line, units))
        x, z, both = (bool(words & names) for names in (_X, _Z, _BOTH))
        if words - _X - _Z - _BOTH - _BESIDE_AXIS:
            continue
        for place, named in enumerate((x, z)):
            if (named and not (x and z)) or (both and not (x or z)):
                known[place] |= units
    picked = [next(iter(units)) if len(units) == 1 else None for units in known]
    return picked if columns > 1 else [picked[1], picked[1]]


def _names_heights(line: str, is_last: bool) -> bool:
    """Return whether a line above one column names it, and not another length."""
    words = set(_words(line, _units_in(line)))
    is_of_heights = words & (_Z | _BOTH) and words <= _Z | _BOTH | _BESIDE_AXIS
    return bool(is_of_heights) or (is_last and not words & _X)


def step_of_header(name: str, header: Sequence[str], decimal: str) -> float | None:
    """Find the distance of two points in a header, in m, or None; InputError for several."""
    steps: list[float] = []
    for line in header:
        step = next(filter(None, (_step(part, decimal) for part in _parts(line, decimal))), None)
        if step is not None and all(abs(step / known - 1) > 1e-9 for known in steps):
            steps.append(step)
    if len(steps) > 1:
        stated = " and ".join(length_text(step, 6) for step in steps)
        raise InputError(
            f"the header of {name} states the steps {stated}: give {parameter('step')}, the "
            "distance of two points"
        )
    return steps[0] if steps else None


def _parts(line: str, decimal: str) -> Iterator[str]:
    """Return statements of a line: between its delimiters, and all of it."""
    line = line.replace('"', "")
    yield from re.split(r"[;\t]|,\s|\s{2,}", line)
    yield re.sub(r"[;\t]" if decimal == "," else r"[;\t,]", " ", line)


def _step(text: str, decimal: str) -> float | None:
    """Return the step that a statement such as "Pitch X: 0.5 µm" or "dx (µm) = 0.5" gives."""
    number = _FIRST_NUMBER.search(text)
    if number is None:
        return None
    label, rest = text[: number.start()], _PER_POINT.sub("", text[number.end() :])
    unit = _LENGTH.fullmatch(rest)
    if unit is None or _NOT_THE_STEP.search(label):
        return None
    within = _units_in(label.strip(" :=\t"))
    units = [unit[1]] if unit[1] else within
    if len(set(units)) != 1 or not _names_step(_words(label, within)):
        return None
    try:
        metres = LENGTH.units[LENGTH.unit_named(units[0])]
        value = float(number[0].replace(",", ".") if decimal == "," else number[0])
    except (InputError, ValueError):
        return None
    return value * metres if value > 0 else None


def _words(label: str, units: Collection[str]) -> list[str]:
    """Return the words of a label in lower case, without its unit."""
    plain = unicodedata.normalize("NFKC", label).replace("∆", "Δ")
    apart = re.sub(r"[_\-.]|(?<=[a-z])(?=[A-Z][a-z])", " ", plain)
    words = re.findall(r"[^\W\d_]+", apart.lower())
    names = {word for word in words if word in _ANY} if units else set()
    return [word for word in words if word not in names]


def _names_step(words: Sequence[str]) -> bool:
    """Return whether a label names the step, and nothing that gives it another meaning."""
    return any(
        "".join(words[k : k + n]) in _STEP and {*words[:k], *words[k + n :]} <= _BESIDE_STEP
        for n in (1, 2)
        for k in range(len(words))
    )
