"""Put findings into sentences: trends, agreement with the paper, errors, what is missing."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.aggregate.cells import Cell, alike, difference, doubtful_loops, precisions
from adhesis.ensemble.campaign.tables import Axis
from adhesis.ensemble.campaign.tasks import name_at
from adhesis.ensemble.quantities import gamma_text, in_one_unit, percent, stress_text
from adhesis.ensemble.report import paper
from adhesis.ensemble.report.further_axes import (
    failed_cells,
    from_to,
    lines_along,
    state_sign,
    together,
    with_figure,
)
from adhesis.ensemble.report.tables.campaign_tables import extreme, inside_interval, off_the_paper
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.task.doubt import (
    INSTEAD,
    doubtful_losses,
    highest_stress,
    most_reached,
    why_beyond,
)
from adhesis.solver.checks import counted
from adhesis.solver.loading.equilibrium_path import STEEP
from adhesis.solver.loading.zero_range import ANY_RANGE
from adhesis.solver.method import BRANCHES

_MOST_LISTED = 4
_NOT_MONOTONE = "is not monotone"
_STRESS_AND_AREA = ("mean_stress_dimensionless", "contact_fraction")


def verdict(data: Aggregate) -> list[str]:
    """Three sentences: what came out, how well the mean is known, how well each loop is.

    They are on the cells with adhesion; that nothing is lost in others is a sentence of its own.
    """
    of_loss = replace(data, cells=tuple(cell for cell in data.cells if cell.work_of_adhesion > 0))
    found = [of(of_loss) for of in (_outcome, _statistical, _numerical) if of_loss.done]
    rest = of_loss.done < data.done
    return [*found, "Without adhesion (γ = 0) nothing is lost."] if rest else found


def _outcome(data: Aggregate) -> str:
    cells = [cell for cell in data.cells if cell.done]
    cells.sort(key=lambda cell: cell.estimates["loss"].mean)
    cycle = data.campaign.cycle
    top = f"A loop to {turning_point(data)} and back until detached loses"
    friction = _friction(data, cells)
    what = "the drops are lost" if friction else "it is lost"
    if cycle.under_load:
        ends = from_to(_all(data, "pull_off_stress").tolist(), stress_text)
        top = (
            f"A loop to {turning_point(data)} and back under a weight, which falls off at {ends} "
            "(the loop is closed at the separation of the fall), loses"
        )
        what = "the drops before the fall are lost"
    if len(cells) == 1:
        return f"{top} on average {_loss(cells[0])}{friction}."
    drops = [[c.estimates[f"loss_{of}_scale"].mean for of in ("small", "large")] for c in cells]
    share = [100 * small / (small + large or 1.0) for small, large in drops]
    return (
        f"{top}, on average over realisations, from {_loss(cells[0])} to {_loss(cells[-1])}; "
        f"{from_to(share, '{:.0f}'.format)} % of {what} where edges run inside patches{friction}."
    )


def _friction(data: Aggregate, cells: Sequence[Cell]) -> str:
    """Return a clause on the friction of edges; empty for one work of adhesion."""
    if data.campaign.material.work_of_adhesion_open is None:
        return ""
    pairs = ((cell.estimates["friction"].mean, cell.estimates["loss"].mean) for cell in cells)
    share = [friction / loss for friction, loss in pairs if loss > 0]
    if not share:
        return ""
    return f"; friction of receding edges is {percent(min(share), max(share))} of the loss"


def law(data: Aggregate) -> Iterator[str]:
    """Report the law of adhesion; none where it is one γ of zero range."""
    material = data.campaign.material

    def shown(name: str) -> str:
        values = [getattr(cell.campaign.material, name) for cell in data.cells]
        finite = [value for value in values if math.isfinite(value)]
        return in_one_unit(name, sorted({min(finite), max(finite)}), " to ")

    mean = "" if material.stripes is None else " in the mean"
    if material.stripes is not None:
        yield (
            f"The work of adhesion varies along the profile, {shown('stripes')} times in its "
            f"period and by {shown('stripe_amplitude')} of γ (phase {shown('stripe_phase')} rad); "
            "γ is its mean."
        )
    if material.work_of_adhesion_open is not None:
        opened = shown("work_of_adhesion_open")
        yield f"Edges advance at γ, and recede at a work of adhesion of {opened}{mean}."
    if material.adhesion_range is not None:
        yield (
            f"Adhesion has a range of {shown('adhesion_range')}: surfaces attract each other "
            "from that gap on, with the strength of γ over it."
        )
    elif material.opens:
        yield (
            f"Adhesion has a strength of {shown('strength')}: its range, a gap from which on "
            "surfaces attract each other, is γ over it."
        )
        if any(cell.campaign.material.strength == math.inf for cell in data.cells):
            yield "Where the strength is inf, the range of adhesion is zero."


def turning_point(data: Aggregate) -> str:
    """Return "Δ/h_max = 0.5 … 0.9": to where the finished loops were loaded."""
    cycle = data.campaign.cycle
    ends = [cell.campaign.cycle.turning_point for cell in data.cells if cell.done]
    if cycle.turns_at_stress:
        what = "mean stress" if cycle.under_load else "preload"
        short = sum(cell.short_of_preload for cell in data.cells)
        rest = f" ({short} of {counted(data.done, 'loop')} turned before that)" if short else ""
        ends = sorted({min(ends), max(ends)})
        return f"a {what} of {in_one_unit('mean_stress', ends, ' … ')}{rest}"
    return f"{state_sign(data)} = {from_to(ends, between=' … ')}"


def _loss(cell: Cell) -> str:
    loss, scaled = (cell.estimates[name].mean for name in ("loss", "loss_dimensionless"))
    over_gamma = f"{loss / cell.work_of_adhesion:.3g} γ"  # of a cell with adhesion
    return f"{1e3 * loss:.3g} mJ/m² ({over_gamma}, W~ = {scaled:.3g}) at {cell.name}"


def _statistical(data: Aggregate) -> str:
    errors = [cell.estimates["loss"].relative_error for cell in data.cells]
    errors = [error for error in errors if np.isfinite(error)]
    counts = [cell.done for cell in data.cells if cell.done]
    plural = "realisations" if max(counts) > 1 else "realisation"
    point = "cell" if data.further else "(H, γ)"
    with_many = f"With {from_to(counts)} {plural} of each {point}"
    if not errors:
        return f"{with_many}, the error of the mean is unknown."
    return (
        f"{with_many}, the 95 % interval of the mean loss in J/m² reaches "
        f"{percent(min(errors), max(errors))} from it, on the further side."
    )


def _numerical(data: Aggregate) -> str:
    loss, audit, races = (_all(data, name) for name in ("loss", "audit_residual", "races"))

    def most(name: str) -> str:
        shares = np.divide(_all(data, name), np.abs(loss), out=0 * loss, where=loss != 0)
        return percent(shares.max())

    elsewhere = "no jump would have ended elsewhere by other speeds, order or a finer field"
    if raced := int(np.sum(races > 0)):
        elsewhere = (
            f"in {raced} of {counted(loss.size, 'loop')} other speeds, order or a finer field "
            f"might end a jump elsewhere (at most {most('energy_at_stake')} of a loss at stake)"
        )
    return (
        f"The estimated numerical error of a loss is at most {most('loss_error')} of it; the "
        f"energy audit of each loop closes within {percent(np.abs(audit).max())}; {elsewhere}."
    )


def precision(data: Aggregate) -> Iterator[str]:
    """Report the cells that have met the precision of ``[stop]``; none without ``[stop]``."""
    found = precisions(data.cells)
    if not found:
        return
    wanted = found[0][1]
    rest = [f"{name}: {precision}" for name, precision in found if not precision.met]
    yield (
        f"The 95 % interval of the mean {wanted.quantity} was to reach at most "
        f"{percent(wanted.wanted, digits=3)} from it ([stop]): {len(found) - len(rest)} of "
        f"{counted(len(found), 'cell')} met that"
        f"{f'; the others: {_listed(rest)}' if rest else ''}."
    )


def missing(data: Aggregate) -> Iterator[str]:
    """Sentences on tasks that are not in the averages; none if the campaign is complete."""
    yield from (f"{doubt}." for doubt in data.doubts)
    if data.pending:
        yield (
            f"The campaign is not finished: {data.pending} of {counted(data.total, 'task')} "
            f"{'is' if data.pending == 1 else 'are'} pending. All "
            f"averages are over the {data.done} finished ones."
        )
    if data.failed:
        yield (
            f"{data.failed} of {counted(data.total, 'task')} failed; the averages leave them out. "
            f"First reason: {data.failures[0][1]}."
        )
    if empty := [cell.name for cell in data.cells if not cell.done and cell.pending]:
        yield f"No task is finished yet for {_listed(empty)}."
    if failed := [cell.name for cell in failed_cells(data.cells)]:
        yield (
            f"WARNING: all tasks failed for {_listed(failed)}: figures and averages lack "
            f"{'this cell' if len(failed) == 1 else 'these cells'}."
        )
    if few := [cell.name for cell in data.cells if cell.done == 1]:
        yield f"Only one realisation, hence no spread, for {_listed(few)}."


def agreement(data: Aggregate) -> Iterator[str]:
    """Sentences on what the averages show; beside the paper's if the campaign is the paper's."""
    shown = data.shown
    of_paper = paper.are_its_cells(shown.cells)
    if of_paper:
        yield from _table_1(shown)
    yield from _growth(data, of_paper)
    for axis in with_figure(data):
        yield from _along(data, axis)
    yield from _order_in_slope(shown, of_paper)
    yield from _unloading_exceeds_loading(data, of_paper)


def quality(data: Aggregate) -> Iterator[str]:
    """Sentences on the error of the losses, and on what the file's shape cut off."""
    audit = _all(data, "audit_residual")
    yield (
        "Energy audit: loop integral and sum of the drops differ by "
        f"{percent(np.sqrt(np.mean(audit**2)))} of the loss (root mean square over loops), "
        f"{percent(np.max(np.abs(audit)))} in the worst loop."
    )
    if wrong := doubtful_loops(data.cells):
        rows = [f"row {c.rows[k]}, {c.name} ({percent(c.doubt[k])})" for c, k in wrong]
        own = _their(len(wrong))
        yield (
            f"WARNING: {doubtful_losses(len(wrong), '', data.done)}, as {own} audit residual or "
            f"{own} estimated error exceeds the accuracy asked for, "
            f"{percent(data.campaign.solver.accuracy)} of the loss, or is no number: "
            f"{_listed(rows)}."
        )
    yield from _limit(data)
    yield from _doubtful_companions(data)
    if data.campaign.cycle.preload is not None:
        yield _preload(data)
    slopes = [(cell, np.sqrt(cell.estimates["m2"].mean)) for cell in data.cells if cell.done]
    if steep := [cell.name for cell, slope in slopes if slope > STEEP]:
        yield (
            f"WARNING: the root mean square slope exceeds {STEEP:g} for {_listed(steep)}: linear "
            "elasticity of small slopes, on which everything here rests, is doubtful there."
        )
    if truncated := sum(cell.jumps.truncated for cell in data.cells):
        yield (
            f"{counted(truncated, 'loop')} made more jumps than the catalogue holds: "
            f"{_their(truncated)} smallest drops are "
            "missing from the distribution and from the table of kinds, not from the losses."
        )
    ends = [float(cell.penetration["unloading"][-1]) for cell in data.cells]
    pull_off = [cell.values["pull_off_penetration"] for cell in data.cells]
    if cut := sum(int(np.sum(at < end - 1e-9)) for at, end in zip(pull_off, ends, strict=True)):
        curves = "its curve is cut, its loss is complete"
        if cut > 1:
            curves = "their curves are cut, their losses are complete"
        yield (
            f"{counted(cut, 'loop')} detached below Δ/h_max = {from_to(ends)}, where the stored "
            f"unloading curve ends: {curves}."
        )


