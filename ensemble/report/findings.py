"""Put findings into sentences: trends, agreement with the paper, errors, what is missing."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.aggregate.average import Aggregate, AveragedCell
from adhesis.ensemble.aggregate.cells import Cell, doubtful_loops
from adhesis.ensemble.aggregate.companions import Companion
from adhesis.ensemble.aggregate.mean_fields import fitted_slope
from adhesis.ensemble.campaign.axes import Axis
from adhesis.ensemble.campaign.tasks import name_at, place
from adhesis.ensemble.quantities import gamma_text, in_one_unit, percent, stress_text, with_unit
from adhesis.ensemble.report import paper
from adhesis.ensemble.report.further_axes import (
    failed_cells,
    lines_along,
    short_of_preload,
    together,
)
from adhesis.ensemble.report.tables.loss_tables import extreme, inside_interval, off_the_paper
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.task.doubt import why_beyond
from adhesis.ensemble.task.preload import INSTEAD, highest_stress, most_reached
from adhesis.solver.loading.zero_range import ANY_RANGE

# Root mean square slope above which linear elasticity of small slopes is doubtful.
STEEP = 0.3
_MOST_LISTED = 4


def verdict(data: Aggregate) -> list[str]:
    """Three sentences: what came out, how well the mean is known, how well each loop is."""
    return [_outcome(data), _statistical(data), _numerical(data)]


def _outcome(data: Aggregate) -> str:
    cells = [cell for cell in data.cells if cell.done]
    cells.sort(key=lambda cell: cell.estimates["loss"].mean)
    cycle = data.campaign.cycle
    top = f"A loop to {turning_point(data)} and back until detached loses"
    what = "it is lost"
    if cycle.under_load:
        falls = _all(data, "pull_off_stress")
        ends = " to ".join(dict.fromkeys(stress_text(end) for end in (falls.min(), falls.max())))
        top = (
            f"A loop to {turning_point(data)} and back under a weight, which falls off at {ends} "
            "(the loop is closed at the separation of the fall), loses"
        )
        what = "the drops before the fall are lost"
    friction = _friction(data, cells)
    if len(cells) == 1:
        return f"{top} on average {_loss(cells[0])}{friction}."
    share = [cell.estimates["small_scale_share"].mean for cell in cells]
    return (
        f"{top}, on average over realisations, from {_loss(cells[0])} to {_loss(cells[-1])}; "
        f"{100 * min(share):.0f} to {100 * max(share):.0f} % of {what} where edges run inside "
        f"patches{friction}."
    )


def _friction(data: Aggregate, cells: Sequence[Cell]) -> str:
    """Return a clause on the friction of edges; empty for one work of adhesion."""
    if data.campaign.material.work_of_adhesion_open is None:
        return ""
    pairs = ((cell.estimates["friction"].mean, cell.estimates["loss"].mean) for cell in cells)
    share = [friction / loss for friction, loss in pairs if loss > 0]
    return f"; {_from_to(share)} is friction of receding edges" if share else ""


def pattern(data: Aggregate) -> list[str]:
    """Report how γ varies along the profile; none where it does not."""
    if data.campaign.material.stripes is None:
        return []
    cells = [cell.campaign.material for cell in data.cells]
    ends = {
        name: sorted({getattr(material, name) for material in cells})
        for name in ("stripes", "stripe_amplitude", "stripe_phase")
    }
    count, amplitude, phase = (
        " to ".join(dict.fromkeys(f"{value:g}" for value in (found[0], found[-1])))
        for found in ends.values()
    )
    return [
        f"The work of adhesion varies along the profile, {count} times in its period and by "
        f"{amplitude} of γ (phase {phase} rad); γ is its mean."
    ]


def _from_to(shares: Sequence[float]) -> str:
    return percent(*sorted({min(shares), max(shares)}))


def turning_point(data: Aggregate) -> str:
    """Return "Δ/h_max = 0.5 … 0.9": to where the finished loops were loaded."""
    cycle = data.campaign.cycle
    ends = sorted({cell.campaign.cycle.turning_point for cell in data.cells if cell.done})
    if cycle.turns_at_stress:
        what = "mean stress" if cycle.under_load else "preload"
        return f"a {what} of {in_one_unit('mean_stress', sorted({ends[0], ends[-1]}), ' … ')}"
    texts = [f"{end:g}" for end in ends]
    end = " … ".join(dict.fromkeys((texts[0], texts[-1])))
    return f"{penetration_sign(data)} = {end}"


def penetration_sign(data: Aggregate) -> str:
    """Return what is prescribed along the loops of a campaign, in units of h_max."""
    return "Δ/h_max" if data.campaign.cycle.stiffness is None else "u_tot/h_max"


def _loss(cell: Cell) -> str:
    loss, gamma = cell.estimates["loss"].mean, cell.work_of_adhesion
    beside = [f"{loss / gamma:.3g} γ"] if gamma > 0 else []
    beside.append(f"W~ = {cell.estimates['loss_dimensionless'].mean:.3g}")
    return f"{1e3 * loss:.3g} mJ/m² ({', '.join(beside)}) at {cell.name}"


def _statistical(data: Aggregate) -> str:
    errors = [cell.estimates["loss"].relative_error for cell in data.cells]
    errors = [error for error in errors if np.isfinite(error)]
    counts = sorted({cell.done for cell in data.cells if cell.done})
    many = f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else f"{counts[0]}"
    plural = "realisations" if counts[-1] > 1 else "realisation"
    point = "cell" if data.further else "(H, γ)"
    if not errors:
        return f"With {many} {plural} of each {point}, the error of the mean is unknown."
    return (
        f"With {many} {plural} of each {point}, the 95 % interval of the mean loss in J/m² reaches "
        f"{_from_to(errors)} from it, on the further side."
    )


def _numerical(data: Aggregate) -> str:
    loss, audit = _all(data, "loss"), np.abs(_all(data, "audit_residual"))
    error, races = _all(data, "loss_error"), _all(data, "races")

    def most(part: NDArray[np.float64]) -> str:
        shares = np.divide(part, np.abs(loss), out=np.zeros_like(loss), where=loss != 0)
        return percent(shares.max())

    elsewhere = "no jump would have ended elsewhere by another rule of descent"
    if raced := int(np.sum(races > 0)):
        elsewhere = (
            f"in {raced} of {loss.size} loops another rule of descent would have ended a jump "
            f"elsewhere (at most {most(_all(data, 'energy_at_stake'))} of a loop's loss at stake)"
        )
    return (
        f"The estimated numerical error of a loss is at most {most(error)} of it; the energy audit "
        f"of each loop closes within {percent(audit.max())}; {elsewhere}."
    )


def precision(data: Aggregate) -> list[str]:
    """Report the cells that have met the precision of ``[stop]``; none without ``[stop]``."""
    known = [(cell.name, cell.precision) for cell in data.cells]
    cells = [(name, found) for name, found in known if found is not None]
    if not cells:
        return []
    quantity, wanted = cells[0][1].quantity, cells[0][1].wanted
    met = sum(bool(found.met) for _, found in cells)
    sentence = (
        f"The 95 % interval of the mean {quantity} was to reach at most "
        f"{percent(wanted, digits=3)} from it ([stop]): {met} of {len(cells)} cells met that"
    )
    rest = [f"{name}: {found}" for name, found in cells if not found.met]
    return [f"{sentence}; the others: {_listed(rest)}." if rest else f"{sentence}."]


def missing(data: Aggregate) -> list[str]:
    """Sentences on tasks that are not in the averages; none if the campaign is complete."""
    out = [f"{doubt}." for doubt in data.doubts]
    total = data.done + data.failed + data.pending + data.damaged
    if data.pending:
        out.append(
            f"The campaign is not finished: {data.pending} of {total} tasks are pending. All "
            f"averages are over the {data.done} finished ones."
        )
    if data.failed:
        why = f" First reason: {data.failures[0][1]}." if data.failures else ""
        out.append(f"{data.failed} of {total} tasks failed; the averages leave them out.{why}")
    if empty := [cell.name for cell in data.cells if not cell.done and cell.pending]:
        out.append(f"No task is finished yet for {_listed(empty)}.")
    if failed := [cell.name for cell in failed_cells(data.cells)]:
        out.append(
            f"WARNING: all tasks failed for {_listed(failed)}: figures and averages lack "
            f"{'this cell' if len(failed) == 1 else 'these cells'}."
        )
    if few := [cell.name for cell in data.cells if cell.done == 1]:
        out.append(f"Only one realisation, hence no spread, for {_listed(few)}.")
    return out


def agreement(data: Aggregate) -> list[str]:
    """Sentences on what the averages show; beside the paper's if the campaign is the paper's."""
    shown = data.shown
    of_paper = paper.are_its_cells(shown.cells)
    return [
        *(_table_1(shown) if of_paper else []),
        *(_slopes(shown) if of_paper else []),
        *_growth(data, of_paper),
        *(
            sentence
            for axis in data.further
            if not together(data, axis) & {"hurst", "work_of_adhesion"}
            for sentence in _along(data, axis)
        ),
        *_order_in_slope(shown, of_paper),
        *_unloading_exceeds_loading(data, of_paper),
        *_spectrum(shown),
    ]


def readings(data: Aggregate) -> list[str]:
    """Report which campaign is nearest to the paper's table, of this one and those beside it."""
    deviations = []
    campaigns: tuple[Aggregate | Companion, ...] = (data, *data.companions)
    for one in campaigns:
        if found := _deviations(one.cells):
            rms = float(np.sqrt(np.mean(np.square(found))))
            deviations.append((rms, one.path.name, len(found)))
    if len(deviations) < 2:
        return []
    deviations.sort()
    listing = "; ".join(
        f"{name} {100 * deviation:.1f} % ({count} values)" for deviation, name, count in deviations
    )
    return [
        f"Nearest to the paper's Table 1: {deviations[0][1]} (root mean square deviation: "
        f"{listing})."
    ]


