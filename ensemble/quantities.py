"""Units of the numbers that results and commands state; losses over the work of adhesion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from adhesis.ensemble.lengths import METRES, length_unit
from adhesis.ensemble.stresses import PASCALS, stress_unit

_NAMES = {
    "m": "h_max h_rms period separation patch_length valid_range edge_range touch_range position "
    "step length height_range adhesion_range tip_radius cut_off noise longest highest rise "
    "form_height rms_level noise_rms begin end beyond rms limit_step limit_noise limit_tip "
    "coefficient_real coefficient_imag narrowest_length",
    "m²": "m0",
    "1/m²": "m4",
    "m³": "power floor",
    "rad/m": "wave_number",
    "Pa": "young strength preload modulus mean_stress pull_off_stress stress_change max_stress "
    "tension largest_interior_tension turning_stress",
    "Pa/m": "stiffness",
    "J/m": "energy elastic_energy adhesion_energy potential hold_energy",
    "J/m²": "work_of_adhesion loss loss_from_drops loss_error energy_drop at_stake energy_at_stake "
    "barrier energy_change work work_gained work_spent effective_work_of_approach "
    "effective_work_of_separation full_contact_energy",
    "s": "seconds expected_seconds wall",
}
UNITS = {name: unit for unit, names in _NAMES.items() for name in names.split()}
"""Unit by the name of a quantity; others are dimensionless (penetrations are in units of h_max)."""

_TWO_DIGITS = 2.95  # an error below has two significant digits
_MOST_PLACES = 9

AXIS_UNITS = {"m": "m", "m2": "m²", "Pa": "Pa", "Pa m-1": "Pa/m"}
"""Units of the axes of a campaign for people, by their spelling in results files."""


def with_units(table: Any) -> Any:
    """Return a DataFrame with the unit of every column in ``attrs["units"]``."""
    table.attrs["units"] = {name: UNITS.get(name, "") for name in table.columns}
    return table


def shown_unit(name: str, largest: float) -> tuple[str, float]:
    """Return a unit of its size for a quantity, and that in the SI unit; ("", 1) for a number.

    Parameters
    ----------
    name : str
        As in :data:`UNITS`.
    largest : float
        Largest of the values that are shown, in the SI unit.
    """
    unit = UNITS.get(name, "")
    if unit == "m":
        unit = length_unit(largest)
        return unit, METRES[unit]
    if unit == "Pa":
        unit = stress_unit(largest)
        return unit, PASCALS[unit]
    return unit, 1.0


def with_unit(name: str, value: float) -> str:
    """Return a value and its unit: "20 kPa"; a number alone where there is none."""
    unit, size = shown_unit(name, value)
    return f"{value / size:g} {unit}".rstrip()


# Of the turning points: in Pa under a load, else dimensionless.
_TURNING = ("turning_point", "turning_points", "start", "turn")
# Not listed: settings of a method, which its documentation describes, and loops with the keys of
# the whole document.
_LEFT_OUT = ("method_details", "turns", "provenance")


def units_of(document: Mapping[str, Any]) -> dict[str, str]:
    """Return the unit of every number of a JSON document; "1" if it is dimensionless.

    The keys are paths ("jumps.energy_drop"), entries of a list have one of them.
    """
    found: dict[str, str] = {}
    turning = "Pa" if document.get("stiffness") == 0 else "1"

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
            found[".".join(path)] = turning if path[-1] in _TURNING else _unit(path)

    for name, value in document.items():
        if name not in _LEFT_OUT:
            visit((name,), value)
    return found


def _unit(path: tuple[str, ...]) -> str:
    name, parent = path[-1], path[-2] if len(path) > 1 else ""
    if parent == "doubts":
        return "1"
    if parent == "cut_off_limits":
        return UNITS["cut_off"]
    if name in ("value", "uncertainty"):
        return UNITS.get(parent, "1")
    return UNITS.get(name, "1")


def bytes_text(size: float) -> str:
    """Return a size in a unit that fits: "300 kB", "20 MB"."""
    return f"{size / 1e6:.0f} MB" if size >= 1e7 else f"{size / 1e3:.0f} kB"


def with_error(value: float, error: float, least: float = -math.inf, most: float = math.inf) -> str:
    """Return "9700 ± 800" or "0.0351 ± 0.0012".

    The last digit is the first one of the error, or the second where the first is 1 or 2.

    Parameters
    ----------
    value, error : float
    least, most : float
        Bounds of the quantity. Where the error reaches beyond them, the ends of the interval are
        given instead: "0.995, from 0.975 to 1".
    """
    if not 0 < error < math.inf:
        return f"{value:.4g} ± {error:g}"
    exponent = math.floor(math.log10(error))
    places = (error < _TWO_DIGITS * 10.0**exponent) - exponent
    if places > _MOST_PLACES:
        return f"{value:.4g} ± {error:.2g}"
    shown = max(places, 0)
    low, high = max(value - error, least), min(value + error, most)
    if least <= value <= most and high - low < 2 * error * (1 - 1e-9):
        middle, *ends = (f"{round(part, places):.{shown}f}" for part in (value, low, high))
        return f"{middle}, from {ends[0]} to {ends[1]}"
    return f"{round(value, places):.{shown}f} ± {round(error, places):.{shown}f}"


def in_works_of_adhesion(loss: float, work_of_adhesion: float) -> str:
    """Return ", 0.31 γ", to follow a loss in J/m²; an empty text without adhesion."""
    return f", {loss / work_of_adhesion:.4g} γ" if work_of_adhesion > 0 else ""
