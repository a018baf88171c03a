"""The campaign file: TOML, read and checked key by key before any work.

A file that breaks a rule is refused with the key, the value and the rule in one sentence.
"""

from __future__ import annotations

import codecs
import math
import os
import re
import tomllib
from dataclasses import MISSING, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

from adhesis.ensemble.campaign.rules import list_of, number_in, shown
from adhesis.ensemble.campaign.tables import KEYS, TABLES, Campaign, SweepTable, Table
from adhesis.ensemble.errors import InputError, quoted
from adhesis.ensemble.files import open_regular
from adhesis.solver.checks import MAX_PENETRATION, MOST_WAVES, at_least
from adhesis.solver.model.pattern import stripes_of
from adhesis.solver.model.problem import check_slope
from adhesis.solver.model.profile import self_affine_profile
from adhesis.solver.registry import check_law, check_nodes

# HDF5 keeps an attribute of at most 64 KiB, and the text is one.
_LONGEST_TEXT = 60_000
_MOST_TASKS = 10_000_000
_LONGEST_AXIS = 1_000_000
_IN_CELLS = "in every cell of the sweep (zip joins lists whose values belong together)"


def load_campaign(path: Path | str) -> Campaign:
    """Read and check a campaign file (InputError)."""
    try:
        with open_regular(path) as stream:
            data = stream.read(_LONGEST_TEXT + len(codecs.BOM_UTF8) + 1)
            size = max(len(data), os.fstat(stream.fileno()).st_size)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    _check_size(str(path), size, _LONGEST_TEXT + len(codecs.BOM_UTF8))
    return parse_campaign(_decoded(data, str(path)), str(path))


