"""Figures and films of a result: the mechanics declare them, the public package makes them.

``adhesis`` names the module that makes them in :data:`maker` when it is imported; that module, and
matplotlib with it, is loaded when a result is first shown.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any


def _unset() -> Any:
    raise ImportError("import adhesis first: it names the module that draws results")


maker: Callable[[], Any] = _unset
"""Return the module that makes figures and films; ``adhesis/__init__.py`` sets it."""


class Viewed:
    """Figure and film of a loop or path."""

    def plot(self) -> Any:
        """Draw mean stress and contact fraction against penetration.

        Returns
        -------
        matplotlib.figure.Figure
            With ``savefig``; a notebook shows it.

        References
        ----------
        docs/python.md, "A loop"

        Examples
        --------
        >>> from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave
        >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
        >>> loop = run_loop(make_method("sharp", problem), max_penetration=0.5, load_steps=4)
        >>> [axes.get_ylabel() for axes in loop.plot().axes]
        ['mean stress (kPa)', 'contact fraction A/A0']
        """
        return maker().plot(self)

    def film(
        self,
        path: str | Path | None = None,
        *,
        frames: int = 120,
        progress: Callable[[int, int], None] | None = None,
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
        progress : callable, optional
            Called with the number of frames that are drawn and that of all.

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
            If ``frames`` is no whole number, or ``path`` no path.

        References
        ----------
        docs/python.md, "A film"

        Examples
        --------
        >>> from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave
        >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
        >>> loop = run_loop(make_method("sharp", problem), max_penetration=0.5, load_steps=4)
        >>> loop.film(frames=6)
        <Film: 9 frames, 2 jumps>
        """
        return maker().film(self, path, frames=frames, progress=progress)
