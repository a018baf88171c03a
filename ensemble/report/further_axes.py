"""Name the further axes of a campaign, beside H and γ, in tables and figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.aggregate.cells import Cell, alike
from adhesis.ensemble.campaign.tables import Axis
from adhesis.ensemble.campaign.tasks import place
from adhesis.ensemble.quantities import common_unit, gamma_text
from adhesis.solver.checks import counted

_LABELS = {
    "max_penetration": r"turning point $\Delta_\mathrm{max}/h_\mathrm{max}$",
    "max_stress": r"turning point $\bar{p}_\mathrm{max}$",
    "preload": r"preload $\bar{p}_\mathrm{max}$",
    "period": r"period $\lambda$",
    "n0": "lowest harmonic $n_0$",
    "ratio": r"$q_\mathrm{max}/q_\mathrm{min}$",
    "rolloff": r"roll-off $q_\mathrm{r}/q_\mathrm{min}$",
    "h_rms": r"root mean square height $h_\mathrm{rms}$",
    "m2": "mean square slope $m_2$",
    "c0": "$C_0$",
    "stiffness": "stiffness $k$",
    "young": "Young's modulus $E$",
    "poisson": r"Poisson's ratio $\nu$",
    "adhesion_range": r"range of adhesion $\delta$",
    "strength": r"strength $\sigma_\mathrm{th}$",
    "work_of_adhesion_open": r"work of adhesion of receding edges $\gamma_\mathrm{open}$",
    "stripes": "stripes of the work of adhesion in a period",
    "stripe_amplitude": r"amplitude $\varepsilon$ of the stripes",
    "stripe_phase": r"phase $\varphi$ of the stripes",
}


def axis_label(axis: Axis) -> tuple[str, float]:
    """Return the label of an axis of a figure, and its unit in the SI unit."""
    unit, size = common_unit(axis.name, axis.values)
    label = _LABELS.get(axis.name, axis.name)
    return (f"{label} ({unit})" if unit else label), size


def gamma_label(work_of_adhesion: float) -> str:
    """Return the label of one γ in a figure."""
    return rf"$\gamma$ = {gamma_text(work_of_adhesion)}"


def cell_label(cell: Cell) -> str:
    """Return the label of H and γ of a cell in a figure."""
    return f"H = {cell.hurst:g}, {gamma_label(cell.work_of_adhesion)}"


def state_sign(data: Aggregate) -> str:
    """Return by what the states of loops are given: "Δ/h_max", or "u_tot/h_max" of a machine.

    Where loops turn at a mean stress, states are at parts of it.
    """
    if data.campaign.cycle.turns_at_stress:
        return "p̄/p̄_max"
    return "Δ/h_max" if data.campaign.cycle.stiffness is None else "u_tot/h_max"


def from_to(
    values: Sequence[float], show: Callable[[float], str] = "{:g}".format, between: str = " to "
) -> str:
    """Return the least and the largest of some values, "3 to 10"; one text if they are alike."""
    return between.join(dict.fromkeys(show(end) for end in (min(values), max(values))))


def together(data: Aggregate, axis: Axis) -> set[str]:
    """Names of the axes that vary together with one, itself included."""
    groups = data.campaign.sweep.zip
    return next((set(names) for names in groups if axis.name in names), {axis.name})


def lines_along(data: Aggregate, axis: Axis) -> list[list[AveragedCell]]:
    """Finished cells that differ along one axis (and those that go with it) alone, ascending."""
    lines = alike((cell for cell in data.cells if cell.done), together(data, axis))
    return [sorted(line, key=lambda c: c.at[axis.name]) for line in lines.values()]


def with_figure(data: Aggregate) -> list[Axis]:
    """Further axes that have a figure: all but those that vary together with H or γ."""
    axes = (a for a in data.further if not together(data, a) & {"hurst", "work_of_adhesion"})
    return [axis for axis in axes if any(len(line) > 1 for line in lines_along(data, axis))]


def common(data: Aggregate) -> list[tuple[str, float]]:
    """Return the values on the further axes that all cells have in common.

    Of :attr:`Aggregate.shown` that is all, but for keys that vary with H or γ.
    """
    alike = set(data.cells[0].others).intersection(*(cell.others for cell in data.cells))
    return [other for other in data.cells[0].others if other in alike]


def failed_cells(cells: Sequence[Cell]) -> list[Cell]:
    """Return the cells of which every task failed."""
    return [cell for cell in cells if not cell.done and not cell.pending]


def below(cells: Sequence[Cell], others: Sequence[tuple[str, float]]) -> str:
    """Return lines to stand below a figure: what its cells have in common, and what is amiss."""
    parts = [place(others)] if others else []
    if failed := failed_cells(cells):
        first = failed[0]
        name = ", ".join(filter(None, (cell_label(first), place(first.others))))
        more = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        parts.append(f"missing, as all tasks failed: {name}{more}")
    drawn = [cell for cell in cells if cell.done]
    done, lost = sum(cell.done for cell in drawn), sum(cell.failed for cell in drawn)
    if lost:
        parts.append(f"{lost} of {counted(done + lost, 'loop')} failed, and are in no mean")
    if short := sum(cell.short_of_preload for cell in drawn):
        parts.append(f"{short} of {counted(done, 'loop')} did not reach the preload")
    return "\n".join(parts)


def shown_cells(data: Aggregate) -> str:
    """A sentence on which cells the figures for each H and γ show; empty if all."""
    at = place(common(data.shown))
    if not data.further or not at:
        return ""
    along = " and ".join(axis.name for axis in with_figure(data))
    return (
        f"Figures with curves for each H and γ show the cells at {at}, as stated below them; all "
        "cells are in the tables and in `curves.nc`"
        + (f", and there are figures along {along}." if along else ".")
    )
