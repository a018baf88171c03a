"""Symmetry of a problem and of its states."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array


class Symmetry:
    """Equal parts and mirror axes of a problem; finds symmetric states, and jumps that break them.

    The mirror image of their end is another end with the same energy: which of the two is reached
    is a convention (docs/methods.md, rule 7).

    Attributes
    ----------
    parts : int
        Number of equal parts of the period.
    axes : array
        Places in θ about which it is its own mirror image.
    """

    def __init__(self, parts: int, axes: Array, near: float) -> None:
        """``near`` is the largest distance of the edges of equal states, in θ."""
        self.parts, self.axes, self._near = parts, axes, near

    def is_symmetric(self, gaps: Array) -> bool:
        """Whether a state is its own mirror image, or consists of equal parts."""
        return self.are_images(gaps, gaps) or self.are_copies(gaps, gaps)

    def are_copies(self, one: Array, other: Array) -> bool:
        """Whether two states differ by a turn of some parts."""
        return any(self._are_same(copy, other) for copy in self._copies(one))

    def are_images(self, one: Array, other: Array) -> bool:
        """Whether two states are mirror images of each other."""
        return any(self._are_same(image, other) for image in self._images(one))

    def is_broken(self, before: Array, after: Array) -> bool:
        """Whether a mirror symmetry of the gaps ``before`` is not one of those ``after``."""
        both = zip(self._images(before), self._images(after), strict=True)
        return any(self._are_same(a, before) and not self._are_same(b, after) for a, b in both)

    def symmetrised(self, gaps: Array) -> Array:
        """Return the mean of a symmetric state and its images, which the field's error parts."""
        images = [*self._copies(gaps), *self._images(gaps)]
        images = [image for image in images if self._are_same(image, gaps)]
        motion = np.zeros_like(gaps)
        for image in images:
            apart = _apart(gaps, image)
            nearest = np.abs(apart).max(axis=2).argmin(axis=1)
            motion -= apart[np.arange(len(gaps)), nearest]
        return gaps + motion / (len(images) + 1)

    def _copies(self, gaps: Array) -> list[Array]:
        return [gaps + 2 * np.pi * n / self.parts for n in range(1, self.parts)]

    def _images(self, gaps: Array) -> list[Array]:
        return [2 * axis - gaps[:, ::-1] for axis in self.axes]

    def _are_same(self, one: Array, other: Array) -> bool:
        """Whether gaps lie at the places of others, on the circle."""
        if one.shape != other.shape:
            return False
        nearest = np.abs(_apart(one, other)).max(axis=2).min(axis=1, initial=np.inf)
        return bool((nearest < self._near).all())


def _apart(one: Array, other: Array) -> Array:
    """Compute on the circle how far gaps lie ahead of each of others, shape (gaps, others, 2)."""
    return np.asarray((one[:, None] - other[None] + np.pi) % (2 * np.pi) - np.pi)
