"""States and jumps of a path, in order; they are only appended."""

from __future__ import annotations

from dataclasses import dataclass, field

from adhesis.solver.model.contact_state import ContactState
from adhesis.solver.model.jump import Jump
from adhesis.solver.sharp.equilibrium.branch_point import Point


@dataclass(frozen=True, eq=False)
class ComputedJump:
    """A jump that has been computed, before it belongs to a path.

    Attributes
    ----------
    at : float
        d of the jump.
    states : tuple of ContactState
        States before it that the path does not hold yet, and the one after it.
    jump : Jump
    point : Point or None
        The stable point after it; None if no contact is left.
    before : Point or None
        The last point of the branch that it ends; None if there was none.
    misplaced : float
        Work in J/m² of nominal area by which it may be wrong, not being at its exact place.
    """

    at: float
    states: tuple[ContactState, ...]
    jump: Jump
    point: Point | None
    before: Point | None
    misplaced: float = 0.0


@dataclass
class History:
    """States and jumps of a path.

    Attributes
    ----------
    states : list of ContactState
    jumps : list of Jump
    misplaced : float
        Work in J/m² of nominal area by which the loss may be wrong because jumps were not found at
        their exact places.
    """

    states: list[ContactState] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)
    misplaced: float = 0.0

    def commit(self, computed: ComputedJump) -> None:
        """Append a jump and its states."""
        self.states += computed.states
        self.jumps.append(computed.jump)
        self.misplaced += computed.misplaced
