"""Find units of length and the step in headers of texts, and parse the parameter ``unit``.

A column has a unit if its name is "Height (um)", "z / um", "x in mm" or "z_nm", or has a row of
units below it, or if a line states it ("Z-Unit: um"). Every word of the name has to be a known one
for positions, for heights or beside them. Of any other name ("log z (nm)", "z (10 nm)", "slope
(um)") it is not known what the numbers are, and the unit is to be given.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from adhesis.ensemble.errors import InputError, parameter
from adhesis.ensemble.quantities import LENGTH, length_text


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_DEPTH = _set(
    "depth depths tiefe profondeur profondità profundidad głębokość hloubka djup dybde "
    "глубина 深さ 深度 깊이"
)
_X = _set(
    "x xunit xunits pos position positions distance distances lateral horizontal length "
    "lengths path abscissa abscisse weg abstand strecke länge ort longueur posición posicion "
    "distancia longitud posizione distanza lunghezza positie afstand lengte pozycja odległość "
    "poloha vzdálenost läge avstånd avstand длина расстояние положение 位置 距離 距离 長さ "
    "长度 水平距離 水平距离 測定位置 위치 거리 길이 수평거리 "
    "travel traverse 水平位置"
)
_Z = _DEPTH | _set(
    "z zunit zunits h height heights höhe höhen hoehe hauteur altitude altura altezza hoogte "
    "wysokość výška höjd høyde højde высота vertical elevation topography profile profiles profil "
    "perfil profilo профиль roughness rauheit waviness 高さ 高度 断面 輪郭 粗さ 轮廓 높이 "
    "단면 relief 測定値"
)
_UNITS = _set(
    "unit units einheit einheiten unité unités unidad unidades unità yunit yunits 単位 单位 단위"
)
_BESIDE = _UNITS | _set(
    "y axis achse axe eje asse direction label value values wert werte valeur column channel "
    "kanal trace scan line sampling stylus sensor stage data daten raw measured measurement "
    "primary filtered unfiltered level levelled leveled coordinate ось surface sample along up "
    "point points of in the all are"
)
_ALONE = _set("a b c d")  # columns of a spreadsheet
_OF_PROFILES = _set("p r w total")  # which P, W and R profiles are, behind their filters

# Units that are words or parts of names, too, need brackets; of Å a capital is none of them. A is
# ampere as well: it is Å in brackets behind a name of positions or heights alone.
_AMBIGUOUS = ("m", "in", "å", "mil", "mils", "thou")
_UNAMBIGUOUS = [name for name in LENGTH.spellings if name.lower() not in (*_AMBIGUOUS, "a")]


def _one_of(names: Sequence[str]) -> str:
    return "|".join(sorted(map(re.escape, names), key=len, reverse=True))


_WORD, _ANY = rf"{_one_of(_UNAMBIGUOUS)}|(?-i:Å)", _one_of([*_UNAMBIGUOUS, *_AMBIGUOUS])
_OPEN, _CLOSE = r"[(\[<{]\s*(?:in\s+)?", r"\s*[)\]>}]"
_COLUMN = re.compile(
    rf"(.*?)(?:{_OPEN}({_ANY}|A){_CLOSE}|(?:[/:=,;]|\bin\s)\s*({_ANY})|(?:^|(?<=[\s_]))({_WORD})"
    rf"|^({_ANY}))",
    re.IGNORECASE,
)
_IN_TEXT = re.compile(
    rf"(?<![^\W\d_])(?:{_WORD})(?![^\W_])|{_OPEN}(?:[^)\]>}}]*\s)?(?:{_ANY}){_CLOSE}|[\s_]in$",
    re.IGNORECASE,
)
# A unit in a sentence, but none of a speed or of a label with its value
_LONE_UNIT = re.compile(rf"(?<![^\W\d_])(?:{_WORD})(?![^\W_]|\W*[/:=])", re.IGNORECASE)
_UNIT_OF_NUMBER = re.compile(
    rf"\d\W*(?:{_WORD})(?![^\W_])|(?<![^\W\d_])(?:{_WORD})\W*\d", re.IGNORECASE
)
# Units of other quantities, in brackets or alone: what has one holds no lengths.
_OTHER = re.compile(
    r"(.*[(\[<{]\s*)?((?:[μumnpk]?(?:A|V|N|s)|[mkMG]?(?:Pa|Hz|W|J|eV|g|K|bar)|min|h|°|°C|deg|degrees?"
    r"|m?rad|counts?|cts|a\.?u\.?|arb\.?( units)?|px|pixels?|%|ppm|dB|bits?|LSB|digits?|Ohm|Ω|1|-)"
    rf"|(?(1)[^)\]>}}]*|(?:{_WORD}))[/^][^)\]>}}]*)(?(1)\s*[)\]>}}])\s*"
)
# A word in brackets that may be a unit: "z [æm]" after a wrong conversion, but no "Height (Z)".
_POSSIBLE_UNIT = re.compile(r"[(\[<{]\s*(?![a-z]\s*[)\]>}])[^\s\d)\]>}]{1,3}\s*[)\]>}]", re.I)
_NUMBERED = re.compile(r"\b(channel|kanal|profile|profil|column|trace|line|scan) \d\b")
_NUMBER = r"(?<![^\W_])[+\-]?(?:\d+(?:[.,]\d+)?|[.,]\d+)(?:e[+\-]?\d+)?"
# A label and a value name no column: "Unit:", "0.5 µm", "Tip radius 2 um", "Cut-off (mm): 0.8".
_VALUE = re.compile(
    rf"(?:^|[:=\s;,])\s*{_NUMBER}[\s,;]*(?:{_WORD})?\s*$|[:=]\s*([+\-]?[.,]?\d|$)", re.IGNORECASE
)

# The step is named by words for the distance of two points, and by nothing else: a "step height" or
# a "sampling length" is another length. Of two words it has both together.
_STEP = _set(
    "step stepsize spacing increment interval dx δx deltax xstep xspacing xpitch xincrement "
    "pixelsize schrittweite punktabstand messpunktabstand samplinginterval sampleinterval "
    "pointinterval datainterval samplespacing sampledistance samplingdistance pointdistance "
    "messschrittweite messschritt abtastschritt abtastschrittweite abtastintervall 測定ピッチ "
    "サンプリングピッチ 測定間隔 サンプリング間隔 データ間隔 측정간격 측정피치 采样间隔 采样步长"
)
# Words for the pitch of a grating, too: one more word makes it the step, or a column that
# counts the points.
_PITCH = _set("pitch pas paso passo шаг ピッチ 간격 피치 步长")
_OF_STEP = _set(
    "x sampling measuring measurement lateral horizontal point points data scan mesure "
    "échantillonnage muestreo campionamento"
)
_BESIDE_STEP = _OF_STEP | _set("in of the size between axis direction de d")
_FIRST_NUMBER = re.compile(_NUMBER, re.IGNORECASE)
_POINT_OF_THOUSANDS = re.compile(r"[1-9]\d{0,2}\.\d{3}")  # beside decimal commas
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


@dataclass(frozen=True)
class Column:
    """A field of a header that may name a column, and its unit."""

    text: str

    @cached_property
    def plain(self) -> str:
        """The text in plain signs, without quotes."""
        return unicodedata.normalize("NFKC", self.text).replace('"', "").strip()

    @cached_property
    def _found(self) -> re.Match[str] | None:
        return _COLUMN.fullmatch(self.plain)

    @cached_property
    def unit(self) -> str | None:
        """The unit of length; None without one that is sure."""
        if self._found is None:
            return None
        name = next(filter(None, self._found.groups()[1:]))
        if name in ("A", "a"):
            is_length = name == "A" and (self.words or frozenset()) & (_X | _Z)
            return "Å" if is_length else None
        return LENGTH.unit_named(name)

    @property
    def has_length(self) -> bool:
        """Whether a unit of length stands in it, understood or not."""
        return self.unit is not None or _IN_TEXT.search(self.plain) is not None

    @cached_property
    def other(self) -> str:
        """The name, with its bracket, before the unit of another quantity; "-" if it is alone."""
        found = _OTHER.fullmatch(self.plain) if self.unit is None else None
        return (found[1] or "-") if found else ""

    @property
    def has_unit(self) -> bool:
        """Whether it has a unit of length, or that of another quantity in brackets."""
        return self.has_length or self.other not in ("", "-")

    @property
    def is_bare(self) -> bool:
        """Whether it is a unit without a name, or nothing."""
        name = self._found[1] if self._found else self.other
        return not name.strip(" -([<{") and bool(self._found or self.other or not self.text)

    @cached_property
    def words(self) -> frozenset[str] | None:
        """Words of the name in lower case; None if one of them is unknown, or no word."""
        name = self._found[1] if self._found else self.plain
        name = name.strip(" :=,_/\t").lower()
        if self._found and self._found[2]:  # "Channel 1 (um)", but not "z 1/um"
            name = _NUMBERED.sub(r"\1", name)
        tokens = re.split(r"[\s,_.\-]+", name) if name else []
        words = frozenset(re.sub(r"(?<=\D)\d$", "", token) for token in tokens)
        known = _X | _Z | _BESIDE | (_ALONE if len(tokens) == 1 else frozenset())
        known |= _OF_PROFILES if words & {"profile", "profil"} else frozenset()
        return words if words <= known else None

    @property
    def is_of_positions(self) -> bool:
        """Whether the name is known, and that of positions."""
        return bool((self.words or frozenset()) & _X)

    def names(self, positions: bool) -> bool:
        """Return whether all words are known, and may name positions, or else heights."""
        own, others = (_X, _Z) if positions else (_Z, _X)
        if self.words is None or self.other or (not positions and "x" in self.words):
            return False
        return bool(self.words & own or not self.words & others)


@dataclass(frozen=True)
class HeaderUnits:
    """What a header states about the units of positions and heights (of one column, twice)."""

    units: tuple[str | None, str | None] = (None, None)
    by_name: bool = False  # whether the columns have them, and not lines of their own
    unclear: str = ""  # a name that has a unit of length and is not understood
    other: tuple[str, str] = ("", "")  # names that have units of other quantities
    depth: str = ""  # name by which heights may grow into the sample


def units_of_header(header: Sequence[str], fields: Sequence[Sequence[str]]) -> HeaderUnits:
    """Find the units of two columns, or of one, in a header.

    ``fields`` are those of its lines that have as many fields as the data.
    """
    rows = [list(map(Column, row)) for row in fields]
    # Beside other rows a label and its unit ("Z unit;um", "Rz;nm") name no columns.
    rows = [r for r in rows if len(rows) == 1 or r[0].is_bare or r[0].has_unit or not r[-1].is_bare]
    found = [row for row in map(_row_of_units, rows, [None, *rows]) if row is not None]
    whole = {row.units for row in found if not row.unclear and None not in row.units}
    known: list[set[str]] = [set(), set()]
    for column in map(Column, header):
        words = column.words or frozenset()
        if column.unit is None:
            continue
        x, z = bool(words & _X), bool(words & _Z)
        for place, named in enumerate((x and not z, z and not x)):
            if named or (words & _UNITS and not (x or z)):
                known[place].add(column.unit)
                if words & _UNITS and found and found[-1].units[place] not in (None, column.unit):
                    return HeaderUnits(unclear=column.text)
    if len(whole) > 1:
        return HeaderUnits(unclear=" and ".join(", ".join(row) for row in fields))
    if found:
        return found[-1]
    units = [next(iter(names)) if len(names) == 1 else None for names in known]
    alone = bool(fields) and len(fields[0]) == 1
    possible = _POSSIBLE_UNIT.search(" ".join(text for row in fields for text in row))
    unclear = possible[0] if possible else next(filter(_mentions_unit, header), "")
    unclear = "" if any(known[alone:]) else unclear
    return HeaderUnits((units[1] if alone else units[0], units[1]), unclear=unclear)


def _mentions_unit(line: str) -> bool:
    """Return whether a line has a unit but m that stands beside no number, or "Units:" of another.

    At the end of a line without numbers it may have any form, elsewhere it is unmistakable.
    """
    column = Column(line)
    lone = _LONE_UNIT.findall(_UNIT_OF_NUMBER.sub(" ", column.plain))
    if any(LENGTH.unit_named(unit) != "m" for unit in lone):
        return True
    words = re.findall(r"[^\W\d_]+", column.plain.lower())
    if not words or any(map(str.isdigit, line)):
        return False
    if column.unit or words[-1] in ("m", *_UNAMBIGUOUS):
        return (column.unit or LENGTH.unit_named(words[-1])) != "m"
    before = words[: next((k for k, word in enumerate(words) if word in _UNITS), None)]
    known = len(before) < len(words) - 1 and (_X | _Z | _BESIDE).issuperset(before)
    return known and "si" not in words


def _row_of_units(row: Sequence[Column], above: Sequence[Column] | None) -> HeaderUnits | None:
    """Return what a row states, with the names above it if it holds units alone."""
    if any(_VALUE.search(column.plain) for column in row) or not any(c.has_unit for c in row):
        return None
    bare = all(column.is_bare for column in row)
    names = above if bare and above else row
    if len(row) == 1 and row[0].unit and names[0].words and not names[0].names(False):
        return None  # above heights alone, it is about positions
    units, other, unclear = [], [], ""
    for k, (column, name) in enumerate(zip(row, names, strict=True)):
        text = name.text if name is column else f"{name.text} {column.text}".strip()
        is_clear = column.unit is not None and name.names(positions=k < len(row) - 1)
        is_other = bare or column.other != "-" if column.other else False
        if column.has_length and not is_clear and not is_other:
            unclear = unclear or text
        units.append(column.unit)
        other.append(text if is_other else "")
    depth = names[-1].text if (names[-1].words or frozenset()) & _DEPTH else ""
    pairs = (units[0], units[-1]), (other[0], other[-1])
    return HeaderUnits(pairs[0], True, unclear, pairs[1], depth)


def step_of_header(
    name: str, header: Sequence[str], decimal: str, counts: bool = False
) -> float | None:
    """Find the distance of two points in a header, in m, or None; InputError for several."""
    steps = stated_steps(header, decimal, counts)
    if len(steps) > 1:
        stated = " and ".join(length_text(step, 6) for step in steps)
        raise InputError(
            f"the header of {name} states the steps {stated}: give {parameter('step')}, the "
            "distance of two points"
        )
    return steps[0] if steps else None


def stated_steps(header: Sequence[str], decimal: str, counts: bool) -> list[float]:
    """Return the different distances of two points that a header states, in m.

    A "pitch" without another word is one only beside a column that ``counts`` the points.
    """
    steps: list[float] = []
    for line in header:
        line = line.replace('"', "")
        statements = re.split(r"[;\t]|,\s|\s{2,}", line)
        statements.append(re.sub(r"[;\t]" if decimal == "," else r"[;\t,]", " ", line))
        *parts, whole = (_step(statement, decimal, counts) for statement in statements)
        for step in filter(None, parts if any(parts) else [whole]):
            if all(abs(step / known - 1) > 1e-9 for known in steps):
                steps.append(step)
    return steps


def other_steps(header: Sequence[str], decimal: str, step: float) -> list[str]:
    """Describe the distances of two points that a header states, and that are not the step in m."""
    return [
        f"the header has a step or pitch of {length_text(other, 5)}, against a step of "
        f"{length_text(step, 5)}"
        for other in stated_steps(header, decimal, counts=True)
        if not math.isclose(other, step, rel_tol=0.01)  # both may be rounded
    ]


def _step(text: str, decimal: str, counts: bool) -> float | None:
    """Return the step that a statement such as "Pitch X: 0.5 µm" or "dx (µm) = 0.5" gives."""
    number = _FIRST_NUMBER.search(text)
    if number is None:
        return None
    label, rest = text[: number.start()].strip(" :=\t"), text[number.end() :]
    unit = _LENGTH.fullmatch(_PER_POINT.sub("", rest))
    if unit is None or _NOT_THE_STEP.search(label):
        return None
    inside = _COLUMN.fullmatch(unicodedata.normalize("NFKC", label))
    named = unit[1] or next(filter(None, inside.groups()[1:] if inside else ()), "")
    if not named or named in ("a", "A") or not _names_step(_words(label), counts):
        return None
    if decimal == "," and _POINT_OF_THOUSANDS.fullmatch(number[0]):
        return None
    try:
        metres = LENGTH.units[LENGTH.unit_named(named)]
        value = float(number[0].replace(",", ".") if decimal == "," else number[0])
    except (InputError, ValueError):
        return None
    return value * metres if value > 0 else None


def _words(label: str) -> list[str]:
    """Return the words of a label in lower case, without its unit."""
    plain = unicodedata.normalize("NFKC", label).replace("∆", "Δ")
    apart = re.sub(r"[_\-.]|(?<=[a-z])(?=[A-Z][a-z])", " ", plain)
    if found := _COLUMN.fullmatch(apart):
        apart = found[1]
    return re.findall(r"[^\W\d_]+", apart.lower())


def _names_step(words: Sequence[str], counts: bool) -> bool:
    """Return whether a label names the step, and nothing that gives it another meaning."""
    for k in range(len(words)):
        for n in (1, 2):
            name, beside = "".join(words[k : k + n]), {*words[:k], *words[k + n :]}
            is_step = name in _STEP or (name in _PITCH and (counts or beside & _OF_STEP))
            if is_step and beside <= _BESIDE_STEP:
                return True
    return False
