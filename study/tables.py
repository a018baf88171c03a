"""The numbers of the page, as tables: header and rows of texts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from adhesis.ensemble.campaign.precision import interval
from study import amplitude, jumps, monotone
from study.data import Array, Study, aligned
from study.readings import Losses, at_turns
from study.table1 import (
    caption_bounds,
    cells,
    factors_of_rows,
    machines,
    main_readings,
    reach,
    stress,
    tens,
    under_load,
    variants,
    without,
)
from study.text import Table, change_text, mean_text, p_equals, p_text, ratio_text


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
    return _row_table(monotone.rows(study))


def around(study: Study) -> Table:
    """Long steps on both sides of H = 0.7: seen afterwards, and tested on new phases."""
    both = (("those that suggested it", monotone.HUNDREDS), ("new ones", monotone.NEW))
    header, rows = [], []
    for profiles, campaigns in both:
        found = [monotone.around(study, name, campaigns) for name in monotone.QUANTITIES]
        header, reported = _row_table([row for row in found if row is not None])
        rows += [[profiles, *row[2:]] for row in reported]
    return ["profiles", *header[2:]], rows


LOSSES = {"loss_dimensionless": "W~", "loss": "J/m²"}


def steps_text(row: monotone.Row) -> str:
    """The steps of a row."""
    return "; ".join(
        f"{step.ends[0]:.3g} → {step.ends[1]:.3g}: "
        f"{change_text(step.difference, step.low, step.high)}, {p_equals(step.p)}"
        for step in row.steps
    )


def _row_table(found: Iterable[monotone.Row]) -> Table:
    rows = []
    for row in found:
        place = [f"{row.gamma:g}", f"{row.turn:g}", LOSSES[row.quantity]]
        n = min(step.n for step in row.steps)
        rows.append([*place, f"{n}", steps_text(row), row.verdict])
    header = ["γ (J/m²)", "Δ~max", "loss", "n", "change from one H to the next lower", "verdict"]
    return header, rows


def _column(study: Study, hurst: float, turn: float, name: str, height: float) -> Array:
    return np.array(list(amplitude.series(study, hurst, turn, name).get(height, {}).values()))


def amplitudes(study: Study) -> Table:
    """Loss, shares and contact against the amplitude at γ = 0.04 J/m²."""
    rows = []
    for turn in amplitude.TURNS:
        for hurst in amplitude.HURSTS:
            for height in amplitude.series(study, hurst, turn, "loss"):
                column = partial(_column, study, hurst, turn, height=height)
                loss = column("loss")
                patches = column("patches_at_turn")
                rows.append(
                    [
                        *(f"{turn:g}", f"{hurst:g}", f"{height:.3g}"),
                        *(f"{column('m2')[0]:.2g}", f"{loss.size}"),
                        mean_text(loss, 1e-3),
                        mean_text(loss, amplitude.GAMMA),
                        mean_text(column("loss_dimensionless")),
                        mean_text(column("share"), 0.01),
                        mean_text(patches) if patches.size else "",
                        mean_text(column("largest_contact_fraction")),
                    ]
                )
    header = ["Δ~max", "H", "h_rms (µm)", "m2", "n", "loss (mJ/m²)", "loss/γ", "W~"]
    return [*header, "small scale (%)", "patches at the turning point", "largest A/A0"], rows


def maxima(study: Study) -> Table:
    """Amplitude at which the loss in J/m² is largest."""
    rows = []
    for turn in amplitude.TURNS:
        for hurst in amplitude.HURSTS:
            found = amplitude.maximum(study, hurst, turn)
            if found is None:
                continue
            at_end = f"{100 * found.at_end:.0f} %"
            unit = next(iter(amplitude.series(study, hurst, turn, "m2").items()))
            slope = next(iter(unit[1].values())) / unit[0] ** 2
            ends = [found.height, found.low, found.high]
            heights = [
                "{:.2f} ({:.2f} … {:.2f})".format(*(h * np.sqrt(gamma / 0.04) for h in ends))
                for gamma in (0.01, 0.04, 0.07)
            ]
            m2 = "{:.2g} ({:.2g} … {:.2g})".format(*(slope * h**2 for h in ends))
            loss = f"{found.loss:.3g} ({found.loss_low:.3g} … {found.loss_high:.3g})"
            rows.append([f"{turn:g}", f"{hurst:g}", *heights, m2, loss, at_end])
    header = ["Δ~max", "H", *(f"h_rms (µm), γ = {gamma:g}" for gamma in (0.01, 0.04, 0.07))]
    return [*header, "m2, γ = 0.04", "loss/γ there", "resamples with the maximum at an end"], rows


def through_amplitude(study: Study) -> Table:
    """Steps along the amplitude, at every γ."""
    rows = []
    for name in monotone.QUANTITIES[::-1]:
        for hurst, row in amplitude.rows(study, name):
            rows.append(
                [
                    *(LOSSES[name], f"{row.turn:g}", f"{hurst:g}"),
                    *(steps_text(row), row.verdict, p_of_verdict(row)),
                ]
            )
    header = ["loss", "Δ~max", "H", "change from one h (µm) to the next larger", "verdict", "p"]
    return header, rows


def p_of_verdict(row: monotone.Row) -> str:
    """Error probability of a verdict; of an open row that of either."""
    one, other = p_text(row.p_not_monotone), p_text(row.p_monotone)
    if row.verdict == "open":
        return f"not monotone {one}, monotone {other}"
    return one if row.verdict == "not monotone" else other


def through_hurst(study: Study) -> Table:
    """Steps along H, at every amplitude."""
    rows = []
    for name in monotone.QUANTITIES[::-1]:
        for height, row in amplitude.rows_along_hurst(study, name):
            n = min(step.n for step in row.steps)
            rows.append(
                [
                    *(LOSSES[name], f"{row.turn:g}", f"{height:.3g}", f"{n}"),
                    *(steps_text(row), row.verdict, p_of_verdict(row)),
                ]
            )
    header = ["loss", "Δ~max", "h at γ = 0.04 (µm)", "n", "change from one H to the next lower"]
    return [*header, "verdict", "p"], rows


def at_paper_gammas(study: Study, name: str) -> dict[tuple[float, float], monotone.Row]:
    """Steps of a loss along H at h_rms = 1 µm, by γ and turning point."""
    known = {(row.turn, height): row for height, row in amplitude.rows_along_hurst(study, name)}
    found = {}
    for gamma, height in amplitude.OF_PAPER.items():
        for turn in amplitude.TURNS:
            if (turn, height) in known:
                found[gamma, turn] = known[turn, height]
            else:
                first = monotone.series(study, gamma, turn, name, monotone.FIRST)
                found[gamma, turn] = monotone.row_of(gamma, turn, name, first)
    return found


def answer(study: Study) -> Table:
    """Whether W~, and the loss in J/m², are monotone in m2: the paper's γ, each turning point."""
    along = {
        name: {(row.turn, hurst): row for hurst, row in amplitude.rows(study, name)}
        for name in monotone.QUANTITIES
    }
    across = {name: at_paper_gammas(study, name) for name in monotone.QUANTITIES}
    rows = []
    for gamma in amplitude.OF_PAPER:
        for turn in amplitude.TURNS:
            reported = []
            for name in monotone.QUANTITIES:
                row = across[name][gamma, turn]
                ups = [along[name].get((turn, hurst)) for hurst in amplitude.HURSTS]
                verdicts = Counter(one.verdict for one in ups if one)
                counted = ", ".join(f"{verdict} ({k} of 3 H)" for verdict, k in verdicts.items())
                rises_and_falls = "not monotone" in verdicts
                p = max(
                    one.p_not_monotone if rises_and_falls else one.p_monotone for one in ups if one
                )
                reported += [row.verdict, p_of_verdict(row), counted, p_text(p)]
            n = min(step.n for step in across["loss"][gamma, turn].steps)
            rows.append([f"{gamma:g}", f"{turn:g}", *reported, f"{n}"])
    header = ["γ (J/m²)", "Δ~max"]
    for title in ("W~", "J/m²"):
        header += [f"{title}, through H", "p", f"{title}, through amplitude"]
        header.append("p of the least certain H")
    return [*header, "n, through H"], rows


