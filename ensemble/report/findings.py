"""What the numbers say, as sentences: agreement with the paper, audit, and what is missing."""

from __future__ import annotations

import numpy as np

from ensemble.aggregate.average import Aggregate
from ensemble.aggregate.cells import Cell
from ensemble.aggregate.fields import fitted_slope
from ensemble.report import paper


def missing(data: Aggregate) -> list[str]:
    """Sentences on tasks that are not in the averages; none if the campaign is complete."""
    out = []
    total = data.done + data.failed + data.pending
    if data.pending:
        out.append(
            f"The campaign is not finished: {data.pending} of {total} tasks are pending. All "
            f"averages are over the {data.done} finished ones."
        )
    if data.failed:
        out.append(f"{data.failed} of {total} tasks failed; the averages leave them out.")
    empty = [_name(cell) for cell in data.cells if not cell.done]
    if empty:
        out.append(f"No task is finished yet for {'; '.join(empty)}.")
    few = [_name(cell) for cell in data.cells if cell.done == 1]
    if few:
        out.append(f"Only one realisation, hence no spread, for {'; '.join(few)}.")
    return out


def agreement(data: Aggregate) -> list[str]:
    """Sentences on what agrees with the paper, and what does not."""
    return [
        *_table_1(data),
        *_slopes(data),
        *_growth(data),
        *_order_in_slope(data),
        *_unloading_exceeds_loading(data),
        *_spectrum(data),
    ]


def readings(data: Aggregate) -> list[str]:
    """Which campaign comes nearest to the paper's table, of this one and those beside it."""
    deviations = []
    for name, cells in (
        (data.path.name, data.cells),
        *((companion.path.name, companion.cells) for companion in data.companions),
    ):
        found = [
            cell.estimates["loss_dimensionless"].mean / value - 1
            for cell in cells
            if cell.done and (value := paper.table_1(cell.hurst, cell.work_of_adhesion)) is not None
        ]
        if found:
            deviations.append((float(np.sqrt(np.mean(np.square(found)))), name))
    if len(deviations) < 2:
        return []
    deviations.sort()
    listing = "; ".join(f"{name} {100 * deviation:.1f} %" for deviation, name in deviations)
    return [
        f"Nearest to the known values of the paper's Table 1: {deviations[0][1]} (root mean square "
        f"deviation: {listing})."
    ]


def quality(data: Aggregate) -> list[str]:
    """Sentences on the energy audit and on what the file's shape cut off."""
    audit = np.concatenate([cell.values["audit_residual"] for cell in data.cells])
    out = [
        "Energy audit: loop integral and sum of the drops differ by "
        f"{100 * np.sqrt(np.mean(audit**2)):.2g} % of the loss (root mean square over loops), "
        f"{100 * np.max(np.abs(audit)):.2g} % in the worst loop."
    ]
    truncated = int(data.jumps.truncated.sum())
    if truncated:
        out.append(
            f"{truncated} loops made more jumps than the catalogue holds: their smallest drops are "
            "missing from the distribution and from the table of kinds, not from the losses."
        )
    end = float(data.campaign.unloading_penetration[-1])
    cut = sum(int(np.sum(cell.values["pull_off_penetration"] < end)) for cell in data.cells)
    if cut:
        out.append(
            f"{cut} loops detached below Δ/h_max = {end:g}, where the stored unloading curve ends: "
            "their curves are cut, their losses are complete."
        )
    return out


def _table_1(data: Aggregate) -> list[str]:
    out = []
    known = 0
    for cell in data.cells:
        value = paper.table_1(cell.hurst, cell.work_of_adhesion)
        if value is None or not cell.done:
            continue
        known += 1
        loss = cell.estimates["loss_dimensionless"]
        inside = loss.low <= value <= loss.high
        where = (
            "no interval can be given"
            if np.isnan(loss.low)
            else f"the paper's value lies {'inside' if inside else 'outside'} the 95 % interval "
            f"{loss.low:.4g} … {loss.high:.4g}"
        )
        out.append(
            f"Table 1, {_name(cell)}: W~ = {loss.mean:.4g} against {value:g} in the paper "
            f"({100 * (loss.mean / value - 1):+.1f} %); {where}."
        )
    if known < paper.TABLE_1_CELLS:
        out.append(
            f"Of the {paper.TABLE_1_CELLS} losses of the paper's Table 1 only "
            f"{len(paper.TABLE_1)} is known here; the others are left blank."
        )
    return out


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