def quality(data: Aggregate) -> list[str]:
    """Sentences on the error of the losses, and on what the file's shape cut off."""
    audit = _all(data, "audit_residual")
    out = [
        "Energy audit: loop integral and sum of the drops differ by "
        f"{percent(np.sqrt(np.mean(audit**2)))} of the loss (root mean square over loops), "
        f"{percent(np.max(np.abs(audit)))} in the worst loop."
    ]
    if wrong := doubts(data):
        out.append(
            f"WARNING: {len(wrong)} of {data.done} losses are doubtful, as their audit residual or "
            "their estimated error exceeds the accuracy asked for, "
            f"{percent(data.campaign.solver.accuracy)} of the loss: {_listed(wrong)}."
        )
    out += _limit(data)
    if data.campaign.cycle.preload is not None:
        out += _preload(data)
    slopes = [(cell, np.sqrt(cell.estimates["m2"].mean)) for cell in data.cells if cell.done]
    if steep := [cell.name for cell, slope in slopes if slope > STEEP]:
        out.append(
            f"WARNING: the root mean square slope exceeds {STEEP:g} for {_listed(steep)}: linear "
            "elasticity of small slopes, on which everything here rests, is doubtful there."
        )
    if truncated := sum(cell.jumps.truncated for cell in data.cells):
        out.append(
            f"{truncated} loops made more jumps than the catalogue holds: their smallest drops are "
            "missing from the distribution and from the table of kinds, not from the losses."
        )
    ends = [float(cell.penetration["unloading"][-1]) for cell in data.cells]
    pull_off = [cell.values["pull_off_penetration"] for cell in data.cells]
    if cut := sum(int(np.sum(at < end)) for at, end in zip(pull_off, ends, strict=True)):
        below = " to ".join(f"{end:g}" for end in sorted({min(ends), max(ends)}))
        out.append(
            f"{cut} loops detached below Δ/h_max = {below}, where the stored unloading curve ends: "
            "their curves are cut, their losses are complete."
        )
    return out


