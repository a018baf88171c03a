"""Units of everything that a result states: numbers, columns of states and jumps, inputs."""

from __future__ import annotations

from typing import Any

_NAMES = {
    "m": (
        *("period", "h_max", "h_rms", "separation", "patch_length", "valid_range", "edge_range"),
        *("narrowest_length", "coefficient_real", "coefficient_imag", "x", "height", "gap"),
        *("displacement", "position", "step", "length", "height_range", "tip_radius", "cut_off"),
    ),
    "m²": ("m0",),
    "1/m": ("curvature",),
    "1/m²": ("m4",),
    "Pa": (
        *("mean_stress", "stress", "young", "modulus", "pull_off_stress", "stress_change"),
        *("largest_interior_tension", "tension"),
    ),
    "Pa/m": ("stiffness",),
    "J/m": ("elastic_energy", "adhesion_energy", "energy", "potential", "hold_energy"),
    "J/m²": (
        *("work_of_adhesion", "loss", "loss_error", "loss_from_drops", "energy_drop", "at_stake"),
        *("energy_at_stake", "work", "work_gained", "work_spent", "energy_change"),
        *("effective_work_of_approach", "effective_work_of_separation", "full_contact_energy"),
    ),
    "s": ("seconds",),
}
UNITS: dict[str, str] = {name: unit for unit, names in _NAMES.items() for name in names}
"""Unit by name; a quantity that is not there has none."""


def with_units(table: Any) -> Any:
    """Return a DataFrame with the unit of every column in ``attrs["units"]``."""
    table.attrs["units"] = {name: UNITS.get(name, "") for name in table.columns}
    return table
