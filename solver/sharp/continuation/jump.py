"""Jumps: what comes of an event at which a branch is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from adhesis.solver.method import ContactState
from adhesis.solver.model.jump import Branch, Jump
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.continuation.descent import Descents, FullContact, NoState, Rival
from adhesis.solver.sharp.mechanics import EdgeMechanics, Point
from adhesis.solver.sharp.nucleation.nucleation import Nucleation, Touch
from adhesis.solver.sharp.output.contact_states import States
from adhesis.solver.sharp.tolerances import ENDLESS


@dataclass(frozen=True, eq=False)
class ComputedJump:
    """A jump that has been computed, before it belongs to a path.

    Attributes
    ----------
    states : tuple of ContactState
        The state before it and the one after it; before these states that led there.
    point : Point or None
        The stable point after it; None if no contact is left.
    misplaced : float
        Work in J/m² of nominal area by which it may be wrong, not being at its exact place.
    """

    d: float
    states: tuple[ContactState, ...]
    jump: Jump
    point: Point | None
    misplaced: float


@dataclass
class History:
    """States and jumps of a path, and the sum of the works by which these may be wrong."""

    states: list[ContactState] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)
    misplaced: float = 0.0

    def commit(self, computed: ComputedJump) -> Point | None:
        """Append a jump and its states, and return the point after it."""
        self.states += computed.states
        self.jumps.append(computed.jump)
        self.misplaced += computed.misplaced
        return computed.point


@dataclass(frozen=True)
class EventOrders:
    """Two events so near to each other that either may come first.

    Attributes
    ----------
    beyond : float
        d beyond both.
    starts : tuple of array, shape (L, 2)
        Gaps from which what the one or the other begins goes first.
    """

    beyond: float
    starts: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Event:
    """An event by which a branch is left: a touch, a fold, or something that vanishes.

    Attributes
    ----------
    before : ContactState
        The state before it.
    d : float
    left : array, shape (L, 2)
        Gaps of the branch there; empty out of contact.
    start : array, shape (L, 2)
        Gaps from which the edges run, with what has nucleated and without what has vanished.
    late : float
        How far in d the event may have come before.
    orders : EventOrders, optional
        If it may as well come after another one.
    """

    before: ContactState
    d: float
    left: Array
    start: Array
    late: float = 0.0
    orders: EventOrders | None = None


class Jumps:
    """Jumps of one problem."""

    def __init__(self, edges: EdgeMechanics, nucleation: Nucleation, states: States) -> None:
        self.edges, self.nucleation, self.states = edges, nucleation, states
        self.symmetry = edges.symmetry
        self.descents = Descents(edges, states)
        self._first: tuple[float, list[Touch]] | None = None

    def first_touch(self) -> tuple[float, list[Touch]]:
        """Find the separation q0 s at which a solid that approaches touches, and the touches.

        The highest crest is then as far away as adhesion reaches; or nearer, where no patch grows
        there or the one that does comes to rest with more energy than no contact has.
        """
        if self._first is None:
            nucleation = self.nucleation
            self._first = nucleation.first_touch()
            low, high = 0.0, nucleation.range
            trial = high
            while high - low > nucleation.tolerance:
                touch = nucleation.first_touch(trial)
                if self._holds(*touch):
                    low, self._first = trial, touch
                else:
                    high = trial
                trial = 0.5 * (low + high)
        return self._first

    def _holds(self, separation: float, touches: list[Touch]) -> bool:
        """Return whether the patches at first touches come to rest with less energy than none."""
        if not touches:
            return False
        d = 0.0 if self.edges.is_load else separation
        try:
            point, _ = self.descents.relax(self.nucleation.insert(np.empty((0, 2)), touches), d)
        except FullContact:
            return True
        return point is not None and self.states.of_point(point).potential < 0

    def compute(self, event: Event, direction: Branch) -> ComputedJump:
        """Descend from an event to the next state in which nothing touches.

        The point of the result is the minimum as it was found: next to a fold it may not be found
        again from its own edges. The jump raced, too, if another order of events leads elsewhere
        in the end, or if it ends on one of two sides that are mirror images. Under a load no other
        order is sought.
        """
        rivals: list[Rival] = []
        before, d = event.before, event.d

        def descend(gaps: Array) -> Point | None:
            return self.descents.to_minimum(gaps, d, rivals)

        point = self._nucleate_until_clear(descend(event.start), d, descend)
        after = self._after(before, point, d)
        at_stake = None
        try:
            if rivals:
                if isinstance(rivals[0], Exception):
                    raise rivals[0]
                rival = self._end_of(rivals[0], d, equal_speeds=True)
                at_stake = self._at_stake(before, point, rival, d)
            if at_stake is None and event.orders is not None and self.descents.may_race:
                at_stake = self._at_stake_beyond(before, point, event.orders)
        except (FullContact, NoState):  # elsewhere, or unknown where: no energy to be compared
            at_stake = 0.0
        unlike = point is not None and self.symmetry.is_broken(event.left, point.gaps)
        if at_stake is None and unlike:
            at_stake = 0.0
        jump = Jump.between(
            before, after, direction, self.states.period, raced=at_stake is not None,
            at_stake=at_stake or 0.0, falls_off=self.edges.is_load and not after.patches,
        )  # fmt: skip
        misplaced = self.states.work(before, after, event.late)
        return ComputedJump(d, (before, after), jump, point, misplaced)

    def _at_stake_beyond(
        self, before: ContactState, point: Point | None, event_orders: EventOrders
    ) -> float | None:
        """Difference in J/m² of the energies to which two events lead in either order, or None."""
        d = event_orders.beyond

        def end(start: Array) -> Point | None:
            return self._end_of(self.descents.relax(start, d)[0], d)

        both = None if point is None else end(point.gaps)
        differences = [self._at_stake(before, both, end(start), d) for start in event_orders.starts]
        return max((one for one in differences if one is not None), default=None)

    def _at_stake(
        self, before: ContactState, point: Point | None, rival: Point | None, d: float
    ) -> float | None:
        """Difference of the energies of two ends in J/m²; None if one, or one in another part."""
        if self.descents.is_same_minimum(rival, point):
            return None
        if point and rival and self.symmetry.are_copies(point.gaps, rival.gaps):
            return None
        if point and rival and self.symmetry.are_images(point.gaps, rival.gaps):
            return 0.0
        ends = [self._after(before, end, d).potential for end in (point, rival)]
        return abs(ends[1] - ends[0]) / self.states.period

    def _after(self, before: ContactState, point: Point | None, d: float) -> ContactState:
        """State that a descent led to.

        Under a load the loop is closed where contact is lost (``model.control``).
        """
        if point is not None:
            return self.states.of_point(point)
        apart = before.separation if self.edges.is_load else d / self.states.q0
        return ContactState.detached(apart)

    def _end_of(self, point: Point | None, d: float, equal_speeds: bool = False) -> Point | None:
        """Go on from a minimum at ``d`` until nothing touches."""

        def relaxed(gaps: Array) -> Point | None:
            return self.descents.relax(gaps, d, equal_speeds=equal_speeds)[0]

        return self._nucleate_until_clear(point, d, relaxed)

    def _nucleate_until_clear(
        self,
        point: Point | None,
        d: float,
        descend: Callable[[Array], Point | None],
    ) -> Point | None:
        """Let contact nucleate wherever surfaces overlap in a minimum, the deepest place first.

        Raises
        ------
        PathError
            If an overlap stays.
        """
        # without adhesion patches narrower than the least are left out, and overlap so much
        adhesive = self.edges.critical > 0
        for _ in range(ENDLESS):
            if point is None:
                touch, touches = self.first_touch()
                if not (adhesive and self.states.attracts_when_detached(d, touch)):
                    return None
                point = descend(self.nucleation.insert(np.empty((0, 2)), touches))
                if point is None and not self.states.attracts_when_detached(d):
                    return None
                continue
            least, minima = self.nucleation.minimum(point.field)
            if least > 0:
                return point
            seeds = self.nucleation.choose(minima)
            grown = descend(self.nucleation.insert(point.gaps, seeds))
            if self.has_gained(point, grown, seeds):
                point = grown
            elif not self.nucleation.heal(seeds, d):
                if adhesive and least < -self.nucleation.tolerance:
                    break
                return point
        raise NoState("surfaces overlap, and no patch comes to rest there", d)

    def has_gained(self, before: Point, after: Point | None, touches: list[Touch]) -> bool:
        """Return whether touches led to another state, with less energy where that is needed.

        Contact that nucleates in an open gap may come to rest with more, which no jump has.
        """
        if after is None:
            return True
        if self.nucleation.range > 0 and touches[0].opening > 0:
            both = (self.states.of_point(point).potential for point in (before, after))
            return not next(both) <= next(both)
        return not self.descents.is_same(after.field.gaps, before.field.gaps)
