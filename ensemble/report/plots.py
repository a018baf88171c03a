"""The figures of the report as methods: each draws one and returns it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from adhesis.ensemble.aggregate.average import Aggregate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from adhesis.ensemble.campaign.axes import Axis
    from adhesis.ensemble.report.figures.style import PublishedFigure


class Plots:
    """One method for each figure of the report; docs/theory.md says what each shows.

    Every method returns the figure, which a notebook displays. With ``ax``, one Axes of matplotlib
    or several, its first panels are drawn into these, and their figure is returned. What is drawn
    are averages over the realisations that are finished.
    """

    def __init__(self, averages: Callable[[], Aggregate]) -> None:
        self._averages = averages

    def __repr__(self) -> str:
        names = (name for name in vars(type(self)) if not name.startswith("_"))
        return f"<Plots: {', '.join(names)}>"

    def _draw(self, name: str, ax: object, axis: Axis | None = None) -> Figure:
        """Draw a figure of the cells that are shown, or that of an axis, which has a note itself.

        Each method calls this alone, so that a warning is of the line that calls the method.
        """
        from adhesis.ensemble.report.figures import along, loops, loss_figures, shapes_and_spectra
        from adhesis.ensemble.report.figures.style import drawn_into
        from adhesis.ensemble.report.further_axes import below, common

        modules = (loops, loss_figures, shapes_and_spectra)
        with drawn_into(ax):
            if axis is not None:
                return along.along(axis)(self._averages()).finish()
            draw: Callable[[Aggregate], PublishedFigure] = next(
                getattr(module, name) for module in modules if hasattr(module, name)
            )
            shown = self._averages().shown
            figure = draw(shown)
            figure.say_below(below(shown.cells, common(shown)))
            return figure.finish()

    def loss_along(self, name: str, ax: object = None) -> Figure:
        """Loss along a further axis of the campaign ("max_penetration"), with intervals.

        Raises
        ------
        ValueError
            If the campaign has no such axis beside H and γ.
        """
        from adhesis.ensemble.report.figures.along import with_figure

        axes = {axis.name: axis for axis in with_figure(self._averages())}
        if name not in axes:
            known = ", ".join(axes) or "none"
            raise ValueError(f"{name!r} is no axis with a figure of its own: there are {known}")
        return self._draw("loss_along", ax, axes[name])

    def contact_against_stress(self, ax: object = None) -> Figure:
        """Contact fraction against mean stress, a panel for each H."""
        return self._draw("contact_against_stress", ax)

    def loop_against_penetration(self, ax: object = None) -> Figure:
        """Mean stress and contact fraction against penetration, a row for each H."""
        return self._draw("loop_against_penetration", ax)

    def loss_against_hurst(self, ax: object = None) -> Figure:
        """Loss against the Hurst exponent, a panel for each work of adhesion, with intervals."""
        return self._draw("loss_against_hurst", ax)

    def loss_against_slope(self, ax: object = None) -> Figure:
        """Loss against mean square slope, a panel for each work of adhesion, with intervals."""
        return self._draw("loss_against_slope", ax)

    def loss_against_penetration(self, ax: object = None) -> Figure:
        """Loss against the largest penetration, of this campaign and those beside it."""
        return self._draw("loss_against_penetration", ax)

    def loss_by_mechanism(self, ax: object = None) -> Figure:
        """Energy drops at small-scale and at large-scale jumps."""
        return self._draw("loss_by_mechanism", ax)

    def jump_energies(self, ax: object = None) -> Figure:
        """Jumps a loop and decade of energy drop."""
        return self._draw("jump_energies", ax)

    def pull_off(self, ax: object = None) -> Figure:
        """Pull-off stress against work of adhesion, with intervals."""
        return self._draw("pull_off", ax)

    def shapes(self, ax: object = None) -> Figure:
        """Rigid profile and deformed surface of one realisation."""
        return self._draw("shapes", ax)

    def spectra_of_branches(self, ax: object = None) -> Figure:
        """Spectral density of profile and deformed surface on both branches at one state."""
        return self._draw("spectra_of_branches", ax)

    def spectra_on_loading(self, ax: object = None) -> Figure:
        """Spectral density of profile and deformed surface on loading."""
        return self._draw("spectra_on_loading", ax)

    def spectra_on_unloading(self, ax: object = None) -> Figure:
        """Spectral density of profile and deformed surface on unloading."""
        return self._draw("spectra_on_unloading", ax)

    def gap_density(self, ax: object = None) -> Figure:
        """Probability density of the gap."""
        return self._draw("gap_density", ax)

    def height_density(self, ax: object = None) -> Figure:
        """Probability density of the heights."""
        return self._draw("height_density", ax)
