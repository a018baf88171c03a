"""The tasks of a campaign: one loop each, and the seed of its profile."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.errors import InputError, parameter
from adhesis.ensemble.quantities import gamma_text, in_one_unit


def place(others: Iterable[tuple[str, float]]) -> str:
    """Return "max_stress = 20 kPa, ratio = 8"; empty without further axes."""
    return ", ".join(f"{name} = {in_one_unit(name, [value])}" for name, value in others)


def name_at(hurst: float, work_of_adhesion: float, others: Sequence[tuple[str, float]]) -> str:
    """Return "H = 0.8, γ = 0.04 J/m²", and where a cell stands on further axes."""
    name = f"H = {hurst:g}, γ = {gamma_text(work_of_adhesion)}"
    return f"{name}, {place(others)}" if others else name


def task_seed(campaign_seed: int, realisation: int) -> int:
    """Return the seed of one realisation's phases.

    It depends on the campaign's seed and the realisation alone: the same profile serves every γ,
    and the same phases every H, so that differences are paired. 53 bits, so that no reader which
    turns integers into floating point numbers can change it.
    """
    sequence = np.random.SeedSequence(campaign_seed, spawn_key=(realisation,))
    return int(sequence.generate_state(1, np.uint64)[0] >> 11)


@lru_cache(4)
def _seeds(campaign_seed: int, realisations: int) -> NDArray[np.int64]:
    """Return the seeds of all realisations, which every opened file of a campaign is checked by."""
    return np.array([task_seed(campaign_seed, r) for r in range(realisations)], np.int64)


@dataclass(frozen=True)
class Task:
    """One loop to compute."""

    hurst: float  # H
    work_of_adhesion: float  # γ in J/m²
    realisation: int  # 0 … realisations - 1
    seed: int  # of the profile's phases; ``adhesis loop --seed`` with it gives the same profile
    others: tuple[tuple[str, float], ...] = ()  # names and values of further axes of the sweep

    @property
    def cell(self) -> tuple[float, ...]:
        """Place of the task on the axes of the sweep, which all realisations of a cell share."""
        return (self.hurst, self.work_of_adhesion, *(value for _, value in self.others))

    @property
    def cell_name(self) -> str:
        """Values of the task on the axes of the sweep: "H = 0.8, γ = 0.04 J/m²"."""
        return name_at(self.hurst, self.work_of_adhesion, self.others)

    def __str__(self) -> str:
        return f"{self.cell_name}, realisation {self.realisation}"


@dataclass(frozen=True, eq=False)
class Tasks:
    """Tasks of a campaign by number; each is made when it is asked for.

    So a campaign of millions of tasks can be refused, or priced, before they take memory.
    """

    cells: Sequence[tuple[float, ...]]  # values on the axes: H, γ, and the others
    names: tuple[str, ...]  # of the others
    realisations: int  # of each cell
    seed: int  # of the campaign
    rows: NDArray[np.int64]  # numbers of these tasks in the whole campaign, cell by cell, ascending

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Task]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, place: int) -> Task:
        cell, realisation = divmod(int(self.rows[place]), self.realisations)
        hurst, gamma, *others = self.cells[cell]
        seed = task_seed(self.seed, realisation)
        return Task(hurst, gamma, realisation, seed, tuple(zip(self.names, others, strict=True)))

    def cell_of(self) -> NDArray[np.int64]:
        """Return the number of each task's cell."""
        return self.rows // self.realisations

    def column(self, name: str) -> NDArray[Any]:
        """Return a value of each task by its name: hurst, seed, or that of a further axis."""
        realisation = self.rows % self.realisations
        if name == "realisation":
            return realisation
        if name == "seed":
            return _seeds(self.seed, self.realisations)[realisation]
        axis = ("hurst", "work_of_adhesion", *self.names).index(name)
        return np.array([cell[axis] for cell in self.cells])[self.cell_of()]

    def by_cell(self) -> list[tuple[Task, NDArray[np.intp]]]:
        """Return the first task of each cell, ascending, and the places of all its tasks."""
        changes = np.flatnonzero(np.diff(self.cell_of())) + 1
        places = np.split(np.arange(len(self)), changes)
        return list(zip(self.of_cells(), places, strict=True))

    def of_cells(self) -> Tasks:
        """Return the first task of each cell."""
        return replace(self, rows=self.rows[np.diff(self.cell_of(), prepend=-1) != 0])


@dataclass(frozen=True)
class Part:
    """A share of the tasks of a campaign, computed apart: every ``of``-th row."""

    number: int  # 1 … of
    of: int  # number of parts

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the part that "3/20" names (InputError)."""
        match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text.strip())
        if match and 1 <= int(match[1]) <= int(match[2]):
            return cls(int(match[1]), int(match[2]))
        raise InputError(f"{parameter('part')} is {text!r}: it must be K/N with 1 ≤ K ≤ N, as 3/20")

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"


WHOLE = Part(1, 1)
