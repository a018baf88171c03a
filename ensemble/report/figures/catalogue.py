"""The figures of the report; what each shows, and the function that draws it from an aggregate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from adhesis.ensemble.aggregate.average import Aggregate
from adhesis.ensemble.campaign.tables import TURNING_POINTS, Axis
from adhesis.ensemble.report import paper
from adhesis.ensemble.report.figures import loss_figures
from adhesis.ensemble.report.figures import shapes_and_spectra as fields
from adhesis.ensemble.report.figures.loops import contact_against_stress, loop_against_penetration
from adhesis.ensemble.report.figures.loss_figures import FEWEST_FOR_A_LINE, hollow_handle
from adhesis.ensemble.report.figures.shapes_and_spectra import (
    cells_with_shape,
    has_fields,
    shown_penetrations,
)
from adhesis.ensemble.report.figures.style import PublishedFigure
from adhesis.ensemble.report.further_axes import below, common, together, with_figure
from adhesis.ensemble.report.paper import PaperFigure


@dataclass(frozen=True)
class Illustration:
    """One figure of the report."""

    name: str  # stem of its files
    title: str
    caption: str  # what it shows, as a sentence or two
    draw: Callable[[Aggregate], PublishedFigure]
    of_paper: str = ""  # the figure or table of the paper that shows the same, if there is one
    # compared_with, beside_paper: where the campaign is the paper's, its figure that the caption
    # compares this one with, and a sentence on what it shows
    compared_with: PaperFigure | None = None
    beside_paper: str = ""
    at_stress: str = ""  # a further sentence for the caption where loops turn at a mean stress
    whole: bool = False  # whether it draws all cells, and not those of :attr:`Aggregate.shown`
    # Returns whether there is something to see: more than one point, or fields
    is_worth: Callable[[Aggregate], bool] = lambda data: True

    def of(self, data: Aggregate) -> PublishedFigure:
        """Draw it; below the panels stands which cells are shown."""
        if self.whole:
            return self.draw(data)
        figure = self.draw(data.shown)
        figure.say_below(below(data.shown.cells, common(data.shown)))
        return figure


def _several(name: str) -> Callable[[Aggregate], bool]:
    """Return the function that is true if finished cells have several values of a number."""
    return lambda data: len({getattr(cell, name) for cell in data.cells if cell.done}) > 1


_CARET = "A caret at 0 marks an interval that goes on below."
_ENDS = (
    "Loops that turn at one mean stress turn at different penetrations: a curve ends where the "
    "first of its realisations turns, and its branches need not meet."
)
LOOPS = (
    Illustration(
        "fig6_contact_against_stress",
        "Contact fraction against mean stress",
        "Means over realisations, taken at equal penetration; σ~ = 2p̄/(E* q0 h_max) with each "
        "realisation's own h_max, compression positive. Shading: one standard deviation of A/A0 "
        "of a single realisation.",
        contact_against_stress,
        "Fig. 6",
        at_stress=_ENDS,
    ),
    Illustration(
        "fig7_loop_against_penetration",
        "Mean stress and contact fraction against penetration",
        "Lines: means over realisations; shading: one standard deviation of a single realisation. "
        "A realisation that has detached counts with zero.",
        loop_against_penetration,
        "Fig. 7",
        at_stress=_ENDS,
    ),
)
LOSSES = (
    Illustration(
        "table1_losses",
        "Loss of each H and work of adhesion",
        f"Means with 95 % intervals, a panel for each γ. {_CARET}",
        loss_figures.loss_against_hurst,
        "Table 1",
        beside_paper="Stars: the paper's values, which have no error.",
        is_worth=_several("hurst"),
    ),
    Illustration(
        "loss_against_m2",
        "Loss against mean square slope",
        f"Means with 95 % intervals, a panel for each γ, a point for each H. {_CARET}",
        loss_figures.loss_against_slope,
        beside_paper="Stars: the paper's values, at the m2 that it quotes.",
        is_worth=_several("hurst"),
    ),
)
# A figure of states of which fields are kept.
_of_states = partial(
    Illustration,
    at_stress="Loops turn at a mean stress, and states are at parts of it instead of penetrations.",
    is_worth=lambda data: any(map(has_fields, data.cells)),
)
FIELDS = (
    Illustration(
        "fig3_shapes",
        "Deformed shapes",
        "The first realisation that kept its fields: rigid profile h, and the elastic surface "
        "above it on both branches, at the same prescribed value. In contact the two coincide. "
        "Right: one and a half of the longest waves around the highest point, carried on across "
        "the end of the period where it lies near one.",
        fields.shapes,
        "Fig. 3",
        compared_with=paper.FIGURE_3,
        beside_paper="Its separations (92, 51 and 20 µm) are larger than h_max of any profile with "
        "h_rms = 1 µm, so the states here are those that the campaign kept.",
        is_worth=lambda data: bool(shown_penetrations(data, 1) and cells_with_shape(data)),
    ),
    _of_states(
        "fig4_spectra_of_branches",
        "Spectral density on both branches",
        "Two-sided, mean over the realisations in contact, at one penetration. Thin lines: slopes "
        "of a self-affine profile, q^-(2H+1), and of Persson's law, q^-(2+H). Beyond the "
        "profile's highest wave number only the edges of contact have power.",
        fields.spectra_of_branches,
        "Fig. 4",
        compared_with=paper.FIGURE_4,
    ),
    _of_states(
        "fig5a_spectra_loading",
        "Spectral density on loading",
        "As before, at several penetrations.",
        fields.spectra_on_loading,
        "Fig. 5(a)",
        compared_with=paper.FIGURE_5,
    ),
    _of_states(
        "fig5b_spectra_unloading",
        "Spectral density on unloading",
        "As on loading. At the largest penetration both branches are one state.",
        fields.spectra_on_unloading,
        "Fig. 5(b)",
        compared_with=paper.FIGURE_5,
    ),
    _of_states(
        "fig8_gap_density",
        "Probability density of the separation",
        "Gap t outside contact, in units of each realisation's h_max; the integral is the "
        "fraction out of contact. At the largest penetration both branches are one state. "
        "Straight part: openings beside the edges of contact grow with the square root of the "
        "distance, and their density with t. Peaks at small t: single gaps, over a crest that is "
        "close to touching; above the least opening t0 there the density falls as (t - t0)^-1/2. "
        "Gaps below the axis are not shown.",
        fields.gap_density,
        "Fig. 8",
        compared_with=paper.FIGURE_8,
    ),
    Illustration(
        "fig9_height_density",
        "Probability density of the heights",
        "Rigid profiles, mean over realisations, with the Gaussian of the same variance.",
        fields.height_density,
        "Fig. 9",
        beside_paper="The paper's figure is at H = 0.8, with heights in units of h_max.",
    ),
)
MECHANISMS = (
    Illustration(
        "loss_by_mechanism",
        "Loss by mechanism",
        "Sum of the energy drops of one loop. Small scale: edges run inside existing patches; "
        "large scale: patches appear, merge, split, open, vanish or pull off. Above the bars: "
        f"share of the small scale. Error bars: 95 % interval of the mean of either part. {_CARET}",
        loss_figures.loss_by_mechanism,
    ),
    Illustration(
        "jump_energies",
        "Distribution of the energy drops",
        "Jumps of one loop per decade of energy drop, mean over realisations. Drops more than "
        "eight decades below the largest are not shown. Shading: n jumps in a bin are known to "
        "sqrt(n).",
        loss_figures.jump_energies,
        is_worth=lambda data: any(cell.jumps.histogram.any() for cell in data.cells),
    ),
    Illustration(
        "pull_off_stress",
        "Pull-off stress",
        f"Largest mean tension on unloading, means with 95 % intervals. {_CARET} The marks are "
        "moved apart a little.",
        loss_figures.pull_off,
        is_worth=_several("work_of_adhesion"),
    ),
)
ALL = (*LOOPS, *LOSSES, *FIELDS, *MECHANISMS)


def sections(data: Aggregate) -> dict[str, list[Illustration]]:
    """Return the figures that are worth drawing, by section of the report."""
    found = {
        "loops": LOOPS,
        "losses": LOSSES,
        # One for each further axis of the campaign, unless it goes with H or γ
        "axes": tuple(_along_axis(data, axis) for axis in with_figure(data)),
        "mechanisms": MECHANISMS,
        "fields": FIELDS,
    }
    return {
        name: [item for item in items if item.is_worth(data if item.whole else data.shown)]
        for name, items in found.items()
    }


def _along_axis(data: Aggregate, axis: Axis) -> Illustration:
    with_it = together(data, axis) - {axis.name}
    further = {other.name for other in data.further} - {*with_it, axis.name}
    caption = (
        "Means with 95 % intervals. The profiles have the same phases in every cell (paired): "
        "differences between cells are as a rule known better than overlapping bars suggest. "
        + _CARET
    )
    if further or len(data.works_of_adhesion) > 1:
        of_each = "each value of the other axis" if further else "each γ"
        caption += f" The marks of {of_each} are moved aside a little."
    if len(axis.values) >= FEWEST_FOR_A_LINE:
        caption += " Lines join them to guide the eye."
    if hollow_handle(data.cells):
        caption += " Hollow: means without loops that failed, or with loops short of their preload."
    if axis.name in TURNING_POINTS:
        caption += " Contact: the largest of the loop; loss per contact: over that largest area."
    if axis.name == "max_penetration":
        caption += " Crosses: mean contact at the turning point."
    if with_it:
        caption += f" With it {', '.join(sorted(with_it))} varies."
    if len(further) > 1:
        caption += " Further axes beside these two stand at one value, as written below the panels."
    name, title = f"loss_along_{axis.name}", f"Loss against {axis.name}"
    return Illustration(name, title, caption, partial(loss_figures.along, axis), whole=True)