def _preload(data: Aggregate) -> list[str]:
    """Report the loops whose mean stress did not reach the preload, by cell."""
    short = short_of_preload(data.cells)
    if not short:
        return ["Every loop reached its preload."]
    with Results(data.path) as results:
        lost = (np.sort(cell.rows[cell.values["preload_reached"] == 0]) for _, cell in short)
        # of the load steps, all that the file holds
        reached = [highest_stress(results.column("loading_mean_stress", rows)) for rows in lost]
    listing = [
        f"{count} at {cell.name} ({most_reached(highest)})"
        for (count, cell), highest in zip(short, reached, strict=True)
    ]
    return [
        f"WARNING: {sum(count for count, _ in short)} of {data.done} loops did not reach their "
        f"preload, and turned at the latest turning point: {_listed(listing)}. {INSTEAD}."
    ]


def _limit(data: Aggregate) -> list[str]:
    """Sentences on the ranges of adhesion below which the zero-range limit holds."""
    ranges = ((extreme(np.min, cell.least_range), cell) for cell in data.cells)
    found = [(value, cell) for value, cell in ranges if value is not None]
    if not found:
        return []
    opens = data.campaign.material.opens
    out = []
    if not opens:  # else patches open from inside where the limit ends
        low, cell = min(found, key=lambda entry: entry[0])
        out.append(
            f"The zero-range limit holds for ranges of adhesion well below {1e9 * low:.3g} nm: the "
            f"least {ANY_RANGE} of all loops, at {cell.name}."
        )
    beyond = [(count, cell) for cell in data.cells if (count := int(cell.beyond_zero_range.sum()))]
    if beyond:
        count = sum(number for number, _ in beyond)
        out.append(
            f"WARNING: {count} of {data.done} losses are doubtful, for {why_beyond(opens)}: "
            f"{_listed([cell.name for _, cell in beyond])}."
        )
    return out


