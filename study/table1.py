"""The tables on the paper's Table 1: its readings, and what they rest on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from adhesis.ensemble.report.paper import M2, TABLE_1
from study.data import Array, Study, aligned
from study.measure import DRAWS, OF_PAPER, TRANSPOSED, Cell, Reading, verdict_of
from study.readings import (
    FAR_SIDES_COMPUTED,
    STIFF,
    STIFFNESSES,
    Losses,
    along_far_side,
    readings,
)
from study.text import Table, mean_text, p_text

drawn_text = partial(p_text, below=1 / DRAWS)

READING_HEADER = [
    *("reading", "n", *(f"{h:g}, {g:g}" for h, g in TABLE_1)),
    *("largest \\|z\\|", "p", "p, other profiles in each cell", "verdict"),
]


def _reading_row(reading: Reading) -> list[str]:
    means = dict(zip(reading.cells, reading.means, strict=True))
    reported = [f"{means[cell]:.3g}" if cell in means else "" for cell in TABLE_1]
    hurst, gamma = reading.worst
    return [
        *(reading.name, f"{reading.realisations}", *reported),
        f"{reading.largest:.1f} at {hurst:g}, {gamma:g}",
        *(drawn_text(reading.p), drawn_text(replace(reading, shared=0.0).p), reading.verdict),
    ]


@cache
def every_reading(study: Study) -> tuple[Reading, ...]:
    """All readings, computed once."""
    return tuple(readings(study))


def complete(every: Iterable[Reading]) -> list[Reading]:
    """Those that have all values of the paper: only they are ranked."""
    return [reading for reading in every if len(reading.cells) == len(TABLE_1)]


def best_of(every: Iterable[Reading]) -> Reading:
    """The reading with the largest p, of equals that with the smallest largest |z|."""
    return max(every, key=lambda reading: (reading.p, -reading.largest))


def is_main(reading: Reading) -> bool:
    """Whether a reading is of the whole loop, in scales of each profile's own h_max."""
    return "≥" not in reading.name and " h_max" not in reading.name


@cache
def all_readings(study: Study) -> Table:
    """Every reading."""
    rows = [_reading_row(reading) for reading in every_reading(study)]
    paper = ["paper", "10", *(f"{value:g}" for value in TABLE_1.values()), "", "", "", ""]
    return READING_HEADER, [paper, *rows]


def main_readings(study: Study) -> Table:
    """Those of the whole loop with own h_max."""
    header, rows = all_readings(study)
    names = {reading.name for reading in every_reading(study) if is_main(reading)}
    return header, [row for row in rows if row[0] in {"paper", *names}]


def reach(study: Study) -> Table:
    """Smallest and largest mean of each cell over all readings, beside the paper's value."""
    every = every_reading(study)
    worst = Counter(reading.worst for reading in every)
    rows = []
    for cell, paper in TABLE_1.items():
        found = [(float(r.means[r.cells.index(cell)]), r.name) for r in every if cell in r.cells]
        # a reading with few values may still have a large mean
        least, most = min(found), max(found)
        values = [f"{paper:g}", f"{least[0]:.3g}", f"{most[0]:.3g}"]
        over = f"{100 * (paper / most[0] - 1):+.0f} %"
        rows.append([f"{cell[1]:g}", f"{cell[0]:g}", *values, most[1], over, f"{worst[cell]}"])
    header = ["γ (J/m²)", "H", "paper", "smallest mean", "largest mean", "reading of the largest"]
    return [*header, "paper against the largest", "readings with the largest \\|z\\| here"], rows


# Seen afterwards: (what is varied, paper's values, free factors, exponent of m2 in the unit)
VARIANTS: tuple[tuple[str, dict[Cell, float], str, float], ...] = (
    ("as decided", TABLE_1, "none", 0.0),
    ("one free factor for the unit of the loss", TABLE_1, "one", 0.0),
    ("one free factor a row of the table", TABLE_1, "one a row", 0.0),
    ("one free factor times √m2", TABLE_1, "one", 0.5),
    ("42.83 and 49.25 exchanged", TRANSPOSED, "none", 0.0),
    ("exchanged, one free factor", TRANSPOSED, "one", 0.0),
    ("exchanged, one free factor a row", TRANSPOSED, "one a row", 0.0),
    ("exchanged, one free factor times √m2", TRANSPOSED, "one", 0.5),
)


