"""Edges of a contact set: their moves, and the energy of moving each by one node."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.lattice import Lattice
from adhesis.solver.model.profile import Array
from adhesis.solver.peaks import patch_ranges

Indices = NDArray[np.intp]

Key = tuple[int, ...]
"""Identifies a move: side of the first edge, the nodes of one or two edges, direction."""


class Move(NamedTuple):
    """One edge's move by ``length`` nodes, or none, outwards (``direction`` +1) or inwards (-1)."""

    edge: int
    direction: int
    length: int
    release: float
    key: Key
    carried: float = 0.0


@dataclass(frozen=True)
class Edges:
    """The two edges of every patch: left edges first, then right ones; shape (2 patches,) each.

    Attributes
    ----------
    side : int array
        -1 for a left edge, +1 for a right one.
    inner, outer : int array
        The contact node and the free node at the edge.
    width, gap : int array
        Nodes of the patch, and free nodes beyond the edge.
    growth, recession : array
        Energy in J/m of adding ``outer``, of removing ``inner``; infinite if not allowed.
    overlap : bool array
        True if ``outer`` overlaps the rigid profile: it then joins whatever the energy.
    """

    side: Indices
    inner: Indices
    outer: Indices
    width: Indices
    gap: Indices
    growth: Array
    recession: Array
    overlap: NDArray[np.bool_]


def survey(contact: Contact, lattice: Lattice) -> Edges:
    """Compute the energy of moving every edge of a solved contact.

    A node counts as overlapping where it does so by more than the residual inside contact.
    """
    n, dx = lattice.n, lattice.dx
    compliance, adhesion = lattice.compliance, lattice.adhesion
    first, width = patch_ranges(contact.mask)
    count = first.size
    last = first + width - 1
    after_patch = np.append(first[1:], first[:1] + n) - last - 1  # free nodes
    gap = np.concatenate([after_patch[-1:], after_patch[:-1], after_patch])
    inner, outer = np.concatenate([first, last % n]), np.concatenate([first - 1, last + 1]) % n
    grow, recede = [0.0] * (2 * count), [0.0] * (2 * count)
    w, gl, gr = width.tolist(), gap[:count].tolist(), gap[count:].tolist()
    total = sum(w)
    for k in range(count):
        before, after = w[k - 1], w[(k + 1) % count]
        if count == 2:  # one patch, on both sides
            before, after = before // 2, after - after // 2
        else:
            rest = total - w[k] - before - after
            before, after = before + rest // 2, after + rest - rest // 2
        for edge, near, near_gap, far_gap, far in (
            (k, before, gl[k], gr[k], after),
            (count + k, after, gr[k], gl[k], before),
        ):
            others = None if count == 1 else (near, far_gap, far)
            grow[edge] = compliance(w[k], near_gap, others)
            recede[edge] = compliance(w[k] - 1, near_gap + 1, others)
    s_grow, s_recede = np.array(grow), np.array(recede)

    factor, gap_rate = lattice.extra_compliance(contact, outer)
    s_grow += factor * gap_rate**2
    s_recede += factor * gap_rate**2  # with that of the free node next to the one removed
    t = lattice.gap(contact, outer)
    growth = dx * (0.5 * t**2 / s_grow - adhesion[outer])
    overlap = t < -contact.residual
    # The last free node never joins: the mean gap is the separation, and it is positive.
    free = n - total
    if free <= 1:
        growth[:] = np.inf
        overlap[:] = False
    stress = contact.stress[inner]
    recession = np.where(stress < 0, dx * (adhesion[inner] - 0.5 * stress**2 * s_recede), np.inf)
    side, both_widths = np.repeat(np.array([-1, 1]), count), np.tile(width, 2)
    return Edges(side, inner, outer, both_widths, gap, growth, recession, overlap)
