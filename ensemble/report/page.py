"""``report.md``: the report as one page, figures embedded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ensemble.aggregate import statistics
from ensemble.aggregate.average import Aggregate
from ensemble.report import findings, paper
from ensemble.report.figures.catalogue import Illustration
from ensemble.report.tables import losses as tables
from ensemble.report.tables import states as state_tables

Drawn = Mapping[str, str]
"""Stem of a figure -> name of its PNG file, beside the page."""


def write_page(data: Aggregate, sections: Sequence[tuple[str, Sequence[Illustration]]]) -> str:
    """Return the text of the page.

    Parameters
    ----------
    data : Aggregate
    sections : sequence of (heading, illustrations)
        The figures that were drawn, under the headings "loops", "losses", "mechanisms", "fields",
        "companions".
    """
    figures = dict(sections)
    losses = tables.losses(data)
    out = [
        f"# Hysteresis loops of `{data.path.name}`",
        _summary(data),
        *_bullets(findings.missing(data)),
        "## Losses",
        losses.markdown(),
        _footnote(),
        *_show(figures.get("losses", ())),
        "## What agrees with the paper, and what does not",
        *_bullets(findings.agreement(data)),
    ]
    growth = tables.paired(data)
    if growth.rows:
        out += [
            "### Growth of the loss with γ, profile by profile",
            "The same profiles serve every γ, so the growth is known better than the losses.",
            growth.markdown(),
        ]
    if data.companions:
        out += [
            "## Beside other campaigns",
            "The same realisations of both campaigns, profile by profile.",
            tables.companions(data).markdown(),
            *_bullets(findings.readings(data)),
            *_show(figures.get("companions", ())),
        ]
    out += ["## Loops", *_show(figures.get("loops", ()))]
    if figures.get("fields"):
        out += ["## Shapes, spectra and distributions", *_show(figures["fields"])]
        slopes = state_tables.slopes(data, ("loading",))
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
        "pull-off).",
        state_tables.mechanisms(data).markdown(),
        *_show(figures.get("mechanisms", ())),
        "### Share of the drops by kind of the jump",
        state_tables.shares_by_kind(data).markdown(),
        "Numbers of jumps: `jumps.csv`.",
        "## Profiles",
        tables.profiles(data).markdown(),
        "## Accuracy and completeness",
        *_bullets(findings.quality(data)),
    ]
    if data.failures:
        out += [
            "### Failed tasks",
            *_bullets([f"row {row}: {text or 'no reason given'}" for row, text in data.failures]),
        ]
    out += ["## The campaign", "```toml\n" + data.campaign.text.strip() + "\n```", _origin(data)]
    return "\n\n".join(part for part in out if part) + "\n"


def _summary(data: Aggregate) -> str:
    sweep, cycle = data.campaign.sweep, data.campaign.cycle
    return (
        f"{data.done} loops of {data.done + data.failed + data.pending} tasks: "
        f"H = {_list(sweep.hurst)}; γ = {_list(sweep.work_of_adhesion)} J/m²; "
        f"{sweep.realisations} realisations. Each loop was loaded to Δ/h_max = "
        f"{cycle.max_penetration:g} in {cycle.load_steps} steps and unloaded until detached; "
        f"method `{data.campaign.solver.method}`. Numbers: `losses.csv`; curves: `curves.nc`."
    )


def _footnote() -> str:
    return (
        "W~ = ∮ σ~ dΔ~ with σ~ = 2p̄/(E* q0 h_max) and Δ~ = Δ/h_max, each realisation with its own "
        "h_max; s.e.: standard error of the mean; 95 % interval of the mean by the BCa bootstrap "
        f"at the expanded level ({statistics.RESAMPLES} resamples, fixed seed), for fewer than "
        f"{statistics.FEWEST_FOR_BOOTSTRAP} realisations by Student's t; ± steps: mean "
        "|loop integral - sum of drops|, or the difference from a campaign with other load steps "
        "beside this one; ± grid: the difference from a campaign with another resolution or "
        "method beside this one; audit: largest |loop integral - sum of drops| / loss; paper: "
        f"{paper.REFERENCE}, Table 1, – where its value is not known here."
    )


def _origin(data: Aggregate) -> str:
    shown = ("adhesis_version", "commit", "created", "mpi", "hdf5", "fftw")
    parts = [f"{name} {data.attributes[name]}" for name in shown if data.attributes.get(name)]
    return f"Results file: {'; '.join(parts)}." if parts else ""


def _bullets(sentences: Sequence[str]) -> list[str]:
    return ["\n".join(f"- {sentence}" for sentence in sentences)] if sentences else []


def _show(illustrations: Sequence[Illustration]) -> list[str]:
    return [
        f"![{item.title}]({item.name}.png)\n\n**{item.title}.** {item.caption} "
        f"([PDF]({item.name}.pdf))"
        for item in illustrations
    ]


def _list(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in sorted(values))
