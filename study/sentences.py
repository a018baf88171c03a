"""Sentences of the study's pages whose numbers follow from the results."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adhesis.ensemble.campaign.precision import interval
from adhesis.ensemble.report.paper import TABLE_1
from study import amplitude, monotone
from study.data import Study
from study.measure import COMPATIBLE, OF_PAPER, Cell, Reading, error_of
from study.table1 import best_of, complete, drawn_text, every_reading

# (heights in µm at γ = 0.04 J/m², turning points, realisations that the plan asks for, text)
GROUPS = (
    ((0.7559, 1.0, 2.0), (0.6, 0.8), 200,
     "at 0.756, 1 and 2 µm with Δ~max = 0.6 and 0.8, which were known before the plan"),
    ((1.0, 2.0), (0.9,), 100, "at 1 and 2 µm with Δ~max = 0.9"),
    ((0.25, 0.5, 1.4142), amplitude.TURNS, 100, "at 0.25, 0.5 and 1.41 µm"),
    ((4.0,), amplitude.TURNS, 24, "at 4 µm"),
    ((8.0,), amplitude.TURNS, 10, "at 8 µm"),
)  # fmt: skip


def listed(parts: list[str]) -> str:
    """Join parts of a sentence."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def span(values: list[int]) -> str:
    """Text of the smallest and the largest number."""
    low, high = min(values), max(values)
    return f"{low}" if low == high else f"{low} to {high}"


def open_cases(study: Study) -> str:
    """The cases through the amplitude that are open."""
    rows = [(h, row) for h, row in amplitude.rows(study, "loss") if row.verdict == "open"]
    if not rows:
        return "In J/m² no case through the amplitude is open."
    by_turn: dict[float, list[str]] = defaultdict(list)
    for hurst, row in rows:
        by_turn[row.turn].append(f"{hurst:g}")
    cases = listed(
        [f"H = {listed(hursts)} at Δ~max = {turn:g}" for turn, hursts in by_turn.items()]
    )
    falls = []
    for hurst, row in rows:
        losses = amplitude.series(study, hurst, row.turn, "loss")
        means = [np.mean(list(one.values())) for one in losses.values()]
        falls.append(means[-1] < max(means))
    after = (
        "; their mean losses fall beyond the maximum too, but the few realisations at 4 and 8 µm "
        "do not make it certain"
        if all(falls)
        else ""
    )
    return f"Open through the amplitude, in J/m²: {cases}{after}."


def answer_note(study: Study) -> str:
    """What the table of the answer leaves out: open cases, realisations, the law of scaling."""
    reported, short = [], []
    for heights, turns, planned, where in GROUPS:
        numbers = [
            len(amplitude.series(study, hurst, turn, "loss").get(height, {}))
            for height in heights
            for turn in turns
            for hurst in amplitude.HURSTS
        ]
        reported.append(f"{span(numbers)} {where}")
        if min(numbers) < planned:
            short.append(f"{planned} {where}")
    reached = (
        "These are all that the plan asks for."
        if not short
        else f"The plan asks for {listed(short)}; the time ended the campaigns before."
    )
    return (
        f"An open row has the p of both verdicts. {open_cases(study)} By the law of scaling the "
        f"verdicts are the same at every γ.\nRealisations through the amplitude: "
        f"{'; '.join(reported)}. {reached}"
    )


def scaling_note(study: Study) -> str:
    """How far the law of scaling holds, beside the intervals of the means that use it."""
    compared = list(amplitude.scaling(study))
    by_height: dict[float, list[amplitude.Comparison]] = defaultdict(list)
    for one in compared:
        by_height[one.height].append(one)
    parts, off = [], 0.0
    for height, here in sorted(by_height.items()):
        pairs = sum(one.pairs for one in here)
        mean = sum(one.mean * one.pairs for one in here) / pairs
        off = abs(mean) if height == 2.0 else off
        counted = f"{pairs} pair{'s' * (pairs > 1)} of loops"
        parts.append(f"{100 * mean:+.2f} % at {height:.3g} µm ({counted})")
    half = []
    for turn in (0.6, 0.8):
        for hurst in amplitude.HURSTS:
            losses = np.array(list(amplitude.series(study, hurst, turn, "loss")[2.0].values()))
            low, high = interval(losses)
            half.append(float((high - low) / 2 / losses.mean()))
    return (
        f"The mean differences are {listed(parts)}. They are no numerical errors, and no property "
        "of rough contacts either: they are the choice of the measure sqrt(1 + h'²) of adhesion "
        "beside linear elasticity. Means at 2 µm with Δ~max = 0.6 and 0.8 "
        "rest on it; half their intervals are "
        f"{100 * min(half):.1f} to {100 * max(half):.1f} % of them, so that the law shifts them by "
        f"{off / max(half):.2f} to {off / min(half):.2f} of half an interval: more than a tenth, "
        "which is the bound for numerical errors."
    )


MANY = 100  # profiles of a cell whose spread is well known


