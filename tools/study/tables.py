"""The numbers of the page, as tables: header and rows of texts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import numpy as np

from adhesis.ensemble.interval import interval
from tools.study import jumps, monotone
from tools.study.data import Study, aligned
from tools.study.table1 import cells, main_readings, stress, tens, under_load, without
from tools.study.text import Table, mean_text, ratio_text


def campaigns(study: Study) -> Table:
    """What was computed."""
    rows = []
    for name in sorted(set(study.loops["campaign"].tolist())):
        done = study.loops.where(campaign=name)
        failed = study.failed.where(campaign=name)
        audit = np.abs(done["audit_residual"]).max()
        error = (done["loss_error"] / done["loss"]).max()
        rows.append(
            [
                name,
                f"{len(done)}",
                f"{len(failed)}",
                f"{int(done['realisation'].max()) + 1}",
                f"{done['cpu_time'].sum() / 60:.1f}",
                f"{audit:.1e}",
                f"{error:.1e}",
                f"{(done['energy_at_stake'] / done['loss']).max():.1e}",
            ]
        )
    header = [
        *("campaign", "loops", "failed", "realisations", "CPU min"),
        *("largest audit residual", "largest estimated error", "largest share at stake in races"),
    ]
    return header, rows


def monotony(study: Study) -> Table:
    """Paired differences between neighbouring H."""
    return _told(monotone.rows(study))


def around(study: Study) -> Table:
    """Long steps on both sides of H = 0.7: seen afterwards, and tested on new phases."""
    both = (("those that suggested it", monotone.HUNDREDS), ("new ones", monotone.NEW))
    header, rows = [], []
    for profiles, campaigns in both:
        found = [monotone.around(study, name, campaigns) for name in monotone.QUANTITIES]
        header, reported = _told([row for row in found if row is not None])
        rows += [[profiles, *row[2:]] for row in reported]
    return ["profiles", *header[2:]], rows


def _told(found: Iterable[monotone.Row]) -> Table:
    rows = []
    for row in found:
        steps = [
            f"{step.hursts[0]:g} → {step.hursts[1]:g}: {100 * step.difference:+.0f} % "
            f"({100 * step.low:+.0f} … {100 * step.high:+.0f})"
            f", p = {min(step.p_rise, step.p_fall):.2g}"
            for step in row.steps
        ]
        name = "W~" if row.quantity == "loss_dimensionless" else "J/m²"
        n = min(step.n for step in row.steps)
        rows.append(
            [f"{row.gamma:g}", f"{row.turn:g}", name, f"{n}", "; ".join(steps), row.verdict]
        )
    return [
        "γ (J/m²)",
        "Δ~max",
        "loss",
        "n",
        "change from one H to the next lower",
        "verdict",
    ], rows


def mechanisms(study: Study) -> Table:
    """Loss and its small-scale share against H."""
    rows = []
    for gamma in (0.01, 0.025, 0.04, 0.07):
        losses = monotone.series(study, gamma, 0.8, "loss_dimensionless")
        small = monotone.series(study, gamma, 0.8, "loss_small_scale")
        whole = monotone.series(study, gamma, 0.8, "loss")
        slopes = monotone.series(study, gamma, 0.8, "m2")
        for hurst in sorted(losses, reverse=True):
            share = aligned(small[hurst], whole[hurst])
            rows.append(
                [
                    f"{gamma:g}",
                    f"{hurst:g}",
                    f"{next(iter(slopes[hurst].values())):.3g}",
                    f"{len(losses[hurst])}",
                    mean_text(np.array(list(losses[hurst].values()))),
                    mean_text(np.array(list(whole[hurst].values())), 1e-3),
                    mean_text(share[0] / share[1], 0.01),
                ]
            )
    return ["γ (J/m²)", "H", "m2", "n", "W~", "loss (mJ/m²)", "small scale (%)"], rows


def turning_point(study: Study) -> Table:
    """What changes between Δ~max = 0.6 and 0.9."""
    quantities: tuple[tuple[str, Callable[[str, float, float, float], dict[int, float]]], ...]

    def column(name: str) -> Callable[[str, float, float, float], dict[int, float]]:
        def of(campaign: str, hurst: float, gamma: float, turn: float) -> dict[int, float]:
            return study.by_realisation(
                name,
                **{"campaign": campaign, "hurst": hurst, "work_of_adhesion": gamma},
                max_penetration=turn,
            )

        return of

    def per_contact(campaign: str, hurst: float, gamma: float, turn: float) -> dict[int, float]:
        loss = column("loss")(campaign, hurst, gamma, turn)
        area = column("largest_contact_fraction")(campaign, hurst, gamma, turn)
        return {r: loss[r] / area[r] for r in loss}

    quantities = (
        ("loss", column("loss")),
        ("pull-off stress", column("pull_off_stress")),
        ("largest contact", column("largest_contact_fraction")),
        ("loss per contact", per_contact),
    )
    rows = []
    for campaign, hurst, gamma in cells(study):
        reported = []
        for _, of in quantities:
            below, above = of(campaign, hurst, gamma, 0.6), of(campaign, hurst, gamma, 0.9)
            if not below or not above:
                break
            low, high = aligned(below, above)
            reported.append(ratio_text(high, low))
        else:
            rows.append([f"{gamma:g}", f"{hurst:g}", f"{low.size}", *reported])
    return ["γ (J/m²)", "H", "n", *(name for name, _ in quantities)], rows


@cache
def law_of(study: Study, branch: str, name: str) -> jumps.PowerLaw:
    """A power law of the jumps of one branch, worked out once."""
    return jumps.power_law(study.jumps.where(branch=branch), name)


def power_laws(study: Study) -> Table:
    """Fits to the jumps."""
    rows = []
    for branch in ("loading", "unloading"):
        for name, title, unit in (
            ("energy_drop", "energy (J/m²)", ""),
            ("area", "area (A/A0)", ""),
        ):
            law = law_of(study, branch, name)
            rows.append(
                [
                    branch,
                    title,
                    f"{law.exponent:.2f} ({law.low:.2f} … {law.high:.2f})",
                    f"{law.smallest:.2g} … {law.largest:.2g}{unit}",
                    f"{law.decades:.1f}",
                    f"{law.n} of {law.of}",
                    f"{law.p:.2g}",
                    f"{law.against_lognormal:.1f}",
                ]
            )
    header = ["branch", "size", "exponent", "range", "decades", "jumps", "p", "against lognormal"]
    return header, rows


def cut_power_laws(study: Study) -> Table:
    """Fits with an exponential cut-off (seen afterwards)."""
    rows = []
    for branch in ("loading", "unloading"):
        for name, title, decades in (("energy_drop", "energy (J/m²)", 4.0), ("area", "area", 2.5)):
            law = jumps.cut_power_law(study.jumps.where(branch=branch), name, decades)
            rows.append(
                [
                    *(branch, title, f"{law.exponent:.2f} ({law.low:.2f} … {law.high:.2f})"),
                    *(f"{law.cut:.2g}", f"{law.smallest:.2g}", f"{law.n} of {law.of}"),
                    f"{law.distance:.3f}",
                ]
            )
    header = ["branch", "size", "exponent", "cut-off", "fitted above", "jumps", "distance"]
    return header, rows


def kinds(study: Study) -> Table:
    """Jumps by branch and kind."""
    rows = []
    loops = len({*zip(study.jumps["hurst"], study.jumps["realisation"], strict=True)})
    for branch in ("loading", "unloading"):
        here = study.jumps.where(branch=branch)
        for kind in sorted(set(here["kind"].tolist())):
            some = here.where(kind=kind)
            energy, area = some["energy_drop"], np.abs(some["area"])
            rows.append(
                [
                    branch,
                    kind,
                    f"{len(some) / loops:.1f}",
                    f"{100 * energy.sum() / study.jumps['energy_drop'].sum():.1f}",
                    f"{np.median(energy):.1e}",
                    f"{energy.max():.1e}",
                    f"{np.median(area):.1e}",
                    f"{area.max():.1e}",
                ]
            )
    header = ["branch", "kind", "a loop", "share of the energy (%)"]
    header += ["median energy (J/m²)", "largest", "median area (A/A0)", "largest"]
    return header, rows


CUTOFFS = (3, 10, 30, 100, 300)


def cutoff_place(hurst: float, ratio: int) -> dict[str, Any]:
    """Where the loops of a cut-off are: at H = 0.8 and 100 among those of `turns`."""
    if ratio < 100:
        return {"campaign": "cutoff", "hurst": hurst, "ratio": ratio}
    if ratio > 100:
        return {"campaign": "cutoff300", "hurst": hurst}
    if hurst < 0.5:
        return {"campaign": "cutoff100", "hurst": hurst}
    return {
        "campaign": "turns",
        "hurst": hurst,
        "work_of_adhesion": 0.04,
        "max_penetration": 0.8,
    }


def cutoff(study: Study) -> Table:
    """Loss against the short-wave cut-off."""
    rows = []
    for hurst in (0.4, 0.8):
        before: dict[int, float] = {}
        for ratio in CUTOFFS:
            place = cutoff_place(hurst, ratio)
            loss = study.by_realisation("loss_dimensionless", **place)
            if not loss:
                continue
            share = aligned(study.by_realisation("loss_small_scale", **place),
                            study.by_realisation("loss", **place))  # fmt: skip
            change = ""
            if before and len(shared := aligned(before, loss)[0]) > 1:
                change = ratio_text(*aligned(before, loss)[::-1])
                assert shared.size
            slope = next(iter(study.by_realisation("m2", **place).values()))
            pull = np.array(list(study.by_realisation("pull_off_stress", **place).values()))
            rows.append(
                [
                    *(f"{hurst:g}", f"{ratio}", f"{slope:.2g}", f"{len(loss)}"),
                    mean_text(np.array(list(loss.values()))),
                    change,
                    mean_text(pull, 1e3),
                    f"{100 * (share[0] / share[1]).mean():.1f}",
                ]
            )
            before = loss
    header = ["H", "q_max/q_min", "m2", "n", "W~", "change from the row above"]
    return [*header, "pull-off (kPa)", "small scale (%)"], rows


def machine(study: Study) -> Table:
    """Loss against the stiffness of the machine."""
    rows = []
    for turn in (0.6, 0.8):
        place = {"hurst": 0.8, "work_of_adhesion": 0.04, "max_penetration": turn}
        fixed = study.by_realisation("loss_dimensionless", campaign="turns", **place)
        for stiffness in (np.inf, 1e10, 3e9, 1e9):
            if np.isinf(stiffness):
                loss = fixed
                failed = 0
            else:
                of = {"campaign": "machine", "stiffness": stiffness, **place}
                loss = study.by_realisation("loss_dimensionless", **of)
                failed = len(study.failed.where(**of))
            if not loss:
                rows.append([f"{turn:g}", f"{stiffness:.0e}", "0", f"{failed}", "", ""])
                continue
            both = aligned(fixed, loss)
            change = "" if np.isinf(stiffness) else ratio_text(both[1], both[0])
            rows.append(
                [
                    f"{turn:g}",
                    "fixed" if np.isinf(stiffness) else f"{stiffness:.0e}",
                    *(
                        f"{len(loss)}",
                        f"{failed}",
                        mean_text(np.array(list(loss.values()))),
                        change,
                    ),
                ]
            )
    return ["u_tot/h_max", "k (Pa/m)", "n", "ran away", "W~", "against fixed separation"], rows


def errors(study: Study) -> Table:
    """Numerical errors of means against their statistical intervals."""
    rows = []
    for turn in (0.6, 0.8):
        place = {"hurst": 0.8, "work_of_adhesion": 0.04, "max_penetration": turn}
        coarse = study.by_realisation("loss", campaign="turns", **place)
        fine = study.by_realisation("loss", campaign="steps", **place)
        if fine:
            both = aligned(coarse, fine)
            reported = f"{abs(both[1].mean() / both[0].mean() - 1):.1e}"
            each = f"{np.abs(both[1] / both[0] - 1).max():.1e}"
            rows.append([f"load steps and accuracy, Δ~max = {turn:g}", reported, each])
    worst = 0.0
    for name in set(study.loops["campaign"].tolist()):
        here = study.loops.where(campaign=name)
        keys = {
            *zip(*(here[k].tolist() for k in ("hurst", "work_of_adhesion", "max_penetration")),
                 strict=True)
        }  # fmt: skip
        for hurst, gamma, turn in keys:
            if np.isnan(turn):
                continue
            cell = here.where(hurst=hurst, work_of_adhesion=gamma, max_penetration=turn)
            for ratio in cell.values("ratio"):
                one = cell.where(ratio=ratio)
                if len(one) >= 5 and np.isnan(one["stiffness"]).all():
                    low, high = interval(one["loss"])
                    worst = max(worst, float(one["loss_error"].mean() / ((high - low) / 2)))
    rows.append(["mean estimated error over half the interval, largest of all cells",
                 f"{worst:.1e}", ""])  # fmt: skip
    return ["", "of the mean", "of the worst loop"], rows


TABLES: dict[str, Callable[[Study], Table]] = {
    "campaigns": campaigns,
    "readings": main_readings,
    "without": without,
    "tens": tens,
    "stress": stress,
    "load": under_load,
    "monotony": monotony,
    "around": around,
    "mechanisms": mechanisms,
    "turning_point": turning_point,
    "power_laws": power_laws,
    "cut_power_laws": cut_power_laws,
    "kinds": kinds,
    "cutoff": cutoff,
    "machine": machine,
    "errors": errors,
}
