"""The figures of the report as methods: each draws one and returns it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from adhesis.ensemble.aggregate.average import Aggregate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from adhesis.ensemble.campaign.axes import Axis
    from adhesis.ensemble.report.figures.style import PublishedFigure


def _function(name: str) -> Callable[[Aggregate], PublishedFigure]:
    """Return the function that draws a figure; matplotlib is loaded with it."""
    from adhesis.ensemble.report.figures import loops, loss_figures, shapes_and_spectra

    modules = (loops, loss_figures, shapes_and_spectra)
    found: Callable[[Aggregate], PublishedFigure] = next(
        getattr(module, name) for module in modules if hasattr(module, name)
    )
    return found


class _Drawing:
    """Method that draws the figure of its name, and is described by the function that does."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, plots: Plots, owner: type | None = None) -> Callable[..., Figure]:
        def draw(ax: object = None) -> Figure:
            return plots._draw(self._name, ax)

        draw.__name__, draw.__doc__ = self._name, _function(self._name).__doc__
        return draw


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
        from adhesis.ensemble.report.figures.along import along
        from adhesis.ensemble.report.figures.style import drawn_into
        from adhesis.ensemble.report.further_axes import below, common

        with drawn_into(ax):
            if axis is not None:
                return along(axis)(self._averages()).finish()
            shown = self._averages().shown
            figure = _function(name)(shown)
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

    contact_against_stress = _Drawing()
    loop_against_penetration = _Drawing()
    loss_against_hurst = _Drawing()
    loss_against_slope = _Drawing()
    loss_against_penetration = _Drawing()
    loss_by_mechanism = _Drawing()
    jump_energies = _Drawing()
    pull_off = _Drawing()
    shapes = _Drawing()
    spectra_of_branches = _Drawing()
    spectra_on_loading = _Drawing()
    spectra_on_unloading = _Drawing()
    gap_density = _Drawing()
    height_density = _Drawing()
