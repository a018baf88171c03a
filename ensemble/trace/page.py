"""The page of an answer: ``trace.md``, and ``trace.html`` with its figures inside."""

from __future__ import annotations

import base64
import html
import re
from importlib import metadata
from pathlib import Path

from adhesis.ensemble.escape import code_span, markdown, printable
from adhesis.ensemble.lengths import length_text
from adhesis.ensemble.quantities import in_works_of_adhesion
from adhesis.ensemble.trace.answer import _DOUBTS, COVERAGE, Answer, Quantity
from adhesis.ensemble.trace.figures import Drawn, draw_all
from adhesis.solver.checks import counted

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 54em; margin: 2em auto; padding: 0 1em;
  color: #222; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; margin: 1em 0; } th, td { padding: .2em .8em; text-align: right;
  border-bottom: 1px solid #ddd; } td + td { white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
img { max-width: 100%; } figure { margin: 1em 0; } figcaption { color: #555; font-size: .9em; }
.warning { background: #fff3d6; border-left: 4px solid #E69F00; padding: .4em .8em; }
code { background: #f3f3f3; padding: 0 .2em; }
"""

Block = tuple[str, list[list[str]] | str]
"""Kind ("h1", "h2", "p", "warning", "list", "table") and content; rows for lists and tables."""


def summary(answer: Answer) -> str:
    """The answer in a few lines for the terminal."""
    loop = answer.main
    lines = [
        f"loss        {_value(answer.loss, 1e3, 'mJ/m²')}"
        f"{in_works_of_adhesion(answer.loss.value, answer.cycle.works_of_adhesion[0])}",
        f"pull-off    {_value(answer.pull_off_stress, 1e-3, 'kPa')} mean tension",
        f"contact     {_value(answer.contact_fraction, 1.0, 'of the nominal area')} at most",
        f"loop        γ = {answer.cycle.works_of_adhesion[0]:g} J/m², to "
        f"{answer.cycle.turn(answer.cycle.turning_points[0])} with h_max = "
        f"{length_text(loop['h_max'], 4)}; "
        f"{loop['waves']} waves, {loop['patches']} patch{'es' if loop['patches'] != 1 else ''} at "
        f"most, {counted(loop['jumps'], 'jump')}, "
        f"audit {loop['audit_residual']:.0e}",
        f"range       {_range(answer)}",
        "doubts      "
        + ", ".join(f"{name} {_percent(share)}" for name, share in answer.loss.doubts.items())
        + " of the loss (standard uncertainties; the half-width of the interval is "
        f"{COVERAGE:g} times the root of the sum of their squares)",
        *(f"WARNING     {w}" for w in answer.warnings if w not in answer.prepared.warnings),
    ]
    return printable("\n".join(lines))


def _range(answer: Answer) -> str:
    """Say below which range of adhesion the zero-range limit holds."""
    if answer.valid_range is None:
        return "no tension inside patches"
    return (
        f"adhesion of a range below {length_text(answer.valid_range, 3)} is of zero range here: "
        f"largest tension inside patches {1e-6 * answer.largest_interior_tension:.3g} MPa"
    )


def write_page(answer: Answer, folder: Path) -> None:
    """Draw the figures and write ``trace.md`` and ``trace.html`` into a directory that exists."""
    figures = draw_all(answer, folder)
    blocks = _blocks(answer)
    (folder / "trace.md").write_text(_markdown(blocks, figures), encoding="utf-8")
    (folder / "trace.html").write_text(_html(blocks, figures, answer), encoding="utf-8")


# ---------------------------------------------------------------------- content


def _value(quantity: Quantity, by: float, unit: str) -> str:
    unit = f" {unit}" if unit else ""
    known = _with_interval(by * quantity.value, by * quantity.uncertainty)
    return f"{known}{unit} (± {_percent(quantity.relative, 0)})"


def _with_interval(value: float, half: float) -> str:
    """Digits down to the first one of the interval."""
    digits = 0
    while digits < 6 and half * 10**digits < 9.5:
        digits += 1
    digits = max(digits - 1, 0)
    return f"{value:.{digits}f} ± {half:.{digits}f}"


def _percent(share: float, digits: int = 1, sign: str = "") -> str:
    """Per cent, and no sign of what rounds to nothing."""
    rounded = round(100 * share, digits) or 0.0
    return f"{rounded:{sign if rounded else ''}.{digits}f} %"


def _blocks(answer: Answer) -> list[Block]:
    prepared, trace, cycle, loop = (
        answer.prepared,
        answer.prepared.trace,
        answer.cycle,
        answer.main,
    )
    half_space = cycle.half_space
    blocks: list[Block] = [
        ("h1", f"From the trace {markdown(trace.path.name)} to its loss"),
        (
            "p",
            f"Loss **{_value(answer.loss, 1e3, 'mJ/m²')}** of nominal area"
            f"{in_works_of_adhesion(answer.loss.value, cycle.works_of_adhesion[0])}, pull-off at a "
            "mean "
            f"tension of **{_value(answer.pull_off_stress, 1e-3, 'kPa')}**, contact fraction at "
            f"most **{_value(answer.contact_fraction, 1.0, '')}**: one loop to "
            f"{cycle.turn(cycle.turning_points[0])} (h_max = {length_text(loop['h_max'], 4)}) and "
            f"off again, with γ = {cycle.works_of_adhesion[0]:g} J/m², "
            f"E = {half_space.young:g} Pa, ν = {half_space.poisson:g}.",
        ),
        *(("warning", markdown(warning)) for warning in answer.warnings),
        ("h2", "What was read"),
        (
            "list",
            [
                [f"{code_span(trace.path.name)}: {markdown('; '.join(trace.said))}"],
                [
                    f"{trace.points} points, step {length_text(trace.step, 5)}, "
                    f"length {length_text(trace.length, 5)}, "
                    f"range of heights {length_text(trace.height_range, 4)}, "
                    f"{counted(trace.drop_outs, 'drop-out')}"
                ],
            ],
        ),
        ("h2", "What was done to it"),
        ("list", [[f"**{step.name}**: {markdown(step.said)}"] for step in prepared.steps]),
        (
            "p",
            "One period: the last 5 % of the trace fade out over the first 5 %, which fade in, "
            "with weights whose squares add up to one.",
        ),
        ("figure", "trace"),
        ("figure", "spectrum"),
        ("h2", "The loop"),
        ("figure", "loop"),
        ("p", f"Range: {_range(answer)} (least of the loop and its variants)."),
        ("h2", "How far it can be trusted"),
        (
            "p",
            "Each doubt is measured by running the loop with the decision made otherwise. "
            "Standard uncertainty: the root mean square of the changes; the interval is "
            f"{COVERAGE:g} times the root of the sum of their squares. It is about this trace, "
            "closed to one period; other places of the same surface have other losses.",
        ),
        ("table", _doubt_table(answer)),
        ("table", _variant_table(answer)),
        ("figure", "cut-off"),
    ]
    mirror = answer.change("mirror")
    if mirror is not None:
        blocks.append(
            (
                "p",
                f"A mirror image instead changes the loss by {_percent(mirror, sign='+')}. It is "
                "not counted: it is a body of twice the period, and the loss grows with the "
                "period.",
            )
        )
    tables = _sweep_table(answer)
    if len(tables) > 2:
        blocks += [
            ("h2", "Against work of adhesion and turning point"),
            ("table", tables),
            ("figure", "tables"),
        ]
    plan = answer.plan
    blocks += [
        ("h2", "What it took"),
        (
            "p",
            f"{len(plan.runs)} loops in {answer.seconds:.0f} s on {plan.processes} cores (planned: "
            f"{plan.wall:.0f} s). Every number: `trace.json`. adhesis {_version()}.",
        ),
    ]
    return blocks


def _doubt_table(answer: Answer) -> list[list[str]]:
    rows = [["doubt", "loss", "pull-off", "contact"]]
    quantities = (answer.loss, answer.pull_off_stress, answer.contact_fraction)
    for name in (*_DOUBTS, "numerics"):
        shares = [q.doubts.get(name) for q in quantities]
        if any(share is not None for share in shares):
            words = _DOUBTS.get(name, "of the loop itself")
            cells = ["" if share is None else _percent(share) for share in shares]
            rows.append([f"{name}: {words}", *cells])
    rows.append(["interval", *(f"± {_percent(q.relative)}" for q in quantities)])
    return rows


def _variant_table(answer: Answer) -> list[list[str]]:
    rows = [["variant", "loss, mJ/m²", "change", "pull-off, kPa", "contact", "waves", "CPU, s"]]
    for run in answer.plan.runs:
        if run.group in ("work of adhesion", "turning point"):
            continue
        found = answer.result(run.name)
        if found is None:
            rows.append([f"{run.name}: failed", *[""] * 6])
            continue
        change = answer.change(run.name) if run.name != "answer" else None
        against = "" if run.reference == "answer" else f" (against {run.reference})"
        rows.append(
            [
                f"{run.name}: {run.said}{against}",
                f"{1e3 * found['loss']:.4g}",
                "" if change is None else _percent(change, sign="+"),
                f"{1e-3 * found['pull_off_stress']:.4g}",
                f"{found['contact_fraction']:.3f}",
                f"{found['waves']}",
                f"{found['seconds']:.1f}",
            ]
        )
    return rows


def _sweep_table(answer: Answer) -> list[list[str]]:
    cycle = answer.cycle
    gamma, point = cycle.works_of_adhesion[0], cycle.turning_points[0]
    turn = (
        "p̄, Pa" if cycle.control.is_load else "Δ/h_max" if cycle.control.is_fixed else "u_tot/h_max"
    )
    rows = [(gamma, point, answer.main)]
    rows += [(float(n.split()[1]), point, r) for n, _, r in answer.group("work of adhesion")]
    rows += [(gamma, float(n.split()[1]), r) for n, _, r in answer.group("turning point")]
    head = ["γ, J/m²", turn, "loss, mJ/m²", "pull-off, kPa", "contact", "jumps"]
    return [
        head,
        *(
            [
                f"{g:g}",
                f"{d:g}",
                _with_interval(1e3 * r["loss"], 1e3 * abs(r["loss"]) * answer.loss.relative),
                _with_interval(
                    1e-3 * r["pull_off_stress"],
                    1e-3 * r["pull_off_stress"] * answer.pull_off_stress.relative,
                ),
                f"{r['contact_fraction']:.3f}",
                f"{r['jumps']}",
            ]
            for g, d, r in sorted(rows, key=lambda row: row[:2])
        ),
    ]


# ---------------------------------------------------------------------- form


def _markdown(blocks: list[Block], figures: list[Drawn]) -> str:
    drawn = {figure.path.stem: figure for figure in figures}
    out = []
    for kind, content in blocks:
        if kind == "figure":
            found = drawn.get(str(content))
            if found:
                out.append(
                    f"![{found.title}]({found.path.name})\n\n*{found.title}.* {found.caption}"
                )
        elif kind in ("h1", "h2"):
            out.append("#" * int(kind[1]) + f" {content}")
        elif kind == "warning":
            out.append(f"> **Warning:** {content}")
        elif kind == "list":
            out.append("\n".join(f"- {row[0]}" for row in content))
        elif kind == "table":
            rows = [f"| {' | '.join(row)} |" for row in content]
            rows.insert(1, "|---|" + "---:|" * (len(content[0]) - 1))
            out.append("\n".join(rows))
        else:
            out.append(str(content))
    return "\n\n".join(out) + "\n"


def _html(blocks: list[Block], figures: list[Drawn], answer: Answer) -> str:
    drawn = {figure.path.stem: figure for figure in figures}
    out = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f"<title>{html.escape(printable(answer.prepared.trace.path.name))}: its loss</title>",
        f"<style>{_STYLE}</style></head><body>",
    ]
    for kind, content in blocks:
        if kind == "figure":
            found = drawn.get(str(content))
            if found:
                data = base64.b64encode(found.path.read_bytes()).decode()
                out.append(
                    f'<figure><img alt="{html.escape(found.title)}" '
                    f'src="data:image/png;base64,{data}"><figcaption><b>{html.escape(found.title)}.'
                    f"</b> {html.escape(found.caption)}</figcaption></figure>"
                )
        elif kind in ("h1", "h2"):
            out.append(f"<{kind}>{_inline(str(content))}</{kind}>")
        elif kind == "warning":
            out.append(f'<p class="warning"><b>Warning:</b> {_inline(str(content))}</p>')
        elif kind == "list":
            items = "".join(f"<li>{_inline(row[0])}</li>" for row in content)
            out.append(f"<ul>{items}</ul>")
        elif kind == "table":
            head = "".join(f"<th>{_inline(cell)}</th>" for cell in content[0])
            body = "".join(
                "<tr>" + "".join(f"<td>{_inline(cell)}</td>" for cell in row) + "</tr>"
                for row in content[1:]
            )
            out.append(f"<table><tr>{head}</tr>{body}</table>")
        else:
            out.append(f"<p>{_inline(str(content))}</p>")
    return "\n".join([*out, "</body></html>"]) + "\n"


def _version() -> str:
    try:
        return metadata.version("adhesis")
    except metadata.PackageNotFoundError:
        return "(not installed)"


# A code span, an escaped character, or the beginning or end of bold text.
_MARKUP = re.compile(
    r"(?P<ticks>`+)(?P<code>.+?)(?<!`)(?P=ticks)(?!`)|\\(?P<char>.)|(?P<bold>\*\*)"
)


def _inline(text: str) -> str:
    """Return a line of Markdown as HTML: bold and code; everything else is text."""
    out, place, is_bold = [], 0, False
    for found in _MARKUP.finditer(text):
        out.append(html.escape(text[place : found.start()], quote=False))
        place = found.end()
        if found["bold"]:
            is_bold = not is_bold
            out.append("<b>" if is_bold else "</b>")
        elif found["code"]:
            out.append(f"<code>{html.escape(found['code'].strip(), quote=False)}</code>")
        else:
            out.append(html.escape(found["char"], quote=False))
    return "".join([*out, html.escape(text[place:], quote=False)])
