"""Events of a stable branch, which the loop that follows a path acts on."""

from __future__ import annotations

from dataclasses import dataclass

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.equilibrium.branch_point import Point


@dataclass(frozen=True, eq=False)
class Accepted:
    """A further point of the branch.

    Attributes
    ----------
    point : Point
    is_output : bool
        Whether its state belongs to the path: the trapezoidal rule needs it, or the target is
        reached.
    may_touch : bool
        Whether surfaces may have touched inside a gap since the last search.
    remaining : array, optional
        Where a gap has closed or a patch vanished: the gaps that are left.
    """

    point: Point
    is_output: bool
    may_touch: bool
    remaining: Array | None


@dataclass(frozen=True, eq=False)
class TwoFolds:
    """Two folds of a branch that are predicted nearer to each other than jumps are located.

    Attributes
    ----------
    edges : tuple of int
        The edge that leads to each of them.
    ways : tuple of float
        The way on which it does: 1 outwards of the contact, -1 inwards. Next to the one fold its
        edge takes the other one along, so that the rates there do not show it.
    beyond : float
        d beyond both.
    apart : float
        Their distance in d.
    """

    edges: tuple[int, ...]
    ways: tuple[float, ...]
    beyond: float
    apart: float


@dataclass(frozen=True, eq=False)
class Fold:
    """No stable equilibrium is found a smallest step beyond ``point``.

    Attributes
    ----------
    point : Point
        The last point of the branch.
    at : float
        d a smallest step beyond it, or the target.
    with_another : TwoFolds, optional
        If a second one is near.
    """

    point: Point
    at: float
    with_another: TwoFolds | None = None
