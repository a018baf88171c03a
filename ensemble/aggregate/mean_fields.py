"""Average spectra and densities of chosen states over realisations; read shapes of the first one.

A state without contact is not deformed and left out, so each average has its own number of
realisations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.results.blocks import row_blocks
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.task.fields import FieldPlan
from adhesis.solver.model.profile import Array

_AVERAGED = ("psd_height", "height_density", "psd_displacement", "gap_density")
_OF_SHAPE = ("field_height", "field_displacement")


@dataclass(frozen=True, eq=False)
class DeformedShape:
    """Fields of one realisation."""

    height: Array  # shape (nodes,); rigid profile h in m
    # Shape (2, penetrations, nodes); deformed surface v in m, loading and unloading; NaN where
    # there is no contact
    displacement: Array


@dataclass(frozen=True, eq=False)
class FieldStatistics:
    """Averages of one cell; NaN without finished tasks.

    Penetrations, wave numbers, and positions of the nodes of shapes are in the plan of the cell.
    """

    psd_height: Array  # shape (wave numbers,), in m³
    height_density: Array  # shape (height bins,)
    # Shape (2, penetrations, wave numbers), in m³, first axis loading and unloading
    psd_displacement: Array
    gap_density: Array  # shape (2, penetrations, gap bins)
    # Shape (2, penetrations); number of realisations averaged in the last two
    in_contact: NDArray[np.int64]
    # Of the first finished realisation whose fields are stored
    shape: DeformedShape | None


def average_fields(
    results: Results, rows: NDArray[np.intp], kept: NDArray[np.intp]
) -> FieldStatistics:
    """Average the rows of a cell.

    ``kept`` are the rows of the file that keep their fields, ascending, and a number beyond them.
    """
    averages = {name: _average(results, name, rows) for name in _AVERAGED}
    places = np.searchsorted(kept, rows)
    slots = places[kept[places] == rows][:1]
    shape = [results.column(name, slots).astype(float) for name in _OF_SHAPE]
    return FieldStatistics(
        in_contact=averages["psd_displacement"][1],
        shape=DeformedShape(*(values[0] for values in shape)) if slots.size else None,
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
    results: Results, name: str, rows: NDArray[np.intp]
) -> tuple[Array, NDArray[np.int64]]:
    """Average the rows that hold finite numbers; return mean and count.

    The count has the shape of the mean without its last axis.
    """
    shape = results.column(name, slice(0, 1)).shape[1:]
    total, count = np.zeros(shape), np.zeros(shape[:-1], dtype=np.int64)
    for block in row_blocks(rows, int(np.prod(shape))):
        values = results.column(name, block).astype(float)
        held = np.isfinite(values).all(axis=-1)
        total += np.where(held[..., None], values, 0.0).sum(axis=0)
        count += held.sum(axis=0)
    with np.errstate(invalid="ignore"):
        return total / count[..., None], count
