"""The loop that follows a path along stable branches: it acts on the events of a branch."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from adhesis.solver._kernels import SearchedGaps
from adhesis.solver.model.contact_state import ContactState
from adhesis.solver.model.jump import Branch
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.continuation.branch import (
    Accepted,
    Fold,
    Resolution,
    StableBranch,
    Target,
)
from adhesis.solver.sharp.continuation.descent import NoState
from adhesis.solver.sharp.continuation.jump import (
    ComputedJump,
    Event,
    EventOrders,
    History,
    Jumps,
)
from adhesis.solver.sharp.gap.ends import lengths_of, move_edges, positions, step_limits
from adhesis.solver.sharp.mechanics import EdgeMechanics, Point
from adhesis.solver.sharp.nucleation.nucleation import Located, Nucleation
from adhesis.solver.sharp.output.contact_states import BranchData, ContinuationData, States
from adhesis.solver.sharp.tolerances import EQUAL, PINNED_PLACE, SECOND_FOLD_DISPLACED
from adhesis.solver.values import with_values


class Follower:
    """Follows the branches of one problem."""

    def __init__(
        self, problem: Problem, edges: EdgeMechanics, states: States, resolution: Resolution
    ) -> None:
        self.edges, self.states, self.resolution = edges, states, resolution
        self.nucleation = Nucleation(problem, edges)
        self.jumps = Jumps(edges, self.nucleation, states)
        self._came_on: Branch | None = None

    def recall_point(self, data: ContinuationData | None) -> Point | None:
        """Return the point at which a path stopped, if these are the data of its state."""
        self.nucleation.healed = []
        self.nucleation.searched, self._came_on = SearchedGaps(), None
        if data is None or data.stopped is None:
            return None
        d, nearly, rate, slope, previous, pinned, searched, name = data.stopped
        self.nucleation.searched, self._came_on = searched, name
        field = self.edges.field(data.gaps, d, nearly)
        return Point(d, field, rate, slope, previous, pinned)

    def run(self, history: History, point: Point, target: Target) -> tuple[float, Point | None]:
        """Follow a stable branch to the target or through its next jump.

        Returns
        -------
        d, point
            d reached and the stable point there, None if no contact is left.
        """
        if self.edges.adhesion.pins and self._came_on not in (None, target.direction):
            # where a path turns back all its edges are pinned at first
            turned = self.edges.equilibrium(point.gaps, point.d, self.edges.newton_tolerance)
            point = point.with_previous(None) if turned is None else turned
            history.states.append(self.states.of_point(point))
        self._came_on = None
        branch = StableBranch(self.edges, self.resolution, point, target)
        while branch.point.d != target.d:
            event = branch.advance()
            if isinstance(event, Fold):
                jump = self._handle_fold(history, branch, event, target)
            else:
                jump = self._handle_accepted(history, branch, event, target)
            if jump is not None:
                return jump.d, history.commit(jump)
        self._remember(history, branch, target.direction)
        return target.d, branch.point

    def _remember(self, history: History, branch: StableBranch, name: Branch) -> None:
        """Let the last state remember its point."""
        point = branch.point
        stopped = BranchData(
            point.d, point.field.nearly, point.rate, point.slope, point.previous, point.pinned,
            self.nucleation.searched, name,
        )  # fmt: skip
        data = ContinuationData(point.gaps, stopped)
        history.states[-1] = with_values(history.states[-1], internal=data)

    def _handle_accepted(
        self, history: History, branch: StableBranch, event: Accepted, target: Target
    ) -> ComputedJump | None:
        """Hand out the state of an accepted point; return the jump there, if there is one."""
        point = event.point
        output = None
        if event.is_output:
            fixed = self.edges.is_fixed and point.d == target.d
            output = self.states.of_point(point, target.prescribed if fixed else None)
        jump = None
        if event.is_output or event.remaining is not None:
            jump = self._nucleation_jump(branch, target)
        if jump is None and event.remaining is not None:
            before = output or self.states.of_point(point)
            vanished = Event(before, point.d, point.gaps, event.remaining)
            return self.jumps.compute(vanished, target.direction)
        if output is not None:
            onwards = -1.0 if target.direction == "loading" else 1.0
            if jump is None or onwards * (self.states.prescribed_of(output) - jump.d) < 0:
                history.states.append(output)
        return jump

    def _handle_fold(
        self, history: History, branch: StableBranch, fold: Fold, target: Target
    ) -> ComputedJump | None:
        """Return the jump at the end of a branch; None if the branch goes on, or is refined."""
        jump = self._nucleation_jump(branch, target)
        if jump is not None:
            return jump
        if self._may_touch_before(fold):
            branch.trail.append(self.edges.hold(fold.point, fold.d))
            jump = self._nucleation_jump(branch, target)
            if jump is not None:
                return replace(jump, states=(self.states.of_point(fold.point), *jump.states))
        last = history.states[-1] if history.states else None
        jump = self._fold_jump(last, fold, target, branch.smallest_step)
        if jump is None:
            branch.refine()
            return None
        after = jump.point
        if after is not None and fold.d != target.d and self._is_near(fold.point, after):
            # Newton's iteration failed where there was no fold: the branch goes on.
            branch.continue_from(after)
            return None
        return jump

    def _may_touch_before(self, fold: Fold) -> bool:
        """Return whether surfaces may touch on the last step to a fold, the edges being held."""
        point, way = fold.point, abs(fold.d - fold.point.d)
        if not self.edges.is_fixed:
            way *= max(1.0, abs(point.field.solution.by_prescribed()[1]))
        # the mean gap closes by the gaps alone, the faster the less of the period they take
        closing = way * 2 * math.pi / lengths_of(point.gaps)[0].sum()
        return bool(self.nucleation.minimum(point.field)[0] <= closing)

    def _nucleation_jump(self, branch: StableBranch, target: Target) -> ComputedJump | None:
        """Compute the jump where contact first appears in a gap; None if it does not.

        The trail is searched for it, and begins anew.
        """
        trail, start = branch.trail, branch.trail[0].d
        if len(trail) == 1:
            return None
        branch.trail = [branch.point]
        fold, beyond = branch.fold_ahead
        # This ends: a touch that does not hold is found again only where its gap closes further.
        while True:
            touched = self.nucleation.locate(trail)
            if touched is None:
                return None
            apart = math.copysign(1.0, target.d - start) * (fold - touched.point.d)
            if apart < -self.resolution.order:
                return None  # the fold comes first
            may_fold = apart < self.resolution.order
            jump = self._touch_jump(touched, beyond if may_fold else None, target)
            if jump is not None:
                return jump

    def _touch_jump(
        self, touched: Located, beyond: float | None, target: Target
    ) -> ComputedJump | None:
        """Compute the jump from the point of a branch at which surfaces touch inside a gap.

        None if the patches do not hold. A fold that may as well come first has come ``beyond`` that
        d.
        """
        point = touched.point
        if self.edges.critical > 0 and touched.touches[0].opening < -self.nucleation.tolerance:
            raise NoState("surfaces overlap, and no first touch is found", point.d)
        since = self.nucleation.way_since_healed(touched.touches, point.d)
        event = Event(
            self.states.of_point(point),
            point.d,
            point.gaps,
            self.nucleation.insert(point.gaps, touched.touches),
            late=touched.late,
            orders=None if beyond is None else EventOrders(beyond, (point.gaps,)),
        )
        jump = self.jumps.compute(event, target.direction)
        gained = self.jumps.has_gained(point, jump.point, touched.touches)
        if not gained and self.nucleation.heal(touched.touches, point.d):
            return None
        # they hold from somewhere since they last did not, where no energy is lost
        healed = self.states.work(event.before, jump.states[-1], since)
        more = min(healed, abs(jump.jump.energy_drop))
        return replace(jump, misplaced=jump.misplaced + more)

    def _fold_jump(
        self, last: ContactState | None, fold: Fold, target: Target, located: float
    ) -> ComputedJump | None:
        """Compute the jump at a fold; None if it was found too late for its drop."""
        point, pins = fold.point, self.edges.adhesion.pins
        refined = located <= self.resolution.field_limit
        # two works of adhesion keep by how much too late a symmetry was lost
        if pins and not refined and self.edges.symmetry.is_symmetric(point.gaps):
            return None
        states: tuple[ContactState, ...] = ()
        if last is None or last.internal.gaps is not point.field.gaps:
            states = (self.states.of_point(point),)
        before = self.states.of_point(point, held=fold.d)
        start, orders = self._start_at_fold(fold)
        event = Event(before, fold.d, point.gaps, start, late=fold.late, orders=orders)
        jump = self.jumps.compute(event, target.direction)
        after, drop = jump.states[-1], jump.jump.energy_drop
        # a branch that is steep, and does not fold, falls by half of the work that it is late by
        allowed = min(self.resolution.late * max(drop, self.resolution.least_drop), drop)
        if jump.misplaced > allowed and not refined:
            return None
        displaced = self.edges.fold_displacement(point, fold.d - point.d)
        displaced = self.states.work(before, after, displaced)
        # in this order a displacement that is no number leaves the error unknown
        misplaced = jump.misplaced + max(displaced - self.resolution.field_share * abs(drop), 0.0)
        if jump.point is None and self.edges.is_load:
            # The loop is closed at the separation of the last state (``model.control``). There s
            # goes like a square root of the distance from the fold, 2 ds/dd times that further on.
            further = 2 * abs(point.slope) * fold.late / self.states.q0
            misplaced += abs(before.mean_stress) * further
        return replace(jump, states=states + jump.states, misplaced=misplaced)

    def _orders_of_folds(self, fold: Fold) -> EventOrders | None:
        """Return starts from which either of two folds comes first, if both may."""
        two, point = fold.with_another, fold.point
        if two is None:
            return None
        displaced = self.edges.fold_displacement(point, fold.d - point.d)
        if two.apart > max(self.resolution.order, SECOND_FOLD_DISPLACED * displaced):
            return None
        furthest = max(fold.d, two.beyond) if fold.d > point.d else min(fold.d, two.beyond)
        longest = self.edges.longest_step
        starts = tuple(self._moved_on(point.gaps, edge, way * longest) for edge, way in two.ahead)
        return EventOrders(furthest, starts)

    def _start_at_fold(self, fold: Fold) -> tuple[Array, EventOrders | None]:
        """Return the edges from which a descent at a fold starts, and other orders of events.

        A symmetric state may go on as a saddle. That is left to either side. Else of edges that are
        alike one is moved on a little: the first to the right of the highest crest. If they hold
        each other back, it goes first, as one does in any other profile; if they help each other,
        they go together all the same. At a saddle this and both sides count as orders, as their
        ends may differ where several modes soften at once.
        """
        point = fold.point
        if not self.edges.symmetry.is_symmetric(point.gaps):
            return point.gaps, self._orders_of_folds(fold)
        rate = np.abs(point.rate)
        fastest = np.flatnonzero(rate >= (1 - EQUAL) * rate.max())
        away = positions(point.gaps, self.edges.source.highest)[fastest]
        edge = int(fastest[np.argmin(away)])
        way = np.sign(point.rate[edge] * (fold.d - point.d))
        length = self.edges.law.rest_step
        if self.edges.adhesion.pins and len(point.gaps) == 1:  # it stays ahead by as much
            length = PINNED_PLACE * self.edges.field_error
        moved = self._moved_on(point.gaps, edge, way * length)
        start, reach = point.extrapolate(fold.d), self.edges.longest_step
        saddle = self.edges.equilibrium(start, fold.d, reach, strict=False)
        if saddle is not None:
            gaps = saddle.gaps
            if not self.edges.adhesion.pins:  # edges that are pinned keep their places
                gaps = self.edges.symmetry.symmetrised(gaps)
            ways = self.jumps.descents.ways_off_saddle(
                gaps, fold.d, self.edges.law_at(point.gaps), at_fold=True
            )
            if ways:
                return ways[0], EventOrders(fold.d, (*ways, moved))
        return moved, self._orders_of_folds(fold)

    def _moved_on(self, gaps: Array, edge: int, length: float) -> Array:
        """Return gaps with one edge moved outwards by a length in θ, or to its limit."""
        longest = step_limits(gaps, abs(length))
        motion = np.zeros(gaps.size)
        motion[edge] = math.copysign(longest[edge], length)
        return move_edges(gaps, motion)

    def _is_near(self, point: Point, after: Point) -> bool:
        """Whether no edge left the reach of Newton's iteration in a descent."""
        if after.gaps.shape != point.gaps.shape:
            return False
        return bool(np.abs(after.gaps - point.gaps).max() < self.edges.law.rest_step)
