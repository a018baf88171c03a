"""Numbers of the paper, Carbone, Pierro & Recchia, arXiv 1511.08891, and what is set beside them.

A campaign is compared with them only where its profile, its material and its path are the paper's.
The paper leaves two of these open (docs/theory.md, sections 2 and 3), so a campaign counts if it is
one of the readings: the spectrum by h_rms with 100 or 200 for q_max/q_min, by C0, or by the m2 that
the paper quotes; the turning point from 0.80 (the separations of its Fig. 3 in units of h_max) to
0.93 (the same in µm).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.campaign.tables import Campaign

REFERENCE = "G. Carbone, E. Pierro, G. Recchia, arXiv 1511.08891 (2015)"

# (H, γ in J/m²) -> dimensionless energy loss, mean of 10 realisations, no error given. The paper
# has a dash at H = 0.7 and γ = 0.01 J/m².
TABLE_1: dict[tuple[float, float], float] = {
    (0.7, 0.04): 26.6,
    (0.7, 0.07): 42.83,
    (0.8, 0.01): 3.44,
    (0.8, 0.04): 19.36,
    (0.8, 0.07): 49.25,
    (0.9, 0.01): 2.59,
    (0.9, 0.04): 17.91,
    (0.9, 0.07): 28.15,
}

# H -> mean square slope that the paper quotes.
M2: dict[float, float] = {0.7: 5.1e-3, 0.8: 2.7e-3, 0.9: 1.5e-3}


@dataclass(frozen=True)
class PaperFigure:
    """Content of a figure of the paper, by its caption."""

    hurst: float
    works_of_adhesion: tuple[float, ...]  # γ in J/m², one for each panel
    penetration: float | None = None  # Δ/h_max of its states, where there is one


FIGURE_3 = PaperFigure(0.8, (0.01,))
FIGURE_4 = PaperFigure(0.8, (0.01, 0.04), 0.4)
FIGURE_5 = PaperFigure(0.8, (0.04,))
FIGURE_8 = PaperFigure(0.7, (0.04,), 0.7)

# By key, what all readings have in common.
_COMMON = {
    "profile.period": 2e-3 * math.pi,
    "profile.n0": 10,
    "profile.amplitudes": "deterministic",
    "profile.rolloff": 1,
    "material.young": 1e6,
    "material.poisson": 0.5,
    "material.work_of_adhesion_open": None,
    "material.stripes": None,
    "material.opens": False,
    "cycle.stiffness": None,
    "cycle.preload": None,
}
_RATIOS = (100, 200)
_H_RMS, _C0 = 1e-6, 1e-13
_TURNING_POINTS = (0.80, 0.93)
_NEAR = 1e-3  # values are the paper's if they agree with its digits


def table_1(cell: Cell) -> float | None:
    """Loss of the paper's Table 1; None where it gives none, or the cell is not its own."""
    return TABLE_1.get(_place(cell)) if is_cell_of(cell) else None


def has_place(cell: Cell) -> bool:
    """Whether the paper's Table 1 has a place for a cell, be it a dash."""
    hurst, gamma = _place(cell)
    return is_cell_of(cell) and hurst in M2 and gamma in {known for _, known in TABLE_1}


def _place(cell: Cell) -> tuple[float, float]:
    return round(cell.hurst, 9), round(cell.work_of_adhesion, 9)


def m2(hurst: float) -> float | None:
    """Mean square slope that the paper quotes for H, None if it gives none."""
    return M2.get(round(hurst, 9))


def is_cell_of(cell: Cell) -> bool:
    """Whether profile, material and path of a cell are a reading of the paper's."""
    return is_reading(cell.campaign, [cell.hurst] if cell.others else cell.campaign.sweep.hurst)


def are_its_cells(cells: Sequence[Cell]) -> bool:
    """Whether all of some cells are a reading of the paper's."""
    return all(is_cell_of(cell) for cell in cells)


def is_reading(campaign: Campaign, hursts: Sequence[float]) -> bool:
    """Whether profile, material and path of a campaign are a reading of the paper's."""
    top, (low, high) = campaign.cycle.max_penetration, _TURNING_POINTS
    is_path = top is not None and low - _NEAR <= top <= high + _NEAR
    alike = (_is(campaign.value(key), of_paper) for key, of_paper in _COMMON.items())
    return is_path and all(alike) and _is_spectrum(campaign, hursts)


def _is_spectrum(campaign: Campaign, hursts: Sequence[float]) -> bool:
    profile = campaign.profile
    if profile.ratio not in _RATIOS:
        return False
    if profile.h_rms is not None:
        return _is(profile.h_rms, _H_RMS)
    if profile.c0 is not None:
        return _is(profile.c0, _C0) and profile.ratio == _RATIOS[0]
    return profile.m2 is not None and all(_is(profile.m2, m2(hurst)) for hurst in hursts)


def _is(value: Any, of_paper: Any) -> bool:
    if isinstance(of_paper, float):
        return math.isclose(value, of_paper, rel_tol=_NEAR)
    return bool(value == of_paper)
