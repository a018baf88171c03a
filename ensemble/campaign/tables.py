"""The tables of a campaign: every key with its rule, its meaning and its default.

Every key has one rule. What a campaign means is here; how its file is read is in
:mod:`ensemble.campaign.file`.
"""

from __future__ import annotations

import math
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from ensemble.campaign.rules import (
    Rule,
    choice,
    list_of,
    negative_number,
    not_negative_number,
    number_between,
    positive_number,
    whole_number,
)
from ensemble.campaign.tasks import WHOLE, Part, Task, task_seed
from solver.profile import Amplitudes, Array
from solver.registry import METHOD_NAMES, MethodName


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
    """A checked campaign. Built by :mod:`ensemble.campaign.file`.

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

    def tasks(self, part: Part = WHOLE) -> list[Task]:
        """Return every task, or those of a part, by H, then γ, then realisation, each ascending.

        The order does not depend on that of the file, so that a grown campaign has the rows of one
        that was this large from the start.
        """
        seeds = [task_seed(self.sweep.seed, r) for r in range(self.sweep.realisations)]
        tasks = [
            Task(hurst, gamma, realisation, seed)
            for hurst in sorted(self.sweep.hurst)
            for gamma in sorted(self.sweep.work_of_adhesion)
            for realisation, seed in enumerate(seeds)
        ]
        return tasks[part.number - 1 :: part.of]

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
