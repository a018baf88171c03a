"""The tasks of a campaign: one loop each, and the seed of its profile."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.errors import InputError, parameter


def task_seed(campaign_seed: int, realisation: int) -> int:
    """Return the seed of one realisation's phases.

    It depends on the campaign's seed and the realisation alone: the same profile serves every γ,
    and the same phases every H, so that differences are paired. 53 bits, so that no reader which
    turns integers into floating point numbers can change it.
    """
    sequence = np.random.SeedSequence(campaign_seed, spawn_key=(realisation,))
    return int(sequence.generate_state(1, np.uint64)[0] >> 11)


@dataclass(frozen=True, order=True)
class Task:
    """One loop to compute.

    Attributes
    ----------
    hurst : float
        H.
    work_of_adhesion : float
        γ in J/m².
    realisation : int
        0 … realisations - 1.
    seed : int
        Of the profile's phases; ``adhesis loop --seed`` with it gives the same profile.
    others : tuple of (str, number)
        Names and values of further axes of the sweep.
    """

    hurst: float
    work_of_adhesion: float
    realisation: int
    seed: int
    others: tuple[tuple[str, float], ...] = ()

    @property
    def cell(self) -> tuple[float, ...]:
        """Place of the task on the axes of the sweep, which all realisations of a cell share."""
        return (self.hurst, self.work_of_adhesion, *(value for _, value in self.others))

    @property
    def cell_name(self) -> str:
        """Values of the task on the axes of the sweep: "H = 0.8, γ = 0.04 J/m²"."""
        return f"H = {self.hurst:g}, γ = {self.work_of_adhesion:g} J/m²" + "".join(
            f", {name} = {value:g}" for name, value in self.others
        )

    def __str__(self) -> str:
        return f"{self.cell_name}, realisation {self.realisation}"


@dataclass(frozen=True)
class Part:
    """A share of the tasks of a campaign, computed apart: every ``of``-th row.

    Attributes
    ----------
    number : int
        1 … of.
    of : int
        Number of parts.
    """

    number: int
    of: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the part that "3/20" names.

        Raises
        ------
        InputError
        """
        match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text.strip())
        if match and 1 <= int(match[1]) <= int(match[2]):
            return cls(int(match[1]), int(match[2]))
        raise InputError(f"{parameter('part')} is {text!r}: it must be K/N with 1 ≤ K ≤ N, as 3/20")

    def rows(self, count: int) -> NDArray[np.int64]:
        """Rows of the whole campaign, of ``count`` tasks, that belong to the part, ascending."""
        return np.arange(self.number - 1, count, self.of)

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"


WHOLE = Part(1, 1)
