"""Declare figures, films, tables, files and displays of results, which another module makes.

``adhesis`` names the module that makes them; that module, and matplotlib with it, is loaded when a
result is first shown.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any


def maker() -> Any:
    """Return the module that makes them."""
    import adhesis

    return adhesis._views()


class NotebookDisplay:
    """Base of objects that a notebook displays as HTML."""

    def _repr_html_(self) -> str:
        """Return the main numbers, and the figure if there is one, for notebooks."""
        return str(maker().page(self))


class ResultViews(NotebookDisplay):
    """Figure, film, tables and file of a loop or path."""

    def plot(self, ax: Any = None) -> Any:
        """Draw mean stress and contact fraction against penetration.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, or two of them, optional
            Where to draw: into two the mean stress (kPa) and the contact fraction, into one the
            mean stress alone. By default a figure is made.

        Returns
        -------
        matplotlib.figure.Figure
            With ``savefig``; a notebook shows it. The figure of ``ax``, if that is given.

        Raises
        ------
        TypeError
            If ``ax`` is neither.

        References
        ----------
        docs/python.md, "A loop"

        Examples
        --------
        >>> from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave
        >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
        >>> loop = run_loop(make_method("sharp", problem), max_penetration=0.5, load_steps=4)
        >>> len(loop.plot().axes)  # mean stress, contact fraction
        2
        """
        return maker().plot(self, ax)

    def film(
        self,
        path: str | Path | None = None,
        *,
        frames: int = 120,
        progress: Callable[[int, int], None] | bool | None = None,
    ) -> Any:
        """Make a film: the deformed surface over the profile, and the point on the curve.

        Parameters
        ----------
        path : path, optional
            Where to write it: ``.html`` is a page of its own with a slider and a play button,
            ``.gif`` needs nothing more, ``.mp4`` needs ffmpeg. Without it nothing is written.
        frames : int
            States that are evenly spaced along the path, from 2 to 1000. Beside them stand the
            states before and after each jump, those with the largest energy drops first, up to
            1000 frames in all.
        progress : bool or callable, optional
            True shows a bar on a terminal, and lines elsewhere; a callable is called with the
            number of frames that are drawn and that of all.

        Returns
        -------
        adhesis.ensemble.loop.film.Film
            A notebook shows it; ``save(path)`` writes it (again).

        Raises
        ------
        InputError
            If the name of the file ends otherwise, nothing can be written there, or ffmpeg is
            missing.
        ValueError
            If ``frames`` is out of range, or the result holds no contact states.
        TypeError
            If ``frames`` is no whole number, ``path`` no path, or ``progress`` no function.

        References
        ----------
        docs/python.md, "A film"

        Examples
        --------
        >>> from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave
        >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
        >>> loop = run_loop(make_method("sharp", problem), max_penetration=0.5, load_steps=4)
        >>> loop.film(frames=6)
        <Film: 10 frames, 2 jumps>
        """
        return maker().film(self, path, frames=frames, progress=progress)

    def to_dataframe(self, of: str = "states") -> Any:
        """Return the states or the jumps as a table.

        Parameters
        ----------
        of : {"states", "jumps"}

        Returns
        -------
        pandas.DataFrame
            One row for each, in the order of the path; ``attrs["units"]`` holds the unit of every
            column.

        Raises
        ------
        ValueError
            If ``of`` is neither.

        References
        ----------
        docs/python.md, "Tables and files"

        Examples
        --------
        >>> from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave
        >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
        >>> loop = run_loop(make_method("sharp", problem), max_penetration=0.5, load_steps=4)
        >>> loop.to_dataframe("jumps").kind.tolist()
        ['snap-in', 'pull-off']
        >>> loop.to_dataframe().attrs["units"]["mean_stress"]
        'Pa'
        """
        return maker().to_dataframe(self, of)

    def to_xarray(self) -> Any:
        """Return everything but the contact states as a labelled dataset.

        Returns
        -------
        xarray.Dataset
            Arrays along ``state``, ``jump`` (names begin with ``jump_``) and ``harmonic`` (the
            profile), each with its ``units``; single numbers are attributes.

        References
        ----------
        docs/python.md, "Tables and files"

        Examples
        --------
        >>> from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave
        >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
        >>> loop = run_loop(make_method("sharp", problem), max_penetration=0.5, load_steps=4)
        >>> loop.to_xarray().jump_energy_drop.units
        'J/m²'
        """
        return maker().to_xarray(self)

    def save(self, path: str | Path) -> None:
        """Write everything but the contact states to a netCDF file; :func:`adhesis.load` reads it.

        Parameters
        ----------
        path : path
            Its name ends in ``.nc``.

        Raises
        ------
        InputError
            If the name ends otherwise, or the file cannot be made there.
        OSError
            If writing fails, as on a full disk.
        TypeError
            If it is no path.

        References
        ----------
        docs/python.md, "Tables and files"
        """
        maker().save(self, path)
