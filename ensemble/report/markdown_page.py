"""``report.md``: the report as one page, figures embedded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.campaign.tables import TURNING_POINTS
from adhesis.ensemble.escape import code_span, fence, markdown, printable
from adhesis.ensemble.interval import FEWEST_FOR_SKEWNESS, interval_method
from adhesis.ensemble.quantities import in_one_unit
from adhesis.ensemble.report import findings, paper
from adhesis.ensemble.report.figures.catalogue import Illustration
from adhesis.ensemble.report.figures.style import left_out
from adhesis.ensemble.report.further_axes import short_of_preload, shown_cells
from adhesis.ensemble.report.tables import loss_tables
from adhesis.ensemble.report.tables import mechanisms as mechanism_tables
from adhesis.solver.loading.zero_range import ANY_RANGE


def write_page(data: Aggregate, figures: Mapping[str, Sequence[Illustration]]) -> str:
    """Return the text of the page, with the figures that were drawn, by section."""
    of_paper = paper.are_its_cells(data.shown.cells)

    numbered = [i for name in ("losses", "loops") for i in figures.get(name, ()) if i.of_paper]

    def show(section: str) -> list[str]:
        items = figures.get(section, ())
        return [_shown(item, data, of_paper, item in numbered[:1]) for item in items]

    losses, known = loss_tables.losses(data), loss_tables.precision(data)
    out = [
        f"# Hysteresis loops of {code_span(data.path.name)}",
        markdown(" ".join(findings.verdict(data))),
        *_bullets([*findings.pattern(data), *findings.precision(data), *findings.missing(data)]),
        _summary(data),
        left_out(data),
        shown_cells(data),
        "## Losses",
        losses.markdown(),
        _footnote(data),
        *(["### Precision of the mean (`[stop]`)", known.markdown()] if known.rows else []),
        *show("losses"),
        *(["### Along further axes", *show("axes")] if figures.get("axes") else []),
    ]
    beside = loss_tables.beside_the_paper(data)
    if beside.rows:
        out += ["## What agrees with the paper, and what does not", beside.markdown()]
    else:
        out += ["## What the averages show"]
    out += _bullets(findings.agreement(data))
    growth = loss_tables.paired(data)
    if growth.rows:
        out += [
            "### Growth of the loss with γ, profile by profile",
            "The same profiles serve every γ, so the growth is known better than from two "
            "independent sets of profiles.",
            growth.markdown(),
        ]
    if data.companions:
        out += [
            "## Beside other campaigns",
            "The same realisations of both campaigns, profile by profile.",
            loss_tables.companions(data).markdown(),
            *_bullets(findings.readings(data)),
        ]
    out += ["## Loops", *show("loops")]
    if figures.get("fields"):
        out += ["## Shapes, spectra and distributions", *show("fields")]
        slopes = mechanism_tables.slopes(data, ("loading",))
        if slopes.rows:
            out += [
                "### Slope of the spectrum of the deformed surface on loading",
                "Power law fitted at small wave numbers: over the lowest decade of the profile's "
                "spectrum, or its lower half if it is shorter than two decades; standard error "
                "of the fit. Unloading: `slopes.csv`.",
                slopes.markdown(),
            ]
    out += [
        "## Mechanisms",
        "A jump is *small scale* if edges only run inside existing patches (spreading, receding), "
        "and *large scale* if patches come or go (snap-in, merging, splitting, vanishing, "
        "pull-off)."
        + (
            " The jump at which a weight falls off is of neither: its drop closes the loop, and "
            "may be negative."
            if data.campaign.cycle.under_load
            else ""
        ),
        mechanism_tables.mechanisms(data).markdown(),
        *show("mechanisms"),
        "### Share of the drops by kind of the jump",
        mechanism_tables.shares_by_kind(data).markdown(),
        "Numbers of jumps: `jumps.csv`.",
        "## Approach and separation",
        loss_tables.works(data).markdown(),
        "Works per nominal area, and the same over the largest contact area of the loop: effective "
        "works of adhesion on approach and separation, and their difference. Full contact: its "
        "elastic energy, to be set beside γ. With intervals: `works.csv`.",
        "## Profiles",
        loss_tables.profiles(data).markdown(),
        "## Accuracy and completeness",
        *_bullets(findings.quality(data)),
    ]
    if data.failures:
        out += [
            "### Failed tasks",
            *_bullets([f"row {row}: {text or 'no reason given'}" for row, text in data.failures]),
        ]
    out += ["## The campaign", _toml(data.campaign.text), _origin(data)]
    return "\n\n".join(part for part in out if part) + "\n"


def _summary(data: Aggregate) -> str:
    sweep, cycle = data.campaign.sweep, data.campaign.cycle
    further = "".join(
        f"{axis.name} = {in_one_unit(axis.name, axis.values)}; "
        for axis in data.further
        if axis.name not in TURNING_POINTS
    )
    many = f"{sweep.realisations} realisations"
    if data.campaign.stop.relative_error is not None:
        counts = [cell.done for cell in data.cells]
        many = f"{min(counts)} to {max(counts)} realisations by `[stop]`"
    return (
        f"{data.done} loops of {data.done + data.failed + data.pending} tasks: "
        f"H = {in_one_unit('hurst', sweep.hurst)}; "
        f"γ = {in_one_unit('work_of_adhesion', sweep.work_of_adhesion)}; {further}"
        f"{many}. Each loop was loaded to {findings.turning_point(data)} "
        f"in {cycle.load_steps} steps and unloaded until detached; "
        f"method `{data.campaign.solver.method}`. Numbers: `losses.csv`; curves: `curves.nc`."
    )


def _footnote(data: Aggregate) -> str:
    counts = {cell.done for cell in data.cells}
    methods = {interval_method(n) for n in counts} - {"none"}
    both = "Student's t and Hall's transformation of it, the further end on each side"
    interval = {
        frozenset(): "",
        frozenset({"transformed"}): f"; 95 % interval of the mean by {both}",
        frozenset({"student"}): "; 95 % interval of the mean by Student's t",
        frozenset({"transformed", "student"}): f"; 95 % interval of the mean by {both}, for "
        f"fewer than {FEWEST_FOR_SKEWNESS} realisations by Student's t",
    }[frozenset(methods)]
    kinds = {companion.kind for companion in data.companions}
    steps = (
        "the difference from the campaign with other load steps beside this one"
        if "load steps" in kinds
        else "mean |loop integral - sum of drops|"
    )
    parts = [
        "W~ = ∮ σ~ dΔ~ with σ~ = 2p̄/(E* q0 h_max) and Δ~ = Δ/h_max, each realisation with its own "
        f"h_max; s.e.: standard error of the mean{interval}",
        "± loop: mean of the estimated numerical error of a loop",
        f"± steps: {steps}",
    ]
    if data.campaign.cycle.under_load:
        parts.append("under a weight: closed at the separation of its fall")
    if short_of_preload(data.cells):
        parts.append("short: loops that turned before their preload was reached")
    if any(cell.work_of_adhesion > 0 for cell in data.cells):
        parts.append("W/γ: loss over work of adhesion")
    if "resolution" in kinds:
        parts.append(
            "± method: the difference from the campaign with another accuracy or method beside it"
        )
    parts.append("audit: largest |loop integral - sum of drops| / loss")
    if any(np.sum(cell.values["races"]) for cell in data.cells):
        parts.append(
            "races: jumps that another rule of descent would have ended elsewhere, all loops"
        )
    if any(np.isfinite(cell.least_range).any() for cell in data.cells):
        parts.append(
            "range: range of adhesion below which the zero-range limit holds (the least of "
            f"{ANY_RANGE} of all loops)"
        )
    if paper.are_its_cells(data.shown.cells):
        parts.append(f"paper: {paper.REFERENCE}, Table 1, – where it gives none")
    return "; ".join(parts) + "."


def _origin(data: Aggregate) -> str:
    shown = ("adhesis_version", "commit", "created", "mpi", "hdf5", "fftw")
    parts = [
        f"{name} {markdown(str(data.attributes[name]))}"
        for name in shown
        if data.attributes.get(name)
    ]
    return f"Results file: {'; '.join(parts)}." if parts else ""


def _toml(text: str) -> str:
    text = printable(text.replace("\r\n", "\n").strip())
    return f"{fence(text)}toml\n{text}\n{fence(text)}"


def _bullets(sentences: Sequence[str]) -> list[str]:
    return ["\n".join(f"- {markdown(sentence)}" for sentence in sentences)] if sentences else []


def _shown(item: Illustration, data: Aggregate, of_paper: bool, first_numbered: bool) -> str:
    title = f"{item.title} (paper's {item.of_paper})" if of_paper and item.of_paper else item.title
    caption = item.caption
    if item.at_stress and data.campaign.cycle.turns_at_stress:
        caption += f" {item.at_stress}"
    if of_paper and item.beside_paper is not None:
        caption += f" {item.beside_paper(data if item.whole else data.shown)}"
    if first_numbered:
        caption += (
            " The number in the name of its file, as in fig3 or table1, is that of "
            f"{paper.REFERENCE}: other figures have none."
        )
    return f"![{title}]({item.name}.png)\n\n**{title}.** {caption} ([PDF]({item.name}.pdf))"
