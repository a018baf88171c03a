"""Write a commented campaign file that runs as it is, as a start for one of your own.

It lists every key with its meaning, its rule and its default. An existing file is not overwritten.
"""

from __future__ import annotations

import argparse
import json
import textwrap
from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import Any

from adhesis.ensemble.escape import shell_word
from adhesis.ensemble.files import check_ending, write_new

EXAMPLES = ("adhesis new my.toml", "adhesis new study/first.toml")
# The campaign that runs as it is: values as TOML spells them.
_VALUES = {
    "profile.period": '"2 mm"',
    "profile.n0": "4",
    "profile.ratio": "8",
    "profile.h_rms": '"1 µm"',
    "material.young": "1e6",
    "material.poisson": "0.5",
    "sweep.hurst": "[0.7, 0.8]",
    "sweep.work_of_adhesion": "[0.04]",
    "sweep.realisations": "3",
    "cycle.max_penetration": "0.9",
    "cycle.load_steps": "20",
}
# Values of keys that are left out by default.
KEY_EXAMPLES = {
    "profile.m2": "1e-4",
    "profile.c0": "1e-14",
    "material.adhesion_range": '"0.3 nm"',
    "material.strength": "1e8",
    "material.work_of_adhesion_open": '"80 mJ/m2"',
    "material.stripes": "8",
    "material.stripe_amplitude": "0.3",
    "cycle.max_stress": "200",
    "cycle.preload": '"0.5 kPa"',
    "cycle.stiffness": "1e9",
    "solver.nodes_per_wave": "64",
    "solver.time_limit": "3600.0",
    "output.field_penetrations": "[0.3, 0.6, 0.9]",
    "stop.relative_error": "0.1",
}
_TITLES = {
    "profile": "the rough profile, by the spectral method",
    "material": "the elastic half-space, and the strength of the interface",
    "sweep": "one task for every H, γ (and what else is a list) and realisation",
    "cycle": "the loading path",
    "solver": "the method and its accuracy",
    "output": "what is kept of a loop, besides losses and curves",
    "stop": "realisations in batches until a mean of every cell is known well enough",
}
_HEAD = """\
# A campaign of adhesis: one loop for every Hurst exponent, work of adhesion and realisation.
#
#   adhesis run FILE.toml --dry-run       what it costs
#   adhesis run FILE.toml                 run it, or resume it
#   adhesis report FILE.h5 --to DIR       tables and figures
#
# Every key is listed, below its meaning and its rule. A line that begins with "# KEY =" has no
# effect until "# " is removed; it shows the default, or an example where there is none. Numbers are
# in SI units; lengths and stresses may have a unit, as here and in "1 MPa". The keys are described
# in docs/campaign-file.md.
"""
_WIDTH = 96

OPTIONS = (("file FILE.toml", Path, "the file to write"),)


def execute(args: argparse.Namespace) -> None:
    """Write the file."""
    check_ending("FILE.toml", args.file, ".toml")
    write_new("FILE.toml", args.file, lambda: campaign_template().encode())
    file = shell_word(args.file)
    print(f"next        adhesis run {file} --dry-run   (its cost; without --dry-run: the run)")


def campaign_template() -> str:
    """Return the text of the file."""
    from adhesis.ensemble.campaign.tables import TABLES  # loads numpy

    return _HEAD + "".join(_table(name, table) for name, table in TABLES.items())


def _table(name: str, table: type) -> str:
    entries = [_entry(f"{name}.{entry.name}", entry) for entry in fields(table)]
    # A table without a key may stay empty, but [stop] asks for one of its own.
    mark = "# " if name == "stop" else ""
    return f"\n{mark}[{name}]  # {_TITLES[name]}\n" + "".join(entries)


def _entry(key: str, entry: Field[Any]) -> str:
    rule = entry.metadata["rule"].text
    if entry.metadata["axis"]:
        rule += "; or a list of them"
    lines = [f"# {line}" for line in textwrap.wrap(entry.metadata["meaning"], _WIDTH)]
    lines += [f"#   {line}" for line in textwrap.wrap(rule, _WIDTH)]
    comment = "".join(f"{line}\n" for line in lines)
    if key in _VALUES:
        return f"{comment}{entry.name} = {_VALUES[key]}\n"
    if key in KEY_EXAMPLES:
        return f"{comment}# {entry.name} = {KEY_EXAMPLES[key]}  # example; left out by default\n"
    assert entry.default not in (MISSING, None), f"{key} has neither default nor example"
    return f"{comment}# {entry.name} = {json.dumps(entry.default)}\n"
