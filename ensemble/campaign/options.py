"""Options of commands that mean the same as keys of a campaign file: one rule for both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from ensemble.campaign.tables import TABLES, Table


def check_options(values: Mapping[str, Any], tables: Mapping[str, Table]) -> None:
    """Check options by the rules of the keys of the same names.

    Parameters
    ----------
    values : dict
        Values by the key's name ("load_steps"); None is not checked, and of a sequence every value
        is.
    tables : dict
        Table of the campaign file that each key stands in.

    Raises
    ------
    InputError
        "--load-steps is 0: it must be …".
    """
    for key, table in tables.items():
        value = values.get(key)
        rule = next(f for f in fields(TABLES[table]) if f.name == key).metadata["rule"]
        several = value if isinstance(value, list | tuple) else [value]
        for one in several:
            if one is not None:
                rule(f"--{key.replace('_', '-')}", one)
