"""Sentences of the study's pages whose numbers follow from the results."""

from __future__ import annotations

from collections import Counter, defaultdict

import numpy as np

from adhesis.ensemble.interval import interval
from adhesis.ensemble.report.paper import TABLE_1
from tools.study import amplitude
from tools.study.data import Study
from tools.study.table1 import complete, every_reading

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
        return "No case through the amplitude is open."
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
    return f"Open through the amplitude: {cases}{after}."


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
        f"The mean differences are {listed(parts)}. They are no numerical errors: the law is an "
        "approximation of the model for small slopes. Means at 2 µm with Δ~max = 0.6 and 0.8 "
        "rest on it; half their intervals are "
        f"{100 * min(half):.1f} to {100 * max(half):.1f} % of them, so that the law shifts them by "
        f"{off / max(half):.2f} to {off / min(half):.2f} of half an interval: more than a tenth, "
        "which is the bound for numerical errors."
    )


def readings_note(study: Study) -> str:
    """Whether any reading is compatible, and what reaches the two largest values."""
    every = every_reading(study)
    whole = complete(every)
    compatible = sum(reading.verdict == "compatible" for reading in whole)
    partly = [r for r in every if len(r.cells) < len(TABLE_1) and r.verdict == "compatible"]
    worst = Counter(reading.worst for reading in every)
    (first, n), (second, m) = worst.most_common(2)
    cells = ((0.7, 0.07), (0.8, 0.07))
    largest = {
        machine: [
            max(
                float(r.means[r.cells.index(cell)])
                for r in every
                if cell in r.cells and r.name.startswith("machine") == machine
            )
            for cell in cells
        ]
        for machine in {r.name.startswith("machine") for r in every}
    }
    fixed = " and ".join(
        f"{mean:.3g} where the paper has {TABLE_1[cell]:g}"
        for mean, cell in zip(largest[False], cells, strict=True)
    )
    means = " and ".join(f"{mean:.3g}" for mean in largest.get(True, ()))
    machines = f" Machines of finite stiffness give up to {means} there." if means else ""
    others = (
        f" Of the {len(every) - len(whole)} others, which lack a value or more, "
        f"{', '.join(f'{r.name} ({len(r.cells)} values)' for r in partly)} is compatible with the "
        "values that it has."
        if partly
        else ""
    )
    return (
        f"**{compatible or 'None'} of the {len(whole)} readings with all eight values does.**"
        f"{others} Whatever the normalisation, spectrum, "
        "amplitude law and turning point, even one chosen cell by cell, the largest means at a "
        f"fixed separation are {fixed}.{machines} {TABLE_1[first]:g} lies furthest off in {n} of "
        f"the readings, {TABLE_1[second]:g} in {m}."
    )
