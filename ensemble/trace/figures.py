"""Draw the figures of an answer: trace, spectrum, loop, loss against cut-off, γ, turning point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from adhesis.ensemble.quantities import shown_unit
from adhesis.ensemble.report.figures import style
from adhesis.ensemble.trace.answer import FIGURES, Answer
from adhesis.ensemble.trace.prepare import Prepared
from adhesis.ensemble.trace.single_features import single_features_text
from adhesis.solver.model.jump import BRANCHES
from adhesis.solver.model.measured_profile import trace_spectrum

_GREY, _BLUE, _ORANGE = "0.62", "#0072B2", "#D55E00"


def draw_all(answer: Answer, folder: Path) -> dict[str, str]:
    """Draw all figures for which the answer has data, as PNG and PDF; return their captions."""
    captions = {}
    builders = (_trace, _spectrum, _loop, _cut_off, _tables)
    with style.style():
        for stem, build in zip(FIGURES, builders, strict=True):
            built = build(answer)
            if built is not None:
                figure, captions[stem] = built
                style.save(figure, folder / stem)
    return captions


def _trace(answer: Answer) -> tuple[Figure, str]:
    prepared = answer.prepared
    heights = prepared.trace.heights
    level, profile = prepared.level(), prepared.profile()
    x = prepared.start + prepared.step * np.arange(level.size)
    unit_x, in_x = shown_unit("length", prepared.trace.length)
    figure = style.new_figure(2, 1, style.TWO_COLUMNS, 3.3, sharex=True)
    above, below = figure.axes
    unit_z, in_z = shown_unit("height_range", prepared.trace.height_range)
    measured = prepared.step * np.arange(heights.size)
    above.plot(measured / in_x, heights / in_z, color=_GREY, lw=0.7)
    fit = prepared.filled - level
    sign = -1.0 if any(step.name == "turned over" for step in prepared.steps) else 1.0
    above.plot(x / in_x, sign * fit / in_z, color=_ORANGE, lw=1.0, label="form subtracted")
    if prepared.gaps.any():
        gaps = prepared.gaps
        filled = sign * prepared.filled[gaps] / in_z
        above.plot(x[gaps] / in_x, filled, ".", ms=2.5, color="k", label="interpolated")
    marked = _mark(figure.axes, in_x, prepared)
    above.set(ylabel=f"measured ({unit_z})")
    above.legend(loc="best")
    unit_z, in_z = shown_unit("height_range", float(np.ptp(level)))
    below.plot(x / in_x, level / in_z, color=_GREY, lw=0.7, label="level")
    n = max(4 * profile.highest_harmonic, 2000) + 1
    used = profile.heights(n)
    at = prepared.start + profile.period * np.arange(n) / n
    below.plot(at / in_x, used / in_z, color=_BLUE, lw=0.8, label="used, one period")
    below.set(xlabel=f"position ({unit_x})", ylabel=f"height ({unit_z})")
    below.legend(loc="best", ncols=2)
    return figure, (
        "Above: heights as read, the form that is subtracted, and interpolated heights. "
        "Below: the level trace, and the period of the profile that is used." + marked
    )


def _mark(panels: Sequence[Axes], unit: float, prepared: Prepared) -> str:
    """Shade what is excluded and the single features, on axes in a unit of so many m.

    Returns sentences for the caption.
    """
    marks = (
        ("excluded", _GREY, prepared.excluded),
        ("single feature", _ORANGE, [(one.begin, one.end) for one in prepared.features]),
    )
    for panel, axes in enumerate(panels):
        for label, colour, ranges in marks:
            for index, (begin, end) in enumerate(ranges):
                sides = begin / unit, min(end, prepared.trace.length) / unit
                name = None if index or panel else label
                axes.axvspan(*sides, color=colour, alpha=0.3, lw=0, label=name)
    sentences = ""
    if prepared.excluded:
        sentences += " Shaded in grey: what is excluded."
    if prepared.features:
        sentences += f" Shaded in orange: {single_features_text(prepared.features)}."
    return sentences


def _spectrum(answer: Answer) -> tuple[Figure, str]:
    prepared = answer.prepared
    tilt_only = prepared.filled - prepared.filled.mean()
    before, after = trace_spectrum(tilt_only, prepared.step), prepared.spectrum
    profile = answer.prepared.profile()
    a = np.abs(profile.coefficients[1:]) ** 2 * profile.period
    q = profile.q0 * np.arange(1, profile.coefficients.size)
    figure = style.new_figure(1, 1, style.ONE_COLUMN * 1.5, 2.8)
    (axes,) = figure.axes
    axes.loglog(before.wave_number, before.power, color=_GREY, lw=0.9, label="as measured")
    axes.loglog(after.wave_number, after.power, color="k", lw=0.9, label="level")
    edges = np.unique(np.round(np.geomspace(1, q.size + 1, 60)).astype(int))
    mean = [a[i - 1 : j - 1].mean() for i, j in pairwise(edges)]
    middle = np.sqrt(edges[:-1] * (edges[1:] - 1.0)) * profile.q0
    axes.loglog(middle, mean, color=_BLUE, lw=1.2, label="used")
    if after.floor > 0:
        axes.axhline(after.floor, color=_ORANGE, lw=0.8, ls=":", label="white noise")
    axes.axvline(2 * np.pi / prepared.cut_off, color=_BLUE, lw=0.8, ls="--", label="cut-off")
    low = min(float(np.min(after.power[after.power > 0])), float(np.min(mean)))
    axes.set(
        xlabel="wave number $q$ (rad/m)",
        ylabel="power $C(q)$ (m³)",
        ylim=(0.3 * low, None),
    )
    axes.legend(loc="best")
    return figure, (
        "Power spectrum with Hann's window, averaged over bands, before and after levelling, and "
        "of the profile that is used; its integral over q is π times the mean square height. Where "
        "it meets the noise or bends down at its end, it is no longer that of the surface."
    )


def draw_loop(answer: Answer) -> Figure:
    """Draw the answer's own loop."""
    states = {name: np.array(values) for name, values in answer.main["states"].items()}
    return style.draw_curves(
        (states, states["branch"] == b, style.look_of_branch(b)) for b in BRANCHES
    )


