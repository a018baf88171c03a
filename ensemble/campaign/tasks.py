"""The tasks of a campaign: one loop each, and the seed of its profile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
    """

    hurst: float
    work_of_adhesion: float
    realisation: int
    seed: int

    @property
    def cell(self) -> tuple[float, ...]:
        """Where the task stands on the axes of the sweep: all realisations of a cell share it."""
        return (self.hurst, self.work_of_adhesion)

    def __str__(self) -> str:
        return (
            f"H = {self.hurst:g}, γ = {self.work_of_adhesion:g} J/m², "
            f"realisation {self.realisation}"
        )
