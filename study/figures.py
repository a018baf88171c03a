"""Figures of the study."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adhesis.ensemble.campaign.precision import interval
from adhesis.ensemble.report.figures.style import MM, TWO_COLUMNS, new_figure, style
from adhesis.ensemble.report.paper import TABLE_1
from study import amplitude, jumps, monotone
from study.data import Array, Study, aligned
from study.readings import Losses
from study.table1 import every_reading, is_main
from study.tables import CUTOFFS, MACHINES, cut_law_of, cutoff_place, machine_of

HURSTS = (0.7, 0.8, 0.9)
COLOURS = {0.01: "#0072B2", 0.025: "#009E73", 0.04: "#E69F00", 0.07: "#D55E00"}
MARKERS = {0.01: "o", 0.025: "D", 0.04: "s", 0.07: "^"}
OF_HURST = {0.7: ("#D55E00", "o"), 0.8: ("#0072B2", "s"), 0.9: ("#000000", "^")}
OF_TURN = {0.6: ("#0072B2", "o"), 0.8: ("#E69F00", "s"), 0.9: ("#D55E00", "^")}
BLUE, RED = "#0072B2", "#D55E00"


def _points(axes: Axes, x: float, values: Array | list[float], unit: float, **look: Any) -> None:
    data = np.asarray(values) / unit
    low, high = (float(end) for end in interval(data))
    _bar(axes, x, float(data.mean()), low, high, **look)


def _bar(axes: Axes, x: float, mean: float, low: float, high: float, **look: Any) -> None:
    error = [[mean - low], [high - mean]]
    look = {"capsize": 2, "markersize": 4, "linestyle": "", **look}
    axes.errorbar([x], [mean], yerr=error, **look)


def _label(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", fontsize="medium")


def _along_amplitude(
    axes: Axes, study: Study, turn: float, name: str, unit: float, label: bool
) -> None:
    """Means with intervals of a column over the amplitude, a curve for each H."""
    for hurst, (colour, marker) in OF_HURST.items():
        series = amplitude.series(study, hurst, turn, name)
        if not series:
            continue
        means = {h: np.mean(list(one.values())) / unit for h, one in series.items() if len(one) > 2}
        axes.plot(list(means), list(means.values()), color=colour, linewidth=0.7, alpha=0.6)
        for k, (height, values) in enumerate(series.items()):
            if len(values) > 2:
                _points(
                    *(axes, height, list(values.values()), unit),
                    color=colour,
                    marker=marker,
                    label=f"H = {hurst:g}" if label and k == 0 else "_",
                )


HEIGHTS = ([0.25, 0.5, 1, 2, 4, 8], ["0.25", "0.5", "1", "2", "4", "8"])


def _heights(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.set_xticks(*HEIGHTS)
    axes.minorticks_off()


def of_amplitude(study: Study) -> Figure:
    """Loss in J/m² against the amplitude, with the maxima."""
    figure = new_figure(1, 3, TWO_COLUMNS, 72 * MM, sharex=True)
    for axes, turn in zip(figure.axes, amplitude.TURNS, strict=True):
        _along_amplitude(axes, study, turn, "loss", 1e-3, turn == amplitude.TURNS[-1])
        top = 1.06 * axes.get_ylim()[1]
        for k, (hurst, (colour, marker)) in enumerate(OF_HURST.items()):
            found = amplitude.maximum(study, hurst, turn)
            if found is not None:
                place = [[found.height - found.low], [found.high - found.height]]
                axes.errorbar(
                    [found.height], [top * (0.03 + 0.035 * k)], xerr=place, color=colour,
                    marker=marker, markersize=3, capsize=2, linestyle="", linewidth=1,
                )  # fmt: skip
        axes.set_ylim(0, top)
        _heights(axes)
        axes.set_xlabel(r"$h_\mathrm{rms}$ (µm) at $\gamma$ = 0.04 J/m²")
        above = axes.secondary_xaxis(
            "top", functions=(lambda h: _slope(study) * h**2, lambda m: np.sqrt(m / _slope(study)))
        )
        above.set_xlabel(r"$m_2$ at $H$ = 0.8", fontsize="small", labelpad=2)
        above.tick_params(labelsize="x-small", pad=1)
        axes.text(
            *(0.03, 0.97), rf"$\Delta_\mathrm{{max}} = {turn:g}\,h_\mathrm{{max}}$",
            transform=axes.transAxes, ha="left", va="top",
        )  # fmt: skip
    figure.axes[0].set_ylabel("loss (mJ/m²)")
    figure.axes[2].legend(fontsize="small", loc="upper left", bbox_to_anchor=(0, 0.9))
    return figure


def _slope(study: Study) -> float:
    """m2 of H = 0.8 and h_rms = 1 µm."""
    return float(study.loops.where(campaign="cells", hurst=0.8)["m2"][0])


def of_amplitude_state(study: Study) -> Figure:
    """W~, small-scale share, patches and largest contact against the amplitude."""
    rows = (
        ("loss_dimensionless", r"loss $\tilde W$", 1.0),
        ("share", "small scale (%)", 0.01),
        ("patches_at_turn", "patches at\nthe turning point", 1.0),
        ("largest_contact_fraction", r"largest $A/A_0$", 1.0),
    )
    figure = new_figure(len(rows), 3, TWO_COLUMNS, 150 * MM, sharex=True, sharey="row")
    grid = np.array(figure.axes).reshape(len(rows), 3)
    for line, (name, label, unit) in zip(grid, rows, strict=True):
        line[0].set_ylabel(label)
        for axes, turn in zip(line, amplitude.TURNS, strict=True):
            _along_amplitude(axes, study, turn, name, unit, name == "loss_dimensionless")
            if name in ("loss_dimensionless", "patches_at_turn"):
                axes.set_yscale("log")
            _heights(axes)
        if name not in ("loss_dimensionless", "patches_at_turn"):
            line[0].set_ylim(0, 1.05 * line[0].get_ylim()[1])
    for axes, turn in zip(grid[0], amplitude.TURNS, strict=True):
        _label(axes, rf"$\Delta_\mathrm{{max}} = {turn:g}\,h_\mathrm{{max}}$")
    for axes in grid[-1]:
        axes.set_xlabel(r"$h_\mathrm{rms}$ (µm) at $\gamma$ = 0.04 J/m²")
    grid[0, 0].legend(fontsize="small")
    return figure


def turning_points(study: Study) -> Figure:
    """Loss, pull-off stress, largest contact and loss per contact against the turning point."""
    rows = (
        ("loss_dimensionless", r"loss $\tilde W$", 1.0),
        ("pull_off_stress", "pull-off (kPa)", 1e3),
        ("largest_contact_fraction", "largest $A/A_0$", 1.0),
        ("per contact", "loss per contact\n(mJ/m²)", 1e-3),
    )
    figure = new_figure(len(rows), 3, TWO_COLUMNS, 150 * MM, sharex=True, sharey="row")
    grid = np.array(figure.axes).reshape(len(rows), 3)
    for line, (name, label, unit) in zip(grid, rows, strict=True):
        line[0].set_ylabel(label)
        for axes, hurst in zip(line, HURSTS, strict=True):
            for campaign, gamma in (("weak", 0.01), ("turns", 0.04), ("turns", 0.07)):
                cell = study.loops.where(campaign=campaign, hurst=hurst, work_of_adhesion=gamma)
                for turn in cell.values("max_penetration"):
                    here = cell.where(max_penetration=turn)
                    if name == "per contact":
                        values = here["loss"] / here["largest_contact_fraction"]
                    else:
                        values = here[name]
                    first = turn == cell.values("max_penetration")[0]
                    _points(
                        *(axes, turn, values, unit),
                        color=COLOURS[gamma],
                        marker=MARKERS[gamma],
                        label=f"γ = {gamma:g} J/m²" if first else "_",
                    )
                if name == "loss_dimensionless" and (hurst, gamma) in TABLE_1:
                    axes.axhline(TABLE_1[hurst, gamma], color=COLOURS[gamma], linestyle=":")
            axes.set_ylim(bottom=0)
    for axes, hurst in zip(grid[0], HURSTS, strict=True):
        _label(axes, f"H = {hurst:g}")
    for axes in grid[-1]:
        axes.set_xlabel(r"turning point $\Delta_\mathrm{max}/h_\mathrm{max}$")
    grid[0, 1].legend(fontsize="small")
    return figure


def of_table1(study: Study) -> Figure:
    """Losses at three turning points beside the paper's; a panel for each γ."""
    figure = new_figure(1, 3, TWO_COLUMNS, 68 * MM)
    losses = Losses(study)
    for axes, gamma in zip(figure.axes, (0.01, 0.04, 0.07), strict=True):
        for place, hurst in enumerate(sorted(HURSTS, reverse=True)):
            for k, (turn, (colour, marker)) in enumerate(OF_TURN.items()):
                found = losses.direct("loss_dimensionless", hurst, gamma, turn, 100)
                if len(found) > 1:
                    label = rf"$\Delta_\mathrm{{max}} = {turn:g}\,h_\mathrm{{max}}$"
                    _points(
                        *(axes, place + 0.16 * (k - 1.5), list(found.values()), 1.0),
                        color=colour,
                        marker=marker,
                        label=label if place == 1 else "_",
                    )
            if (hurst, gamma) in TABLE_1:
                axes.plot(
                    [place + 0.26], [TABLE_1[hurst, gamma]], "*", color="black", markersize=8,
                    label="paper" if place == 1 else "_",
                )  # fmt: skip
        places = [f"H = {h:g}\n{1e3 * _m2(study, h):.2g}" for h in sorted(HURSTS, reverse=True)]
        axes.set_xticks(range(3), places)
        axes.set_xlim(-0.6, 2.6)
        axes.set_ylim(0, 1.08 * axes.get_ylim()[1])
        axes.minorticks_off()
        _label(axes, f"γ = {gamma:g} J/m²")
        axes.set_xlabel(r"$10^3\,m_2$")
    figure.axes[0].set_ylabel(r"loss $\tilde W$")
    figure.axes[1].legend(fontsize="small", loc="lower right")
    return figure


