"""The campaign file: TOML, read and checked key by key before any work.

A file that breaks a rule is refused with the key, the value and the rule in one sentence.
"""

from __future__ import annotations

import tomllib
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from ensemble.campaign.rules import shown
from ensemble.campaign.tables import TABLES, Campaign, Table
from ensemble.errors import InputError
from solver.profile import MOST_WAVES

# HDF5 keeps an attribute of at most 64 KiB, and the text is one.
_LONGEST_TEXT = 60_000
_MOST_TASKS = 10_000_000
_LONGEST_AXIS = 1_000_000


def load_campaign(path: Path | str) -> Campaign:
    """Read and check a campaign file.

    Raises
    ------
    InputError
        If it cannot be read or breaks a rule; one sentence.
    """
    try:
        text = Path(path).read_bytes().decode("utf-8")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not a campaign file: it is not UTF-8 text") from error
    return parse_campaign(text, str(path))


def parse_campaign(text: str, source: str = "campaign") -> Campaign:
    """Check the text of a campaign file; ``source`` names it in errors.

    Raises
    ------
    InputError
        If it breaks a rule; one sentence.
    """
    size = len(text.encode("utf-8"))
    if size > _LONGEST_TEXT:
        raise InputError(
            f"{source} has {size} bytes: a campaign file has at most {_LONGEST_TEXT}, since the "
            "results file keeps its text"
        )
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{source} is not valid TOML: {reason}") from error
    for name in document:
        if name not in TABLES:
            known = ", ".join(f"[{t}]" for t in TABLES)
            raise InputError(f"{source}: {shown(name)} is unknown; the tables are {known}")
    tables = {name: _read_table(source, name, document.get(name, {})) for name in TABLES}
    campaign = Campaign(text=text, **tables)
    _check_together(source, campaign)
    return campaign


def _read_table(source: str, name: Table, entries: object) -> Any:
    kind = TABLES[name]
    if not isinstance(entries, dict):
        raise InputError(f"{source}: {name} is {shown(entries)}: it must be a table, [{name}]")
    known = {f.name: f for f in fields(kind)}
    for key in entries:
        if key not in known:
            names = ", ".join(known)
            raise InputError(
                f"{source}: [{name}] {_spelt(key)} is unknown; the keys of [{name}] are {names}"
            )
    values = {
        key: known[key].metadata["rule"](f"{source}: [{name}] {key}", value)
        for key, value in entries.items()
    }
    for key, entry in known.items():
        if key not in values and entry.default is MISSING:
            raise InputError(
                f"{source}: [{name}] {key} is missing ({entry.metadata['meaning']}): "
                f"it must be {entry.metadata['rule'].text}"
            )
    return kind(**values)


def _spelt(key: str) -> str:
    return key if key.isidentifier() else shown(key)


def _check_together(source: str, campaign: Campaign) -> None:
    """Check the rules that join several keys."""
    profile, cycle = campaign.profile, campaign.cycle
    given = list(profile.normalisation)
    if len(given) != 1:
        raise InputError(
            f"{source}: [profile] gives {' and '.join(given) or 'none of h_rms, m2 and c0'}: "
            "exactly one of h_rms, m2 and c0 must be given"
        )
    if profile.n0 * profile.ratio > MOST_WAVES:
        raise InputError(
            f"{source}: [profile] n0 · ratio is {profile.n0 * profile.ratio}: "
            f"it must be at most {MOST_WAVES} harmonics"
        )
    if campaign.task_count > _MOST_TASKS:
        raise InputError(
            f"{source}: [sweep] makes {campaign.task_count} tasks: "
            f"at most {_MOST_TASKS} are allowed"
        )
    for value in campaign.output.field_penetrations or ():
        if not cycle.unloading_until <= value <= cycle.max_penetration:
            raise InputError(
                f"{source}: [output] field_penetrations holds {value}: it must lie between "
                f"unloading_until ({cycle.unloading_until:g}) and max_penetration "
                f"({cycle.max_penetration:g})"
            )
    length = cycle.load_steps * (1 - cycle.unloading_until / cycle.max_penetration)
    if length > _LONGEST_AXIS:
        raise InputError(
            f"{source}: [cycle] unloading_until is {cycle.unloading_until}: with these load steps "
            f"the unloading curve has {length:.6g} values, and at most {_LONGEST_AXIS} are allowed"
        )
