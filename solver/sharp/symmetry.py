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
        self._turns = [2 * np.pi * n / parts for n in range(1, parts)]

    def is_symmetric(self, gaps: Array) -> bool:
        """Whether a state is its own mirror image, or consists of equal parts."""
        return self.are_images(gaps, gaps) or self.are_copies(gaps, gaps)

    def are_copies(self, one: Array, other: Array) -> bool:
        """Whether two states differ by a turn of some parts."""
        return one.shape == other.shape and any(
            self._is_copy(one + turn, other) for turn in self._turns
        )

    def are_images(self, one: Array, other: Array) -> bool:
        """Whether two states are mirror images of each other."""
        return one.shape == other.shape and any(
            self._is_image(one, other, axis) for axis in self.axes
        )

    def is_broken(self, before: Array, after: Array) -> bool:
        """Whether a symmetry of the gaps ``before`` is not one of those ``after``."""
        return any(
            self._is_image(before, before, axis) and not self._is_image(after, after, axis)
            for axis in self.axes
        )

    def symmetrised(self, gaps: Array) -> Array:
        """Return the mean of a symmetric state and its images, which the field's error parts."""
        images = [gaps + turn for turn in self._turns]
        images += [2 * axis - gaps[:, ::-1] for axis in self.axes]
        images = [image for image in images if self._is_copy(image, gaps)]
        motion = np.zeros_like(gaps)
        for image in images:
            apart = _apart(gaps, image)
            nearest = np.abs(apart).max(axis=2).argmin(axis=1)
            motion -= apart[np.arange(len(gaps)), nearest]
        return gaps + motion / (len(images) + 1)

    def _is_image(self, one: Array, other: Array, axis: float) -> bool:
        """Whether the image of some gaps about this axis are others."""
        return self._is_copy(2 * axis - one[:, ::-1], other)

    def _is_copy(self, image: Array, other: Array) -> bool:
        """Whether gaps lie at the places of others, on the circle."""
        nearest = np.abs(_apart(image, other)).max(axis=2).min(axis=1, initial=np.inf)
        return bool((nearest < self._near).all())


def _apart(one: Array, other: Array) -> Array:
    """Compute on the circle how far gaps lie ahead of each of others, shape (gaps, others, 2)."""
    return np.asarray((one[:, None] - other[None] + np.pi) % (2 * np.pi) - np.pi)
