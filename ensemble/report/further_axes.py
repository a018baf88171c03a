"""Name the further axes of a campaign, beside H and γ, in tables and figures."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.aggregate.cells import Cell
from adhesis.ensemble.campaign.axes import Axis
from adhesis.ensemble.campaign.tasks import name_at, place
from adhesis.ensemble.quantities import common_unit, with_unit

_LABELS = {
    "max_penetration": r"turning point $\Delta_\mathrm{max}/h_\mathrm{max}$",
    "max_stress": r"turning point $\bar p_\mathrm{max}$",
    "preload": r"preload $\bar p_\mathrm{max}$",
    "period": r"period $\lambda$",
    "n0": "lowest harmonic $n_0$",
    "ratio": r"$q_\mathrm{max}/q_\mathrm{min}$",
    "rolloff": r"roll-off $q_\mathrm{r}/q_\mathrm{min}$",
    "h_rms": r"root mean square height $h_\mathrm{rms}$",
    "m2": "mean square slope $m_2$",
    "c0": "$C_0$ (m²)",
    "stiffness": "stiffness $k$",
    "young": "Young's modulus $E$",
    "poisson": r"Poisson's ratio $\nu$",
    "adhesion_range": r"range of adhesion $\delta$",
    "strength": r"strength $\sigma_\mathrm{th}$",
    "work_of_adhesion_open": r"work of adhesion of receding edges $\gamma_\mathrm{open}$",
}


def cell_name(cell: Cell) -> str:
    """Return "H = 0.8, γ = 0.04 J/m²", and where the cell stands on further axes."""
    return name_at(cell.hurst, cell.work_of_adhesion, cell.others)


def axis_label(axis: Axis) -> tuple[str, float]:
    """Return the label of an axis of a figure, and its unit in the SI unit."""
    unit, size = common_unit(axis.name, axis.values)
    label = _LABELS.get(axis.name, axis.name)
    return (f"{label} ({unit})" if unit else label), size


def symbols(others: Sequence[tuple[str, float]]) -> str:
    """Return :func:`place` for figures, with symbols where a name is no word: "$h_rms$ = 2 µm"."""
    named = []
    for name, value in others:
        symbol = None if name.isalpha() else re.search(r"\$.*\$", _LABELS.get(name, ""))
        named.append(f"{symbol[0] if symbol else name} = {with_unit(name, value)}")
    return ", ".join(named)


def together(data: Aggregate, axis: Axis) -> set[str]:
    """Names of the axes that vary together with one, itself included."""
    groups = data.campaign.sweep.zip
    return next((set(names) for names in groups if axis.name in names), {axis.name})


def lines_along(data: Aggregate, axis: Axis) -> list[list[Cell]]:
    """Finished cells that differ along one axis (and those that go with it) alone, ascending."""
    moving = together(data, axis)
    lines: dict[tuple[object, ...], list[Cell]] = {}
    for cell in data.cells:
        fixed = tuple(other for other in cell.others if other[0] not in moving)
        if cell.done:
            lines.setdefault((cell.hurst, cell.work_of_adhesion, fixed), []).append(cell)
    return [sorted(line, key=lambda c: dict(c.others)[axis.name]) for line in lines.values()]


def common(data: Aggregate) -> list[tuple[str, float]]:
    """Return the values on the further axes that all cells have in common.

    Of :attr:`Aggregate.shown` that is all, but for keys that vary with H or γ.
    """
    alike = set(data.cells[0].others).intersection(*(cell.others for cell in data.cells))
    return [other for other in data.cells[0].others if other in alike]


def failed_cells(data: Aggregate) -> list[str]:
    """Return the names of the cells of which every task failed."""
    return [cell_name(cell) for cell in data.cells if not cell.done and not cell.pending]


def short_of_preload(data: Aggregate) -> list[tuple[int, Cell]]:
    """Return the cells with loops that did not reach their preload, and how many these are."""
    if data.campaign.cycle.preload is None:
        return []
    short = ((int(np.sum(cell.values["preload_reached"] == 0)), cell) for cell in data.cells)
    return [(count, cell) for count, cell in short if count]


def below(data: Aggregate, others: Sequence[tuple[str, float]]) -> str:
    """Return what stands below a figure: what its cells have in common, and what is amiss."""
    failed = failed_cells(data)
    parts = [symbols(others)] if others else []
    if failed:
        more = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        parts.append(f"missing, as all tasks failed: {failed[0]}{more}")
    if short := sum(count for count, _ in short_of_preload(data)):
        parts.append(f"{short} of {data.done} loops did not reach their preload")
    return "; ".join(parts)


def shown_cells(data: Aggregate) -> str:
    """A sentence on which cells the figures for each H and γ show; empty if all."""
    at = place(common(data.shown))
    if not data.further or not at:
        return ""
    return (
        f"Figures with curves for each H and γ show the cells at {at}, as stated below them; "
        "all cells are in the tables and in `curves.nc`, and there are figures along each further "
        "axis."
    )