def variant(reading: Reading, paper: dict[Cell, float], factors: str, power: float) -> Reading:
    """One reading with other values of the paper, free factors, or losses times a power of m2."""
    mean = np.mean([m2**power for m2 in M2.values()])
    of_losses = {cell: value * mean / M2[cell[0]] ** power for cell, value in paper.items()}
    return replace(reading, paper=of_losses, factors=factors)


def variants(study: Study) -> Table:
    """Readings with a free unit of the loss, and with two values exchanged (seen afterwards)."""
    every = [reading for reading in complete(every_reading(study)) if is_main(reading)]
    rows = []
    for name, paper, factors, power in VARIANTS:
        changed = [variant(reading, paper, factors, power) for reading in every]
        verdicts = Counter(reading.verdict for reading in changed)
        best = best_of(changed)
        fitted = ", ".join(f"{factor:.2f}" for factor in best.fitted)
        counts = [f"{verdicts[v]}" for v in ("compatible", "doubtful", "excluded")]
        largest = f"{best.largest:.1f} at {best.worst[0]:g}, {best.worst[1]:g}"
        rows.append([name, *counts, best.name, fitted, largest, drawn_text(best.p)])
    header = ["changed", "compatible", "doubtful", "excluded", "best", "its factors"]
    return [*header, "its largest \\|z\\|", "its p"], rows


def factors_of_rows(study: Study) -> Table:
    """The factor that each row of the paper's table asks for, at some turning points."""
    rows = []
    for reading in every_reading(study):
        if reading.name in {f"h_rms, N = 100, Δ~max = {turn:g}" for turn in (0.6, 0.7, 0.8, 0.9)}:
            free = replace(reading, factors="one a row")
            exchanged = replace(free, paper=TRANSPOSED)
            values = [f"{f:.2f}" for f in (*free.fitted, *exchanged.fitted)]
            largest = [f"{r.largest:.1f} at {r.worst[0]:g}, {r.worst[1]:g}"
                       for r in (free, exchanged)]  # fmt: skip
            rows.append([reading.name.split(", ")[-1], *values[:3], largest[0],
                         *values[3:], largest[1]])  # fmt: skip
    hursts = [f"H = {hurst:g}" for hurst in sorted(M2)]
    largest_z = "largest \\|z\\|"
    return ["turning point", *hursts, largest_z, *(f"{h}, exchanged" for h in hursts),
            f"{largest_z}, exchanged"], rows  # fmt: skip


def caption_bounds(study: Study) -> Table:
    """What the separations of the paper's Fig. 3 say of the turning point, in three units."""
    rows = []
    h_max = np.array(list(Losses(study).direct("h_max", 0.8, 0.01, 0.8, 100).values()))
    for unit, scale in (("0.01 h_max", None), ("0.01 µm", 1e-8), ("nm", 1e-9), ("µm", 1e-6)):
        reported = [f"92, 51, 20 {unit}"]
        for s in (92, 51, 20):
            turns = 1 - s * 0.01 * np.ones_like(h_max) if scale is None else 1 - s * scale / h_max
            reported.append(mean_of_turns(turns))
        rows.append(reported)
    return ["separations read as", *(f"Δ~ of {s}" for s in (92, 51, 20))], rows


def mean_of_turns(turns: Array) -> str:
    """Mean of a turning point over profiles, with its range."""
    if turns.max() < 0:
        return f"{turns.mean():.1f}: apart"
    if np.ptp(turns) < 1e-12:
        return f"{turns[0]:.2f}"
    return f"{turns.mean():.3f} ({turns.min():.3f} … {turns.max():.3f})"


STRONG = tuple(cell for cell in TABLE_1 if cell[1] >= 0.04)


