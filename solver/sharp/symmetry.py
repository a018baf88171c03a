"""Symmetry of a problem and of its states."""

from __future__ import annotations

from collections.abc import Iterator

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
        motion = sum((_apart(gaps, image) for image in images), start=np.zeros_like(gaps))
        return np.asarray(gaps - motion / (len(images) + 1))

    def _copies(self, gaps: Array) -> Iterator[Array]:
        return (gaps + 2 * np.pi * n / self.parts for n in range(1, self.parts))

    def _images(self, gaps: Array) -> Iterator[Array]:
        return (2 * axis - gaps[:, ::-1] for axis in self.axes)

    def _are_same(self, one: Array, other: Array) -> bool:
        """Whether gaps lie at the places of others, on the circle."""
        return one.shape == other.shape and bool((np.abs(_apart(one, other)) < self._near).all())


def _apart(one: Array, other: Array) -> Array:
    """Compute on the circle how far gaps lie ahead of the nearest of others, shape (L, 2)."""
    if not len(one):
        return one
    place = other[:, 0] % (2 * np.pi)
    order = np.argsort(place)
    after = np.searchsorted(place[order], one[:, 0] % (2 * np.pi))
    beside = other[order[[after - 1, after % len(other)]]]
    apart = (one - beside + np.pi) % (2 * np.pi) - np.pi
    nearest = np.abs(apart).max(axis=2).argmin(axis=0)
    return np.asarray(apart[nearest, np.arange(len(one))])