def _their(count: int) -> str:
    return "its" if count == 1 else "their"


def warnings(data: Aggregate) -> list[str]:
    """Return what :func:`quality` warns of, to be said where the numbers stand."""
    return [text.removeprefix("WARNING: ") for text in quality(data) if text.startswith("WARNING")]


def _doubtful_companions(data: Aggregate) -> Iterator[str]:
    """Sentences on campaigns beside this one with doubtful losses, or with no loop in common."""
    for other in data.companions:
        if not any(difference(cell, other.like(cell)) for cell in data.cells):
            yield f"WARNING: {other.path.name}, beside this campaign, shares no loop with it."
        wrong = sum(int(np.sum(cell.doubtful | cell.beyond_zero_range)) for cell in other.cells)
        if wrong:
            losses = f"{wrong} of {counted(sum(cell.done for cell in other.cells), 'loss')}"
            yield (
                f"WARNING: {losses} of {other.path.name}, beside this campaign, "
                f"{'is' if wrong == 1 else 'are'} doubtful: adhesis status lists them."
            )


def _preload(data: Aggregate) -> str:
    """Report the loops whose mean stress did not reach the preload, by cell."""
    short = [cell for cell in data.cells if cell.short_of_preload]
    if not short:
        return "Every loop reached its preload."
    listing = []
    with Results(data.path) as results:
        for cell in short:
            rows = np.sort(cell.rows[cell.values["preload_reached"] == 0])
            # of the load steps, all that the file holds
            highest = highest_stress(results.column("loading_mean_stress", rows))
            listing.append(f"{rows.size} at {cell.name} ({most_reached(highest)})")
    return (
        f"WARNING: {sum(cell.short_of_preload for cell in short)} of {counted(data.done, 'loop')} "
        f"did not reach the preload, and turned at the latest turning point: {_listed(listing)}. "
        f"{INSTEAD}."
    )


