"""The findings of the study in words, with their numbers."""

from __future__ import annotations

from collections import Counter

import numpy as np

from tools.study import monotone
from tools.study.data import Study
from tools.study.table1 import every_reading
from tools.study.tables import (
    cutoff,
    errors,
    law_of,
    machine,
    turning_point,
)
from tools.study.text import Table


def _change(text: str) -> float:
    """The mean of "+96 % (+84 … +106)"."""
    return float(text.split(" ")[0])


def _span(texts: list[str]) -> str:
    values = [_change(text) for text in texts]
    return f"{min(values):+.0f} … {max(values):+.0f} %"


def _readings(study: Study) -> list[str]:
    every = every_reading(study)
    verdicts = Counter(reading.verdict for reading in every)
    worst = Counter(reading.worst for reading in every)
    (hurst, gamma), often = worst.most_common(1)[0]
    best = max(every, key=lambda reading: reading.p)
    p = "below 1e-5" if best.p < 1e-5 else f"{best.p:.1g}"
    numbers = Counter(len(reading.cells) for reading in every)
    reported = ", ".join(f"{count} with {n} values" for n, count in sorted(numbers.items()))
    return [
        "some readings are compatible with all values of Table 1",
        f"of {len(every)} readings ({reported}) {verdicts['compatible']} are compatible, "
        f"{verdicts['doubtful']} doubtful, {verdicts['excluded']} excluded; the best, "
        f"{best.name}, has p {p}; the value that lies furthest off is most often H = {hurst:g}, "
        f"γ = {gamma:g} ({often} readings)",
        "holds" if verdicts["compatible"] else "wrong",
    ]


def _monotone(study: Study) -> list[str]:
    rows = [row for row in monotone.rows(study) if min(step.n for step in row.steps) >= 10]
    verdicts = {
        name: Counter(row.verdict for row in rows if row.quantity == name)
        for name in ("loss_dimensionless", "loss")
    }
    reported = "; ".join(
        f"{title}: "
        + ", ".join(f"{count} {verdict}" for verdict, count in sorted(verdicts[name].items()))
        for name, title in (("loss_dimensionless", "W~"), ("loss", "J/m²"))
    )
    both = any(counts["rises"] and counts["falls"] for counts in verdicts.values())
    seen = any(counts["not monotone"] for counts in verdicts.values())
    new = monotone.around(study, "loss", monotone.NEW)
    if new is not None:
        n = min(step.n for step in new.steps)
        fresh = f"{n} new profiles, J/m²: {new.verdict}"
        reported += f"; H = 0.9, 0.7, 0.5 at γ = 0.04 and 0.6, {fresh}"
        seen = seen or new.verdict == "not monotone"
    return [
        "the loss is not monotone in m2 (the paper's guess)",
        f"rows with ten realisations or more: {reported}",
        "seen"
        if seen
        else "not seen at one γ and turning point; the sign of the change depends on them"
        if both
        else "not seen",
    ]


def _weakly(text: str, n: int) -> str:
    """What a change by more than 5 % at H = 0.4 is worth."""
    if not text or n < 4:
        return "; open for H = 0.4"
    low = float(text.split("(")[1].split(" ")[0])
    if abs(_change(text)) <= 5:
        return "; wrong for H = 0.4"
    return "; holds for H = 0.4" + ("" if low > 5 else " on average, likewise")


def findings(study: Study) -> Table:
    """Expected, and what came out."""
    _, turns = turning_point(study)
    turns = [row for row in turns if int(row[2]) >= 4]
    loss, pull, per = ([row[k] for row in turns] for k in (3, 4, 6))
    quarter = all(abs(_change(b)) < 0.25 * abs(_change(a)) for a, b in zip(loss, pull, strict=True))
    less = all(abs(_change(b)) < abs(_change(a)) for a, b in zip(loss, per, strict=True))
    laws = [
        law_of(study, branch, name)
        for name in ("energy_drop", "area")
        for branch in ("loading", "unloading")
    ]
    sound = sum(law.p >= 0.05 and law.decades > 1 for law in laws)
    _, cut = cutoff(study)
    change = {(row[0], row[1]): row[5] for row in cut}
    counts = {(row[0], row[1]): row[3] for row in cut}
    _, machines = machine(study)
    soft = [row[5] for row in machines if row[1] == "1e+09"]
    _, error = errors(study)
    ratio = float(error[-1][1])
    converged = abs(_change(change["0.8", "100"])) < 5
    other = change.get(("0.4", "100"), "")
    rows = [
        _readings(study),
        _monotone(study),
        [
            "1. the loss grows with the turning point, the pull-off stress changes less than a "
            "quarter as much",
            f"loss {_span(loss)}, pull-off stress {_span(pull)} from 0.6 to 0.9",
            "holds" if quarter else "wrong: pull-off depends on the turning point as much",
        ],
        [
            "2. the loss per largest contact changes less than the loss",
            f"{_span(per)}, against {_span(loss)}",
            "holds" if less else "wrong",
        ],
        [
            "3. energies and areas of jumps are power laws over more than a decade, with one "
            "exponent on both branches",
            f"{sound} of {len(laws)} fits over more than a decade have p ≥ 0.05; exponents of the "
            + ", ".join(
                f"{name} {a.exponent:.2f} and {b.exponent:.2f}"
                for name, a, b in (("energies", *laws[:2]), ("areas", *laws[2:]))
            ),
            "holds" if sound == len(laws) else "wrong",
        ],
        [
            "4. from q_max/q_min = 30 to 100 the loss changes by less than 5 % for H = 0.8, by "
            "more for H = 0.4",
            f"H = 0.8: {change['0.8', '100']}; H = 0.4: {other or 'too few loops'} "
            f"(n = {counts.get(('0.4', '100'), '0')})",
            (
                "holds for H = 0.8 on average, within a wider interval"
                if converged
                else "wrong for H = 0.8"
            )
            + _weakly(other, int(counts.get(("0.4", "100"), "0"))),
        ],
        [
            "5. the softer the machine, the larger the loss",
            f"k = 1e9 Pa/m against a fixed separation: {' and '.join(soft)} at 0.6 and 0.8",
            "holds" if all(_change(text) > 0 for text in soft) else "wrong",
        ],
        [
            "6. the numerical error of every mean is below a tenth of its interval",
            f"largest: {ratio:.1e} of half the interval",
            "holds" if ratio < 0.1 else "wrong",
        ],
    ]
    assert np.isfinite(ratio)
    return ["expected", "came out", ""], rows