def _growth(data: Aggregate) -> list[str]:
    if not data.paired:
        return []
    up = [pair for pair in data.paired if pair.loss.mean > 0]
    sure = [pair for pair in up if pair.loss.low > 0]
    if len(sure) == len(data.paired):
        return [
            "The loss grows with γ at every H, profile by profile, beyond the 95 % interval; the "
            "paper says the same."
        ]
    down = "; ".join(
        f"H = {pair.hurst:g}, γ = {pair.lower:g} to {pair.upper:g} J/m²"
        for pair in data.paired
        if pair not in sure
    )
    return [
        f"The mean loss grows with γ in {len(up)} of {len(data.paired)} steps of γ; not beyond the "
        f"95 % interval in: {down}."
    ]


def _order_in_slope(data: Aggregate) -> list[str]:
    """Whether the loss is monotone in m2; the paper's table is not."""
    out = []
    for gamma in data.works_of_adhesion:
        cells = [c for c in data.cells if c.work_of_adhesion == gamma and c.done > 1]
        if len(cells) < 3:
            continue
        cells.sort(key=lambda c: c.estimates["m2"].mean)
        steps = np.diff([c.estimates["loss_dimensionless"].mean for c in cells])
        monotone = bool(np.all(steps > 0) or np.all(steps < 0))
        word = ("falls" if steps[0] < 0 else "grows") if monotone else "is not monotone"
        out.append(f"{word} {'with' if monotone else 'in'} m2 at γ = {gamma:g} J/m²")
    return [f"The mean loss {', '.join(out)}; the paper's table is not monotone."] if out else []


def _unloading_exceeds_loading(data: Aggregate) -> list[str]:
    ratios = [(cell, ratio) for cell in data.cells if (ratio := area_ratio(cell)) is not None]
    if not ratios:
        return []
    where = "At equal load, on unloading up to the largest tension, the contact is"
    below = [cell for cell, ratio in ratios if ratio < 1]
    if below:
        names = "; ".join(_name(cell) for cell in below)
        return [f"{where} not everywhere larger than on loading: {names}."]
    least = min(ratio for _, ratio in ratios)
    apart = [_name(cell) for cell in data.cells if cell.done and area_ratio(cell) is None]
    rest = f" (no load in common away from the turning point: {'; '.join(apart)})" if apart else ""
    return [
        f"{where} larger than on loading everywhere, by a factor of at least {least:.2f}{rest}; "
        "the paper says the same."
    ]


def _spectrum(data: Aggregate) -> list[str]:
    """Fitted slope of the loading spectrum at the deepest penetration, against -(2+H)."""
    fields = data.fields
    parts = []
    for hurst in data.hursts:
        cell = typical_cell(data, hurst)
        if cell is None or not fields.penetration.size:
            continue
        density = fields.psd_displacement[data.cells.index(cell), 0, -1]
        slope, error = fitted_slope(data.campaign, fields.wave_number, density)
        if not np.isnan(slope):
            parts.append(f"{slope:.2f} ± {error:.2f} against {-(2 + hurst):.1f} at {_name(cell)}")
    if not parts:
        return []
    return [
        "Slope of the loading spectrum of the deformed surface at small wave numbers and "
        f"Δ/h_max = {fields.penetration[-1]:.2f}, fitted, against Persson's -(2+H): "
        f"{'; '.join(parts)}."
    ]


def typical_cell(data: Aggregate, hurst: float | None = None) -> Cell | None:
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


def area_ratio(cell: Cell) -> float | None:
    """Least ratio of A/A0 on unloading to loading at equal mean stress, on the mean curves.

    Unloading up to its largest tension only: afterwards patches are lost while the tension falls.
    Loading between a tenth and 95 % of its final contact: at the turning point both branches meet.
    None without common stresses.
    """
    if not cell.done:
        return None
    stress_up = cell.curves["loading_stress"].mean
    area_up = cell.curves["loading_contact_fraction"].mean
    stop = int(np.argmin(cell.curves["unloading_stress"].mean)) + 1
    stress_down = cell.curves["unloading_stress"].mean[:stop]
    area_down = cell.curves["unloading_contact_fraction"].mean[:stop]
    wanted = (area_up > 0.1 * area_up[-1]) & (area_up < 0.95 * area_up[-1])
    wanted &= (stress_up >= stress_down.min()) & (stress_up <= stress_down.max())
    if not np.any(wanted):
        return None
    order = np.argsort(stress_down)
    unloading = np.interp(stress_up[wanted], stress_down[order], area_down[order])
    return float(np.min(unloading / area_up[wanted]))


def _name(cell: Cell) -> str:
    return f"H = {cell.hurst:g}, γ = {cell.work_of_adhesion:g} J/m²"
