"""The page of an answer: ``trace.md``, ``trace.html``, and their figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from adhesis._version import __version__
from adhesis.ensemble.escape import code_span, markdown, markdown_table, printable
from adhesis.ensemble.quantities import (
    common_unit,
    length_text,
    rounded_percent,
    stress_text,
    with_error,
)
from adhesis.ensemble.report.figures import style
from adhesis.ensemble.report.html import html_page, picture_of, table_of
from adhesis.ensemble.trace.answer import (
    COVERAGE,
    DOUBTS,
    FIGURES,
    LEAST,
    OF_MODEL,
    Answer,
    Uncertain,
)
from adhesis.ensemble.trace.prepare import Prepared
from adhesis.ensemble.trace.single_features import single_features_text
from adhesis.ensemble.trace.variants import TABLES
from adhesis.solver.checks import counted
from adhesis.solver.loading.equilibrium_path import (
    friction_text,
    in_works_of_adhesion,
    sticking_text,
)
from adhesis.solver.loading.zero_range import RANGES, limit_text
from adhesis.solver.model.jump import BRANCHES
from adhesis.solver.model.measured_profile import trace_spectrum

_DIGITS = 3  # of a loss whose interval is 2 % at least
_GREY, _BLUE, _ORANGE = "0.62", "#0072B2", "#D55E00"


def summary(answer: Answer) -> str:
    """The answer in a few lines for the terminal."""
    lines = [f"{name:<11} {text}" for name, text in _findings(answer)]
    lines += [f"WARNING     {w}" for w in answer.warnings if w not in answer.prepared.warnings]
    return printable("\n".join(lines))


def _findings(answer: Answer) -> list[tuple[str, str]]:
    """Return what was found, as names and texts, for the terminal, the page and notebooks."""
    loop, cycle = answer.main, answer.cycle
    note = f" ({loop['loss_note']})" if loop["loss_note"] else ""  # what a load leaves out
    opened = cycle.work_of_adhesion_open
    friction = []
    if opened is not None and opened != cycle.works_of_adhesion[0]:
        parts = opened, loop["loss"], loop["friction"]
        text = friction_text(*parts, varies=cycle.pattern is not None, digits=_DIGITS)
        friction = [("friction", text)]
    doubts = (f"{name} {rounded_percent(share)}" for name, share in answer.loss.doubts.items())
    found = [
        (
            "loss",
            f"{_value(answer.loss, 1e3, 'mJ/m²')}"
            f"{in_works_of_adhesion(answer.loss.value, cycle.works_of_adhesion[0], _DIGITS)}{note}",
        ),
        ("pull-off", f"{_value(answer.pull_off_stress, 1e-3, 'kPa')} mean tension"),
        (
            "contact",
            f"{_value(answer.contact_fraction, 1.0, 'of the nominal area', 1.0)} at most",
        ),
        ("changes", _largest_changes(answer)),
        (
            "loop",
            f"γ = {cycle.works_of_adhesion[0]:g} J/m², to {cycle.turn(cycle.turning_points[0])} "
            f"with h_max = {length_text(loop['h_max'], 4)}; "
            f"{'adhesion on the projection (flat); ' if cycle.measure == 'flat' else ''}"
            f"{loop['waves']} waves, {counted(loop['patches'], 'patch')} at most, "
            f"{counted(loop['jumps'], 'jump')}, "
            f"audit {loop['audit_residual']:.0e}",
        ),
        *friction,
        ("scope", _scope(answer)),
        ("range", _range(answer)),
        (
            "doubts",
            f"{', '.join(doubts)} of the loss (standard uncertainties; the half-width of the "
            f"interval is {COVERAGE:g} times the root of the sum of their squares, at least "
            f"{100 * LEAST:g} %)",
        ),
    ]
    # Without adhesion the loss is rounding, and so is what changes it.
    left_out = () if cycle.works_of_adhesion[0] > 0 else ("changes", "doubts")
    return [entry for entry in found if entry[0] not in left_out]


def _largest_changes(answer: Answer) -> str:
    """Say which decision changes the loss most, by what factor, and whether the interval has it."""
    relative = answer.loss.relative
    low, high = max(1 - relative, 0.0), 1 + relative
    clauses: list[str] = []
    for run, factor in answer.largest_changes:
        against = "" if run.reference == "answer" else f", against “{run.reference}”"
        of = "of the other decisions " if clauses else "most "
        beyond = "" if low <= factor <= high else ", beyond the interval"
        clauses.append(f"{of}by “{run.name}” ({run.description}{against}): × {factor:.3g}{beyond}")
    return "; ".join(clauses) or "no other decision about the trace could be run"


def _scope(answer: Answer) -> str:
    """Describe of what body the loss is, and whether anything presses it."""
    largest = max(answer.main["states"]["mean_stress"])
    pressed = (
        f"the mean stress reaches a compression of {stress_text(largest)}"
        if largest > 0
        else "the mean stress is a tension on the whole loop"
    )
    wide = length_text(answer.main["period"])
    main = answer.main
    of_sticking = ("full_contact_energy", "work_of_adhesion", "contact_fraction")
    sticks = sticking_text(*(main[name] for name in of_sticking))
    clauses = (f"one period of parallel grooves, {wide} wide", pressed, sticks)
    return "; ".join(clause for clause in clauses if clause)


def _range(answer: Answer) -> str:
    """Describe the range of adhesion that is given, or below which zero range holds."""
    if answer.main["work_of_adhesion"] == 0:
        return "without adhesion there is none, and nothing is lost"
    if answer.main["strength"] is not None:
        return str(answer.main["range_summary"])
    inside = "no tension inside patches"
    if answer.valid_range is not None:
        inside = f"tension inside patches of up to {stress_text(answer.largest_interior_tension)}"
    ranges = (getattr(answer, name) for name in RANGES)
    return limit_text(inside, *(math.inf if one is None else one for one in ranges))


def write_page(answer: Answer, folder: Path) -> None:
    """Draw the figures and write ``trace.md`` and ``trace.html`` into a directory that exists."""
    text = page_text(answer, draw_all(answer, folder))
    (folder / "trace.md").write_text(text, encoding="utf-8")
    (folder / "trace.html").write_text(html_page(text, folder), encoding="utf-8")


def notebook_page(answer: Answer) -> str:
    """Return the summary of an answer and the figure of its loop as HTML."""
    rows = (line.split(maxsplit=1) for line in summary(answer).splitlines())
    return table_of((name, text) for name, text in rows) + picture_of(draw_loop(answer))


# ---------------------------------------------------------------------- content


def _value(quantity: Uncertain, by: float, unit: str, most: float = math.inf) -> str:
    """Return a quantity that is not negative, with its interval."""
    known = with_error(by * quantity.value, by * quantity.uncertainty, most)
    share = f" (± {rounded_percent(quantity.relative, 0)})" if "±" in known else ""
    return f"{known} {unit}{share}"


def page_text(answer: Answer, captions: Mapping[str, str]) -> str:
    """Return the page as Markdown, with those figures that were drawn and have a caption."""
    prepared, plan, half_space = answer.prepared, answer.plan, answer.cycle.half_space
    trace = prepared.trace
    name = Path(trace.source).name
    images = {
        stem: f"![{FIGURES[stem]}]({stem}.png)\n\n*{FIGURES[stem]}.* {caption}"
        for stem, caption in captions.items()
    }
    parts = [
        f"# From the trace {code_span(name)} to its loss",
        "\n".join(f"- **{name}**: {text}" for name, text in _findings(answer)),
        f"E = {half_space.young:g} Pa, ν = {half_space.poisson:g}; losses per nominal area.",
        *(f"> **Warning:** {markdown(warning)}" for warning in answer.warnings),
        "## What was read",
        f"- {code_span(name)}: {markdown('; '.join(trace.notes))}\n- {trace.summary}",
        "## What was done to it",
        "\n".join(f"- **{step.name}**: {markdown(step.description)}" for step in prepared.steps),
        "One period: the last 5 % of the trace fade out over the first 5 %, which fade in, "
        "with weights whose squares add up to one.",
        images.get("trace"),
        images.get("spectrum"),
        "## The loop",
        images.get("loop"),
        "## How far it can be trusted",
        "Each doubt is the root mean square of the changes by loops with the decision made "
        "otherwise; cut-offs from × 2 on are drawn, and do not count. The interval is about this "
        "trace, closed to one period; other places of the same surface have other losses.",
        markdown_table(*_doubt_rows(answer), left_columns=1),
        markdown_table(*_variant_rows(answer), left_columns=1),
        images.get("cut-off"),
    ]
    sweep = _sweep_rows(answer)
    if len(sweep) > 2:
        heading = "## Against work of adhesion and turning point"
        parts += [heading, markdown_table(*sweep, left_columns=1), images.get("tables")]
    parts += [
        "## What it took",
        f"{len(plan.runs)} loops in {answer.seconds:.0f} s on {plan.cores} "
        f"(planned: {plan.wall:.0f} s). Every number: `trace.json`. adhesis {__version__}.",
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def _doubt_rows(answer: Answer) -> list[list[str]]:
    rows = [["doubt", "loss", "pull-off", "contact"]]
    quantities = (answer.loss, answer.pull_off_stress, answer.contact_fraction)
    for name, words in (DOUBTS | OF_MODEL).items():
        shares = [q.doubts.get(name) for q in quantities]
        if any(share is not None for share in shares):
            cells = ["" if share is None else rounded_percent(share) for share in shares]
            rows.append([f"{name}: {words}", *cells])
    rows.append(["interval", *(f"± {rounded_percent(q.relative)}" for q in quantities)])
    return rows


def _variant_rows(answer: Answer) -> list[list[str]]:
    rows = [["variant", "loss, mJ/m²", "change", "pull-off, kPa", "contact", "waves", "CPU, s"]]
    for run in answer.plan.runs:
        if run.group in TABLES:
            continue
        found = answer.result(run.name)
        if found is None:
            rows.append([f"{run.name}: failed", *[""] * 6])
            continue
        change = answer.change(run.name) if run.name != "answer" else None
        against = "" if run.reference == "answer" else f" (against {run.reference})"
        rows.append(
            [
                f"{run.name}: {run.description}{against}",
                f"{1e3 * found['loss']:.4g}",
                "" if change is None else rounded_percent(change, sign="+"),
                f"{1e-3 * found['pull_off_stress']:.4g}",
                f"{found['contact_fraction']:.3f}",
                f"{found['waves']}",
                f"{found['seconds']:.1f}",
            ]
        )
    return rows


def _sweep_rows(answer: Answer) -> list[list[str]]:
    cycle = answer.cycle
    gamma, point = cycle.works_of_adhesion[0], cycle.turning_points[0]
    rows = [(g, point, numbers) for g, numbers in answer.works_of_adhesion]
    rows += [(gamma, d, numbers) for d, numbers in answer.turning_points if d != point]
    table = [["γ, J/m²", cycle.turning.sign, "loss, mJ/m²", "pull-off, kPa", "contact", "jumps"]]
    for g, d, r in sorted(rows, key=lambda row: row[:2]):
        pairs = (
            (1e3 * r["loss"], answer.loss),
            (1e-3 * r["pull_off_stress"], answer.pull_off_stress),
        )
        known = [with_error(value, abs(value) * of.relative) for value, of in pairs]
        table.append([f"{g:g}", f"{d:g}", *known, f"{r['contact_fraction']:.3f}", f"{r['jumps']}"])
    return table


# ---------------------------------------------------------------------- figures


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
    unit_x, in_x = common_unit("length", [prepared.trace.length])
    figure = style.new_figure(2, 1, style.TWO_COLUMNS, 3.3, sharex=True)
    above, below = figure.axes
    unit_z, in_z = common_unit("height_range", [prepared.trace.height_range])
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
    unit_z, in_z = common_unit("height_range", [float(np.ptp(level))])
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
        unit, size = common_unit("preload", cycle.turning_points[:1])
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
