"""The figures of the report as methods: each draws one and returns its axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from adhesis.ensemble.aggregate.average import Aggregate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Panels(list["Axes"]):
    """The axes of a figure, panel by panel; a notebook displays the figure."""

    @property
    def figure(self) -> Figure:
        """The figure, with ``savefig``."""
        found = self[0].get_figure(root=True)
        assert found is not None
        return found

    def _repr_html_(self) -> str:
        """Return the figure as a picture, for notebooks."""
        from adhesis.ensemble.report.html import picture_of

        return picture_of(self.figure)


class Plots:
    """One method for each figure of the report; docs/theory.md says what each shows.

    Every method returns the figure's axes, panel by panel, which a notebook displays as the figure;
    ``axes.figure`` is the figure, with ``savefig``. What is drawn are averages over the
    realisations that are finished.
    """

    def __init__(self, averages: Callable[[], Aggregate]) -> None:
        self._averages = averages

    def __repr__(self) -> str:
        names = (name for name in vars(type(self)) if not name.startswith("_"))
        return f"<Plots: {', '.join(names)}>"

    def _draw(self, name: str) -> Panels:
        from adhesis.ensemble.report.figures import loops, loss_figures, shapes_and_spectra
        from adhesis.ensemble.report.figures.style import say_below, style
        from adhesis.ensemble.report.further_axes import below, common

        modules = (loops, loss_figures, shapes_and_spectra)
        draw: Callable[[Aggregate], Figure] = next(
            getattr(module, name) for module in modules if hasattr(module, name)
        )
        with style():
            shown = self._averages().shown
            figure = draw(shown)
            say_below(figure, below(shown, common(shown)))
            figure.canvas.draw()  # the layout is found with the style's own sizes
        return Panels(figure.axes)

    def loss_along(self, name: str) -> Panels:
        """Loss along a further axis of the campaign ("max_penetration"), with intervals.

        Raises
        ------
        ValueError
            If the campaign has no such axis beside H and γ.
        """
        from adhesis.ensemble.report.figures.along import along, with_figure
        from adhesis.ensemble.report.figures.style import style

        data = self._averages()
        axes = {axis.name: axis for axis in with_figure(data)}
        if name not in axes:
            known = ", ".join(axes) or "none"
            raise ValueError(f"{name!r} is no axis with a figure of its own: there are {known}")
        with style():
            figure = along(axes[name])(data)
            figure.canvas.draw()
        return Panels(figure.axes)

    def contact_against_stress(self) -> Panels:
        """Contact fraction against mean stress, a panel for each H."""
        return self._draw("contact_against_stress")

    def loop_against_penetration(self) -> Panels:
        """Mean stress and contact fraction against penetration, a row for each H."""
        return self._draw("loop_against_penetration")

    def loss_against_hurst(self) -> Panels:
        """Loss against the Hurst exponent, a panel for each work of adhesion, with intervals."""
        return self._draw("loss_against_hurst")

    def loss_against_slope(self) -> Panels:
        """Loss against mean square slope, a panel for each work of adhesion, with intervals."""
        return self._draw("loss_against_slope")

    def loss_against_penetration(self) -> Panels:
        """Loss against the largest penetration, of this campaign and those beside it."""
        return self._draw("loss_against_penetration")

    def loss_by_mechanism(self) -> Panels:
        """Energy drops at small-scale and at large-scale jumps."""
        return self._draw("loss_by_mechanism")

    def jump_energies(self) -> Panels:
        """Jumps a loop and decade of energy drop."""
        return self._draw("jump_energies")

    def pull_off(self) -> Panels:
        """Pull-off stress against work of adhesion, with intervals."""
        return self._draw("pull_off")

    def shapes(self) -> Panels:
        """Rigid profile and deformed surface of one realisation."""
        return self._draw("shapes")

    def spectra_of_branches(self) -> Panels:
        """Spectral density of profile and deformed surface on both branches at one state."""
        return self._draw("spectra_of_branches")

    def spectra_on_loading(self) -> Panels:
        """Spectral density of profile and deformed surface on loading."""
        return self._draw("spectra_on_loading")

    def spectra_on_unloading(self) -> Panels:
        """Spectral density of profile and deformed surface on unloading."""
        return self._draw("spectra_on_unloading")

    def gap_density(self) -> Panels:
        """Probability density of the gap."""
        return self._draw("gap_density")

    def height_density(self) -> Panels:
        """Probability density of the heights."""
        return self._draw("height_density")
