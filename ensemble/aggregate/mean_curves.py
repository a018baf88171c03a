"""Average curves on the common penetration axis: mean, standard deviation, quantiles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.results.blocks import column_blocks
from adhesis.ensemble.results.read import Results
from adhesis.solver.model.profile import Array

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity on the penetration axis of one branch, over the realisations of a cell."""

    # mean, std: shape (points,); std has n - 1 in the denominator; NaN for one realisation. A
    # realisation that has detached is counted, as zero.
    mean: Array
    std: Array
    quantiles: Array  # shape (len(QUANTILES), points)


def average_curves(
    results: Results, name: str, rows: NDArray[np.intp], scales: Mapping[str, Array]
) -> dict[str, Curve]:
    """Average a dataset over the rows of a cell; NaN for a cell without rows.

    ``scales`` holds the factor of each row, by curve to make of the dataset.
    """
    points = results.column(name, slice(0, 1)).shape[1]
    shapes = (points, points, (len(QUANTILES), points))
    out = {curve: Curve(*(np.full(shape, np.nan) for shape in shapes)) for curve in scales}
    for columns in column_blocks(rows.size, points) if rows.size else ():
        raw = results.column(name, rows, columns).astype(float)
        if name.endswith("patches"):  # -1 beyond the turning point of a load: not known
            raw[raw < 0] = np.nan
        for curve, factors in scales.items():
            values = raw * factors[:, None]
            out[curve].mean[columns] = values.mean(axis=0)
            if rows.size > 1:
                out[curve].std[columns] = values.std(axis=0, ddof=1)
            out[curve].quantiles[:, columns] = np.quantile(
                values, QUANTILES, axis=0, overwrite_input=True
            )
    return out