def _m2(study: Study, hurst: float) -> float:
    return float(study.loops.where(campaign="turns", hurst=hurst)["m2"][0])


def of_readings(study: Study) -> Figure:
    """Draw z of each reading and value of the paper, as a heat map."""
    shown = [reading for reading in every_reading(study) if is_main(reading)]
    cells = list(TABLE_1)
    z = np.full((len(shown), len(cells)), np.nan)
    for line, reading in zip(z, shown, strict=True):
        for cell, value in zip(reading.cells, reading.z, strict=True):
            line[cells.index(cell)] = value
    figure = new_figure(1, 1, TWO_COLUMNS, (26 + 4.4 * len(shown)) * MM)
    axes = figure.axes[0]
    image = axes.imshow(z, cmap="RdBu_r", vmin=-8, vmax=8, aspect="auto")
    for (row, column), value in np.ndenumerate(z):
        if np.isfinite(value):
            shade = "white" if abs(value) > 5 else "black"
            axes.text(
                *(column, row, f"{value:+.1f}"), ha="center", va="center", color=shade, fontsize=6.5
            )
    axes.set_yticks(range(len(shown)), [reading.name for reading in shown], fontsize=7)
    labels = [f"H = {h:g}\nγ = {g:g}\n{TABLE_1[h, g]:g}" for h, g in cells]
    axes.set_xticks(range(len(cells)), labels, fontsize=7)
    axes.xaxis.tick_top()
    axes.tick_params(length=0, which="both")
    axes.minorticks_off()
    axes.grid(False)
    bar = figure.colorbar(image, ax=axes, fraction=0.03, pad=0.01)
    bar.set_label("z: red, the paper's value is larger than ours", fontsize=8)
    return figure


