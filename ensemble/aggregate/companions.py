"""Compare campaigns: the same loops with another resolution, path or spectrum.

The seed of a realisation's phases is the same in all cells of a campaign, and of campaigns that
share their seed, so the difference of two losses is taken profile by profile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from adhesis.ensemble.aggregate.cells import Cell, finished_cells
from adhesis.ensemble.campaign.compare import differing
from adhesis.ensemble.campaign.rules import shown
from adhesis.ensemble.campaign.tables import Axis, Campaign
from adhesis.ensemble.interval import Estimate, estimates
from adhesis.ensemble.results.read import Results

Kind = Literal["resolution", "load steps", "other"]

# Keys that choose tasks and outputs, and do not change a loop.
_IGNORED = ("sweep.", "stop.", "output.", "solver.time_limit")


@dataclass(frozen=True, eq=False)
class Companion:
    """Campaign that is compared with the reported one."""

    path: Path
    campaign: Campaign
    cells: tuple[Cell, ...]
    # "key = value" of the keys that differ, with the values of this campaign
    differs: tuple[str, ...]
    # Subject of the difference: "resolution" (the solver), "load steps", "other"
    kind: Kind
    further: tuple[Axis, ...] = ()  # axes beside H and γ of the reported campaign
    doubts: tuple[str, ...] = ()  # sentences on damage of the file

    def like(self, cell: Cell) -> Cell | None:
        """Return the cell of the same H, γ and values on the further axes of either campaign.

        None if this campaign lacks it.
        """
        keys = {axis.key for axis in (*self.campaign.axes[2:], *self.further)}

        def point(of: Cell) -> tuple[Any, ...]:
            return (of.hurst, of.work_of_adhesion, *(of.campaign.value(key) for key in keys))

        return next((other for other in self.cells if point(other) == point(cell)), None)


@dataclass(frozen=True)
class LossDifference:
    """A loss of two cells, over the realisations of the same phases that both have finished."""

    here: Estimate
    there: Estimate
    difference: Estimate  # there less here


def read_companion(path: Path | str, campaign: Campaign) -> Companion:
    """Read another results file and the keys in which its campaign differs (InputError)."""
    with Results(path) as results:
        other, cells = results.campaign, finished_cells(results)
        doubts = results.doubts()
    values, keys = other.values(), differing_keys(campaign, other)
    return Companion(
        path=Path(path),
        campaign=other,
        cells=tuple(cells),
        differs=tuple(f"{key} = {shown(values[key])}" for key in keys),
        kind=kind_of(keys),
        further=campaign.axes[2:],
        doubts=doubts,
    )


def differing_keys(here: Campaign, there: Campaign) -> list[str]:
    """Return the keys ("cycle.load_steps") in which the loops of two campaigns differ."""
    return [key for key in differing(here, there) if not key.startswith(_IGNORED)]


def kind_of(keys: Sequence[str]) -> Kind:
    """Classify a difference in these keys; see :class:`Companion`."""
    if keys and all(key.startswith("solver.") for key in keys):
        return "resolution"
    if list(keys) == ["cycle.load_steps"]:
        return "load steps"
    return "other"


def difference(
    here: Cell, there: Cell | None, name: str = "loss_dimensionless"
) -> LossDifference | None:
    """Compare a loss profile by profile; None without a realisation that both have finished."""
    if there is None:
        return None
    _, mine, theirs = np.intersect1d(here.seed, there.seed, assume_unique=True, return_indices=True)
    if not mine.size:
        return None
    own, other = here.values[name][mine], there.values[name][theirs]
    return LossDifference(*estimates(np.array([own, other, other - own])))
