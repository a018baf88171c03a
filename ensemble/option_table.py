"""Declare the options of a command by a table: a line each, and more where it is long.

    --work-of-adhesion G work: in J/m², or 20mJ/m2
    --n0 whole: lowest harmonic
    --quiet: no progress on stderr

Name, placeholder of the value (by default the name), kind of the value, and what the option is. One
without a kind is a flag.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from adhesis.ensemble.quantities import HEIGHT, LENGTH, STIFFNESS, STRESS, WORK_OF_ADHESION

_KINDS: Mapping[str, Callable[[str], Any] | None] = {
    "text": None,
    "whole": int,
    "number": float,
    "file": Path,
    "length": LENGTH.option,
    "height": HEIGHT.option,
    "stress": STRESS.option,
    "stiffness": STIFFNESS.option,
    "work": WORK_OF_ADHESION.option,
}


def declare(group: argparse._ActionsContainer, table: str, **more: Mapping[str, Any]) -> None:
    """Declare the options of a table, in its order.

    ``more`` has further arguments of ``add_argument`` by the option's attribute: a default, say, or
    a type with bounds.
    """
    for entry in re.split(r"\n(?=--)", table.strip()):
        head, _, text = " ".join(entry.split()).partition(": ")
        name, *value = head.rstrip(":").split()
        about: dict[str, Any] = {"action": "store_true"}
        if value:
            about = {"type": _KINDS[value[-1]]}
        if len(value) > 1:
            about["metavar"] = value[0]
        about |= more.get(name.removeprefix("--").replace("-", "_"), {})
        group.add_argument(name, help=text or None, **about)