def against_slope(study: Study) -> Figure:
    """Paired change of the loss in J/m² from one H to the next lower one."""
    figure = new_figure(1, 3, TWO_COLUMNS, 66 * MM, sharey=True)
    hursts = (0.95, 0.9, 0.8, 0.7, 0.6, 0.5)
    for axes, turn in zip(figure.axes, (0.6, 0.8, 0.9), strict=True):
        axes.axhline(0, color="0.3", linewidth=0.8)
        for k, gamma in enumerate((0.01, 0.04, 0.07)):
            for first, step in enumerate(_hurst_steps(study, gamma, turn)):
                x = hursts.index(step.ends[0]) + 0.5 + 0.2 * (k - 1)
                label = f"γ = {gamma:g} J/m²" if first == 0 else "_"
                _bar(
                    *(axes, x, 100 * step.difference, 100 * step.low, 100 * step.high),
                    color=COLOURS[gamma],
                    marker=MARKERS[gamma],
                    label=label,
                )
        axes.set_xticks(range(len(hursts)), [f"{h:g}" for h in hursts])
        axes.minorticks_off()
        axes.set_xlim(-0.3, len(hursts) - 0.7)
        _label(axes, rf"$\Delta_\mathrm{{max}} = {turn:g}\,h_\mathrm{{max}}$")
        axes.set_xlabel("$H$ (falls, $m_2$ rises)")
    figure.axes[0].set_ylabel("change of the loss\nfrom one H to the next (%)")
    figure.axes[0].legend(fontsize="small", loc="upper left")
    return figure


