"""Expectations of the four readings that were planned later, and what came out."""

from __future__ import annotations

from collections import Counter

import numpy as np

from adhesis.ensemble.report.paper import TABLE_1
from study.data import Study, aligned, by_realisation
from study.measure import Reading
from study.readings import (
    CURVES,
    FAR_SIDES_COMPUTED,
    FEWEST,
    NANOMETRES,
    STIFFNESSES,
    TURNS,
    Losses,
    Series,
    along_far_side,
)
from study.table1 import best_of, complete, drawn_text, every_reading
from study.text import Table

KINDS = {
    "detached ones left out": "detached ones left out",
    "20 nm": "20 nm",
    "machine": "machine of finite stiffness",
    "coarse": "coarse steps",
}
MISSING = "too few loops computed"


def of_kind(study: Study, kind: str) -> list[Reading]:
    """The readings of one kind."""
    return [reading for reading in every_reading(study) if reading.name.startswith(kind)]


def _changes(pairs: list[tuple[Series, Series]]) -> list[float]:
    """Relative changes of the mean from the first to the second, over shared realisations."""
    found = []
    for before, after in pairs:
        if len(set(before) & set(after)) >= FEWEST:
            both = aligned(before, after)
            found.append(float(both[1].mean() / both[0].mean() - 1))
    return found


def _span(values: list[float]) -> str:
    return f"{100 * min(values):+.0f} … {100 * max(values):+.0f} %"


def _compatible(study: Study) -> list[str]:
    reported, missing, any_compatible = [], [], False
    for kind, name in KINDS.items():
        found = of_kind(study, kind)
        if not found:
            missing.append(name)
            continue
        verdicts = Counter(reading.verdict for reading in found)
        counted = ", ".join(f"{k} {verdict}" for verdict, k in verdicts.most_common())
        best = best_of(complete(found) or found)
        hurst, gamma = best.worst
        reported.append(
            f"{name}: {counted}; best {best.name}, largest \\|z\\| {best.largest:.1f} at "
            f"{hurst:g}, {gamma:g}, p {drawn_text(best.p)}"
        )
        any_compatible |= any(r.verdict == "compatible" for r in complete(found))
    if missing:
        reported.append(f"{', '.join(missing)}: {MISSING}")
    verdict = "wrong" if any_compatible else "open" if missing else "holds"
    return ["none of the four is compatible with all eight values", "; ".join(reported), verdict]


def _detached(study: Study) -> list[str]:
    pairs = []
    for hurst, gamma in TABLE_1:
        for turn in TURNS:
            place = {"hurst": hurst, "work_of_adhesion": gamma, "max_penetration": turn}
            pairs.append(
                (study.joined("loss_curve", CURVES, **place),
                 study.joined("loss_in_contact", CURVES, **place))
            )  # fmt: skip
    changes = _changes(pairs)
    expected = "leaving out detached realisations raises all means, by less than a quarter"
    if not changes:
        return [expected, MISSING, "open"]
    holds = min(changes) > 0 and max(changes) < 0.25
    return [expected, f"{_span(changes)} in {len(changes)} cells", "holds" if holds else "wrong"]


def _nanometres(study: Study) -> list[str]:
    expected = "at Δ~max = 0.993 the column of γ = 0.01 J/m² is missed by more than a factor of 3"
    factors = []
    for (hurst, gamma), paper in TABLE_1.items():
        place = {"hurst": hurst, "work_of_adhesion": gamma, "max_penetration": NANOMETRES}
        found = study.joined("loss_dimensionless", CURVES, **place)
        if gamma == 0.01 and len(found) >= FEWEST:
            factors.append(float(np.mean(list(found.values())) / paper))
    if not factors:
        return [expected, MISSING, "open"]
    reported = ", ".join(f"{factor:.1f}" for factor in factors)
    return [expected, f"factors {reported}", "holds" if min(factors) > 3 else "wrong"]


def _machines(study: Study) -> list[str]:
    expected = (
        "a finite stiffness lowers the column of γ = 0.01 J/m², raises those of 0.04 and 0.07, "
        "and comes nearer to the paper than any fixed separation, not to 28.15 and 49.25 at once"
    )
    losses = Losses(study)
    weak, strong = [], []
    for hurst, gamma in TABLE_1:
        for stiffness in STIFFNESSES:
            along = along_far_side(study, hurst, gamma, stiffness)
            for far in FAR_SIDES_COMPUTED[1:]:
                fixed = losses.direct("loss_dimensionless", hurst, gamma, far, 100)
                changes = _changes([(fixed, along.get(far, {}))])
                (weak if gamma == 0.01 else strong).extend(changes)
    found = complete(of_kind(study, "machine"))
    if not found or not weak or not strong:
        return [expected, MISSING, "open"]
    others = [r for r in complete(every_reading(study)) if not r.name.startswith("machine")]
    nearest, fixed_nearest = (min(r.largest for r in rs) for rs in (found, others))
    pair = [tuple(TABLE_1).index(cell) for cell in ((0.9, 0.07), (0.8, 0.07))]
    both = min(float(np.abs(r.z[pair]).max()) for r in found)
    reported = (
        f"γ = 0.01: {_span(weak)}, others: {_span(strong)}; largest \\|z\\| of the nearest one "
        f"{nearest:.1f}, of all other readings {fixed_nearest:.1f}; "
        f"\\|z\\| at 28.15 and 49.25 at best {both:.1f}"
    )
    parts = (max(weak) < 0, min(strong) > 0, nearest < fixed_nearest, both > 2)
    return [expected, reported, "holds" if all(parts) else f"holds in {sum(parts)} of 4 parts"]


def _coarse(study: Study) -> list[str]:
    expected = "the coarse path changes the means by less than 20 %, more with the longer steps"
    losses = Losses(study)
    changes: dict[float, list[float]] = {}
    for step in study.coarse.values("unloading_step"):
        pairs = []
        for hurst, gamma in TABLE_1:
            for turn in TURNS:
                place = {"hurst": hurst, "work_of_adhesion": gamma, "max_penetration": turn}
                rows = study.coarse.where(unloading_step=step, **place)
                pairs.append(
                    (losses.direct("loss_dimensionless", hurst, gamma, turn, 100),
                     by_realisation(rows, "loss_dimensionless"))
                )  # fmt: skip
        if found := _changes(pairs):
            changes[step] = found
    if len(changes) < 2:
        return [expected, MISSING, "open"]
    reported = "; ".join(
        f"unloading in steps of {step:g} h_max: {_span(found)}, on average "
        f"{100 * np.mean(found):+.0f} %"
        for step, found in changes.items()
    )
    sizes = [float(np.mean(np.abs(found))) for found in changes.values()]
    less = max(max(map(abs, found)) for found in changes.values()) < 0.2
    holds = less and sizes[0] < sizes[-1]
    return [expected, reported, "holds" if holds else "wrong"]


def more_findings(study: Study) -> Table:
    """Expectations of the plan for four more readings, and what came out."""
    rows = [_compatible(study), _detached(study), _nanometres(study), _machines(study)]
    return ["expected", "came out", ""], [*rows, _coarse(study)]
