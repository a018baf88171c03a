"""Jumps between contact states after a loss of stability, and their kinds.

The first kind that applies is assigned (a jump may run through several events):

``pull-off``    the last contact is lost.
``snap-in``     a patch appears where there was none.
``merging``     two or more patches become one.
``vanishing``   a patch is lost while others stay.
``splitting``   a patch becomes two.
``spreading``   edges advance, the patches stay the same.
``receding``    edges recede, the patches stay the same.

A jump that begins with a gap that opens inside a patch, at a finite strength of the interface, has
the kind ``opening``, whatever comes of it.

Spreading and receding are the small-scale mechanism (an edge moves over the roughness of one
patch); the others are the large-scale mechanism (patches form, merge, split, open and vanish).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.contact_state import ContactState
from adhesis.solver.model.profile import Array
from adhesis.solver.views import Shown

Indices = NDArray[np.int64]

Branch = Literal["loading", "unloading"]
BRANCHES: tuple[Branch, ...] = get_args(Branch)

JumpKind = Literal[
    "pull-off", "snap-in", "merging", "vanishing", "splitting", "spreading", "receding", "opening"
]
JUMP_KINDS: tuple[JumpKind, ...] = get_args(JumpKind)
SMALL_SCALE: frozenset[JumpKind] = frozenset({"spreading", "receding"})


@dataclass(frozen=True)
class Jump(Shown):
    """One jump, at a fixed prescribed value.

    Attributes
    ----------
    branch : {"loading", "unloading"}
    separation : float
        s at which stability is lost, in m.
    energy_drop : float
        U before minus U after (the potential W if the separation is not fixed), per unit nominal
        area, in J/m². Negative by at most the error of the energies, which then counts in the error
        of the loss. At the loss of contact under a load it is U before, of either sign
        (:mod:`adhesis.solver.model.control`).
    kind : JumpKind
    patches_before, patches_after : int
    contact_before, contact_after : float
        Contact fractions.
    patch_length : float
        Length in m of the largest patch that the jump changed, before or after it.
    raced : bool
        True if the end state depends on the assumed edge kinetics.
    at_stake : float
        |U_other - U_after| per unit nominal area, in J/m², with U_other the energy of the end state
        under the other assumed edge kinetics; 0 unless ``raced``.
    barrier : float
        Of an opening, the energy per unit nominal area, in J/m², up to the crack that grows by
        itself, which adhesion of zero range has to be lifted over; else 0.

    References
    ----------
    docs/theory.md, "4. Jumps and mechanisms"
    """

    branch: Branch
    separation: float
    energy_drop: float
    kind: JumpKind
    patches_before: int
    patches_after: int
    contact_before: float
    contact_after: float
    patch_length: float
    raced: bool = False
    at_stake: float = 0.0
    barrier: float = 0.0

    @classmethod
    def between(
        cls,
        before: ContactState,
        after: ContactState,
        branch: Branch,
        period: float,
        *,
        raced: bool = False,
        at_stake: float = 0.0,
        barrier: float = 0.0,
    ) -> Jump:
        """Make the jump from one contact state to another at the same prescribed value.

        Parameters
        ----------
        before, after : ContactState
        branch : {"loading", "unloading"}
        period : float
            λ in m.
        raced, at_stake, barrier
            As in the class; a jump with a barrier is an opening.
        """
        kind, length = classify(before.edges, after.edges, period)
        if barrier > 0:
            kind = "opening"
        return cls(
            branch=branch,
            separation=before.separation,
            energy_drop=(before.potential - after.potential) / period,
            kind=kind,
            patches_before=before.patches,
            patches_after=after.patches,
            contact_before=before.contact_fraction,
            contact_after=after.contact_fraction,
            patch_length=length,
            raced=raced,
            at_stake=at_stake,
            barrier=barrier,
        )

    @property
    def small_scale(self) -> bool:
        """True if the patches stay the same and only their edges move."""
        return self.kind in SMALL_SCALE


def classify(before: Array, after: Array, period: float) -> tuple[JumpKind, float]:
    """Classify a jump; returns its kind and the length (m) of the largest patch that it changed.

    Parameters
    ----------
    before, after : array, shape (patches, 2)
        Edges in m, as in :class:`~adhesis.solver.model.contact_state.ContactState`.
    period : float
        λ in m.
    """
    if len(after) == 0:
        longest = float((before[:, 1] - before[:, 0]).max()) if len(before) else 0.0
        return "pull-off", longest
    touches, one = _overlapping(before, after, period)
    touched, other = _overlapping(after, before, period)
    length = 0.0
    for mine, others, hits, hit in ((before, after, touches, one), (after, before, touched, other)):
        moved = hits != 1
        single = np.flatnonzero(~moved)
        moved[single] = ~_same(mine[single], others[hit[single]], period)
        length = float((mine[moved, 1] - mine[moved, 0]).max(initial=length))
    if (touched == 0).any():
        return "snap-in", length
    if (touched > 1).any():
        return "merging", length
    if (touches == 0).any():
        return "vanishing", length
    if (touches > 1).any():
        return "splitting", length
    grown = (after[:, 1] - after[:, 0]).sum() - (before[:, 1] - before[:, 0]).sum()
    return ("spreading" if grown >= 0 else "receding"), length


def _overlapping(patches: Array, others: Array, period: float) -> tuple[Indices, Indices]:
    """Count, for each patch, the ``others`` that overlap it on the circle; returns the first too.

    Patches of one state do not overlap, so their left and right edges have the same order.
    """
    if len(others) == 0:
        return np.zeros(len(patches), dtype=np.int64), np.zeros(len(patches), dtype=np.int64)
    order = np.argsort(others[:, 0])
    turns = period * np.arange(-1, 2)
    left = np.add.outer(turns, others[order, 0]).ravel()
    right = np.add.outer(turns, others[order, 1]).ravel()
    first = np.searchsorted(right, patches[:, 0], side="right")
    stop = np.searchsorted(left, patches[:, 1], side="left")
    hits = np.minimum(np.maximum(stop - first, 0), len(others))  # clip() takes ten times as long
    return hits, order[first % len(others)]


def _same(one: Array, two: Array, period: float) -> NDArray[np.bool_]:
    """Compare the edges of patches on the circle."""
    offset = (one[:, 0] - two[:, 0] + period / 2) % period - period / 2
    change = (one[:, 1] - one[:, 0]) - (two[:, 1] - two[:, 0])
    same: NDArray[np.bool_] = np.maximum(np.abs(offset), np.abs(change)) < 1e-12 * period
    return same
