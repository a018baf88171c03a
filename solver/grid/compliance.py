"""Compute the local compliance S of a node at the edge of a patch.

Adding the free node j with gap t_j to the contact set costs the elastic energy ½ dx t_j²/S, and
removing the contact node i with stress σ_i releases ½ dx σ_i² S, both exactly, with

    S = V_jj - V_jΩ (V_ΩΩ)⁻¹ V_Ωj,

Ω the contact set without the node. S depends on the geometry alone: 1.7286 dx/E* at the edge of a
long isolated patch, more for short patches, less beside narrow gaps. Here the nodes of the patch
and of its two neighbours are lumped into blocks of uniform stress that grow away from their ends;
as S is stationary with respect to the stress, the relative error of lumping is below 1e-4. Rounded
lengths add up to 4e-4, and the patches beyond both neighbours, which are added to these, more: of
random sets of five patches S is off by 8e-4 in the median, at most by 6e-3.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from adhesis.solver.model.profile import Array

# Number of one-node blocks at the end of a patch beside the node, and growth of the next blocks.
_SINGLE_NODES = 5
_GROWTH = 1.8
# Lengths up to this many nodes are exact, longer ones rounded in equal ratios.
_EXACT_LENGTH = 24
_RATIO = 1.08


@cache
def _growing(length: int) -> tuple[int, ...]:
    """Return the offsets of block ends, with blocks that grow from offset 0 up to ``length``."""
    ends = [0]
    width = 1.0
    while ends[-1] + round(width) <= length:
        ends.append(ends[-1] + round(width))
        if len(ends) > _SINGLE_NODES:
            width *= _GROWTH
    return tuple(ends)


@cache
def _fine_near(length: int) -> tuple[int, ...]:
    """Return the block ends of a patch of ``length`` nodes, fine at offset 0 only."""
    ends = _growing(length)
    return ends if ends[-1] == length else (*ends, length)


@cache
def _fine_both(length: int) -> tuple[int, ...]:
    """Return the block ends of a patch of ``length`` nodes, fine at both ends."""
    half = _growing(length // 2)
    return tuple(sorted({*half, *(length - offset for offset in half)}))


@cache
def _rounded(length: int) -> int:
    """Round a length on a scale of equal ratios, exact up to ``_EXACT_LENGTH``."""
    if length <= _EXACT_LENGTH:
        return length
    steps = round(float(np.log(length / _EXACT_LENGTH) / np.log(_RATIO)))
    return round(_EXACT_LENGTH * _RATIO**steps)


class EdgeCompliance:
    """S of edge nodes on a periodic grid, cached by geometry, from the first column of V."""

    def __init__(self, kernel: Array) -> None:
        self.n = kernel.size
        # Second antidifference F of the kernel, F(k+1) - 2F(k) + F(k-1) = V_k, F even: the sum of
        # V over two blocks of nodes is then a combination of four values of F.
        slope = np.concatenate(([0.5 * kernel[0]], 0.5 * kernel[0] + np.cumsum(kernel[1:])))
        self._f = np.concatenate(([0.0], np.cumsum(slope)))
        self._known: dict[tuple[int, ...], float] = {}
        self._pairs: dict[tuple[int, ...], Array] = {}

    def __call__(
        self,
        width: int,
        gap: int,
        neighbours: tuple[int, int, int] | None,
    ) -> float:
        """Compute S of the free node next to a patch, in m/Pa.

        Parameters
        ----------
        width : int
            Nodes of the patch without the node in question; may be 0.
        gap : int
            Free nodes from the patch to the next contact on the node's side, the node included.
        neighbours : (int, int, int) or None
            Contact nodes beyond the gap on the node's side, nodes of the gap on the patch's other
            side, and contact nodes beyond that; None if the patch is the only one of the period.
            The nodes of all other patches are divided between both sides and added to the
            neighbours without gaps: far away only their number matters.
        """
        if neighbours is None:
            key = self._rounded_patch(width)
        else:
            near, far_gap, far = neighbours
            key = tuple(_rounded(k) for k in (width, gap, near, far_gap, far))
        known = self._known.get(key)
        if known is None:
            width, gap, next_width, other_gap, other_width = key
            # Rounded lengths must not reach round the period.
            gap = min(gap, self.n - 1)
            other_gap = min(other_gap, self.n - gap)
            width = min(width, self.n - gap - other_gap)
            free = self.n - gap - width - other_gap
            next_width = min(next_width, free)
            other_width = min(other_width, free - next_width)
            blocks = [(0, -1, _fine_both(width))]  # of the patch, which starts beside the node at 0
            if next_width > 0:
                blocks.append((gap, 1, _fine_near(next_width)))
            if other_width > 0:
                blocks.append((-width - other_gap, -1, _fine_near(other_width)))
            known = self._known[key] = float(self._schur(blocks, (0,))[0, 0])
        return known

    def _rounded_patch(self, width: int) -> tuple[int, ...]:
        """Round the shorter of the only patch and the only gap; together they are the period."""
        short = _rounded(min(width, self.n - width))
        width = short if width <= self.n - width else self.n - short
        return width, self.n - width, 0, 0, 0

    def across_patch(self, width: int, left: int, right: int, before: int, after: int) -> Array:
        """Compute S of the two free nodes beside a patch of ``width`` nodes, shape (2, 2), in m/Pa.

        ``left`` and ``right`` are the free nodes on either side, ``before`` and ``after`` the
        contact nodes beyond them; 0 for none.
        """
        if before == 0 and after == 0:
            key = self._rounded_patch(width)
        else:
            key = tuple(_rounded(k) for k in (width, left, right, before, after))
        known = self._pairs.get(key)
        if known is None:
            width, left, right, before, after = key
            # Rounded lengths must not reach round the period.
            left = min(left, self.n - 2)
            right = min(right, self.n - 1 - left)
            width = min(width, self.n - left - right)
            blocks = [(0, 1, _fine_both(width))]
            free = self.n - width - left - right
            after = min(after, free)
            before = min(before, free - after)
            if after > 0:
                blocks.append((width + right, 1, _fine_near(after)))
            if before > 0:
                blocks.append((-left, -1, _fine_near(before)))
            known = self._pairs[key] = self._schur(blocks, (-1, width))
        return known

    def across_gap(self, near: int, gap: int, far: int) -> Array:
        """Compute S of the first and last free node of a gap, shape (2, 2), in m/Pa.

        From the nodes of the patch before the gap, of the gap, and of the patch after it.
        """
        key = tuple(_rounded(k) for k in (near, gap, far))
        known = self._pairs.get(key)
        if known is None:
            near, gap, far = key
            # Rounded lengths must not reach round the period.
            gap = min(gap, self.n - 2)
            near = min(near, self.n - gap - 1)
            far = min(far, self.n - gap - near)
            blocks = [(0, -1, _fine_both(near))]
            if far > 0:
                blocks.append((gap, 1, _fine_both(far)))
            known = self._pairs[key] = self._schur(blocks, (0, gap - 1))
        return known

    def _schur(
        self, patches: list[tuple[int, int, tuple[int, ...]]], nodes: tuple[int, ...]
    ) -> Array:
        """Compute S of one or two free nodes beside patches (start, direction, block ends)."""
        low: list[int] = []
        high: list[int] = []
        for start, sign, ends in patches:
            nodes_between = sorted(start + sign * offset for offset in ends)
            low += nodes_between[:-1]
            high += nodes_between[1:]
        j = np.array(nodes)
        s = self._block(j[:, None], j[:, None] + 1, j[None, :], j[None, :] + 1)
        if not low:
            return s
        a = np.array(low)
        b = np.array(high)
        v = self._block(a[:, None], b[:, None], a[None, :], b[None, :])
        to = self._block(j[:, None], j[:, None] + 1, a[None, :], b[None, :])
        return s - to @ np.linalg.solve(v, to.T)

    def _block(self, a: Array, b: Array, c: Array, d: Array) -> Array:
        """Compute the sum of V over the nodes a … b-1 and c … d-1."""
        f = self._f
        return np.asarray(f[np.abs(b - c)] - f[np.abs(a - c)] - f[np.abs(b - d)] + f[np.abs(a - d)])
