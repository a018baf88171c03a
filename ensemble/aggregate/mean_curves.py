"""Average curves on the common penetration axis: mean, standard deviation, quantiles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    results: Results,
    branch: str,
    name: str,
    rows: Sequence[NDArray[np.intp]],
    scales: Mapping[str, Sequence[Array]],
) -> dict[str, list[Curve]]:
    """Average the dataset ``branch_name`` over the rows of every cell; NaN for a cell without rows.

    ``scales`` holds, by curve to make of the dataset, one array for each cell: the factor of each
    row.
    """
    points = results.column(f"{branch}_penetration").size
    out = {curve: [_empty(points) for _ in rows] for curve in scales}
    for k, mine in enumerate(rows):
        for columns in column_blocks(mine.size, points) if mine.size else ():
            raw = results.column(f"{branch}_{name}", mine, columns).astype(float)
            if name == "patches":  # -1 beyond the turning point of a load: not known
                raw[raw < 0] = np.nan
            for curve, factors in scales.items():
                values = raw * factors[k][:, None]
                average = out[curve][k]
                average.mean[columns] = values.mean(axis=0)
                if mine.size > 1:
                    average.std[columns] = values.std(axis=0, ddof=1)
                average.quantiles[:, columns] = np.quantile(
                    values, QUANTILES, axis=0, overwrite_input=True
                )
    return out


def _empty(points: int) -> Curve:
    shapes = (points, points, (len(QUANTILES), points))
    return Curve(*(np.full(shape, np.nan) for shape in shapes))
