"""Read and format lengths with their units, for options, campaign files and messages."""

from __future__ import annotations

import argparse
import math
import re
import unicodedata
from collections.abc import Callable, Mapping
from decimal import Decimal

from adhesis.ensemble.errors import InputError, UnitError, quoted

# A larger number without a unit is likely to be in another unit than metres, and is asked about.
LONGEST_IN_METRES = 1.0  # m
HIGHEST_IN_METRES = 1e-3  # m, of the heights of a roughness

METRES = {
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "µm": 1e-6,
    "nm": 1e-9,
    "Å": 1e-10,
    "inch": 25.4e-3,
    "mil": 25.4e-6,
    "µin": 25.4e-9,
}

OTHER_NAMES = {
    "um": "µm",
    "μm": "µm",  # the Greek letter instead of the sign
    "micron": "µm",
    "microns": "µm",
    "micrometer": "µm",
    "micrometers": "µm",
    "micrometre": "µm",
    "micrometres": "µm",
    "mikrometer": "µm",
    "nanometer": "nm",
    "nanometers": "nm",
    "nanometre": "nm",
    "nanometres": "nm",
    "millimeter": "mm",
    "millimeters": "mm",
    "millimetre": "mm",
    "millimetres": "mm",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "metres": "m",
    "a": "Å",
    "å": "Å",
    "angstrom": "Å",
    "angstroms": "Å",
    "ångström": "Å",
    "in": "inch",
    "inches": "inch",
    "mils": "mil",
    "thou": "mil",
    "uin": "µin",
    "μin": "µin",
    "uinch": "µin",
    "μinch": "µin",
    "microinch": "µin",
    "microinches": "µin",
}

_WITH_UNIT = re.compile(r"\s*([+\-]?(?:\d+\.?\d*|\.\d+)(?:e[+\-]?\d+)?)\s*([^\W\d_]+)\s*", re.I)


def unit_named(name: str) -> str:
    """Return the unit of this name ("um" is "µm").

    Raises
    ------
    InputError
        For a name that is no unit of length.
    """
    unit = _unit_or_none(name.strip())
    if unit is not None:
        return unit
    raise InputError(f"{name!r} is no unit of length: it must be one of {', '.join(METRES)}")


def _unit_or_none(name: str) -> str | None:
    """Return the unit of this name, capitals or not, or None; ㎛ is one sign for µm."""
    name = unicodedata.normalize("NFKC", name)
    for known in METRES:
        if name == known or name.lower() == known.lower():
            return known
    return OTHER_NAMES.get(name.lower())


def length(text: str) -> float:
    """Read an option that is a length, in m; to be given to argparse."""
    return _of_an_option(text, LONGEST_IN_METRES)


def height(text: str) -> float:
    """Read an option that is a height of a roughness, in m; to be given to argparse."""
    return _of_an_option(text, HIGHEST_IN_METRES)


def _of_an_option(text: str, longest: float) -> float:
    try:
        return parse_length(text, longest)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def parse_length(text: str, longest: float = math.inf) -> float:
    """Read a length in m: a number in m, or a number and its unit as in 2.5um.

    Whether it is positive and finite is left to the rule of the quantity.

    Parameters
    ----------
    text : str
    longest : float
        Largest size in m of a number without a unit.

    Raises
    ------
    InputError
        If it is no length, or a larger number without a unit; the sentence begins with "is".
    """
    try:
        value = float(text)
    except ValueError:
        pass
    else:
        if longest < abs(value) < math.inf:
            raise InputError(
                f"is {value:g}, which would be {value:g} m: give its unit, as in {value:g}um "
                f"({value:g}m, if metres are meant)"
            )
        return value
    return length_with_unit(text)


def length_with_unit(text: str) -> float:
    """Read a number and its unit, as in "2 mm", in m.

    Raises
    ------
    InputError
        If it is anything else; the sentence begins with "is".
    """
    return number_with_unit(text, METRES, _unit_or_none, "a length, as in 5e-6 (m) or 5um")


def number_with_unit(
    text: str, units: Mapping[str, float], named: Callable[[str], str | None], rule: str
) -> float:
    """Read a number and its unit, in the SI unit.

    Parameters
    ----------
    text : str
    units : mapping of str to float
        Size of each unit in the SI unit.
    named : callable
        Returns the unit of a name, or None.
    rule : str
        What the text must be, for the message.

    Raises
    ------
    InputError
        If it is anything else; the sentence begins with "is".
    """
    found = _WITH_UNIT.fullmatch(unicodedata.normalize("NFKC", text))
    if not found:
        raise InputError(f"is {quoted(text)}: it must be {rule}")
    unit = named(found[2])
    if unit is None:
        names = ", ".join(units)
        raise UnitError(f"is {quoted(text)}: its unit must be one of {names}")
    # Decimal numbers, so that 7um is the same number as 7e-6.
    return float(Decimal(found[1]) * Decimal(repr(units[unit])))


def length_text(metres: float, digits: int = 3) -> str:
    """Format a length in a unit of its size: "5 µm"."""
    unit = length_unit(metres)
    return f"{metres / METRES[unit]:.{digits}g} {unit}"


def length_unit(metres: float) -> str:
    """Return the largest of m, mm, µm and nm that is not larger than a length; nm for less."""
    return next((unit for unit in ("m", "mm", "µm") if abs(metres) >= METRES[unit]), "nm")
