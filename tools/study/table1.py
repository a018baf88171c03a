"""The tables on the paper's Table 1: its readings, and what they rest on."""

from __future__ import annotations

from functools import cache

import numpy as np

from adhesis.ensemble.report.paper import TABLE_1
from tools.study.data import Study, aligned
from tools.study.readings import OF_PAPER, Losses, Reading, readings
from tools.study.text import Table, mean_text


def _reading_row(reading: Reading) -> list[str]:
    means = dict(zip(reading.cells, reading.means, strict=True))
    reported = [f"{means[cell]:.3g}" if cell in means else "" for cell in TABLE_1]
    p = "< 1e-5" if reading.p < 1e-5 else f"{reading.p:.2g}"
    hurst, gamma = reading.worst
    return [
        *(reading.name, f"{reading.realisations}", *reported),
        *(f"{np.abs(reading.z).max():.1f} at {hurst:g}, {gamma:g}", p),
        *(f"{reading.log_likelihood:.0f}", reading.verdict),
    ]


READING_HEADER = [
    *("reading", "n", *(f"{h:g}, {g:g}" for h, g in TABLE_1)),
    *("largest \\|z\\|", "p", "ln L", "verdict"),
]


@cache
def every_reading(study: Study) -> tuple[Reading, ...]:
    """All readings, worked out once."""
    return tuple(readings(study))


def all_readings(study: Study) -> Table:
    """Every reading."""
    rows = [_reading_row(reading) for reading in every_reading(study)]
    paper = ["paper", "10", *(f"{value:g}" for value in TABLE_1.values()), "", "", "", ""]
    return READING_HEADER, [paper, *rows]


def main_readings(study: Study) -> Table:
    """Those of the whole loop with own h_max."""
    header, rows = all_readings(study)
    return header, [row for row in rows if "≥" not in row[0] and " h_max" not in row[0]]


STRONG = tuple(cell for cell in TABLE_1 if cell[1] >= 0.04)


def without(study: Study) -> Table:
    """Compatible readings when values of the paper are left out (seen afterwards)."""
    every = [r for r in every_reading(study) if set(STRONG) <= set(r.cells)]
    left_out: list[tuple[tuple[float, float], ...]] = [(), *((cell,) for cell in STRONG)]
    left_out.append(((0.8, 0.07), (0.7, 0.07)))
    rows = []
    for cells in left_out:
        kept = tuple(cell for cell in STRONG if cell not in cells)
        cut = [Reading(r.name, kept, r.losses[[r.cells.index(c) for c in kept]]) for r in every]
        best = max(cut, key=lambda r: (r.p, -np.abs(r.z).max()))
        count = sum(r.verdict == "compatible" for r in cut)
        rows.append(
            [
                " and ".join(f"{TABLE_1[c]:g} (H = {c[0]:g}, γ = {c[1]:g})" for c in cells)
                or "none of them",
                f"{count} of {len(cut)}",
                best.name,
                "< 1e-5" if best.p < 1e-5 else f"{best.p:.2g}",
                f"{np.abs(best.z).max():.1f}",
            ]
        )
    return ["left out", "compatible", "best", "its p", "its largest \\|z\\|"], rows


DRAWN, DRAW_SEED = 100_000, 49


def tens(study: Study) -> Table:
    """Means of ten profiles drawn from hundreds, beside the paper's (seen afterwards)."""
    rng = np.random.default_rng(DRAW_SEED)
    losses = Losses(study)
    rows = []
    for (hurst, gamma), paper in TABLE_1.items():
        reported = []
        for turn in (0.6, 0.8):
            found = losses.direct("loss_dimensionless", hurst, gamma, turn, 100)
            values = np.array(list(found.values()))
            # without replacement: the ten smallest of random keys
            means = np.concatenate(
                [
                    values[np.argpartition(rng.random((5000, values.size)), OF_PAPER)[:, :OF_PAPER]]
                    .mean(axis=1)
                    for _ in range(DRAWN // 5000)
                ]
            )  # fmt: skip
            low, high = np.quantile(means, [0.025, 0.975])
            beyond = int(min((means >= paper).sum(), (means <= paper).sum()))
            reported += [f"{low:.3g} … {high:.3g}", f"{means.min():.3g} … {means.max():.3g}"]
            reported.append(f"{beyond}")
        rows.append([f"{gamma:g}", f"{hurst:g}", f"{values.size}", f"{paper:g}", *reported])
    header = ["γ (J/m²)", "H", "profiles", "paper"]
    for turn in (0.6, 0.8):
        header += [f"95 % at {turn:g}", "least … largest", "as far as the paper"]
    return header, rows


def cells(study: Study) -> list[tuple[str, float, float]]:
    """Campaign, H and γ of the cells that have many turning points."""
    return [
        *(("turns", h, g) for g in (0.04, 0.07) for h in (0.7, 0.8, 0.9)),
        *(("weak", h, 0.01) for h in (0.8, 0.9)),
    ]


def stress(study: Study) -> Table:
    """Mean stress at the turning point, which is no coordinate of the loading branch."""
    rows = []
    for campaign, hurst, gamma in cells(study):
        place = {"campaign": campaign, "hurst": hurst, "work_of_adhesion": gamma}
        found = {
            turn: study.by_realisation("stress_at_turn", max_penetration=turn, **place)
            for turn in (0.6, 0.8, 0.9)
        }
        if not all(found.values()):
            continue
        both = aligned(*found.values())
        lower = int(np.sum(both[2] < both[0]))
        rows.append(
            [
                *(f"{gamma:g}", f"{hurst:g}"),
                *(mean_text(values, 1e3) for values in both),
                f"{lower} of {both.shape[1]}",
            ]
        )
    header = ["γ (J/m²)", "H", *(f"p̄ at {turn} (kPa)" for turn in (0.6, 0.8, 0.9))]
    return [*header, "lower at 0.9 than at 0.6"], rows


def under_load(study: Study) -> Table:
    """Loops under a load of 500 Pa."""
    rows = []
    for gamma in (0.01, 0.04, 0.07):
        for hurst in (0.7, 0.8, 0.9):
            place = {"campaign": "load", "hurst": hurst, "work_of_adhesion": gamma}
            done, failed = study.loops.where(**place), study.failed.where(**place)
            if len(done) + len(failed) == 0:
                continue
            mean = mean_text(done["loss_dimensionless"]) if len(done) > 1 else ""
            contact = f"{done['largest_contact_fraction'].mean():.2f}" if len(done) else ""
            paper = TABLE_1.get((hurst, gamma))
            paper_value = "–" if paper is None else f"{paper:g}"
            counts = f"{len(done)}", f"{len(failed)}"
            rows.append([f"{gamma:g}", f"{hurst:g}", *counts, mean, contact, paper_value])
    header = ["γ (J/m²)", "H", "loops", "into full contact", "W~", "largest A/A0", "paper"]
    return header, rows