def scaling(study: Study) -> Table:
    """Loops at an equivalent work of adhesion against those of higher or lower profiles."""
    rows = []
    for one in amplitude.scaling(study):
        place = f"{one.height:.3g}", f"{one.gamma:g}", f"{one.turn:g}", f"{one.pairs}"
        ends = f" ({100 * one.low:+.2f} … {100 * one.high:+.2f})" if one.pairs > 1 else ""
        differences = f"{100 * one.mean:+.2f} %{ends}", f"{100 * one.largest:.2f} %"
        rows.append([*place, *differences, f"{100 * one.slope:.2f} %", f"{100 * one.error:.2f} %"])
    header = ["h_rms at γ = 0.04 J/m² (µm)", "compared with 1 µm at γ =", "Δ~max", "pairs of loops"]
    header += ["mean difference of W~", "largest", "half the difference of m2 (largest)"]
    return [*header, "sum of the estimated errors (largest)"], rows


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
    """A power law of the jumps of one branch, computed once."""
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
                    p_text(law.p, 1 / jumps.RESAMPLES),
                    f"{law.against_lognormal:.1f}",
                ]
            )
    header = ["branch", "size", "exponent", "range", "decades", "jumps", "p", "against lognormal"]
    return header, rows


@cache
def cut_law_of(study: Study, branch: str, name: str) -> jumps.CutPowerLaw:
    """A power law with a cut-off of the jumps of one branch, computed once."""
    decades = {"energy_drop": jumps.ENERGY_DECADES, "area": jumps.AREA_DECADES}[name]
    return jumps.cut_power_law(study.jumps.where(branch=branch), name, decades)


