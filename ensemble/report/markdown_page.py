"""``report.md``: the report as one page, figures embedded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.campaign.tables import TURNING_POINTS
from adhesis.ensemble.escape import code_span, fence, markdown, printable
from adhesis.ensemble.quantities import in_one_unit
from adhesis.ensemble.report import findings, paper
from adhesis.ensemble.report.figures.catalogue import Illustration
from adhesis.ensemble.report.figures.shapes_and_spectra import beside_paper
from adhesis.ensemble.report.figures.style import left_out
from adhesis.ensemble.report.further_axes import from_to, shown_cells
from adhesis.ensemble.report.tables import campaign_tables
from adhesis.ensemble.report.tables.table import Table
from adhesis.solver.checks import counted


def write_page(data: Aggregate, figures: Mapping[str, Sequence[Illustration]]) -> str:
    """Return the text of the page, with the figures that were drawn, by section."""
    of_paper = paper.are_its_cells(data.shown.cells)

    numbered = [i for name in ("losses", "loops") for i in figures.get(name, ()) if i.of_paper]

    def show(section: str) -> list[str]:
        items = figures.get(section, ())
        return [_shown(item, data, of_paper, item in numbered[:1]) for item in items]

    losses = campaign_tables.losses(data)
    beside = campaign_tables.beside_the_paper(data)
    out = [
        f"# Hysteresis loops of {code_span(data.path.name)}",
        markdown(" ".join(findings.verdict(data))),
        _bullets(
            *findings.law(data),
            *findings.precision(data),
            *findings.missing(data),
            *(f"WARNING: {sentence}" for sentence in findings.warnings(data)),
        ),
        _summary(data),
        left_out(data),
        shown_cells(data),
        "## Losses",
        losses.markdown(),
        losses.notes(),
        *_table("### Precision of the mean (`[stop]`)", campaign_tables.precision(data)),
        *show("losses"),
        *(["### Along further axes", *show("axes")] if figures.get("axes") else []),
        *_table("## What agrees with the paper, and what does not", beside),
        "" if beside.rows else "## What the averages show",
        _bullets(*findings.agreement(data)),
        *_table(
            "### Growth of the loss with γ, profile by profile",
            campaign_tables.paired(data),
            "The same profiles serve every γ, so the growth is known better than from two "
            "independent sets of profiles.",
        ),
    ]
    if data.companions:
        out += [
            "## Beside other campaigns",
            "The same realisations of both campaigns, profile by profile.",
            campaign_tables.companions(data).markdown(),
        ]
    out += ["## Loops", *show("loops")]
    if figures.get("fields"):
        out += [
            "## Shapes, spectra and distributions",
            *show("fields"),
            *_table(
                "### Slope of the spectrum of the deformed surface on loading",
                campaign_tables.slopes(data, ("loading",)),
                "Power law fitted at small wave numbers: over the lowest decade of the profile's "
                "spectrum, or its lower half if it is shorter than two decades; standard error "
                "of the fit. Unloading: `slopes.csv`.",
            ),
        ]
    fall = (
        " The jump at which a weight falls off is of neither: its drop closes the loop, and may be "
        "negative."
    )
    out += [
        "## Mechanisms",
        "A jump is *small scale* if edges only run inside existing patches (spreading, receding), "
        "and *large scale* if patches come or go (snap-in, merging, splitting, opening, vanishing, "
        f"pull-off).{fall if data.campaign.cycle.under_load else ''}",
        campaign_tables.mechanisms(data).markdown(),
        *show("mechanisms"),
        "### Share of the drops by kind of the jump",
        campaign_tables.shares_by_kind(data).markdown(),
        "Numbers of jumps: `jumps.csv`.",
        "## Approach and separation",
        campaign_tables.works(data).markdown(),
        "Works per nominal area, and the same over the largest contact area of the loop: effective "
        "works of adhesion on approach and separation, and their difference. Full contact: its "
        "elastic energy, to be set beside γ. With intervals: `works.csv`.",
        "## Profiles",
        campaign_tables.profiles(data).markdown(),
    ]
    rest = (text for text in findings.quality(data) if not text.startswith("WARNING"))
    if accuracy := _bullets(*rest):
        out += ["## Accuracy and completeness", accuracy]
    if data.failures:
        failed = (f"row {row}: {text}" for row, text in data.failures)
        out += ["### Failed tasks", _bullets(*failed)]
    text = printable(data.campaign.text.replace("\r\n", "\n").strip())
    out += ["## The campaign", f"{fence(text)}toml\n{text}\n{fence(text)}", _origin(data)]
    return "\n\n".join(part for part in out if part) + "\n"


def _table(heading: str, table: Table, text: str = "") -> list[str]:
    """Return a heading, a text and a table; nothing for a table without rows."""
    return [heading, text, table.markdown()] if table.rows else []


def _summary(data: Aggregate) -> str:
    sweep = data.campaign.sweep
    further = "".join(
        f"{axis.name} = {in_one_unit(axis.name, axis.values)}; "
        for axis in data.further
        if axis.name not in TURNING_POINTS
    )
    part = f", part {data.attributes['part']} of the campaign" if "part" in data.attributes else ""
    many = counted(sweep.realisations, "realisation")
    if data.campaign.stop.relative_error is not None:
        counts = [cell.done for cell in data.cells]
        many = f"{from_to(counts)} realisations by `[stop]`"
    return (
        f"{counted(data.done, 'loop')} of {counted(data.total, 'task')}{part}: "
        f"H = {in_one_unit('hurst', sweep.hurst)}; "
        f"γ = {in_one_unit('work_of_adhesion', sweep.work_of_adhesion)}; {further}"
        f"{many}. Each loop was loaded to {findings.turning_point(data)} "
        f"in {_load_steps(data)} and unloaded until detached; "
        f"method `{data.campaign.solver.method}`. Numbers: `losses.csv`; curves: `curves.nc`."
    )


def _load_steps(data: Aggregate) -> str:
    """Return "20 steps", or to where so many lead where a loop takes the first of them."""
    campaign, cycle = data.campaign, data.campaign.cycle
    if cycle.preload is not None:
        far = "Δ/h_max" if cycle.stiffness is None else "u_tot/h_max"
        return f"steps of which {cycle.load_steps} would lead to {far} = {cycle.deepest:g}"
    if len(campaign.sharing(campaign.tasks()[0])) > 1:
        return f"steps of which {cycle.load_steps} lead to the largest"
    return counted(cycle.load_steps, "step")


def _origin(data: Aggregate) -> str:
    shown = ("adhesis_version", "commit", "created", "mpi", "hdf5", "fftw")
    known = ((name, data.attributes.get(name)) for name in shown)
    parts = [f"{name} {markdown(str(value))}" for name, value in known if value]
    return f"Results file: {'; '.join(parts)}." if parts else ""


def _bullets(*sentences: str) -> str:
    return "\n".join(f"- {markdown(sentence)}" for sentence in sentences)


def _shown(item: Illustration, data: Aggregate, of_paper: bool, first_numbered: bool) -> str:
    title = f"{item.title} (paper's {item.of_paper})" if of_paper and item.of_paper else item.title
    caption = item.caption
    if item.at_stress and data.campaign.cycle.turns_at_stress:
        caption += f" {item.at_stress}"
    if of_paper and item.compared_with is not None:
        caption += f" {beside_paper(data.shown, item.compared_with)}"
    if of_paper and item.beside_paper:
        caption += f" {item.beside_paper}"
    if first_numbered:
        caption += (
            " The number in the name of its file, as in fig3 or table1, is that of "
            f"{paper.REFERENCE}: other figures have none."
        )
    return f"![{title}]({item.name}.png)\n\n**{title}.** {caption} ([PDF]({item.name}.pdf))"