def _hurst_steps(study: Study, gamma: float, turn: float) -> Iterable[monotone.Step]:
    many = monotone.series(study, gamma, turn, "loss", monotone.HUNDREDS)
    if len(many) > 1:
        return monotone.row_of(gamma, turn, "loss", many).steps
    height = {0.01: 2.0, 0.04: 1.0}.get(gamma)
    for there, row in amplitude.rows_along_hurst(study, "loss"):
        if there == height and row.turn == turn:
            return row.steps
    first = monotone.series(study, gamma, turn, "loss", monotone.FIRST)
    return monotone.row_of(gamma, turn, "loss", first).steps if len(first) > 1 else ()


def of_jumps(study: Study) -> Figure:
    """Complementary distributions of energies and areas, with power laws that have a cut-off."""
    figure = new_figure(1, 2, TWO_COLUMNS, 70 * MM)
    for axes, (name, label) in zip(
        figure.axes,
        (("energy_drop", "energy drop $e$ (J/m²)"), ("area", r"area $|\Delta A|/A_0$")),
        strict=True,
    ):
        for branch, colour in (("loading", BLUE), ("unloading", RED)):
            rows = study.jumps.where(branch=branch)
            values = np.sort(np.abs(rows[name]))
            values = values[values > 0]
            share = 1 - np.arange(values.size) / values.size
            axes.plot(values, share, color=colour, label=branch)
            law = cut_law_of(study, branch, name)
            x = np.geomspace(law.smallest, values[-1], 200)
            of_all = law.n / law.of
            curves = [of_all * jumps.share_above(x, law.smallest, *one) for one in law.drawn]
            low, high = np.quantile(curves, [0.025, 0.975], axis=0)
            axes.fill_between(x, low, high, color=colour, alpha=0.25, linewidth=0)
            axes.plot(
                *(x, of_all * jumps.share_above(x, law.smallest, law.exponent, law.cut), "--"),
                color=colour,
                label=f"exponent {law.exponent:.2f}, cut-off {law.cut:.2g}",
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_ylim(1e-4, 2)
        axes.set_xlabel(label)
        axes.set_ylabel("share of larger jumps")
        axes.legend(fontsize="small", loc="lower left")
    figure.axes[0].set_xlim(left=1e-7)
    return figure


def of_cutoff(study: Study) -> Figure:
    """Paired change with the short-wave cut-off, and with the stiffness of the machine."""
    figure = new_figure(1, 2, TWO_COLUMNS, 68 * MM)
    left, right = figure.axes
    for aside, (hurst, colour, marker) in enumerate(((0.4, BLUE, "o"), (0.8, RED, "s"))):
        place = cutoff_place(hurst, 30)
        base = study.by_realisation("loss_dimensionless", **place)
        for ratio in CUTOFFS:
            loss = study.by_realisation("loss_dimensionless", **cutoff_place(hurst, ratio))
            both = aligned(base, loss) if loss else np.empty((2, 0))
            if both.shape[1] > 1 and ratio != 30:
                label = f"H = {hurst:g}" if ratio == CUTOFFS[0] else "_"
                change = (both[1] - both[0]) / both[0].mean()
                _points(
                    *(left, ratio * 1.08 ** (2 * aside - 1), change, 0.01),
                    color=colour,
                    marker=marker,
                    label=label,
                )
    left.axhline(0, color="0.3", linewidth=0.8)
    left.set_xscale("log")
    left.set_xticks(CUTOFFS, [f"{ratio}" for ratio in CUTOFFS])
    left.minorticks_off()
    left.set_xlabel(r"$q_\mathrm{max}/q_\mathrm{min}$")
    left.set_ylabel("change of the loss\nagainst $q_\\mathrm{max}/q_\\mathrm{min}$ = 30 (%)")
    left.legend(fontsize="small")
    right.axhline(0, color="0.3", linewidth=0.8)
    for k, (turn, colour) in enumerate(((0.6, BLUE), (0.8, RED))):
        for stiffness in MACHINES:
            of = machine_of(study, turn, stiffness)
            for j, (both, marker, fill) in enumerate(
                ((of.same_far_side, "s", "white"), (of.same_penetration, "o", colour))
            ):
                name = (r"at $\Delta = u_\mathrm{tot}$", "at the Δ reached")[j]
                label = rf"$u_\mathrm{{tot}} = {turn:g}\,h_\mathrm{{max}}$, {name}"
                x = stiffness * 1.09 ** (2 * (2 * k + j) - 3)
                change = (both[1] - both[0]) / both[0].mean()
                _points(
                    *(right, x, change, 0.01),
                    color=colour,
                    marker=marker,
                    markerfacecolor=fill,
                    label=label if stiffness == MACHINES[0] else "_",
                )
            right.text(
                *(stiffness, -22 - 11 * k, f"{of.reached.mean():.2f}"),
                ha="center", va="center", fontsize="x-small", color=colour,
            )  # fmt: skip
    right.text(
        *(0.01, 0.02), "Δ/h_max reached:", transform=right.transAxes, fontsize="x-small",
        va="bottom",
    )  # fmt: skip
    right.set_ylim(bottom=-50)
    right.set_xscale("log")
    right.set_xlabel("stiffness of the machine (Pa/m)")
    right.set_ylabel("change of the loss\nagainst a fixed separation (%)")
    right.legend(fontsize="x-small")
    return figure


FIGURES: dict[str, Callable[[Study], Figure]] = {
    "amplitude": of_amplitude,
    "amplitude_state": of_amplitude_state,
    "table1": of_table1,
    "turning_points": turning_points,
    "readings": of_readings,
    "slope": against_slope,
    "jumps": of_jumps,
    "cutoff_machine": of_cutoff,
}


def draw_all(folder: Path) -> None:
    """Draw every figure of the study's folder."""
    study = Study.at(folder)
    for name, draw in FIGURES.items():
        with style():
            figure = draw(study)
            figure.savefig(folder / "figures" / f"{name}.png", dpi=160)