def doubts(data: Aggregate) -> list[str]:
    """Loops whose own checks say that their loss is off by a share that counts, worst first."""
    return [
        f"row {cell.rows[k]}, {cell.name} ({percent(cell.doubt[k])})"
        for cell, k in doubtful_loops(data.cells)
    ]


def _table_1(data: Aggregate) -> list[str]:
    found = _deviations(data.cells)
    if not found:
        return []
    known = [verdict for cell in data.cells if (verdict := inside_interval(cell)) is not None]
    here = f"; {known.count('yes')} of {len(known)} lie inside the 95 % interval of the mean here"
    low, high = 100 * min(found), 100 * max(found)
    rms = 100 * np.sqrt(np.mean(np.square(found)))
    return [
        f"Of the {len(paper.TABLE_1)} losses of the paper's Table 1, {len(found)} have a cell "
        f"here: W~ is off by {low:+.1f} % to {high:+.1f} %, root mean square {rms:.1f} %"
        f"{here if known else ''}."
    ]


def _deviations(cells: Sequence[Cell]) -> list[float]:
    """Relative deviations of the mean W~ from the values that the paper gives."""
    return [found for cell in cells if (found := off_the_paper(cell)) is not None]


def _slopes(data: Aggregate) -> list[str]:
    parts = []
    for hurst in data.hursts:
        quoted = paper.m2(hurst)
        cells = [cell for cell in data.cells if cell.hurst == hurst and cell.done]
        if quoted is None or not cells:
            continue
        m2 = cells[0].estimates["m2"].mean
        parts.append(f"{m2:.3g} against {quoted:.2g} at H = {hurst:g}")
    return [f"Mean square slope m2 here and in the paper: {', '.join(parts)}."] if parts else []


def _growth(data: Aggregate, of_paper: bool) -> list[str]:
    if not data.paired:
        return []
    up = [pair for pair in data.paired if pair.loss.mean > 0]
    sure = [pair for pair in up if pair.loss.low > 0]
    if len(sure) == len(data.paired):
        everywhere = "H and further axis" if data.further else "H"
        same = "; the paper says the same" if of_paper else ""
        return [
            f"The loss in J/m² grows with γ at every {everywhere}, profile by profile, beyond "
            f"the 95 % interval{same}."
        ]
    rest = [pair for pair in data.paired if pair not in sure]
    down = [
        f"H = {pair.hurst:g}, γ = {gamma_text(pair.lower)} to {gamma_text(pair.upper)}"
        + (f", {place(pair.others)}" if pair.others else "")
        for pair in rest
    ]
    return [
        f"The mean loss in J/m² grows with γ in {len(up)} of {len(data.paired)} steps of γ; not "
        f"beyond the 95 % interval in: {_listed(down)}."
    ]


def _along(data: Aggregate, axis: Axis) -> list[str]:
    """Whether the mean loss is monotone along a further axis, in every line of cells.

    Lines with loops short of their preload are left out: their cells are not alike in it.
    """
    lines = [line for line in lines_along(data, axis) if len(line) > 1]
    if not lines:
        return []
    moving = together(data, axis)
    short = [
        name_at(line[0].hurst, line[0].work_of_adhesion, _others(line[0], moving))
        for line in lines
        if short_of_preload(line)
    ]
    counted = [line for line in lines if not short_of_preload(line)]
    low, high = (with_unit(axis.name, end) for end in (min(axis.values), max(axis.values)))
    along = f"Along {axis.name} from {low} to {high}"
    if not counted:
        return [
            f"{along} no trend is given: in every series of cells that are else alike, loops did "
            "not reach their preload."
        ]
    steps = [np.diff([cell.estimates["loss"].mean for cell in line]) for line in counted]
    up = sum(bool(np.all(step > 0)) for step in steps)
    down = sum(bool(np.all(step < 0)) for step in steps)
    flat = sum(bool(np.all(step == 0)) for step in steps)
    verbs = {"grows": up, "falls": down, "stays the same": flat}
    verbs["is not monotone"] = len(steps) - sum(verbs.values())
    parts = [f"{verb} in {count}" for verb, count in verbs.items() if count]
    rest = f"; not counted, as loops did not reach their preload: {_listed(short)}" if short else ""
    return [
        f"{along} the mean loss in J/m² {', '.join(parts)} of {len(steps)} series of cells that "
        f"are else alike{rest}."
    ]


def _others(cell: Cell, moving: Collection[str]) -> list[tuple[str, float]]:
    return [other for other in cell.others if other[0] not in moving]