def _decoded(data: bytes, source: str) -> str:
    """Decode the bytes of a campaign file, with or without a UTF-8 mark."""
    refused = f"{source} is not a campaign file: it is not UTF-8 text"
    if data[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in data:
        kind = "UTF-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "it holds zero bytes"
        raise InputError(f"{refused} ({kind}), so save it as UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{refused} (line {line} holds the byte 0x{data[error.start]:02x}), so save it as UTF-8"
        ) from error


def parse_campaign(text: str, source: str = "campaign", *, is_stored: bool = False) -> Campaign:
    """Check the text of a campaign file; ``source`` names it in errors (InputError).

    ``is_stored``: an earlier run has taken the lists as they are, and stored them with its results.
    """
    try:
        size = len(text.encode("utf-8"))
    except UnicodeEncodeError as error:
        raise InputError(
            f"{source} is not valid TOML: {quoted(text[error.start])} on line "
            f"{text.count(chr(10), 0, error.start) + 1} is half a character, so write it anew"
        ) from None
    _check_size(source, size)
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        reason = _explained(text, " ".join(str(error).split()))
        raise InputError(f"{source} is not valid TOML: {reason}") from error
    try:
        campaign = _campaign_of(document, text)
        if not is_stored:
            _check_lists(campaign, document)
        return campaign
    except InputError as error:
        raise InputError(f"{source}: {error}") from None


def _campaign_of(document: dict[str, Any], text: str) -> Campaign:
    for name in document:
        if name not in TABLES:
            known = ", ".join(f"[{t}]" for t in TABLES)
            raise InputError(f"{shown(name)} is unknown; the tables are {known}")
    lists: dict[str, tuple[float, ...]] = {}
    tables = {name: _read_table(name, document.get(name, {}), lists) for name in TABLES}
    _check_zip(tables["sweep"], lists)
    if "stop" in document and tables["stop"].relative_error is None:
        raise InputError("[stop] relative_error is missing: it must be a number between 0 and 1")
    campaign = Campaign(text=text, lists=lists, **tables)
    _check_together(campaign)
    return campaign


# Signs that word processors and other keyboards put in the place of those of TOML.
_PLAIN = {
    **dict.fromkeys("\u201c\u201d\u201e\u201f\u00ab\u00bb\u2033\uff02", '"'),
    **dict.fromkeys("\u2018\u2019\u201a\u201b\u2032\uff07\u00b4`", "'"),
    **dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2212\uff0d", "-"),
    **dict.fromkeys("\u00a0\u2007\u2009\u202f\u3000\u200b\ufeff", " "),
    "\uff1d": "=",
    "\uff0c": ",",
}


def _explained(text: str, error: str) -> str:
    """Return an error of TOML's reader with its line, or the sign there that TOML has another for.

    A line that gives a value is followed by how TOML writes values.
    """
    found = re.search(r"\(at line (\d+)", error)
    lines = text.replace("\r\n", "\n").rstrip(" \t\n").split("\n")
    numbers = [min(int(found[1]), len(lines))] if found else range(1, len(lines) + 1)
    hidden = re.compile(r'"[^"]*"|\'[^\']*\'|#.*')  # texts and comments may hold any sign
    for number in numbers:
        bare = hidden.sub(lambda found: " " * len(found[0]), lines[number - 1])
        for column, sign in enumerate(bare, 1):
            if sign in _PLAIN:
                shown = sign if sign.isprintable() and not sign.isspace() else "a blank"
                return (
                    f"line {number}, column {column} holds {shown} (U+{ord(sign):04X}), where TOML "
                    f"has {_PLAIN[sign] if _PLAIN[sign] != ' ' else 'a plain blank'}"
                )
    line = lines[numbers[-1] - 1].strip(" \t\r")
    if error.startswith("Cannot overwrite a value"):  # which may end lines below its key
        line = next(line for line in reversed(lines[: numbers[-1]]) if "=" in line).strip()
        return f"{error} in {quoted(line)}, whose key is given before, so remove one of the two"
    form = ', where values are as 0.5, [0.5, 0.6], or "2 mm" with a unit' if "=" in line else ""
    return f"{error} in {quoted(line)}{form}"


def _check_size(source: str, size: int, most: int = _LONGEST_TEXT) -> None:
    if size > most:
        raise InputError(
            f"{source} has {size} bytes: a campaign file has at most {_LONGEST_TEXT}, since the "
            "results file keeps its text"
        )


def _read_table(name: Table, entries: object, lists: dict[str, tuple[float, ...]]) -> Any:
    """Check a table; of an axis it gets the smallest value, and ``lists`` gets all of them."""
    kind = TABLES[name]
    if not isinstance(entries, dict):
        raise InputError(f"{name} is {shown(entries)}: it must be a table, [{name}]")
    known = {f.name: f for f in fields(kind)}
    for key in entries:
        if key not in known:
            names, spelt = ", ".join(known), key if key.isidentifier() else shown(key)
            raise InputError(f"[{name}] {spelt} is unknown; the keys of [{name}] are {names}")
    values = {}
    for key, value in entries.items():
        metadata, where = known[key].metadata, f"[{name}] {key}"
        if metadata["axis"] and isinstance(value, list):
            several = list_of(metadata["rule"])(where, value)
            values[key] = min(several)
            if len(several) > 1:
                lists[f"{name}.{key}"] = several
        else:
            values[key] = metadata["rule"](where, value)
    for key, entry in known.items():
        if key not in values and entry.default is MISSING:
            raise _missing(name, key)
    return kind(**values)


def _missing(table: Table, name: str) -> InputError:
    about = KEYS[f"{table}.{name}"].metadata
    rule = f"it must be {about['rule'].text}"
    return InputError(f"[{table}] {name} is missing ({about['meaning']}): {rule}")


def _check_lists(campaign: Campaign, document: dict[str, Any]) -> None:
    """Check that no list may be a number with a decimal comma, and that cells differ by name."""
    for name, table in document.items():
        for key, given in table.items():
            for one, other in pairwise(given if isinstance(given, list) else []):
                if type(one) is type(other) is int and one == 0 < other:
                    raise InputError(
                        f"[{name}] {key} holds 0,{other}: write 0.{other}, or 0.0, {other}.0 for "
                        "two"
                    )
    for axis in campaign.axes:
        if len({f"{value:g}" for value in axis.values}) < len(axis.values):
            raise InputError(
                f"[{axis.table}] {axis.name} is {shown(list(axis.values))}: it must be a list of "
                "different values, in the first six digits, by which cells are named"
            )


def _check_zip(sweep: SweepTable, lists: dict[str, tuple[float, ...]]) -> None:
    """Check that the keys which are to vary together are axes of one length."""
    length = {key.partition(".")[2]: len(values) for key, values in lists.items()}
    length |= {"hurst": len(sweep.hurst), "work_of_adhesion": len(sweep.work_of_adhesion)}
    for group in sweep.zip:
        for name in sorted(set(group) - length.keys()):
            raise InputError(
                f"[sweep] zip names {shown(name)}: it must name keys that are lists of several "
                f"values, here {', '.join(sorted(length))}"
            )
        if len({length[name] for name in group}) > 1:
            lengths = ", ".join(f"{name} {length[name]}" for name in group)
            rule = "they must have as many values each"
            raise InputError(f"[sweep] zip joins lists of different lengths ({lengths}): {rule}")


def _check_together(campaign: Campaign) -> None:
    profile, cycle = campaign.profile, campaign.cycle
    given, count = list(profile.normalisation), campaign.task_count
    if count > _MOST_TASKS:
        raise InputError(f"[sweep] makes {count} tasks: it must make at most {_MOST_TASKS}")
    _check_turning_point(campaign)
    if len(given) != 1:
        raise InputError(
            f"[profile] gives {' and '.join(given) or 'none of h_rms, m2 and c0'}: "
            "exactly one of h_rms, m2 and c0 must be given"
        )
    material = campaign.material
    if material.adhesion_range is not None and material.strength is not None:
        raise InputError(
            "[material] gives adhesion_range and strength: at most one of them can be "
            "given, strength = work_of_adhesion/adhesion_range"
        )
    _check_stripes(campaign)
    pins, solver = _check_open(campaign), campaign.solver
    waves, most = campaign.finest_harmonic, MOST_WAVES
    if waves > most:
        raise InputError(f"[profile] n0 · ratio is {waves}: it must be at most {most} harmonics")
    for ratio, rolloff in campaign.in_cells("profile.ratio", "profile.rolloff"):
        if rolloff > ratio:
            rule = f"at most ratio ({ratio}) {_IN_CELLS}"
            raise InputError(f"[profile] rolloff is {rolloff:g}: it must be {rule}")
    _check_slopes(campaign)
    try:
        check_law(solver.method, solver.nodes_per_wave, pins=pins, has_range=material.opens)
        if solver.nodes_per_wave is not None:
            check_nodes(solver.nodes_per_wave, waves)
    except ValueError as error:
        raise InputError(f"[solver] {error}") from None
    stop, first = campaign.stop, campaign.sweep.realisations
    if stop.relative_error is not None and stop.most < first:
        raise InputError(
            f"[stop] most is {stop.most}: it must be at least realisations, the number that every "
            f"cell gets ({first})"
        )
    for holds, where, turn in (
        (campaign.has_axis("max_penetration"), "beside several max_penetration", "each"),
        (cycle.preload is not None, "beside a preload", "preload"),
        (cycle.under_load, "under a load", "max_stress"),
    ):
        if campaign.output.field_penetrations and holds:
            raise InputError(
                f"[output] field_penetrations is given {where}: it must be left out "
                f"there (a third, two thirds and all of {turn} are kept) or be empty"
            )
    for value in campaign.output.field_penetrations or ():
        if not cycle.unloading_until <= value <= cycle.turning_point:
            raise InputError(
                f"[output] field_penetrations holds {value}: it must lie between unloading_until "
                f"({cycle.unloading_until:g}) and max_penetration ({cycle.turning_point:g})"
            )
    length = cycle.load_steps * (1 - cycle.unloading_until / cycle.deepest)
    if length > _LONGEST_AXIS:
        raise InputError(
            f"[cycle] unloading_until is {cycle.unloading_until}: with these load steps "
            f"the unloading curve has {length:.6g} values, and at most {_LONGEST_AXIS} are allowed"
        )


def _check_stripes(campaign: Campaign) -> None:
    """Check that stripes have number and amplitude, and adhesion without a range to vary."""
    material = campaign.material
    try:
        pattern = stripes_of(material.stripes, material.stripe_amplitude, material.stripe_phase)
    except ValueError as error:
        raise InputError(f"[material] {error}") from None
    beside = "a strength or range" if material.opens else "a work of adhesion of 0"
    if pattern is not None and (material.opens or 0 in campaign.sweep.work_of_adhesion):
        raise InputError(f"[material] stripes is given beside {beside}: leave one of them out")


def _check_open(campaign: Campaign) -> bool:
    """Check the work of adhesion of receding edges against that of advancing ones, in each cell.

    Returns whether they differ.
    """
    material = campaign.material
    if material.work_of_adhesion_open is None:
        return False
    works = campaign.in_cells("sweep.work_of_adhesion", "material.work_of_adhesion_open")
    for gamma, found in works:
        if found < gamma or gamma == 0 < found:
            least = f"at least the work of adhesion, {at_least(gamma, 6)}"
            rule = least if gamma else "left out, as γ is 0"
            raise InputError(
                f"[material] work_of_adhesion_open is {found:g}: it must be {rule}, {_IN_CELLS}"
            )
    pins = any(found != gamma for gamma, found in works)
    if pins and material.opens:
        raise InputError(
            "[material] gives work_of_adhesion_open and a range or strength: at most "
            "one of them can be given, as edges of two works of adhesion have no range"
        )
    return pins


def _check_slopes(campaign: Campaign) -> None:
    """Check that heights and period are in one unit: by the rms slope of every spectrum.

    Where amplitudes are scattered, the slope of their mean stands for all realisations.
    """
    (norm,) = campaign.profile.normalisation
    names = ("period", "n0", "ratio", "rolloff", norm)
    keys = (f"profile.{name}" for name in names)
    for hurst, *values in campaign.in_cells("sweep.hurst", *keys):
        spectrum: dict[str, Any] = dict(zip(names, values, strict=True))
        try:
            check_slope(math.sqrt(self_affine_profile(hurst, seed=0, **spectrum).m2))
        except ValueError as error:
            given = f"{shown(spectrum[norm])} with period {shown(spectrum['period'])}"
            raise InputError(f"[profile] {norm} is {given}, so the {error}") from None


def _check_turning_point(campaign: Campaign) -> None:
    """Check that the path turns where its control lets it turn."""
    cycle = campaign.cycle
    if cycle.preload is not None:
        _check_preload(campaign)
    if cycle.max_stress is not None and not cycle.under_load:
        stress = shown(cycle.max_stress)
        raise InputError(
            f'[cycle] max_stress is given: with control = "separation" a path turns at '
            "max_penetration, so leave max_stress out. A weight or a machine? For a weight give "
            'control = "load"; for a machine, which turns at that mean stress, give '
            f"preload = {stress}"
        )
    wanted = "max_stress" if cycle.under_load else "max_penetration"
    by_default = cycle.preload is not None and cycle.stiffness is None
    if getattr(cycle, wanted) is None and not by_default:
        raise _missing("cycle", wanted)
    if cycle.stiffness is None and not cycle.under_load:
        largest = campaign.in_cells("cycle.max_penetration")[-1][0] or cycle.deepest
        number_in(MAX_PENETRATION)(f"[cycle] {wanted}", largest)
    for name in ("max_penetration", "stiffness") if cycle.under_load else ():
        if getattr(cycle, name) is not None:
            raise InputError(
                f'[cycle] {name} is given: with control = "{cycle.control}" a path '
                f"turns at {wanted}, so leave {name} out"
            )


def _check_preload(campaign: Campaign) -> None:
    """Check that a preload stands where a machine presses, and goes to one depth at most."""
    preload = shown(campaign.cycle.preload)
    if campaign.cycle.under_load:
        raise InputError(
            f'[cycle] preload is {preload} with control = "load": a weight or a machine? '
            f"For a weight give max_stress = {preload} instead; for a machine, which turns at that "
            'mean stress, leave control = "load" out'
        )
    if campaign.has_axis("max_penetration"):
        raise InputError(
            "[cycle] max_penetration has several values beside a preload: it must be "
            "one number, at which a loop turns that has not reached its preload"
        )
