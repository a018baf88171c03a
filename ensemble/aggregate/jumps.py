"""Count the jumps of the catalogue by kind and energy drop.

The catalogue (task × jump) is read in blocks of rows. Of a task with more jumps than the catalogue
holds it has those with the largest drops; ``truncated`` counts such tasks. The jump at which a
weight falls off is not counted: its drop depends on where the loop is closed.
"""

from __future__ import annotations

from dataclasses import dataclass

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


SMALL = np.array([kind in SMALL_SCALE for kind in JUMP_KINDS])
"""Whether jumps of a kind only move edges inside existing patches, shape (kinds,)."""


@dataclass(frozen=True, eq=False)
class JumpStatistics:
    """Jumps of all tasks of a cell together, by kind."""

    number: NDArray[np.int64]  # shape (kinds,)
    energy: Array  # shape (kinds,); their drops, J/m² of nominal area
    # Shape (kinds, bins); number of jumps by energy drop, between :data:`BIN_EDGES`
    histogram: NDArray[np.int64]
    truncated: int  # number of tasks that made more jumps than the catalogue holds


def count_jumps(results: Results, rows: NDArray[np.intp]) -> JumpStatistics:
    """Count the jumps of the rows of a cell."""
    slots, bins = results.campaign.output.jumps, BIN_EDGES.size - 1
    number, energy = np.zeros(len(JUMP_KINDS), dtype=np.int64), np.zeros(len(JUMP_KINDS))
    histogram = np.zeros((len(JUMP_KINDS), bins), dtype=np.int64)
    for block in row_blocks(rows, slots):
        flags = results.column("jump_kind", block)
        used = flags >= 0
        if results.campaign.cycle.under_load:
            used &= results.column("jump_patches_after", block) > 0
        kind = flags[used].astype(np.intp)
        drop = results.column("jump_energy_drop", block)[used]
        bin_of_drop = np.clip(np.searchsorted(BIN_EDGES, drop, side="right") - 1, 0, bins - 1)
        np.add.at(number, kind, 1)
        np.add.at(energy, kind, drop)
        np.add.at(histogram, (kind, bin_of_drop), 1)
    truncated = int(np.sum(results.column("jump_count", rows) > slots))
    return JumpStatistics(number, energy, histogram, truncated)
