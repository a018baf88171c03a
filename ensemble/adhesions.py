"""Read works of adhesion with their units, for options and campaign files."""

from __future__ import annotations

import argparse
import math
import re

from adhesis.ensemble.errors import InputError, quoted
from adhesis.ensemble.lengths import number_with_unit

# A larger number without a unit is likely to be in mJ/m², and is asked about: the surface energies
# of solids are below 10 J/m².
LARGEST_IN_JOULES = 10.0  # J/m²

_JOULES = {"J/m²": 1.0, "mJ/m²": 1e-3, "N/m": 1.0, "mN/m": 1e-3}
_WITH_UNIT = re.compile(r"(.*[JN])\s*/\s*m(2|²|\^2)?\s*", re.DOTALL)


def work_of_adhesion(text: str) -> float:
    """Read an option that is a work of adhesion, in J/m²; to be given to argparse."""
    try:
        return parse_work_of_adhesion(text, LARGEST_IN_JOULES)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def parse_work_of_adhesion(text: str, largest: float = math.inf) -> float:
    """Read a work of adhesion in J/m²: a number in J/m², or a number and its unit as in 20mJ/m2.

    N/m and mN/m, the units of surface tensions, are J/m² and mJ/m².

    Whether it is positive and finite is left to the rule of the quantity.

    Parameters
    ----------
    text : str
    largest : float
        Largest size in J/m² of a number without a unit.

    Raises
    ------
    InputError
        If it is anything else, or a larger number without a unit; the sentence begins with "is".
    """
    try:
        value = float(text)
    except ValueError:
        return work_of_adhesion_with_unit(text)
    if largest < abs(value) < math.inf:
        raise InputError(
            f"is {value:g}, which would be {value:g} J/m²: give its unit, as in {value:g}mJ/m2 "
            f"({value:g}J/m2, if J/m² are meant)"
        )
    return value


def work_of_adhesion_with_unit(text: str) -> float:
    """Read a number and its unit, as in "20 mJ/m2", in J/m².

    Raises
    ------
    InputError
        If it is anything else; the sentence begins with "is".
    """
    rule = "a number in J/m² with a decimal point, as in 0.02, or with its unit, as in 20mJ/m2"
    found = _WITH_UNIT.fullmatch(text)
    if not found:
        raise InputError(f"is {quoted(text)}: it must be {rule}")
    area = "/m²" if found[2] else "/m"

    def unit_or_none(name: str) -> str | None:
        """Return the unit with this name before its slash, or None; capitals count."""
        return name + area if name + area in _JOULES else None

    return number_with_unit(found[1], _JOULES, unit_or_none, rule)