def _limit(data: Aggregate) -> Iterator[str]:
    """Sentences on the ranges of adhesion below which the zero-range limit holds."""
    adhesive = [cell for cell in data.cells if cell.work_of_adhesion > 0]
    ranges = [(extreme(np.min, cell.least_range), cell.name) for cell in adhesive]
    found = [(value, name) for value, name in ranges if value is not None]
    if not found:
        return
    low, least = min(found)
    opens = data.campaign.material.opens
    if low > 0 and not opens:  # a range that is given is in the model
        yield (
            f"The zero-range limit holds for ranges of adhesion well below {1e9 * low:.3g} nm: the "
            f"least {ANY_RANGE} of all loops, at {least}."
        )
    counts = [(cell.name, int(cell.beyond_zero_range.sum())) for cell in data.cells]
    if beyond := [name for name, count in counts if count]:
        number = sum(count for _, count in counts)
        yield (
            f"WARNING: {doubtful_losses(number, ', for', data.done)} {why_beyond(opens)}: "
            f"{_listed(beyond)}."
        )


def _table_1(data: Aggregate) -> Iterator[str]:
    found = [off for cell in data.cells if (off := off_the_paper(cell)) is not None]
    if not found:
        return
    known = [verdict for cell in data.cells if (verdict := inside_interval(cell)) is not None]
    here = f"; {known.count('yes')} of {len(known)} lie inside the 95 % interval of the mean here"
    yield (
        f"Of the {len(paper.TABLE_1)} losses of the paper's Table 1, {len(found)} have a cell "
        f"here: W~ is off by {100 * min(found):+.1f} % to {100 * max(found):+.1f} %, root mean "
        f"square {100 * np.sqrt(np.mean(np.square(found))):.1f} %{here if known else ''}."
    )