def _order_in_slope(data: Aggregate, of_paper: bool) -> list[str]:
    """Whether the mean loss is monotone in m2 through H; the paper's table is not."""
    found: dict[str, list[str]] = {}
    for gamma in data.works_of_adhesion:
        cells = [c for c in data.cells if c.work_of_adhesion == gamma and c.done > 1]
        if len(cells) < 3:
            continue
        cells.sort(key=lambda c: c.estimates["m2"].mean)
        quantity = "loss_dimensionless" if of_paper else "loss"
        steps = np.diff([c.estimates[quantity].mean for c in cells])
        verb = "falls with m2" if steps[0] < 0 else "grows with m2"
        if not (np.all(steps > 0) or np.all(steps < 0)):
            verb = "is not monotone in m2"
        found.setdefault(verb, []).append(gamma_text(gamma))
    parts = [f"{verb} at γ = {_listed(gammas, ', ')}" for verb, gammas in found.items()]
    rest = "; the paper's table is not monotone" if of_paper else ""
    what = "mean W~" if of_paper else "mean loss in J/m²"
    return [f"Through H, the {what} {', and '.join(parts)}{rest}."] if parts else []


def _unloading_exceeds_loading(data: Aggregate, of_paper: bool) -> list[str]:
    ratios = [(cell, ratio) for cell in data.cells if (ratio := area_ratio(cell)) is not None]
    if not ratios:
        return []
    where = "At equal load, on unloading up to the largest tension, the contact is"
    if below := [cell.name for cell, ratio in ratios if ratio < 1]:
        return [f"{where} not everywhere larger than on loading: {_listed(below)}."]
    least = min(ratio for _, ratio in ratios)
    apart = [cell.name for cell in data.cells if cell.done and area_ratio(cell) is None]
    rest = f" (no load in common away from the turning point: {_listed(apart)})" if apart else ""
    says = "; the paper says the same" if of_paper else ""
    return [
        f"{where} larger than on loading everywhere, by a factor of at least {least:.2f}{rest}"
        f"{says}."
    ]


def _spectrum(data: Aggregate) -> list[str]:
    """Fitted slope of the loading spectrum at the deepest penetration, against -(2+H)."""
    parts = []
    for hurst in data.hursts:
        cell = typical_cell(data, hurst)
        if cell is None or not cell.plan.penetration.size:
            continue
        slope, error = fitted_slope(cell.plan, cell.fields.psd_displacement[0, -1])
        if not np.isnan(slope):
            fit = f"{slope:.2f} ± {error:.2f} against {-(2 + hurst):.1f}"
            parts.append(f"{fit} at {cell.name}")
    if not parts:
        return []
    depths = {f"{cell.plan.penetration[-1]:.2f}" for cell in data.cells}
    sign = "p̄/p̄_max" if data.campaign.cycle.turns_at_stress else penetration_sign(data)
    depth = f"{sign} = {' or '.join(sorted(depths))}"
    return [
        "Slope of the loading spectrum of the deformed surface at small wave numbers and "
        f"{depth}, fitted, against Persson's -(2+H): {_listed(parts)}."
    ]


def typical_cell(data: Aggregate, hurst: float | None = None) -> AveragedCell | None:
    """The cell that stands for all: middle H (unless given) and middle γ that have results."""
    hursts = [hurst] if hurst is not None else _from_middle(data.hursts)
    for h in hursts:
        for gamma in _from_middle(data.works_of_adhesion):
            cell = data.cell(h, gamma)
            if cell is not None and cell.done:
                return cell
    return None


def _from_middle(values: tuple[float, ...]) -> list[float]:
    middle = (len(values) - 1) / 2
    return [values[k] for k in sorted(range(len(values)), key=lambda k: abs(k - middle))]


def area_ratio(cell: AveragedCell) -> float | None:
    """Least ratio of A/A0 on unloading to loading at equal mean stress, on the mean curves.

    Unloading up to its largest tension only: afterwards patches are lost while the tension falls.
    Loading between a tenth and 95 % of its final contact: at the turning point both branches meet.
    None without common stresses.
    """
    if not cell.done:
        return None
    stress_up = cell.curves["loading_mean_stress_dimensionless"].mean
    area_up = cell.curves["loading_contact_fraction"].mean
    stop = int(np.argmin(cell.curves["unloading_mean_stress_dimensionless"].mean)) + 1
    stress_down = cell.curves["unloading_mean_stress_dimensionless"].mean[:stop]
    area_down = cell.curves["unloading_contact_fraction"].mean[:stop]
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
