"""Count the jumps of the catalogue by kind and energy drop.

The catalogue (task × jump) is read in blocks of rows. Of a task with more jumps than the catalogue
holds it has those with the largest drops; ``truncated`` counts such tasks. The jump at which a
weight falls off is not counted: its drop depends on where the loop is closed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.results.blocks import row_blocks
from adhesis.ensemble.results.read import Results
from adhesis.solver.model.jump import JUMP_KINDS, SMALL_SCALE
from adhesis.solver.model.profile import Array

BINS_PER_DECADE = 2
# Energy drops outside these bounds (J/m²) are counted in the outermost bin.
SMALLEST, LARGEST = 1e-16, 1e2
BIN_EDGES: Array = np.logspace(
    np.log10(SMALLEST),
    np.log10(LARGEST),
    1 + BINS_PER_DECADE * round(np.log10(LARGEST / SMALLEST)),
)


@dataclass(frozen=True, eq=False)
class JumpStatistics:
    """Jumps of every cell (in the order of the cells given), by kind."""

    kinds: tuple[str, ...]
    # Shape (kinds,); whether jumps of a kind only move edges inside existing patches
    small_scale: NDArray[np.bool_]
    number: NDArray[np.int64]  # shape (cells, kinds); number of jumps in all tasks together
    energy: Array  # shape (cells, kinds); their drops, J/m² of nominal area, in all tasks together
    # Shape (cells, kinds, bins); number of jumps by energy drop, between :data:`BIN_EDGES`
    histogram: NDArray[np.int64]
    # Shape (cells,); number of tasks that made more jumps than the catalogue holds
    truncated: NDArray[np.int64]

    def part(self, cells: Sequence[int]) -> JumpStatistics:
        """Return the statistics of some of the cells."""
        names, chosen = ("number", "energy", "histogram", "truncated"), list(cells)
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


def aggregate_jumps(results: Results, rows: Sequence[NDArray[np.intp]]) -> JumpStatistics:
    """Count the jumps of the given rows, one array of rows for each cell."""
    slots = results.campaign.output.jumps
    bins = BIN_EDGES.size - 1
    shape = (len(rows), len(JUMP_KINDS))
    number = np.zeros(shape, dtype=np.int64)
    energy = np.zeros(shape)
    histogram = np.zeros((*shape, bins), dtype=np.int64)
    for k, mine in enumerate(rows):
        for block in row_blocks(mine, slots):
            flags = results.column("jump_kind", block)
            used = flags >= 0
            if results.campaign.cycle.under_load:
                used &= results.column("jump_patches_after", block) > 0
            kind = flags[used].astype(np.intp)
            drop = results.column("jump_energy_drop", block)[used]
            bin_of_drop = np.clip(np.searchsorted(BIN_EDGES, drop, side="right") - 1, 0, bins - 1)
            np.add.at(number[k], kind, 1)
            np.add.at(energy[k], kind, drop)
            np.add.at(histogram[k], (kind, bin_of_drop), 1)
    count = results.column("jump_count")
    return JumpStatistics(
        kinds=tuple(JUMP_KINDS),
        small_scale=np.array([kind in SMALL_SCALE for kind in JUMP_KINDS]),
        number=number,
        energy=energy,
        histogram=histogram,
        truncated=np.array([int(np.sum(count[mine] > slots)) for mine in rows], dtype=np.int64),
    )
