"""Figure and film of a result, as its methods ``plot`` and ``film`` return them.

The mechanics find this module by :data:`adhesis.solver.views.maker`. A call loads matplotlib.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.path import PathResult

if TYPE_CHECKING:
    from adhesis.ensemble.loop.film import Film

Result = LoopResult | PathResult


def plot(result: Result) -> Any:
    """Draw mean stress and contact fraction; see :meth:`adhesis.LoopResult.plot`."""
    from adhesis.ensemble.loop.figure import draw_loops

    return draw_loops(result if isinstance(result, PathResult) else [result])


def film(
    result: Result,
    path: str | os.PathLike[str] | None,
    *,
    frames: int,
    progress: Callable[[int, int], None] | None,
) -> Film:
    """Make a film, and write it where a path is given; see :meth:`adhesis.LoopResult.film`."""
    from adhesis.ensemble.loop.film import check_film, film_of

    if path is not None:
        path = check_film("path", path)
    made = film_of(result, frames=frames, progress=progress)
    if path is not None:
        made.save(path)
    return made