def _growth(data: Aggregate, of_paper: bool) -> Iterator[str]:
    if not data.paired:
        return
    rest = [pair for pair in data.paired if not pair.loss.difference.low > 0]
    if not rest:
        steps = len(data.cells) - len(alike(data.cells, {"work_of_adhesion"}))
        where = f"at every {'H and further axis' if data.further else 'H'}"
        if len(data.paired) < steps:
            unknown = steps - len(data.paired)
            where = f"in all {len(data.paired)} steps of γ that can be compared ({unknown} cannot)"
        same = "; the paper says the same" if of_paper else ""
        yield (
            f"The loss in J/m² grows with γ {where}, profile by profile, beyond the 95 % "
            f"interval{same}."
        )
        return
    down = [f"{pair.lower.name} to γ = {gamma_text(pair.upper.work_of_adhesion)}" for pair in rest]
    up = sum(pair.loss.difference.mean > 0 for pair in data.paired)
    yield (
        f"The mean loss in J/m² grows with γ in {up} of {len(data.paired)} steps of γ; not "
        f"beyond the 95 % interval in: {_listed(down)}."
    )


def _along(data: Aggregate, axis: Axis) -> Iterator[str]:
    """Whether the mean loss is monotone along a further axis, in every line of cells.

    Lines with loops short of their preload are left out: their cells are not alike in it.
    """
    lines = [li for li in lines_along(data, axis) if len(li) > 1 and li[0].work_of_adhesion]
    if not lines:
        return
    moving = together(data, axis)
    short, trends = [], []
    for line in lines:
        if any(cell.short_of_preload for cell in line):
            alike = [other for other in line[0].others if other[0] not in moving]
            short.append(name_at(line[0].hurst, line[0].work_of_adhesion, alike))
        else:
            trends.append(_trend(line))
    low, high = (in_one_unit(axis.name, [end]) for end in (min(axis.values), max(axis.values)))
    along = f"Along {axis.name} from {low} to {high}"
    if not trends:
        yield (
            f"{along} no trend is given: in every series of cells that are else alike, loops did "
            "not reach their preload."
        )
        return
    parts = [f"{trend} in {count}" for trend, count in Counter(trends).most_common()]
    rest = f"; not counted, as loops did not reach their preload: {_listed(short)}" if short else ""
    yield (
        f"{along} the mean loss in J/m² {', '.join(parts)} of {len(trends)} series of cells that "
        f"are else alike{rest}."
    )


