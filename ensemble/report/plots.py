"""The figures of the report as methods: each draws one and returns it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from adhesis.ensemble.aggregate.average import Aggregate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from adhesis.ensemble.report.figures.style import PublishedFigure


class Plots:
    """One method for each figure of the report; docs/theory.md says what each shows.

    Every method returns the figure, which a notebook displays. With ``ax``, one Axes of matplotlib
    or several, its first panels are drawn into these, and their figure is returned. What is drawn
    are averages over the realisations that are finished.
    """

    def __init__(self, averages: Callable[[], Aggregate]) -> None:
        self._averages = averages

    def __dir__(self) -> list[str]:
        from adhesis.ensemble.report.figures.catalogue import ALL

        return [item.draw.__name__ for item in ALL] + ["loss_along"]

    def __repr__(self) -> str:
        return f"<Plots: {', '.join(dir(self))}>"

    def __getattr__(self, name: str) -> Callable[..., Figure]:
        """Return the method of a figure of the catalogue, by the name of the function."""
        if name.startswith("_") or name not in dir(self):
            raise AttributeError(name)
        from adhesis.ensemble.report.figures.catalogue import ALL

        item = next(item for item in ALL if item.draw.__name__ == name)

        def draw(ax: object = None) -> Figure:
            return self._draw(item.of, ax)

        draw.__name__, draw.__doc__ = name, item.draw.__doc__
        return draw

    def _draw(self, function: Callable[[Aggregate], PublishedFigure], ax: object) -> Figure:
        """Draw a figure; each method calls this alone, so that a warning is of the user's line."""
        from adhesis.ensemble.report.figures.style import drawn_into

        with drawn_into(ax):
            return function(self._averages()).finish()

    def loss_along(self, name: str, ax: object = None) -> Figure:
        """Loss along a further axis of the campaign ("max_penetration"), with intervals.

        Raises
        ------
        ValueError
            If the campaign has no such axis beside H and γ.
        """
        from adhesis.ensemble.report.figures.along import along, with_figure

        axes = {axis.name: axis for axis in with_figure(self._averages())}
        if name not in axes:
            known = ", ".join(axes) or "none"
            raise ValueError(f"{name!r} is no axis with a figure of its own: there are {known}")
        return self._draw(along(axes[name]), ax)
