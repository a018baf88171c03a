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
        return self.are_images(gaps, gaps)

    def are_images(self, one: Array, other: Array) -> bool:
        """Whether two states are mirror images of each other."""
        return one.shape == other.shape and any(
            self._is_image(one, other, axis) for axis in self._axes
        )

    def is_broken(self, before: Array, after: Array) -> bool:
        """Whether a symmetry of the gaps ``before`` is not one of those ``after``."""
        return any(
            self._is_image(before, before, axis) and not self._is_image(after, after, axis)
            for axis in self._axes
        )

    def _is_image(self, one: Array, other: Array, axis: float) -> bool:
        """Whether the image of some gaps about this axis are others."""
        image = 2 * axis - one[:, ::-1]
        apart = np.abs((image[:, None] - other[None] + np.pi) % (2 * np.pi) - np.pi)
        nearest = apart.max(axis=2).min(axis=1, initial=np.inf)
        return bool((nearest < self._near).all())
