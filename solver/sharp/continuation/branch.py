"""A stable branch: predictor, corrector, and what ends it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adhesis.solver.method import ContactState
from adhesis.solver.model.jump import Branch
from adhesis.solver.sharp.continuation.jump import Jumps
from adhesis.solver.sharp.continuation.local_branch import Astray, advance, confirmed, led_by
from adhesis.solver.sharp.continuation.predictor import Course
from adhesis.solver.sharp.continuation.trail import Walk
from adhesis.solver.sharp.equilibrium.branch_point import Point, PreviousPoint
from adhesis.solver.sharp.gap.ends import without_small
from adhesis.solver.sharp.mechanics import CORRECTED, EdgeMechanics
from adhesis.solver.sharp.nucleation.clearance import NOT_SEEN
from adhesis.solver.sharp.nucleation.nucleation import Located, Nucleation
from adhesis.solver.sharp.output.contact_states import Memory, States, Trace

_BEGUN = 0.05  # longest first step of an edge after a jump, in λ_min: there its course is straight
_PREDICTED = 0.15  # longest predicted motion of an edge in one continuation step, in λ_min
# A gap closes locally at most so many times faster than gaps on average; where there are many, a
# look for touches costs more than to go back to one that was passed.
_FASTEST_CLOSING = 4.0
_CLOSING_OF_MANY = 1.0
_ADVANCING = 4.0  # so many times the motion of one gap's edges closes others, where there are many
_SAME = 1e-3  # edges that a jump moves by less than this, in λ_min, have not left their branch
_FINER = 1e-2  # tolerance, over that of the path, of the field that shows the error of the path's
_QUIET = 0.05  # mean stresses below this (in units of σ~ = 1) do not tighten the trapezoidal rule


@dataclass(frozen=True)
class Resolution:
    """How finely a path is followed; separations as q0 s.

    Attributes
    ----------
    jump : float
        Separation to which a jump is located.
    bend : float
        Largest relative error of the trapezoidal rule over one step.
    scale : float
        q0 h_max.
    finest : float
        No jump is located more finely than this.
    late : float
        Work that a jump may add to the loss by being found late, in units of its drop.
    least_drop : float
        Drop in J/m² below which jumps need not be located more finely.
    field_share : float
        Share of every drop that counts as its error by the error of the field.
    """

    jump: float
    bend: float
    scale: float
    finest: float
    late: float
    least_drop: float
    field_share: float


@dataclass(frozen=True)
class Target:
    """Where a path goes: d, the same in m or Pa without rounding, and on which branch."""

    at: float
    prescribed: float
    branch: Branch


class Follower:
    """Follows the branches of one problem.

    Parameters
    ----------
    edges : EdgeMechanics
    nucleation : Nucleation
    states : States
    jumps : Jumps
    resolution : Resolution
    """

    def __init__(
        self,
        edges: EdgeMechanics,
        nucleation: Nucleation,
        states: States,
        jumps: Jumps,
        resolution: Resolution,
    ) -> None:
        self.edges, self.nucleation, self.states, self.jumps = edges, nucleation, states, jumps
        self.resolution = resolution
        self._last: tuple[Memory, Point] | None = None

    def remembered(self, memory: Memory | None) -> Point | None:
        """Point at which a path stopped, if this is the memory of its state."""
        self.nucleation.clearances.seen = NOT_SEEN if memory is None else memory.seen
        if memory is None or memory.course is None:
            return None
        if self._last is not None and self._last[0] is memory:
            return self._last[1]
        at, rate, slope = memory.course
        return Point(at, self.edges.field(memory.gaps, at), rate, slope, memory.clearance)

    def equilibrium(self, point: Point, at: float) -> Point | None:
        """Stable equilibrium at q0 s = ``at`` near the one predicted from ``point``."""
        return self.edges.equilibrium(point.extrapolate(at), at, CORRECTED * self.edges.wave)

    def run(self, trace: Trace, point: Point, target: Target) -> tuple[float, Point | None]:
        """Walk along a stable branch to the target or through its next jump.

        Returns
        -------
        at, point
            d reached and the stable state there, None if no contact is left.
        """
        wanted = np.inf
        finest = self.resolution.jump
        lost = np.inf  # distance of the nearest d at which no equilibrium was found
        across = False  # whether to step across the fold that is seen, after a failure short of it
        course = Course(point)  # straight at first: short steps there keep the integral exact
        walk = Walk(point)
        shown = point
        windows = len(point.gaps) >= self.edges.many
        led: Point | None = None  # where an edge leads that had led astray
        while point.at != target.at:
            step = self._next_step(course, target.at, wanted, finest, lost, across)
            reached = None
            try:
                reached = self._advance(course, step, target.at, windows)
                if reached is None and (across or abs(step) <= finest) and windows:
                    point = walk.confirm()
                if reached is not None:
                    error = self._trapezoid_error(shown, reached)
                    closed = self._closed(point, reached, target.branch)
                    there = reached.at == target.at
                    small = without_small(reached.gaps, self.edges.smallest)
                    looks = walk.closed + closed >= walk.clearance or small is not None
                    # What was stepped across for want of a nearer point cannot be halved.
                    coarse = error > 4 and abs(step) > 2 * self.resolution.finest and not across
                    if not coarse and (error > 1 or there or looks):
                        reached = confirmed(reached)
            except Astray as astray:
                far = point.at if reached is None else reached.at
                point, lost = walk.back(), np.inf
                # once at a point the window moves to the edge outside that led astray
                windows = point is not led and led_by(self.edges, point, astray.edge)
                led = point
                course = Course(point)
                wanted = 0.5 * abs(far - point.at)
                continue
            if reached is None:
                if abs(step) > finest and not across:
                    lost = abs(step)
                    wanted = max(0.25 * abs(step), 0.999 * finest)
                    continue
                across = not across and abs(step) < course.ahead < 2 * finest
                if across:
                    continue
                touched = self._look(trace, walk, target.branch)
                if touched is not None:
                    return self._touch(trace, touched, target.branch)
                at = target.at if step == target.at - point.at else point.at + step
                touched = self._touch_before_fold(point, at)
                if touched is not None:
                    trace.states.append(self.states.of_point(point))
                    return self._touch(trace, touched, target.branch)
                known = len(trace.states), len(trace.jumps), trace.misplaced
                after, better = self._fold(trace, point, at, target.branch, finest)
                if windows and self._nearby(point, after):
                    # A window's verdict that this is a fold is not taken for that of all edges:
                    # where the descent ends nearby, the step is taken once more with all of them.
                    del trace.states[known[0] :], trace.jumps[known[1] :]
                    trace.misplaced = known[2]
                    windows, course = False, Course(point)
                    continue
                if better < finest:
                    wanted = finest = better
                    continue
                if at != target.at and not windows and after and self._same(point, after):
                    # Newton's iteration failed where there was no fold: the branch goes on.
                    del trace.states[known[0] :], trace.jumps[known[1] :]
                    trace.misplaced = known[2]
                    walk.add(after, self._closed(point, after, target.branch))
                    point, course, across, lost = after, Course(after), False, np.inf
                    continue
                return at, after
            if coarse:  # also where a branch bends more sharply than jumps are located
                wanted = 0.5 * abs(step)
                finest = min(finest, wanted)
                continue
            reached = reached.with_previous(PreviousPoint(point.at, point.rate, point.gaps))
            walk.add(reached, closed)
            if error > 1 or there:
                exact = None
                if there and self.states.problem.control.is_fixed:
                    exact = target.prescribed
                walk.pending.append(self.states.of_point(reached, exact))
                shown = reached
            # Every state that is handed out is looked at; between states only if a gap may have
            # closed.
            if looks or walk.pending:
                touched = self._look(trace, walk, target.branch)
                if touched is not None:
                    return self._touch(trace, touched, target.branch)
            if small is not None:
                if shown is not reached:
                    trace.states.append(self.states.of_point(reached))
                last = trace.states[-1]
                after = self.jumps.run(trace, last, small, reached.at, target.branch, known=reached)
                return reached.at, after
            course = Course(reached)
            point, wanted, across = reached, 2 * abs(step), False
            # only before a fold is a failure more than that of a prediction
            lost = lost - abs(step) if np.isfinite(course.ahead) else np.inf
            windows = len(point.gaps) >= self.edges.many
        trace.states += walk.pending
        # What has not closed since the last look need not be looked at again.
        point = point.with_clearance(max(walk.clearance - walk.closed, 0.0))
        remembered = Memory(
            point.field.gaps,
            point.clearance,
            (point.at, point.rate, point.slope),
            self.nucleation.clearances.seen,
        )
        # Few gaps have one field, whichever way it was come to; of many it depends on the way.
        few = len(point.field.gaps) < self.edges.many
        self._last = (remembered, point.with_previous(None)) if few else None
        trace.states[-1] = replace(trace.states[-1], internal=remembered)
        return target.at, point

    def _look(self, trace: Trace, walk: Walk, branch: Branch) -> Located | None:
        """Whether surfaces have touched since the last look; hands out the states before that."""
        touched = None
        if len(walk.trail) > 1:
            touched, clearance = self.nucleation.located(
                walk.trail, self.resolution.jump, walk.clearance
            )
            walk.restart(clearance)
        way = -1.0 if branch == "loading" else 1.0
        for state in walk.pending:
            if touched is None or way * (self.states.place(state) - touched.point.at) < 0:
                trace.states.append(state)
        walk.pending.clear()
        return touched

    def _closed(self, point: Point, reached: Point, branch: Branch) -> float:
        """Estimate, on the safe side, of how far a gap has closed locally over a step."""
        if branch == "loading":
            return abs(reached.at - point.at) * self._closing(reached)
        # While the mean gap widens only edges that run can close a gap elsewhere.
        each = np.abs(reached.gaps - point.gaps).sum(axis=1)
        many = len(each) >= self.edges.many
        moved = float(_ADVANCING * each.max() if many else np.abs(reached.gaps - point.gaps).sum())
        return float(self.edges.critical / np.sqrt(self.edges.wave) * moved)

    def _closing(self, point: Point) -> float:
        """How fast a gap may close locally along the branch, in units of d."""
        closing = self._held_closing(point)
        if self.states.problem.control.is_fixed:
            return closing
        # d(q0 s)/dd along the branch, from d = weight q0 s - compliance p and dY/dd
        weight, compliance = self.edges.model.device
        mean = 1 + compliance * point.slope if weight else point.slope
        return closing * max(1.0, abs(mean))

    def _held_closing(self, point: Point) -> float:
        """How fast a gap may close locally while edges are held, in units of q0 s.

        The mean gap closes by the gaps alone, the faster the less of the period they take.
        """
        many = len(point.gaps) >= self.edges.many
        fastest = _CLOSING_OF_MANY if many else _FASTEST_CLOSING
        return float(fastest * 2 * np.pi / np.diff(point.gaps, axis=1).sum())

    def _touch(self, trace: Trace, touched: Located, branch: Branch) -> tuple[float, Point | None]:
        """Jump from the point of a branch at which surfaces touch inside a gap."""
        point = touched.point
        before = self.states.of_point(point)
        trace.states.append(before)
        gaps = point.field.gaps
        after = self.jumps.run(trace, before, gaps, point.at, branch, touched.touches, point)
        trace.misplaced += self._late(before, trace.states[-1], touched.late)
        return point.at, after

    def _touch_before_fold(self, point: Point, at: float) -> Located | None:
        """Where surfaces touch on the last step to a fold, its edges being held; None if nowhere.

        The fold lies somewhere on that step, too: which of the two comes first is not resolved.
        """
        low = self.nucleation.least(point.field)[0]
        way = abs(at - point.at)
        if not self.states.problem.control.is_fixed:
            way *= max(1.0, abs(point.field.separation_by_prescribed))
        if low > self._held_closing(point) * way:
            return None
        return self.nucleation.located_held(point, low, at)

    def _fold(
        self, trace: Trace, point: Point, at: float, branch: Branch, finest: float
    ) -> tuple[Point | None, float]:
        """Jump at d = ``at``, a step beyond the last point of a branch.

        Returns the point after the jump, and the separation to which the jump is to be located:
        below ``finest`` the jump was found too late for its drop, and was not recorded.
        """
        states, jumps = len(trace.states), len(trace.jumps)
        if not states or trace.states[-1].internal.gaps is not point.field.gaps:
            trace.states.append(self.states.of_point(point))
        before = self.states.shifted(trace.states[-1], point.field, at)
        trace.states.append(before)
        after = self.jumps.run(trace, before, point.field.gaps, at, branch, known=point)
        late = self._late(before, trace.states[-1], abs(at - point.at))
        drop = trace.jumps[-1].energy_drop
        allowed = self.resolution.late * max(drop, self.resolution.least_drop)
        if late > allowed and finest > self.resolution.finest:
            del trace.states[states:], trace.jumps[jumps:]
            share = max(0.5 * allowed / late, 1e-3)
            return None, max(share * min(abs(at - point.at), finest), self.resolution.finest)
        displaced = self._late(before, trace.states[-1], self._displaced(point))
        trace.misplaced += late + max(0.0, displaced - self.resolution.field_share * abs(drop))
        if after is None and self.states.problem.control.is_load:
            trace.misplaced += self._closed_early(before, point, abs(at - point.at))
        return after, finest

    def _closed_early(self, before: ContactState, point: Point, way: float) -> float:
        """Work in J/m² that a loop under a load misses at most, as it is closed short of the fold.

        It is closed at the separation of the last state (``control``), a
        ``way`` in d or less before the fold. There s goes like a square root of the distance from
        the fold, which therefore lies 2 ds/dd times that distance further on.
        """
        return abs(before.mean_stress) * 2 * abs(point.slope) * way / self.states.q0

    def _displaced(self, point: Point) -> float:
        """Estimate how far (in d) the error of the field displaces the fold next to ``point``.

        The error of the openings is their difference from those of a more accurate field.
        """
        finer = self.edges.field(point.gaps, point.at, share=_FINER)
        return abs(point.fold_displacement(finer.opening - point.field.opening))

    def _same(self, point: Point, after: Point) -> bool:
        """Whether a descent from ``point`` led hardly anywhere: to its own branch."""
        if after.gaps.shape != point.gaps.shape:
            return False
        return bool(np.abs(after.gaps - point.gaps).max() < _SAME * self.edges.wave)

    def _nearby(self, point: Point, after: Point | None) -> bool:
        """Whether a descent from ``point`` led no further than a step along a branch."""
        if after is None or after.gaps.shape != point.gaps.shape:
            return False
        return bool(np.abs(after.gaps - point.gaps).max() < _PREDICTED * self.edges.wave)

    def _late(self, before: ContactState, after: ContactState, late: float) -> float:
        """Work in J/m² that a jump found ``late`` (in d) adds to the loss, at most."""
        return self.states.work(before, after, late)

    def _next_step(
        self,
        course: Course,
        target: float,
        wanted: float,
        finest: float,
        lost: float,
        across: bool,
    ) -> float:
        """Next step in q0 s: no edge moves too far by prediction, the target is not passed.

        Nor is a place where no equilibrium was found, ``lost`` ahead, unless it is to lead
        ``across`` the fold that is seen.
        """
        many = len(course.point.gaps) >= self.edges.many
        most = _PREDICTED if course.way != 0 or many else _BEGUN
        size = min(wanted, course.reach(most * self.edges.wave, finest))
        if 0 < lost <= size:
            size = 0.5 * lost
        if not course.ahead < finest:
            size = max(size, 0.999 * finest)
        if across:
            size = course.across(finest)
        left = target - course.point.at
        return left if size >= abs(left) else float(np.copysign(size, left))

    def _advance(self, course: Course, step: float, target: float, windows: bool) -> Point | None:
        """Predict and correct; None if no stable equilibrium is within reach."""
        point = course.point
        if np.isinf(course.ahead) and (
            course.fastest * abs(step) > 2 * _PREDICTED * self.edges.wave
        ):
            return None
        at = target if step == target - point.at else point.at + step
        return advance(self.edges, course, at, windows)

    def _trapezoid_error(self, shown: Point, point: Point) -> float:
        """Error of the trapezoidal rule since the last state shown, in units of what is allowed."""
        span = abs(point.at - shown.at)
        # p = q0 h_max is σ~ = 1
        load = self.states.problem.control.is_load
        conjugate = point.separation - self.resolution.scale if load else point.pressure
        scale = max(abs(conjugate), _QUIET * self.resolution.scale)
        return float(span * abs(point.slope - shown.slope) / 12 / (self.resolution.bend * scale))
