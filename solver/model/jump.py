"""Jumps between contact states after a loss of stability, and their kinds.

The first kind that applies is assigned (a jump may run through several events):

``pull-off``    the last contact is lost.
``snap-in``     a patch appears where there was none.
``merging``     two or more patches become one.
``vanishing``   a patch is lost while others stay.
``splitting``   a patch becomes two.
``spreading``   edges advance, the patches stay the same.
``receding``    edges recede, the patches stay the same.

A jump that begins with a gap that opens inside a patch has the kind ``opening``, whatever comes of
it; a method states that of its jumps.

Spreading and receding are the small-scale mechanism (an edge moves over the roughness of one
patch); the others are the large-scale mechanism (patches form, merge, split, open and vanish).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from adhesis.solver.model.contact_state import ContactState
from adhesis.solver.model.profile import Array, Integers
from adhesis.solver.views import NotebookDisplay

Branch = Literal["loading", "unloading"]
BRANCHES: tuple[Branch, ...] = get_args(Branch)

JumpKind = Literal[
    "pull-off", "snap-in", "merging", "vanishing", "splitting", "spreading", "receding", "opening"
]
JUMP_KINDS: tuple[JumpKind, ...] = get_args(JumpKind)
SMALL_SCALE: frozenset[JumpKind] = frozenset({"spreading", "receding"})


@dataclass(frozen=True)
class Jump(NotebookDisplay):
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
        Length in m of the largest patch, before or after it.
    raced : bool
        True if the end state depends on the assumed speeds of the edges, on which of two mirror
        images is taken, or on the error of the field: which of two near events comes first, or
        whether there is a minimum on the way.
    at_stake : float
        |U_other - U_after| per unit nominal area, in J/m², with U_other the energy of the end state
        at the other speeds, in the other order or on the way; 0 unless ``raced``, or where that end
        is a mirror image or not known.

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
        opens: bool = False,
        falls_off: bool = False,
    ) -> Jump:
        """Make the jump from one contact state to another at the same prescribed value.

        ``opens``: whether it begins with a gap that opens inside a patch. Where the solid falls off
        under a load, the work of that is not counted: the drop is U before
        (:mod:`adhesis.solver.model.control`).
        """
        edges = np.concatenate([before.edges, after.edges])
        kind: JumpKind = "opening" if opens else classify(before.edges, after.edges, period)
        return cls(
            branch=branch,
            separation=before.separation,
            energy_drop=(before.energy if falls_off else before.potential - after.potential)
            / period,
            kind=kind,
            patches_before=before.patches,
            patches_after=after.patches,
            contact_before=before.contact_fraction,
            contact_after=after.contact_fraction,
            patch_length=float((edges[:, 1] - edges[:, 0]).max(initial=0.0)),
            raced=raced,
            at_stake=at_stake,
        )

    @property
    def small_scale(self) -> bool:
        """True if the patches stay the same and only their edges move."""
        return self.kind in SMALL_SCALE


def classify(before: Array, after: Array, period: float) -> JumpKind:
    """Classify a jump.

    Parameters
    ----------
    before, after : array, shape (patches, 2)
        Edges in m, as in :class:`~adhesis.solver.model.contact_state.ContactState`.
    period : float
        λ in m.
    """
    if len(after) == 0:
        return "pull-off"
    touching = _overlaps(after, before, period)
    if touching.min() == 0:
        return "snap-in"
    if touching.max() > 1:
        return "merging"
    touched_by = _overlaps(before, after, period)
    if touched_by.min() == 0:
        return "vanishing"
    if touched_by.max() > 1:
        return "splitting"
    grown = (after[:, 1] - after[:, 0]).sum() - (before[:, 1] - before[:, 0]).sum()
    return "spreading" if grown >= 0 else "receding"


def _overlaps(patches: Array, others: Array, period: float) -> Integers:
    """Count, for each patch, the ``others`` that overlap it on the circle.

    Patches of one state do not overlap, so their left and right edges have the same order.
    """
    turns = np.concatenate([others - period, others, others + period])
    begin = np.searchsorted(turns[:, 1], patches[:, 0], side="right")
    behind = np.searchsorted(turns[:, 0], patches[:, 1])
    return np.asarray(np.clip(behind - begin, 0, len(others)), dtype=np.int64)
