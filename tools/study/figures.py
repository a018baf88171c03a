"""Figures of the study."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adhesis.ensemble.interval import interval
from adhesis.ensemble.report.figures.style import MM, TWO_COLUMNS, new_figure, style
from adhesis.ensemble.report.paper import TABLE_1
from tools.study import jumps, monotone
from tools.study.data import Study
from tools.study.readings import readings
from tools.study.tables import CUTOFFS, cutoff_place

HURSTS = (0.7, 0.8, 0.9)
COLOURS = {0.01: "#0072B2", 0.025: "#009E73", 0.04: "#E69F00", 0.07: "#D55E00"}
MARKERS = {0.01: "o", 0.025: "D", 0.04: "s", 0.07: "^"}


def _points(axes: Axes, x: float, values: list[float], unit: float, **look: Any) -> None:
    data = np.array(values) / unit
    low, high = (float(end) for end in interval(data))
    error = [[data.mean() - low], [high - data.mean()]]
    axes.errorbar([x], [data.mean()], yerr=error, capsize=2, markersize=4, linestyle="", **look)


def _label(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", fontsize="medium")


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
                        *(axes, turn, values.tolist(), unit),
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


def of_readings(study: Study) -> Figure:
    """Means of some readings over the paper's values."""
    shown = [r for r in readings(study) if "≥" not in r.name and " h_max" not in r.name]
    figure = new_figure(1, 1, TWO_COLUMNS, (20 + 4.2 * len(shown)) * MM)
    axes = figure.axes[0]
    cells = list(TABLE_1)
    for place, reading in enumerate(shown):
        for cell, deviation, variance in zip(
            reading.cells, reading.deviation, np.diag(reading.covariance), strict=True
        ):
            aside = (cells.index(cell) - (len(cells) - 1) / 2) * 0.09
            axes.errorbar(
                [np.exp(-deviation)],
                [place + aside],
                xerr=[
                    [np.exp(-deviation) * (1 - np.exp(-2 * np.sqrt(variance)))],
                    [np.exp(-deviation) * (np.exp(2 * np.sqrt(variance)) - 1)],
                ],
                color=COLOURS[cell[1]],
                marker={0.7: "o", 0.8: "s", 0.9: "^"}[cell[0]],
                markersize=3,
                linewidth=0.7,
                linestyle="",
                label=f"H = {cell[0]:g}, γ = {cell[1]:g}" if place == 0 else "_",
            )
    axes.axvline(1, color="0.3", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_xticks([0.3, 0.5, 0.7, 1, 1.5, 2], ["0.3", "0.5", "0.7", "1", "1.5", "2"])
    axes.minorticks_off()
    axes.set_yticks(range(len(shown)), [reading.name for reading in shown])
    axes.invert_yaxis()
    axes.set_xlabel("our mean over the paper's value, ± 2 standard deviations of ten profiles")
    axes.legend(fontsize="x-small", loc="upper right")
    return figure


def against_slope(study: Study) -> Figure:
    """Loss against the mean square slope."""
    figure = new_figure(1, 2, TWO_COLUMNS, 62 * MM)
    for axes, (name, label, unit) in zip(
        figure.axes,
        (("loss_dimensionless", r"loss $\tilde W$", 1.0), ("loss", "loss (mJ/m²)", 1e-3)),
        strict=True,
    ):
        for gamma in COLOURS:
            losses = monotone.series(study, gamma, 0.8, name)
            slopes = monotone.series(study, gamma, 0.8, "m2")
            for k, (hurst, values) in enumerate(sorted(losses.items())):
                _points(
                    *(axes, next(iter(slopes[hurst].values())), list(values.values()), unit),
                    color=COLOURS[gamma],
                    marker=MARKERS[gamma],
                    label=f"γ = {gamma:g} J/m²" if k == 0 else "_",
                )
        axes.set_xscale("log")
        axes.set_xlabel("mean square slope $m_2$")
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0)
    figure.axes[0].legend(fontsize="small")
    return figure


def of_jumps(study: Study) -> Figure:
    """Complementary distributions of energies and areas, with the fits."""
    figure = new_figure(1, 2, TWO_COLUMNS, 66 * MM)
    for axes, (name, label) in zip(
        figure.axes,
        (("energy_drop", "energy drop $e$ (J/m²)"), ("area", r"area $|\Delta A|/A_0$")),
        strict=True,
    ):
        for branch, colour in (("loading", "#0072B2"), ("unloading", "#D55E00")):
            rows = study.jumps.where(branch=branch)
            values = np.sort(np.abs(rows[name]))
            values = values[values > 0]
            share = 1 - np.arange(values.size) / values.size
            axes.plot(values, share, color=colour, label=branch)
            exponent, smallest, _ = jumps.fit(values)
            tail = values[values >= smallest]
            law = (tail / smallest) ** (1 - exponent) * tail.size / values.size
            axes.plot(tail, law, "--", color=colour, label=f"exponent {exponent:.2f}")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_ylim(bottom=1e-4)
        axes.set_xlabel(label)
        axes.set_ylabel("share of larger jumps")
        axes.legend(fontsize="small")
    return figure


def of_cutoff(study: Study) -> Figure:
    """Loss against the short-wave cut-off, and the machine."""
    figure = new_figure(1, 2, TWO_COLUMNS, 62 * MM)
    left, right = figure.axes
    for hurst, colour, marker in ((0.4, "#0072B2", "o"), (0.8, "#D55E00", "s")):
        for ratio in CUTOFFS:
            loss = study.by_realisation("loss_dimensionless", **cutoff_place(hurst, ratio))
            if len(loss) > 1:
                label = f"H = {hurst:g}" if ratio == CUTOFFS[0] else "_"
                _points(
                    left, ratio, list(loss.values()), 1.0, color=colour, marker=marker, label=label
                )
    left.set_xscale("log")
    left.set_xlabel(r"$q_\mathrm{max}/q_\mathrm{min}$")
    left.set_ylabel(r"loss $\tilde W$")
    left.set_ylim(bottom=0)
    left.legend(fontsize="small")
    for turn, colour, marker in ((0.6, "#0072B2", "o"), (0.8, "#D55E00", "s")):
        place = {"hurst": 0.8, "work_of_adhesion": 0.04, "max_penetration": turn}
        fixed = study.by_realisation("loss_dimensionless", campaign="turns", **place)
        mean = np.mean(list(fixed.values()))
        right.axhline(mean, color=colour, linestyle=":")
        for stiffness in (1e9, 3e9, 1e10):
            loss = study.by_realisation(
                "loss_dimensionless", campaign="machine", stiffness=stiffness, **place
            )
            if len(loss) > 1:
                label = f"u_tot = {turn:g} h_max" if stiffness == 1e9 else "_"
                _points(
                    *(right, stiffness, list(loss.values()), 1.0),
                    color=colour,
                    marker=marker,
                    label=label,
                )
    right.set_xscale("log")
    right.set_xlabel("stiffness of the machine (Pa/m)")
    right.set_ylabel(r"loss $\tilde W$")
    right.set_ylim(bottom=0)
    right.legend(fontsize="small")
    return figure


FIGURES: dict[str, Callable[[Study], Figure]] = {
    "turning_points": turning_points,
    "readings": of_readings,
    "slope": against_slope,
    "jumps": of_jumps,
    "cutoff_machine": of_cutoff,
}


def draw_all(folder: Path, to: Path) -> None:
    """Draw every figure of the study in ``folder`` into the folder ``to``."""
    study = Study.at(folder)
    for name, draw in FIGURES.items():
        with style():
            figure = draw(study)
            figure.savefig(to / f"{name}.png", dpi=130)