def _trend(cells: Sequence[Cell], loss: str = "loss") -> str:
    """Return how a mean loss behaves; steps within the loops' numerical errors are none."""
    names = (loss, loss.replace("loss", "loss_error"))
    means, errors = (np.array([c.estimates[name].mean for c in cells]) for name in names)
    steps = np.diff(means)
    signs = np.unique(np.sign(steps)[np.abs(steps) > errors[1:] + errors[:-1]])
    known = {(1.0,): "grows", (-1.0,): "falls", (): "stays the same"}
    return known.get(tuple(signs.tolist()), _NOT_MONOTONE)


def _order_in_slope(data: Aggregate, of_paper: bool) -> Iterator[str]:
    """Whether the mean loss is monotone in m2 through H; the paper's table is not."""
    quantity, what = "loss", "mean loss in J/m²"
    if of_paper:
        quantity, what = "loss_dimensionless", "mean W~"
    found: dict[str, list[str]] = {}
    for gamma in filter(None, data.works_of_adhesion):
        cells = [c for c in data.cells if c.work_of_adhesion == gamma and c.done > 1]
        if len(cells) > 2:
            cells.sort(key=lambda c: c.estimates["m2"].mean)
            trend = _trend(cells, quantity)
            verb = f"{trend} {'in' if trend == _NOT_MONOTONE else 'with'} m2"
            found.setdefault(verb, []).append(gamma_text(gamma))
    parts = [f"{verb} at γ = {_listed(gammas, ', ')}" for verb, gammas in found.items()]
    rest = "; the paper's table is not monotone" if of_paper else ""
    if parts:
        yield f"Through H, the {what} {', and '.join(parts)}{rest}."


def _unloading_exceeds_loading(data: Aggregate, of_paper: bool) -> Iterator[str]:
    adhesive = (cell for cell in data.cells if cell.done and cell.work_of_adhesion)
    done = [(cell.name, area_ratio(cell)) for cell in adhesive]
    ratios = [ratio for _, ratio in done if ratio is not None]
    where = "At equal load, on unloading up to the largest tension, the contact is"
    if below := [name for name, ratio in done if ratio is not None and ratio < 1]:
        yield f"{where} not everywhere larger than on loading: {_listed(below)}."
    elif ratios:
        apart = [name for name, ratio in done if ratio is None]
        rest = f" (no load in common away from the turning point: {_listed(apart)})"
        yield (
            f"{where} larger than on loading everywhere, by a factor of at least {min(ratios):.2f}"
            f"{rest if apart else ''}{'; the paper says the same' if of_paper else ''}."
        )


def area_ratio(cell: AveragedCell) -> float | None:
    """Least ratio of A/A0 on unloading to loading at equal mean stress, on the mean curves.

    Unloading up to its largest tension only: afterwards patches are lost while the tension falls.
    Loading between a tenth and 95 % of its final contact: at the turning point both branches meet.
    None without common stresses. Loops that turn at one mean stress end at several penetrations:
    where one of them has no state, the mean is unknown, and left out.
    """
    (stress_up, area_up), (stress_down, area_down) = (
        branch[:, np.isfinite(branch).all(axis=0)]
        for branch in (
            np.array([cell.curves[f"{name}_{of}"].mean for of in _STRESS_AND_AREA])
            for name in BRANCHES
        )
    )
    if not stress_up.size or not stress_down.size:
        return None
    part = slice(0, int(np.argmin(stress_down)) + 1)
    stress_down, area_down = stress_down[part], area_down[part]
    wanted = (area_up > 0.1 * area_up[-1]) & (area_up < 0.95 * area_up[-1])
    wanted &= (stress_up >= stress_down.min()) & (stress_up <= stress_down.max())
    if not np.any(wanted):
        return None
    order = np.argsort(stress_down)
    unloading = np.interp(stress_up[wanted], stress_down[order], area_down[order])
    return float(np.min(unloading / area_up[wanted]))


def _listed(texts: Sequence[str], between: str = "; ") -> str:
    """The first of a list, and how many more there are."""
    rest = len(texts) - _MOST_LISTED
    shown = between.join(texts[:_MOST_LISTED])
    return f"{shown} and {rest} more" if rest > 0 else shown


def _all(data: Aggregate, name: str) -> NDArray[np.float64]:
    return np.concatenate([cell.values[name] for cell in data.cells])
