"""Choose the cells and states that figures of fields show: the paper's, or the nearest to them."""

from __future__ import annotations

import numpy as np

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.report.figures.style import MOST_PANELS, spread_out
from adhesis.ensemble.report.findings import typical_cell
from adhesis.ensemble.report.paper import PaperFigure
from adhesis.ensemble.task.fields import FieldPlan


def has_fields(cell: AveragedCell) -> bool:
    """Whether a loop of a cell was in contact at a state with fields, as short of a preload."""
    return bool(np.any(cell.fields.psd_displacement > 0))


def cell_of_hurst(data: Aggregate, hurst: float, figure: PaperFigure) -> AveragedCell | None:
    """Return the cell of H with the first γ of a figure; else the typical one of H."""
    kept = [cell for cell in data.cells if has_fields(cell) and cell.hurst == hurst]
    of_paper = [cell for cell in kept if cell.work_of_adhesion == figure.works_of_adhesion[0]]
    return next(iter([*of_paper, *kept[(len(kept) - 1) // 2 :]]), typical_cell(data, hurst))


def cells_of(data: Aggregate, figure: PaperFigure) -> list[AveragedCell]:
    """Return the cells of a figure that have results.

    Where the campaign lacks its H, they are of the typical one; where it lacks all of its γ, they
    are of all γ of the campaign.
    """
    kept = [cell for cell in data.cells if has_fields(cell)]
    kept = kept or [cell for cell in data.cells if cell.done]
    known = {(cell.hurst, cell.work_of_adhesion): cell for cell in kept}
    typical = typical_cell(data)
    assert typical is not None  # an aggregate has finished tasks
    for hurst in (figure.hurst, typical.hurst):
        for gammas in (figure.works_of_adhesion, data.works_of_adhesion):
            if found := [gamma for gamma in gammas if (hurst, gamma) in known]:
                return [known[hurst, gamma] for gamma in spread_out(found, MOST_PANELS)]
    return [typical]


def state_of(plan: FieldPlan, figure: PaperFigure) -> int:
    """Return the place of the stored state that is nearest to a figure's penetration.

    The last state is the turning point, where both branches are one: it is taken if it is alone.
    """
    assert figure.penetration is not None
    before = plan.penetration[:-1] if plan.penetration.size > 1 else plan.penetration
    return int(np.argmin(np.abs(before - figure.penetration)))


def beside_paper(data: Aggregate, figure: PaperFigure) -> str:
    """Return a sentence on what the paper's figure shows, and what is nearest to it here."""
    cells = cells_of(data, figure)
    plan = cells[0].plan
    at = figure.penetration
    drawn = None if at is None else float(plan.penetration[state_of(plan, figure)])
    gammas = tuple(cell.work_of_adhesion for cell in cells)
    shown = f"The paper's figure is at {_place(figure.hurst, figure.works_of_adhesion, at)}"
    # A state is stored at the load step that is nearest to the penetration that was asked for.
    half = 0.5 * plan.max_penetration / plan.load_steps
    near = at is None or drawn is None or abs(drawn - at) <= 1.001 * half
    if (cells[0].hurst, gammas, near) == (figure.hurst, figure.works_of_adhesion, True):
        return f"{shown}."
    return f"{shown}; the nearest to it here is {_place(cells[0].hurst, gammas, drawn)}."


def _place(hurst: float, gammas: tuple[float, ...], penetration: float | None) -> str:
    text = f"H = {hurst:g}, γ = {' and '.join(f'{gamma:g}' for gamma in gammas)} J/m²"
    return text if penetration is None else f"{text}, Δ/h_max = {penetration:.2g}"
