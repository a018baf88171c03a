"""Mirror symmetry of states, and the jumps by which it is lost."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import OTHER_MINIMUM


class MirrorCheck:
    """Finds jumps by which a mirror-symmetric state loses its symmetry.

    The mirror image of their end is another end with the same energy: which of the two is reached
    is a convention (docs/methods.md, rule 7).

    Parameters
    ----------
    edges : EdgeMechanics
    axes : array, shape (axes,)
        About which the profile is its own mirror image, in θ.
    """

    def __init__(self, edges: EdgeMechanics, axes: Array) -> None:
        self._near, self._axes = OTHER_MINIMUM * edges.wave, axes

    def is_symmetric(self, gaps: Array) -> bool:
        """Whether these gaps are their own mirror image."""
        return any(self._is_image(gaps, axis) for axis in self._axes)

    def is_broken(self, before: Array, after: Array) -> bool:
        """Whether a symmetry of the gaps ``before`` is not one of those ``after``."""
        return any(
            self._is_image(before, axis) and not self._is_image(after, axis) for axis in self._axes
        )

    def _is_image(self, gaps: Array, axis: float) -> bool:
        """Whether these gaps are their own image about this axis."""
        image = 2 * axis - gaps[:, ::-1]
        apart = np.abs((image[:, None] - gaps[None] + np.pi) % (2 * np.pi) - np.pi)
        nearest = apart.max(axis=2).min(axis=1, initial=np.inf)
        return bool((nearest < self._near).all())
