"""Track of a descent through several sets of gaps, kept so that another can be compared with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array


class Stage(NamedTuple):
    """Part of a descent with one set of gaps.

    Attributes
    ----------
    way : array, shape (2L,)
        Outward motion of every edge.
    taken : array, shape (2L, 2L)
        Force, as C², that the motion of each edge (columns) took from every edge (rows).
    """

    way: Array
    taken: Array


@dataclass
class Track:
    """Edges that a descent went through, for another one to be compared with.

    Attributes
    ----------
    ways : list of arrays, shape (n, 2L)
        One for every set of gaps on the way.
    has_left, rejoined : bool
        Whether the other descent has left the track, and come back to it.
    rest : array, optional
        Gaps of a window in which the descent first came to rest.
    stages : list of Stage
        What the edges did, one for every set of gaps on the way.
    is_complete : bool
        Whether the stages are known.
    """

    ways: list[Array] = field(default_factory=list)
    has_left: bool = False
    rejoined: bool = False
    rest: Array | None = None
    stages: list[Stage] = field(default_factory=list)
    is_complete: bool = True

    def of(self, edges: int) -> Array:
        """Return the track where there are so many edges."""
        return np.concatenate(
            [np.empty((0, edges)), *(w for w in self.ways if w.shape[1] == edges)]
        )