def _reach(every: Sequence[Reading], cell: Cell) -> str:
    """The largest mean of a cell, and by how many standard errors it is off the paper's value.

    Also the reading that is nearest in standard errors, if that is another one.
    """
    found = [
        (float(r.means[r.cells.index(cell)]), float(r.z[r.cells.index(cell)]), r.name)
        for r in every
        if cell in r.cells
    ]
    mean, z, name = max(found)
    nearest = min(found, key=lambda one: abs(one[1]))
    other = f"; nearest {nearest[2]}, {abs(nearest[1]):.1f}" if nearest[2] != name else ""
    return (
        f"{mean:.3g} where the paper has {TABLE_1[cell]:g} ({name}: "
        f"{abs(z):.1f} standard errors {'below' if z > 0 else 'above'}{other})"
    )


def readings_note(study: Study) -> str:
    """Whether any reading is compatible, and what reaches the two largest values."""
    every = every_reading(study)
    whole = complete(every)
    verdicts = Counter(reading.verdict for reading in whole)
    best = best_of(whole)
    partly = [r for r in every if len(r.cells) < len(TABLE_1) and r.verdict == "compatible"]
    counted = (
        f"**Of the {len(whole)} readings with all eight values {verdicts['compatible']} "
        f"{'is' if verdicts['compatible'] == 1 else 'are'} compatible, {verdicts['doubtful']} "
        f"doubtful and {verdicts['excluded']} excluded.** The best is {best.name}, with p = "
        f"{drawn_text(best.p)} ± {error_of(best.p):.1g}, where compatible begins at "
        f"{COMPATIBLE:g}. It is selected: p is that of a reading named beforehand, and the best of "
        f"{len(every)} looks better than it is."
    )
    known = [r for r in whole if r.realisations >= MANY]
    few = [r.realisations for r in whole if r.verdict == "doubtful"]
    spread = (
        f" All {len(known)} with {MANY} profiles or more in each cell are excluded; the doubtful "
        f"ones have {span(few)}, so that ten loops or so decide little."
        if all(r.verdict == "excluded" for r in known)
        else ""
    )
    others = (
        f" Of the {len(every) - len(whole)} others, which lack a value or more, "
        f"{listed([f'{r.name} ({len(r.cells)} values)' for r in partly])} "
        f"{'is' if len(partly) == 1 else 'are'} compatible with the values there are."
        if partly
        else ""
    )
    cells = ((0.7, 0.07), (0.8, 0.07))
    fixed = [r for r in every if not r.name.startswith("machine")]
    machines = [r for r in every if r.name.startswith("machine")]
    worst = Counter(reading.worst for reading in every)
    (first, n), (second, m) = worst.most_common(2)
    return (
        f"{counted}{spread}{others}\n\nWhatever the normalisation, spectrum, amplitude law and "
        "turning point, even one chosen cell by cell, the largest means at a fixed separation are "
        f"{' and '.join(_reach(fixed, cell) for cell in cells)}. A standard error is that of the "
        "difference of both means, estimated from the loops that there are. Machines of finite "
        f"stiffness give up to {' and '.join(_reach(machines, cell) for cell in cells)}. "
        f"{TABLE_1[first]:g} lies "
        f"furthest off in {n} of the readings, {TABLE_1[second]:g} in {m}."
    )


def profiles_note(study: Study) -> str:
    """What changes if the paper drew other profiles for each cell."""
    changed = [
        f"{r.name} ({r.verdict}, then {other.verdict})"
        for r in complete(every_reading(study))
        if (other := replace(r, shared=0.0)).verdict != r.verdict
    ]
    csv = "[readings.csv](data/readings.csv)"
    if not changed:
        return f"With other profiles in each cell every verdict is the same ({csv})."
    return (
        f"With other profiles in each cell {len(changed)} of the verdicts on readings with eight "
        f"values change ({csv}): {'; '.join(changed)}."
    )


DRAWN, DRAW_SEED = 20_000, 10


def coverage_note(study: Study) -> str:
    """How often an interval of ten loops holds the mean of two hundred."""
    rng = np.random.default_rng(DRAW_SEED)
    held: dict[str, list[float]] = {}
    for name in ("loss_dimensionless", "loss"):
        held[name] = []
        for campaign in monotone.HUNDREDS:
            rows = study.loops.where(campaign=campaign)
            names = ("hurst", "work_of_adhesion", "max_penetration")
            for place in sorted({*zip(*(rows[n] for n in names), strict=True)}):
                losses = rows.where(**dict(zip(names, place, strict=True)))[name]
                low, high = interval(losses[rng.integers(losses.size, size=(DRAWN, OF_PAPER))])
                held[name].append(float(np.mean((low <= losses.mean()) & (losses.mean() <= high))))
    scaled, plain = (held[name] for name in ("loss_dimensionless", "loss"))
    return (
        f"Their coverage with ten loops, by {DRAWN:,} draws of ten from the two hundred of each of "
        f"{len(scaled)} cells: {100 * np.mean(scaled):.1f} % for W~ ({100 * min(scaled):.1f} to "
        f"{100 * max(scaled):.1f}) and {100 * np.mean(plain):.1f} % for the loss in J/m² "
        f"({100 * min(plain):.1f} to {100 * max(plain):.1f})."
    )
