"""Average spectra and densities of chosen states over realisations; read shapes of the first one.

A state without contact is not deformed and left out, so each average has its own number of
realisations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.results.blocks import row_blocks
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.task.dataset import KEPT
from adhesis.ensemble.task.fields import FieldPlan
from adhesis.solver.model.profile import Array

_AVERAGED = ("psd_height", "height_density", "psd_displacement", "gap_density")


@dataclass(frozen=True, eq=False)
class DeformedShape:
    """Fields of one realisation."""

    height: Array  # shape (nodes,); rigid profile h in m
    # Shape (2, penetrations, nodes); deformed surface v in m, loading and unloading; NaN where
    # there is no contact
    displacement: Array


@dataclass(frozen=True, eq=False)
class FieldStatistics:
    """Averages of every cell, in the order of the cells."""

    # Shape (penetrations,); Δ/h_max of the states, or Δ over the largest one if the campaign has
    # several of these
    penetration: Array
    # gap_bin, height_bin: middles of the bins: gap/h_max, height/h_rms. Wave numbers, and positions
    # of the nodes of shapes, are in the plan of each cell.
    gap_bin: Array
    height_bin: Array
    psd_height: Array  # shape (cells, wave numbers), in m³; NaN for a cell without finished tasks
    height_density: Array  # shape (cells, height bins)
    # Shape (cells, 2, penetrations, wave numbers), in m³, second axis loading and unloading
    psd_displacement: Array
    gap_density: Array  # shape (cells, 2, penetrations, gap bins)
    # Shape (cells, 2, penetrations); number of realisations averaged in the last two
    in_contact: NDArray[np.int64]
    # Shapes of the first finished realisation whose fields are stored
    shapes: tuple[DeformedShape | None, ...]

    def part(self, cells: Sequence[int]) -> FieldStatistics:
        """Return the averages of some of the cells."""
        names = (*_AVERAGED, "in_contact")
        arrays: dict[str, Any] = {name: getattr(self, name)[list(cells)] for name in names}
        return replace(self, shapes=tuple(self.shapes[k] for k in cells), **arrays)


def aggregate_fields(results: Results, rows: Sequence[NDArray[np.intp]]) -> FieldStatistics:
    """Average the given rows, one array of rows for each cell."""
    averages = {name: _average(results, name, rows) for name in _AVERAGED}
    return FieldStatistics(
        penetration=results.column("field_penetration"),
        gap_bin=results.column("gap_bin"),
        height_bin=results.column("height_bin"),
        in_contact=averages["psd_displacement"][1],
        shapes=_shapes(results, rows),
        **{name: mean for name, (mean, _) in averages.items()},
    )


def fitted_slope(plan: FieldPlan, density: Array) -> tuple[float, float]:
    """Fit a power law to a spectrum at small wave numbers: exponent and its standard error.

    Least squares in the logarithms over the lowest decade of the profile's spectrum (over its lower
    half if it is shorter than two decades). NaN if fewer than three bins lie there.
    """
    wave_number = plan.wave_number
    lowest = plan.lowest_harmonic * 2 * np.pi / plan.period
    span = min(10.0, float(np.sqrt(plan.highest_harmonic / plan.lowest_harmonic)))
    chosen = plan.filled & (wave_number <= lowest * span) & (density > 0)
    if np.sum(chosen) < 3:
        return float("nan"), float("nan")
    x, y = np.log(wave_number[chosen]), np.log(density[chosen])
    x = x - x.mean()
    slope = float(x @ y / (x @ x))
    residual = y - y.mean() - slope * x
    return slope, float(np.sqrt(residual @ residual / max(1, x.size - 2) / (x @ x)))


def _average(
    results: Results, name: str, rows: Sequence[NDArray[np.intp]]
) -> tuple[Array, NDArray[np.int64]]:
    """Average the rows of each cell that hold finite numbers; return means and counts.

    The count has the shape of the mean without its last axis.
    """
    shape = results.column(name, slice(0, 1)).shape[1:]
    total = np.zeros((len(rows), *shape))
    count = np.zeros((len(rows), *shape[:-1]), dtype=np.int64)
    for k, mine in enumerate(rows):
        for block in row_blocks(mine, int(np.prod(shape))):
            values = results.column(name, block).astype(float)
            held = np.isfinite(values).all(axis=-1)
            total[k] += np.where(held[..., None], values, 0.0).sum(axis=0)
            count[k] += held.sum(axis=0)
    with np.errstate(invalid="ignore"):
        return total / count[..., None], count


def _shapes(results: Results, rows: Sequence[NDArray[np.intp]]) -> tuple[DeformedShape | None, ...]:
    kept = results.column(KEPT)
    out: list[DeformedShape | None] = []
    for mine in rows:
        slots = np.flatnonzero(np.isin(kept, mine))
        if not slots.size:
            out.append(None)
            continue
        slot = slice(int(slots[0]), int(slots[0]) + 1)
        out.append(
            DeformedShape(
                height=results.column("field_height", slot)[0].astype(float),
                displacement=results.column("field_displacement", slot)[0].astype(float),
            )
        )
    return tuple(out)
