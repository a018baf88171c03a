"""Quantities with their units: how they are read, and how numbers are shown.

Each quantity that a user can give is one :class:`Quantity`, by which options, campaign files and
Python read it.
"""

from __future__ import annotations

import argparse
import math
import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from functools import cached_property
from itertools import pairwise
from typing import Any

from adhesis.ensemble.errors import InputError, UnitError, parameter, quoted

_NUMBER = r"\s*([+\-]?(?:\d+\.?\d*|\.\d+)(?:e[+\-]?\d+)?)\s*"
_WORD = r"[^\W\d_]+"
_QUOTIENT = rf"{_WORD}\s*/\s*{_WORD}(?:\^?2)?"


def in_plain_signs(text: str) -> str:
    """Return a text with plain digits, blanks and units: "㎛" is "μm".

    A raised digit or a fraction ("2² mm") becomes no digit of the number that it follows.
    """
    raised = {ord(sign): f"^{sign}" for sign in set(text) if unicodedata.category(sign) == "No"}
    return unicodedata.normalize("NFKC", text.translate(raised))


class Written(float):
    """A number in its SI unit, with the unit in which it was written, for labels."""

    unit: str

    def __new__(cls, value: float, unit: str = "") -> Written:
        """Return the number; ``unit`` is one of its quantity's."""
        made = super().__new__(cls, value)
        made.unit = unit
        return made


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity, given as a number in its SI unit or as a number with a unit.

    Whether a value is positive and finite is left to its bounds. Sentences of errors begin with
    "is", to follow the name of an option or a key.
    """

    name: str
    units: Mapping[str, float]  # size of each unit in the SI unit, which is the first
    example: str  # a value with its unit
    rule: str  # what a text must be
    shown: tuple[str, ...]  # units in which values are shown, from the largest to the smallest
    # A larger number without a unit is likely to be in another unit, and is asked about
    largest: float = math.inf
    # What to give instead of such a number, which replaces ``{0}``: in quotes, which a campaign
    # file needs and a shell takes off
    question: str = ""
    # Units by further names; with them, capitals do not count
    others: Mapping[str, str] = field(default_factory=dict)

    @property
    def unit(self) -> str:
        """The SI unit."""
        return next(iter(self.units))

    @cached_property
    def spellings(self) -> dict[str, str]:
        """Unit by each of its names, as these are compared."""
        named = {unit: unit for unit in self.units} | dict(self.others)
        return {self._compared(name): unit for name, unit in named.items()}

    def _compared(self, name: str) -> str:
        """Return a name in the form in which names are compared."""
        name = in_plain_signs(name).strip().replace("^2", "2")
        name = re.sub(r"\s*/\s*", "/", name)
        return name.lower() if self.others else name

    def unit_named(self, name: str) -> str:
        """Return the unit of a name ("um" is "µm"), or raise InputError."""
        unit = self.spellings.get(self._compared(name))
        if unit is None:
            units, option = ", ".join(self.units), parameter("unit")
            raise InputError(f"{option} is {quoted(name)}: it must be one of {units}")
        return unit

    def check(self, number: float) -> None:
        """Raise UnitError for a number that can hardly be in the SI unit."""
        if self.largest < abs(number) < math.inf:
            shown = f"{number:g}"
            raise UnitError(
                f"is {shown}, which would be {shown} {self.unit}: give its unit, "
                f"{self.question.format(shown)}"
            )

    def read(self, text: str) -> float:
        """Read a number in the SI unit, or a number with its unit; InputError for anything else."""
        try:
            number = float(text)
        except ValueError:
            return self.read_with_unit(text)
        self.check(number)
        return number

    def read_with_unit(self, text: str) -> Written:
        """Read a number with a unit, "2 mm" (InputError; UnitError for another unit)."""
        named = _QUOTIENT if "/" in self.unit else _WORD
        found = re.fullmatch(rf"{_NUMBER}({named})\s*", in_plain_signs(text), re.IGNORECASE)
        if not found:
            raise InputError(f"is {quoted(text)}: it must be {self.rule}")
        unit = self.spellings.get(self._compared(found[2]))
        if unit is None:
            raise UnitError(f"is {quoted(text)}: its unit must be one of {', '.join(self.units)}")
        # Decimal numbers, so that 7um is the same number as 7e-6.
        return Written(float(Decimal(found[1]) * Decimal(repr(self.units[unit]))), unit)

    def option(self, text: str) -> float:
        """Read an option; to be given to argparse."""
        try:
            return self.read(text)
        except InputError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    def unit_for(self, value: float) -> str:
        """Return the unit of a value as written, or the largest shown one that is not larger."""
        if isinstance(value, Written):
            return value.unit
        return next((u for u in self.shown if abs(value) >= self.units[u]), self.shown[-1])

    def text(self, value: float, digits: int = 3) -> str:
        """Show a value in a unit of its size: "5 µm"."""
        unit = self.unit_for(float(f"{value:.{digits}g}"))
        return f"{value / self.units[unit]:.{digits}g} {unit}"


# Unit, its size in m, and its further names
_LENGTHS = (
    ("m", 1.0, "meter meters metre metres метр"),
    ("cm", 1e-2, "centimeter centimeters centimetre centimetres zentimeter"),
    ("mm", 1e-3, "millimeter millimeters millimetre millimetres millimètre millimètres мм 毫米"),
    ("µm", 1e-6, "um micron microns micrometer micrometers micrometre micrometres mikrometer"),
    ("µm", 1e-6, "мкм 微米"),
    ("nm", 1e-9, "nanometer nanometers nanometre nanometres нм 纳米"),
    ("Å", 1e-10, "a angstrom angstroms ångström angström angstroem"),
    ("inch", 25.4e-3, "in inches zoll pouce pouces дюйм 英寸"),
    ("mil", 25.4e-6, "mils thou"),
    ("µin", 25.4e-9, "uin uinch µinch microinch microinches"),
    ("kÅ", 1e-7, "kiloangstrom"),
)
LENGTH = Quantity(
    "length",
    {unit: size for unit, size, _ in _LENGTHS},
    "2 mm",
    "a length, as in 5e-6 (m) or 0.5um",
    ("m", "mm", "µm", "nm"),
    1.0,
    'as in "{0}um" ("{0}m", if metres are meant)',
    {name: unit for unit, _, names in _LENGTHS for name in names.split()},
)
HEIGHT = replace(LENGTH, largest=1e-3)
"""A height of a roughness."""

STRESS = Quantity(
    "stress",
    {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    "20 kPa",
    "a stress, as in 2e4 (Pa) or 0.5kPa",
    ("GPa", "MPa", "kPa", "Pa"),
)
STIFFNESS = Quantity(
    "stiffness",
    {"Pa/m": 1.0, "kPa/m": 1e3, "MPa/m": 1e6, "GPa/m": 1e9},
    "2 GPa/m",
    "a stiffness, as in 2e9 (Pa/m) or 0.5GPa/m",
    ("Pa/m",),
)
WORK_OF_ADHESION = Quantity(
    "work of adhesion",
    {"J/m²": 1.0, "mJ/m²": 1e-3, "N/m": 1.0, "mN/m": 1e-3},
    "20 mJ/m2",
    "a number in J/m² with a decimal point, as in 0.02, or with its unit, as in 20mJ/m2",
    ("J/m²",),
    10.0,  # the surface energies of solids are below
    'as in "{0}mJ/m2" ("{0}J/m2", if J/m² are meant)',
)
QUANTITIES = {q.unit: q for q in (LENGTH, STRESS, STIFFNESS, WORK_OF_ADHESION)}
"""Quantities by their SI unit."""

length_text, stress_text = LENGTH.text, STRESS.text


def drive_text(drive: float, load: bool) -> str:
    """Show how far a loop is on its way: Δ/h_max (u_tot/h_max of a stiffness), or a load in Pa."""
    return f"p̄ {stress_text(drive)}" if load else f"Δ/h_max {drive:+.4g}"


_WHOLE = re.compile(r"[+\-]?\d+")
_DIGITS = re.compile(r"(\d+)(?![\d.])(e[+\-]?\d+)?(.*)", re.IGNORECASE)


def read_list(
    option: str,
    text: str,
    read: Callable[[str], float] = float,
    rule: str = "",
    given: str | None = None,
) -> tuple[float, ...]:
    """Read the numbers of an option that is a list, such as "0.3,0.6" (InputError).

    A whole number, a comma and digits can be one number with a decimal comma, and are refused. A
    list of whole numbers has decimals ("1.0,5.0") or blanks ("1, 5"). ``rule`` says what the list
    must be, for a ``read`` whose ValueError has no sentence; ``given`` is the option as it was
    given, if it holds more than the list.
    """
    given = quoted(text if given is None else given)
    words = text.split(",")
    for whole, rest in pairwise(words):
        found = _DIGITS.fullmatch(rest)
        if _WHOLE.fullmatch(whole.strip()) and found is not None:
            digits, exponent, unit = found.groups("")
            raise InputError(
                f"{option} is {given}: numbers have a decimal point, as in {whole}.{rest}; if two "
                f"are meant, write {float(whole):.1f}{unit},{int(digits)}.0{exponent}{unit}"
            )
    try:
        numbers = tuple(read(word.strip()) for word in words)
    except InputError as error:
        raise InputError(f"{option} {error}") from None
    except ValueError:
        raise InputError(f"{option} is {given}: it must be {rule}") from None
    if len({isinstance(number, Written) for number in numbers if number}) > 1:
        raise InputError(f"{option} is {given}: give each of the numbers its unit")
    return numbers


_NAMES = {
    "m": "h_max h_rms period separation patch_length valid_range edge_range touch_range turn_range "
    "position step length height_range adhesion_range tip_radius cut_off noise longest highest "
    "rise form_height rms_level noise_rms begin end beyond rms limit_step limit_noise limit_tip "
    "coefficient_real coefficient_imag narrowest_length tip",
    "m²": "m0 c0",
    "1/m²": "m4",
    "m³": "power floor",
    "rad/m": "wave_number",
    "Pa": "young strength preload modulus mean_stress pull_off_stress stress_change max_stress "
    "tension largest_interior_tension turning_stress",
    "Pa/m": "stiffness",
    "J/m": "energy elastic_energy adhesion_energy potential hold_energy edge_friction",
    "J/m²": "work_of_adhesion work_of_adhesion_open least_work_of_adhesion friction loss "
    "loss_from_drops loss_error zone_error energy_drop at_stake energy_at_stake "
    "energy_change work work_gained work_spent "
    "effective_work_of_approach effective_work_of_separation full_contact_energy",
    "s": "seconds expected_seconds wall",
}
UNITS = {name: unit for unit, names in _NAMES.items() for name in names.split()}
"""Unit by the name of a quantity; others are dimensionless (penetrations are in units of h_max)."""

# Of the turning points: in Pa under a load, else dimensionless.
_TURNING = ("turning_point", "turning_points", "start", "turn")
_TWO_DIGITS = 2.95  # an error below has two significant digits
_MOST_PLACES = 9


def units_under(is_load: bool) -> Mapping[str, str]:
    """Return :data:`UNITS`, with that of turning points, which are stresses under a load."""
    return UNITS | dict.fromkeys(_TURNING, "Pa") if is_load else UNITS


def with_units(table: Any, is_load: bool = False) -> Any:
    """Return a DataFrame with the unit of every column in ``attrs["units"]``."""
    units = units_under(is_load)
    table.attrs["units"] = {name: units.get(name, "") for name in table.columns}
    return table


def common_unit(name: str, values: Sequence[float]) -> tuple[str, float]:
    """Return a unit for a quantity of :data:`UNITS`, and that in the SI unit; ("", 1) for a number.

    It is the one in which one of the values was written, or one of the size of the largest.
    """
    unit = UNITS.get(name, "")
    quantity = QUANTITIES.get(unit)
    by = next((value for value in values if isinstance(value, Written)), max(values))
    if quantity is None or math.isinf(by):
        return unit, 1.0
    unit = quantity.unit_for(by)
    return unit, quantity.units[unit]


def in_one_unit(name: str, values: Sequence[float], between: str = ", ") -> str:
    """Return values, ascending, in their common unit, if they have one: "0.2, 0.4 kPa"."""
    unit, size = common_unit(name, values)
    return f"{between.join(f'{value / size:g}' for value in sorted(values))} {unit}".rstrip()


def gamma_text(work_of_adhesion: float) -> str:
    """Return a work of adhesion γ and its unit: "0.02 J/m²", or "20 mJ/m²" if written so."""
    return in_one_unit("work_of_adhesion", [work_of_adhesion])


# Not listed: settings of a method, which its documentation describes, and loops with the keys of
# the whole document.
_LEFT_OUT = ("method_details", "turns", "provenance")


def units_of(document: Mapping[str, Any]) -> dict[str, str]:
    """Return the unit of every number of a JSON document; "1" if it is dimensionless.

    The keys are paths ("jumps.energy_drop"), entries of a list have one of them.
    """
    found: dict[str, str] = {}
    units = units_under(document.get("stiffness") == 0)

    def visit(path: tuple[str, ...], value: Any) -> None:
        if isinstance(value, Mapping):
            for name, part in value.items():
                visit((*path, name), part)
        elif isinstance(value, list | tuple):
            parts = [part for part in value if isinstance(part, Mapping | list | tuple)]
            for part in parts or value[:1]:
                visit(path, part)
        elif value is None and path[-1] not in UNITS:
            pass  # unknown whether it would be a number
        elif value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
            parent, name = ("", *path)[-2:]
            name = parent if name in ("value", "uncertainty") else name
            found[".".join(path)] = "1" if parent == "doubts" else units.get(name, "1")

    for name, value in document.items():
        if name not in _LEFT_OUT:
            visit((name,), value)
    return found


def duration(seconds: float) -> str:
    """Return a time as people read it: "4.2 s", "3 min 20 s", "2 h 05 min"."""
    if seconds < 60:
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    hours, minutes = divmod(minutes, 60)
    if hours < 48:
        return f"{hours} h {minutes:02d} min"
    return f"{hours // 24} d {hours % 24} h"


def percent(*shares: float, digits: int = 2) -> str:
    """Return significant digits of a share without exponent: "12 %"; "3 to 12 %" of unlike ones."""
    texts = (f"{float(f'{100 * share:.{digits}g}'):g}" for share in shares)
    return " to ".join(dict.fromkeys(texts)) + " %"


def rounded_percent(share: float, places: int = 1, sign: str = "") -> str:
    """Return a share with so many places, and with no sign if it rounds to 0: "+3.0 %"."""
    rounded = round(100 * share, places) or 0.0
    return f"{rounded:{sign if rounded else ''}.{places}f} %"


def bytes_text(size: float) -> str:
    """Return a size in a unit that fits: "300 kB", "20 MB", "12.5 GB"."""
    if size >= 1e10:
        return f"{size / 1e9:.3g} GB"
    return f"{size / 1e6:.0f} MB" if size >= 1e7 else f"{size / 1e3:.0f} kB"


def with_error(value: float, error: float, most: float = math.inf) -> str:
    """Return "9700 ± 800" or "0.0351 ± 0.0012".

    The last digit is the first one of the error, or the second where the first is 1 or 2. Where the
    error reaches below 0 or above ``most``, the bounds of the quantity, the ends of the interval
    are given instead: "0.995, from 0.975 to 1". What would be rounded to nought keeps two digits.
    """
    if not 0 < error < math.inf:
        return f"{value:.4g} ± {error:g}"
    exponent = math.floor(math.log10(error))
    places = (error < _TWO_DIGITS * 10.0**exponent) - exponent
    if places > _MOST_PLACES:
        return f"{value:.4g} ± {error:.2g}"
    shown = max(places, 0)
    low, high = max(value - error, 0.0), min(value + error, most)
    if 0 <= value <= most and high - low < 2 * error * (1 - 1e-9):
        middle, *ends = (f"{round(part, places):.{shown}f}" for part in (value, low, high))
        if round(value, places) == 0 < value:
            middle = f"{float(f'{value:.2g}'):g}"
        return f"{middle}, from {ends[0]} to {ends[1]}"
    value = round(value, places) + 0.0  # no sign of a nought
    return f"{value:.{shown}f} ± {round(error, places):.{shown}f}"