def without(study: Study) -> Table:
    """Compatible readings when values of the paper are left out (seen afterwards)."""
    every = [r for r in every_reading(study) if set(STRONG) <= set(r.cells)]
    left_out: list[tuple[Cell, ...]] = [(), *((cell,) for cell in STRONG)]
    left_out.append(((0.8, 0.07), (0.7, 0.07)))
    rows = []
    for cells in left_out:
        kept = tuple(cell for cell in STRONG if cell not in cells)
        cut = [(r.over(kept), r) for r in every]
        (largest, p), best = max(cut, key=lambda one: (one[0][1], -one[0][0]))
        count = sum(verdict_of(p) == "compatible" for (_, p), _ in cut)
        rows.append(
            [
                " and ".join(f"{TABLE_1[c]:g} (H = {c[0]:g}, γ = {c[1]:g})" for c in cells)
                or "none of them",
                f"{count} of {len(cut)}",
                best.name,
                drawn_text(p),
                f"{largest:.1f}",
            ]
        )
    return ["left out", "compatible", "best", "its p", "its largest \\|z\\|"], rows


DRAWN, DRAW_SEED = 100_000, 49


def _means_of_ten(rng: np.random.Generator, values: Array) -> Array:
    """Draw ten values without replacement, those of the smallest random keys, 5000 times."""
    keys = rng.random((5000, values.size))
    tenth = np.partition(keys, OF_PAPER - 1)[:, OF_PAPER - 1 : OF_PAPER]
    return np.asarray((keys <= tenth) @ values / OF_PAPER)


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
            means = np.concatenate([_means_of_ten(rng, values) for _ in range(DRAWN // 5000)])
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


def machines(study: Study) -> Table | str:
    """Loops on machines of finite stiffness, in every cell of the paper."""
    if not any(len(study.loops.where(campaign=name)) for name in STIFF):
        return (
            "Not computed: the time ended the campaigns `stiff` and `stiff001` before a "
            "realisation of all cells was complete."
        )
    rows = []
    for stiffness in STIFFNESSES:
        for (hurst, gamma), paper in TABLE_1.items():
            columns = {
                name: along_far_side(study, hurst, gamma, stiffness, name)
                for name in ("loss_dimensionless", "stress_at_turn", "h_max")
            }
            reported = []
            for far in FAR_SIDES_COMPUTED:
                losses = columns["loss_dimensionless"].get(far, {})
                if not losses:
                    reported.append("none")
                    continue
                stress, h_max = (columns[name][far] for name in ("stress_at_turn", "h_max"))
                reached = np.mean([far - stress[r] / (stiffness * h_max[r]) for r in losses])
                mean = mean_text(np.array(list(losses.values())))
                some = f"{mean}, Δ~ {reached:.2f}, " if mean else ""
                reported.append(f"{some}n = {len(losses)}")
            place = f"{stiffness:.0e}", f"{gamma:g}", f"{hurst:g}", f"{paper:g}"
            rows.append([*place, *reported])
    header = ["k (Pa/m)", "γ (J/m²)", "H", "paper"]
    return [*header, *(f"W~ at u_tot = {far:g} h_max" for far in FAR_SIDES_COMPUTED)], rows


def under_load(study: Study) -> Table:
    """Loops under a load of 500 Pa."""
    rows = []
    for gamma in (0.01, 0.04, 0.07):
        for hurst in (0.7, 0.8, 0.9):
            place = {"campaign": "load", "hurst": hurst, "work_of_adhesion": gamma}
            done, failed = study.loops.where(**place), study.failed.where(**place)
            if len(done) + len(failed) == 0:
                continue
            mean = mean_text(done["loss_dimensionless"])
            contact = f"{done['largest_contact_fraction'].mean():.2f}" if len(done) else ""
            paper = TABLE_1.get((hurst, gamma))
            paper_value = "–" if paper is None else f"{paper:g}"
            counts = f"{len(done)}", f"{len(failed)}"
            rows.append([f"{gamma:g}", f"{hurst:g}", *counts, mean, contact, paper_value])
    header = ["γ (J/m²)", "H", "loops", "into full contact", "W~", "largest A/A0", "paper"]
    return header, rows
