"""The campaign file: what is to be computed, as TOML, checked key by key before any work.

Every key has one rule. A file that breaks one is refused with the key, the value and the rule in
one sentence. Two campaigns are compared by meaning, not by text: order, comments and the spelling
of numbers do not matter, and neither do the few keys that cannot change a result.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from ensemble.errors import InputError
from ensemble.rules import (
    Rule,
    choice,
    list_of,
    negative_number,
    not_negative_number,
    number_between,
    positive_number,
    shown,
    whole_number,
)
from ensemble.task import Task, task_seed
from solver.methods import METHOD_NAMES, MethodName
from solver.profile import Amplitudes, Array

# HDF5 keeps an attribute of at most 64 KiB, and the text is one.
_LONGEST_TEXT = 60_000
_MOST_HARMONICS = 1_000_000
_MOST_TASKS = 10_000_000
_LONGEST_AXIS = 1_000_000


def _key(rule: Rule, meaning: str, default: Any = MISSING, *, free: bool = False) -> Any:
    """Return a dataclass field for one key.

    ``free`` marks a key that cannot change a result: it may differ when a file is resumed.
    """
    return field(default=default, metadata={"rule": rule, "meaning": meaning, "free": free})


@dataclass(frozen=True)
class ProfileTable:
    """``[profile]``: the rough profile, by the spectral method."""

    period: float = _key(positive_number("m"), "period λ in m")
    n0: int = _key(whole_number(1), "lowest harmonic: its wave number is n0 · 2π/λ")
    ratio: int = _key(whole_number(1), "highest over lowest wave number, q_max/q_min")
    h_rms: float | None = _key(positive_number("m"), "root mean square height in m", None)
    m2: float | None = _key(positive_number("1"), "mean square slope", None)
    c0: float | None = _key(positive_number("m²"), "C0 = |a_n0|² in m²", None)
    amplitudes: Amplitudes = _key(  # noqa: RUF009
        choice(*get_args(Amplitudes)),
        "amplitudes fixed by the power law, or scattered about it (a Gaussian process)",
        "deterministic",
    )

    @property
    def normalisation(self) -> dict[str, float]:
        """The one of h_rms, m2 and c0 that is given, by name."""
        named = {"h_rms": self.h_rms, "m2": self.m2, "c0": self.c0}
        return {name: value for name, value in named.items() if value is not None}


@dataclass(frozen=True)
class MaterialTable:
    """``[material]``: the elastic half-space."""

    young: float = _key(positive_number("Pa"), "Young's modulus E in Pa")
    poisson: float = _key(number_between(-1, 0.5, upper_included=True), "Poisson's ratio ν")


@dataclass(frozen=True)
class SweepTable:
    """``[sweep]``: one task for every H, γ and realisation."""

    hurst: tuple[float, ...] = _key(list_of(number_between(0, 1)), "Hurst exponents H")
    work_of_adhesion: tuple[float, ...] = _key(
        list_of(not_negative_number("J/m²")), "works of adhesion γ in J/m²"
    )
    realisations: int = _key(whole_number(1, 2**31 - 1), "profiles for every H and γ")
    seed: int = _key(whole_number(0), "seed of all profiles", 0)


@dataclass(frozen=True)
class CycleTable:
    """``[cycle]``: the loading path."""

    max_penetration: float = _key(
        number_between(0, 1), "Δ~max, the penetration in units of h_max at which unloading starts"
    )
    load_steps: int = _key(whole_number(1, 100_000), "equal steps of the loading branch")
    unloading_until: float = _key(
        negative_number(-1000),
        "end of the stored unloading curve, in units of h_max (the loop itself ends at detachment)",
        -8.0,
    )


@dataclass(frozen=True)
class SolverTable:
    """``[solver]``: the method and its accuracy."""

    method: MethodName = _key(  # noqa: RUF009
        choice(*METHOD_NAMES), "how contact states are found; auto chooses", "auto"
    )
    accuracy: float = _key(number_between(0, 1), "wanted relative error of the loss", 1e-3)
    nodes_per_wave: int | None = _key(
        whole_number(8, 100_000), "nodes per shortest wave, instead of those of accuracy", None
    )
    time_limit: float | None = _key(
        positive_number("s"), "longest time of one task in s", None, free=True
    )


@dataclass(frozen=True)
class OutputTable:
    """``[output]``: what is kept of a loop, besides losses and curves."""

    jumps: int = _key(whole_number(1, 100_000), "places in the catalogue of jumps of a task", 512)
    field_penetrations: tuple[float, ...] | None = _key(
        list_of(number_between(-1000, 1), may_be_empty=True),
        "penetrations Δ/h_max at which spectra and gaps are kept, on both branches; by default a "
        "third, two thirds and all of max_penetration",
        None,
    )
    field_realisations: int = _key(
        whole_number(0, 1000), "so many first realisations keep the fields themselves", 1
    )
    field_nodes: int = _key(
        whole_number(16, 65_536), "most nodes of a field that is kept (a power of two is)", 4096
    )


Table = Literal["profile", "material", "sweep", "cycle", "solver", "output"]
TABLES: dict[Table, type] = {
    "profile": ProfileTable,
    "material": MaterialTable,
    "sweep": SweepTable,
    "cycle": CycleTable,
    "solver": SolverTable,
    "output": OutputTable,
}


@dataclass(frozen=True)
class Campaign:
    """A checked campaign. Built by :func:`load_campaign` or :func:`parse_campaign`.

    Equal if they mean the same; ``text`` is the TOML as it was written.
    """

    profile: ProfileTable
    material: MaterialTable
    sweep: SweepTable
    cycle: CycleTable
    solver: SolverTable
    output: OutputTable
    text: str = field(default="", compare=False, repr=False)

    @property
    def task_count(self) -> int:
        """Number of tasks."""
        return len(self.sweep.hurst) * len(self.sweep.work_of_adhesion) * self.sweep.realisations

    def tasks(self) -> list[Task]:
        """Return every task, by H, then γ, then realisation, each ascending.

        The order does not depend on that of the file, so that a grown campaign has the rows of one
        that was this large from the start.
        """
        seeds = [task_seed(self.sweep.seed, r) for r in range(self.sweep.realisations)]
        return [
            Task(hurst, gamma, realisation, seed)
            for hurst in sorted(self.sweep.hurst)
            for gamma in sorted(self.sweep.work_of_adhesion)
            for realisation, seed in enumerate(seeds)
        ]

    @cached_property
    def loading_penetration(self) -> Array:
        """Δ/h_max of the loading curve, ascending, shape (load_steps + 1,)."""
        steps = self.cycle.load_steps
        return self.cycle.max_penetration * np.arange(steps + 1) / steps

    @cached_property
    def unloading_penetration(self) -> Array:
        """Δ/h_max of the stored unloading curve, descending from Δ~max with the same step."""
        steps, top = self.cycle.load_steps, self.cycle.max_penetration
        last = math.ceil(self.cycle.unloading_until / top * steps - 1e-9)
        return top * np.arange(steps, last - 1, -1) / steps

    def values(self) -> dict[str, Any]:
        """Every value by its key ("sweep.hurst"), defaults included, lists ascending."""
        out: dict[str, Any] = {}
        for name in TABLES:
            table = getattr(self, name)
            for entry in fields(table):
                value = getattr(table, entry.name)
                out[f"{name}.{entry.name}"] = sorted(value) if type(value) is tuple else value
        return out


@dataclass(frozen=True)
class Difference:
    """How a campaign differs from the one of a results file.

    Attributes
    ----------
    grown : tuple of str
        Keys of the sweep that only gained values.
    other : tuple of str
        One phrase for each other key that differs: its name and both values.
    """

    grown: tuple[str, ...]
    other: tuple[str, ...]


def compare(old: Campaign, new: Campaign) -> Difference:
    """Say how ``new`` differs from ``old``; keys that cannot change a result are left out."""
    before, after = old.values(), new.values()
    grown, other = [], []
    for key, was in before.items():
        value = after[key]
        if value == was or _is_free(key):
            continue
        if _extends(key, was, value):
            grown.append(key)
        else:
            other.append(f"{key} is {shown(value)} here and {shown(was)} there")
    return Difference(tuple(grown), tuple(other))


def _is_free(key: str) -> bool:
    table, name = key.split(".")
    return any(f.name == name and f.metadata["free"] for f in fields(TABLES[table]))  # type: ignore[index]


def _extends(key: str, was: Any, now: Any) -> bool:
    if key == "sweep.realisations":
        return bool(now > was)
    return key in ("sweep.hurst", "sweep.work_of_adhesion") and set(was) < set(now)


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
    if profile.n0 * profile.ratio > _MOST_HARMONICS:
        raise InputError(
            f"{source}: [profile] n0 · ratio is {profile.n0 * profile.ratio}: "
            f"it must be at most {_MOST_HARMONICS} harmonics"
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
            f"the unloading curve has {length:.0f} values, and at most {_LONGEST_AXIS} are allowed"
        )