def cut_power_laws(study: Study) -> Table:
    """Fits with an exponential cut-off (seen afterwards)."""
    rows = []
    for branch in ("loading", "unloading"):
        for name, title in (("energy_drop", "energy (J/m²)"), ("area", "area")):
            law = cut_law_of(study, branch, name)
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


MACHINES = (1e10, 3e9, 1e9)


@dataclass(frozen=True)
class Machine:
    """Loops at a stiffness and a turning point of the far side, beside those at fixed separation.

    Attributes
    ----------
    reached : array
        Δ~ at the turning point.
    losses : array
        W~.
    same_far_side : array, shape (2, realisations)
        W~ with a fixed separation at Δ~ = u_tot/h_max, and W~.
    same_penetration : array, shape (2, realisations)
        W~ with a fixed separation at the Δ~ reached, and W~.
    """

    failed: int
    reached: Array
    losses: Array
    same_far_side: Array
    same_penetration: Array


def machine_of(study: Study, turn: float, stiffness: float) -> Machine:
    """Compare at the same far side, and at the same penetration reached."""
    place = {"hurst": 0.8, "work_of_adhesion": 0.04}
    of = {"campaign": "machine", "stiffness": stiffness, "max_penetration": turn, **place}
    column = {
        name: study.by_realisation(name, **of)
        for name in ("loss_dimensionless", "stress_at_turn", "h_max")
    }
    reached = {
        r: turn - stress / (stiffness * column["h_max"][r])
        for r, stress in column["stress_at_turn"].items()
    }
    fixed = study.by_realisation(
        "loss_dimensionless", campaign="turns", max_penetration=turn, **place
    )
    along = Losses(study).along(0.8, 0.04)
    there = at_turns(along, lambda r: reached.get(r, np.nan), beyond=0.0)
    loss = column["loss_dimensionless"]
    return Machine(
        len(study.failed.where(**of)),
        np.array(list(reached.values())),
        np.array(list(loss.values())),
        aligned(fixed, loss),
        aligned(there, loss),
    )


def machine(study: Study) -> Table:
    """Loss against the stiffness of the machine."""
    rows = []
    for turn in (0.6, 0.8):
        for stiffness in MACHINES:
            of = machine_of(study, turn, stiffness)
            span = f"{of.reached.mean():.2f} ({of.reached.min():.2f} … {of.reached.max():.2f})"
            rows.append(
                [
                    *(f"{turn:g}", f"{stiffness:.0e}", f"{of.losses.size}", f"{of.failed}"),
                    *(span, mean_text(of.losses), ratio_text(*of.same_far_side[::-1])),
                    f"{ratio_text(*of.same_penetration[::-1])}, n = {of.same_penetration.shape[1]}",
                ]
            )
    header = ["u_tot/h_max", "k (Pa/m)", "n", "ran away", "Δ~ reached", "W~"]
    return [*header, "against fixed separation at Δ~ = u_tot/h_max", "at the Δ~ reached"], rows


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
            *zip(*(here[k].tolist() for k in
                   ("hurst", "work_of_adhesion", "max_penetration", "h_rms")), strict=True)
        }  # fmt: skip
        for hurst, gamma, turn, h_rms in keys:
            if np.isnan(turn):
                continue
            cell = here.where(
                hurst=hurst, work_of_adhesion=gamma, max_penetration=turn, h_rms=h_rms
            )
            for ratio in cell.values("ratio"):
                one = cell.where(ratio=ratio)
                if len(one) >= 5 and np.isnan(one["stiffness"]).all():
                    low, high = interval(one["loss"])
                    worst = max(worst, float(one["loss_error"].mean() / ((high - low) / 2)))
    rows.append(["mean estimated error over half the interval, largest of all cells",
                 f"{worst:.1e}", ""])  # fmt: skip
    return ["", "of the mean", "of the worst loop"], rows


TABLES: dict[str, Callable[[Study], Table | str]] = {
    "answer": answer,
    "amplitudes": amplitudes,
    "maxima": maxima,
    "through_amplitude": through_amplitude,
    "through_hurst": through_hurst,
    "scaling": scaling,
    "campaigns": campaigns,
    "reach": reach,
    "readings": main_readings,
    "variants": variants,
    "factors": factors_of_rows,
    "captions": caption_bounds,
    "without": without,
    "tens": tens,
    "stress": stress,
    "load": under_load,
    "machines": machines,
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
