"""Read stresses with their units, for options and campaign files."""

from __future__ import annotations

import argparse

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.lengths import number_with_unit

PASCALS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9}


def stress(text: str) -> float:
    """Read an option that is a stress, in Pa; to be given to argparse."""
    try:
        return parse_stress(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def parse_stress(text: str) -> float:
    """Read a stress in Pa: a number in Pa, or a number and its unit as in 20kPa.

    Whether it is positive and finite is left to the rule of the quantity.

    Raises
    ------
    InputError
        If it is anything else; the sentence begins with "is".
    """
    try:
        return float(text)
    except ValueError:
        return stress_with_unit(text)


def stress_with_unit(text: str) -> float:
    """Read a number and its unit, as in "20 kPa", in Pa.

    Raises
    ------
    InputError
        If it is anything else; the sentence begins with "is".
    """
    return number_with_unit(text, PASCALS, _unit_or_none, "a stress, as in 2e4 (Pa) or 20kPa")


def stress_unit(pascals: float) -> str:
    """Return the largest unit that is not larger than a stress; Pa for less."""
    return next((u for u in reversed(PASCALS) if abs(pascals) >= PASCALS[u]), "Pa")


def _unit_or_none(name: str) -> str | None:
    """Return the unit of this name, or None; mPa and MPa are two, so that capitals count."""
    return name if name in PASCALS else None
