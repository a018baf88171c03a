"""The page of an answer: ``trace.md``, and ``trace.html`` with its figures inside."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from adhesis._version import __version__
from adhesis.ensemble.escape import code_span, markdown, markdown_table, printable
from adhesis.ensemble.quantities import (
    length_text,
    rounded_percent,
    stress_text,
    with_error,
)
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
from adhesis.ensemble.trace.figures import draw_all, draw_loop
from adhesis.ensemble.trace.variants import TABLES
from adhesis.solver.checks import counted
from adhesis.solver.loading.equilibrium_path import (
    friction_text,
    in_works_of_adhesion,
    sticking_text,
)
from adhesis.solver.loading.zero_range import RANGES, limit_text

_DIGITS = 3  # of a loss whose interval is 2 % at least


def summary(answer: Answer) -> str:
    """The answer in a few lines for the terminal."""
    lines = [f"{name:<11} {text}" for name, text in _findings(answer)]
    lines += [f"WARNING     {w}" for w in answer.warnings if w not in answer.prepared.warnings]
    return printable("\n".join(lines))


def _findings(answer: Answer) -> list[tuple[str, str]]:
    """Return what was found, as names and texts, for the terminal, the page and notebooks."""
    loop, cycle = answer.main, answer.cycle
    note = f" ({loop['loss_note']})" if loop["loss_note"] else ""  # what a load leaves out
    patches = f"{loop['patches']} patch{'es' if loop['patches'] != 1 else ''}"
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
            f"{loop['waves']} waves, {patches} at most, {counted(loop['jumps'], 'jump')}, "
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
