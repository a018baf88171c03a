"""Options of a command as a table, a line each, in the words of its help."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from adhesis.ensemble.quantities import HEIGHT, LENGTH, STIFFNESS, STRESS, WORK_OF_ADHESION

_KINDS: dict[str, Callable[[str], Any]] = {
    **{"int": int, "float": float, "path": Path, "length": LENGTH.option, "height": HEIGHT.option},
    **{"stress": STRESS.option, "stiffness": STIFFNESS.option, "work": WORK_OF_ADHESION.option},
}


def add_options(
    group: argparse._ActionsContainer, table: str, **types: Callable[[str], Any]
) -> None:
    """Add the options of a table: "--step S length: distance of two heights, 0.5um".

    Behind the name stand the name of its value and its kind, if it is no text, perhaps with a
    default ("int=40"). Lines that are indented go on with the help. An option without a value is a
    flag; a kind that ends in "+" may be given several times. ``types`` are further kinds.
    """
    for entry in re.split(r"\n(?=\S)", table.strip()):
        head, _, text = " ".join(entry.split()).partition(": ")
        name, *words = head.split()
        if not words:
            group.add_argument(name, action="store_true", help=text)
            continue
        kind, _, default = (words[1] if len(words) > 1 else "").partition("=")
        known = _KINDS | types
        read = known.get(kind.removesuffix("+"))
        more: dict[str, Any] = {"type": read} if read is not None else {}
        if default:
            more["default"] = read(default) if read is not None else default
        if kind.endswith("+"):
            more["action"] = "append"
        group.add_argument(name, metavar=words[0], help=text, **more)