def _loop(answer: Answer) -> tuple[Figure, str]:
    caption = "Mean stress (compression positive) and contact fraction over the whole loop."
    return draw_loop(answer), caption


def _cut_off(answer: Answer) -> tuple[Figure, str] | None:
    prepared = answer.prepared
    rows = [(prepared.cut_off, answer.main["loss"])]
    rows += [(run.changes["cut_off"], found["loss"]) for run, found in answer.group("cut-off")]
    if len(rows) < 3:
        return None
    rows.sort()
    shortest, loss = np.array(rows).T
    figure = style.new_figure(1, 1, style.ONE_COLUMN * 1.5, 2.6)
    (axes,) = figure.axes
    axes.semilogx(1e6 * shortest, 1e3 * loss, "o-", color=_BLUE)
    value = answer.loss
    axes.errorbar(
        [1e6 * prepared.cut_off],
        [1e3 * value.value],
        yerr=[1e3 * value.uncertainty],
        fmt="s",
        color=_ORANGE,
        label="answer, and its interval",
        zorder=3,
    )
    axes.invert_xaxis()
    axes.set(xlabel="shortest wave kept (µm)", ylabel="loss (mJ/m²)")
    top = 1.1e3 * max(float(loss.max()), value.value + value.uncertainty)
    axes.set_ylim(0, top if top > 0 else None)
    axes.xaxis.set_major_locator(LogLocator(base=10, subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.legend(loc="lower right")
    return figure, "Finer to the right. A loss that still changes at the answer is not converged."


def _tables(answer: Answer) -> tuple[Figure, str] | None:
    cycle = answer.cycle
    gammas, turns = answer.works_of_adhesion, answer.turning_points
    turning_point = cycle.turning.symbol
    if cycle.turning.has_unit:
        unit, size = shown_unit("preload", cycle.turning_points[0])
        turns = [(turn / size, row) for turn, row in turns]
        turning_point = f"{turning_point} ({unit})"
    if len(gammas) + len(turns) < 4:
        return None
    figure = style.new_figure(3, 2, style.TWO_COLUMNS, 4.4, sharex="col")
    panels = np.array(figure.axes).reshape(3, 2)
    rows = (
        ("loss", 1e3, "loss (mJ/m²)", answer.loss),
        ("pull_off_stress", 1e-3, "pull-off (kPa)", answer.pull_off_stress),
        ("contact_fraction", 1.0, "largest $A/A_0$", answer.contact_fraction),
    )
    for line, (key, by, label, quantity) in enumerate(rows):
        top = 0.0
        for column, points in enumerate((gammas, turns)):
            axes: Axes = panels[line, column]
            x = [point[0] for point in points]
            y = np.array([by * point[1][key] for point in points])
            bars = quantity.relative * np.abs(y)
            above = np.minimum(bars, 1 - y) if key == "contact_fraction" else bars
            axes.errorbar(x, y, yerr=[bars, above], fmt="o-", color=_BLUE)
            top = max(top, 1.1 * (1 + quantity.relative) * float(y.max()))
        for axes in panels[line]:
            axes.set_ylim(0, top if top > 0 else None)  # without adhesion nothing pulls, or is lost
        panels[line, 0].set_ylabel(label)
    panels[2, 0].set_xlabel(r"work of adhesion $\gamma$ (J/m²)")
    panels[2, 1].set_xlabel(f"turning point: {turning_point}")
    return figure, (
        "Bars: the relative uncertainty of the answer; at the other points it is assumed to be "
        "the same."
    )
