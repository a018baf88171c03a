"""Units of the numbers that results and commands state."""

from __future__ import annotations

from typing import Any

_NAMES = {
    "m": "h_max h_rms period separation patch_length valid_range edge_range position step length "
    "height_range tip_radius cut_off noise longest highest rise form_height rms_level noise_rms "
    "limit_step limit_noise limit_tip coefficient_real coefficient_imag narrowest_length",
    "m²": "m0",
    "1/m²": "m4",
    "m³": "power floor",
    "rad/m": "wave_number",
    "Pa": "young modulus mean_stress pull_off_stress stress_change max_stress tension "
    "largest_interior_tension",
    "Pa/m": "stiffness",
    "J/m": "energy elastic_energy adhesion_energy potential hold_energy",
    "J/m²": "work_of_adhesion loss loss_from_drops loss_error energy_drop at_stake energy_at_stake "
    "energy_change work work_gained work_spent effective_work_of_approach "
    "effective_work_of_separation full_contact_energy",
    "s": "seconds expected_seconds wall",
}
UNITS = {name: unit for unit, names in _NAMES.items() for name in names.split()}
"""Unit by the name of a quantity; others are dimensionless (penetrations are in units of h_max)."""


def with_units(table: Any) -> Any:
    """Return a DataFrame with the unit of every column in ``attrs["units"]``."""
    table.attrs["units"] = {name: UNITS.get(name, "") for name in table.columns}
    return table
