"""A stable branch: predictor, corrector and step size, up to the next event."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from adhesis.solver._kernels import (
    ELSEWHERE,
    STEP_GROWTH,
    STEP_REDUCTION,
    Predictor,
    shortest_length,
)
from adhesis.solver.model.jump import Branch
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.gap.ends import signs_of, without_small
from adhesis.solver.sharp.mechanics import EdgeMechanics, PinnedEdges, Point, PreviousPoint
from adhesis.solver.sharp.tolerances import (
    LONGEST_STEP,
    ORDER_RESOLVED,
    PINNED_PLACE,
    PREDICTED_MOTION,
    QUIET_STRESS,
    TRAPEZOID_FAR,
)


@dataclass(frozen=True)
class Target:
    """End of a load step: d, the same value in m or Pa without rounding, and the way there."""

    d: float
    prescribed: float
    direction: Branch


@dataclass(frozen=True)
class Resolution:
    """Tolerances with which a path is followed; separations as q0 s.

    Attributes
    ----------
    jump : float
        To which a jump is located, in d.
    bend : float
        Largest relative error of the trapezoidal rule over one step.
    h_max : float
        q0 h_max.
    field_limit : float
        Nearer to a fold the error of the field hides it: no jump is located more finely.
    late : float
        Work that a jump may add to the loss by being found late, in units of its drop.
    least_drop : float
        Drop in J/m² below which jumps need not be located more finely.
    field_share : float
        Share of every drop that counts as its error by the error of the field.
    """

    jump: float
    bend: float
    h_max: float
    field_limit: float
    late: float
    least_drop: float
    field_share: float

    @property
    def order(self) -> float:
        """Separation of two events below which either may come first."""
        return ORDER_RESOLVED * self.jump


@dataclass(frozen=True, eq=False)
class Accepted:
    """A further point of the branch.

    Attributes
    ----------
    point : Point
    is_output : bool
        Whether its state belongs to the path: the trapezoidal rule needs it, an edge begins to
        move there, or the target is reached.
    remaining : array, optional
        Where a gap has closed or a patch vanished: the gaps that are left.
    """

    point: Point
    is_output: bool
    remaining: Array | None


@dataclass(frozen=True, eq=False)
class TwoFolds:
    """Two folds of a branch that are predicted nearer to each other than jumps are located.

    Attributes
    ----------
    ahead : tuple of (int, float)
        The edge that leads to each of them, and the way on which it does: 1 outwards of the
        contact, -1 inwards. Next to the one fold its edge takes the other one along, so that the
        rates there do not show it.
    beyond : float
        d beyond both.
    apart : float
        Their distance in d.
    """

    ahead: tuple[tuple[int, float], ...]
    beyond: float
    apart: float


@dataclass(frozen=True, eq=False)
class Fold:
    """No stable equilibrium is found beyond ``point``, by a smallest step or one across the fold.

    Attributes
    ----------
    point : Point
        The last point of the branch.
    d : float
        d a step beyond it: a smallest one, one across the fold, or to the target.
    late : float
        Distance of d from the last point that Newton's iteration has found: beyond it a descent may
        have come to rest where there is no minimum any more.
    with_another : TwoFolds, optional
        If a second one is near.
    """

    point: Point
    d: float
    late: float
    with_another: TwoFolds | None = None


class StableBranch:
    """A stable branch that is followed from a point towards a target.

    Attributes
    ----------
    point : Point
        The last accepted point.
    trail : list of Point
        Accepted points from that at which touches were last searched for.
    smallest_step : float
        Separation to which a jump is located, in d: the smallest step, but across a fold or to the
        target.
    """

    def __init__(
        self,
        edges: EdgeMechanics,
        resolution: Resolution,
        point: Point,
        target: Target,
    ) -> None:
        self._edges, self._resolution = edges, resolution
        self._target = target
        before = point.previous
        if before is not None and (point.d - before.d) * (target.d - point.d) < 0:
            point = point.with_previous(None)  # the path turns back
        self.point = self._output = point  # the last one whose state belongs to the path
        self._found = point.d  # of the last one that Newton's iteration has found
        self.trail = [point]
        self.smallest_step, self._longest = resolution.jump, math.inf  # step
        self._unrefined = 0.0  # smallest step before the fold ahead was located finely
        # straight where no point before is known: short steps there keep the integral exact
        self._predictor = beyond(point)
        self._free_step, self._begins_to_move = 0.0, False  # with two works of adhesion
        self._two_folds: TwoFolds | None = None
        self._folds_apart = math.inf  # by the last prediction that saw two

    def advance(self) -> Accepted | Fold:
        """Take steps until one is accepted, or the smallest one finds no equilibrium."""
        while True:
            step = self._next_step()
            left = self._target.d - self.point.d
            d = self._target.d if step == left else self.point.d + step
            reached = correct(self._edges, self._predictor, d)
            if reached is not None:
                error = self._trapezoid_error(reached)
                share = 0.5 if error > TRAPEZOID_FAR else self._share_to_turn(reached, step)
                if share == 1 or abs(step) <= 2 * self._resolution.field_limit:
                    return self._accept(reached, step, error)
                # a branch may bend more sharply than jumps are located
                self._longest = share * abs(step)
                self.smallest_step = min(self.smallest_step, self._longest)
            elif abs(step) <= self.smallest_step:
                return Fold(self.point, d, abs(d - self._found), self._two_folds)
            else:
                self._longest = max(STEP_REDUCTION * abs(step), self.smallest_step)

    @property
    def fold_ahead(self) -> tuple[float, float]:
        """Return d of the fold that is predicted, or infinity, and of a place beyond it."""
        predictor = self._predictor
        way, distance = self._target.d - predictor.d, predictor.leading.fold_distance
        across = predictor.across(distance, self._resolution.jump)
        return predictor.d + math.copysign(distance, way), predictor.d + math.copysign(across, way)

    def refine(self) -> None:
        """Locate the fold ahead as finely as the field resolves it."""
        self._unrefined = self.smallest_step
        self.smallest_step = self._longest = self._resolution.field_limit

    def continue_from(self, point: Point) -> None:
        """Go on from a further point of the branch, which a descent led to."""
        self.trail.append(point)
        self.point, self._predictor = point, beyond(point)
        if self._edges.adhesion.pins:  # else the branch would creep on from where edges part
            self.smallest_step = max(self.smallest_step, self._unrefined)

    def _next_step(self) -> float:
        """Return the next step in d: the leading edge is not to move far, nor the target be passed.

        A step that leads across a fold may be shorter than the smallest. The first one after a jump
        follows the tangent: where it was longer, more than a half of them failed in a loop of 120
        patches.
        """
        predictor = self._predictor
        motion = PREDICTED_MOTION if predictor.way else LONGEST_STEP * STEP_REDUCTION
        size = min(self._longest, predictor.reach(motion * self._edges.wave, self.smallest_step))
        if not predictor.leading.fold_distance < self.smallest_step:
            size = max(size, self.smallest_step)
        left = self._target.d - self.point.d
        step = left if size >= abs(left) else math.copysign(size, left)
        self._free_step, self._begins_to_move = step, False
        return step if self.point.pinned is None else self._step_to_kink(step, self.point.pinned)

    def _step_to_kink(self, step: float, pinned: PinnedEdges) -> float:
        """Shorten a step to where a pinned edge begins to move, or let it lead just across.

        The branch has a kink there, and the state on either side belongs to the path.
        """
        near = self.smallest_step
        distance = pinned.distance(step)
        if not distance < abs(step) + near:
            return step
        self._begins_to_move = True
        size = distance - near if distance > 2 * near else distance + near
        return step if size >= abs(step) else math.copysign(size, step)

    def _share_to_turn(self, reached: Point, step: float) -> float:
        """Return the share of a step at which an edge turns back, 1 if none does.

        With two works of adhesion it is pinned where it turns. An edge that is pinned where the
        step began turned midway.
        """
        if not self._edges.adhesion.pins:
            return 1.0
        motion = signs_of(len(reached.gaps)) * (reached.gaps - self.point.gaps).ravel()
        start, end = step * self.point.rate, step * reached.rate
        pinned = motion == 0
        motion, end = np.where(pinned, start, motion), np.where(pinned, -start, end)
        share = np.divide(start, start - end, out=np.zeros_like(start), where=start != end)
        back = np.where(motion * end < 0, 0.5 * (1 - share) * np.abs(end), 0.0)
        worst = int(np.argmax(back))
        edges = self._edges
        if back[worst] <= max(edges.newton_tolerance, PINNED_PLACE * edges.field_error):
            return 1.0
        return float(np.clip(share[worst], 0.1, 0.9))

    def _accept(self, reached: Point, step: float, error: float) -> Accepted:
        gaps, smallest = reached.gaps, self._edges.smallest
        remaining = without_small(gaps, smallest) if shortest_length(gaps) < smallest else None
        is_output = error > 1 or reached.d == self._target.d or self._begins_to_move
        point = reached.with_previous(PreviousPoint(self.point.d, self.point.rate, self.point.gaps))
        self.trail.append(point)
        self.point, self._found = point, point.d
        if is_output:
            self._output = point
        if point.d != self._target.d:
            # what lies before a kink predicts nothing beyond it
            kink = self._begins_to_move
            self._predictor = beyond(point.with_previous(None) if kink else point)
            self._look_for_two_folds()
            self._longest = STEP_GROWTH * abs(self._free_step if kink else step)
        return Accepted(point, is_output, remaining)

    def _look_for_two_folds(self) -> None:
        """Note whether two folds ahead are nearer to each other than jumps are located.

        By the last two predictions that saw a second one: next to a fold, where both edges are
        fast, it may be seen too far away, or not at all.
        """
        predictor, resolution = self._predictor, self._resolution.jump
        other = predictor.other_leading()
        if math.isinf(other.fold_distance):
            return
        now = other.fold_distance - predictor.leading.fold_distance
        apart, self._folds_apart = min(now, self._folds_apart), now
        self._two_folds = None
        if apart < resolution:
            way = math.copysign(predictor.across(other.fold_distance, resolution), predictor.way)
            rate, edges = predictor.rate, (predictor.leading.edge, other.edge)
            ahead = tuple((edge, float(np.sign(rate[edge] * way))) for edge in edges)
            self._two_folds = TwoFolds(ahead, predictor.d + way, apart)

    def _trapezoid_error(self, point: Point) -> float:
        """Error of the trapezoidal rule since the last output, in units of what is allowed.

        Over stripes of the work of adhesion, and where edges are pinned on the way, slopes at both
        ends are equal by chance: there their difference from the mean slope counts, too.
        """
        output = self._output
        way = point.d - output.d
        # p = q0 h_max is σ~ = 1
        h_max = self._resolution.h_max
        load = self._edges.is_load
        which = 1 if load else 0  # of p and q0 s
        before, here = (p.field.nearly[which] for p in (output, point))
        conjugate = here - h_max if load else here
        scale = max(abs(conjugate), QUIET_STRESS * h_max)
        change = abs(way) * abs(point.slope - output.slope)
        if self._edges.adhesion.least < self._edges.adhesion.largest:
            change = max(change, *(abs(here - before - way * p.slope) for p in (output, point)))
        return float(change / 12 / (self._resolution.bend * scale))


def correct(edges: EdgeMechanics, predictor: Predictor, d: float) -> Point | None:
    """Return the stable equilibrium of all edges at ``d`` near the predicted one, or None.

    None, too, where an edge is predicted to move far: what is found there may be another branch.
    """
    gaps = predictor.predict_gaps(d)
    # not written as > : a prediction that is no number is none
    if not np.abs(gaps - predictor.gaps).max() <= ELSEWHERE * edges.longest_step:
        return None
    return edges.equilibrium(gaps, d, edges.longest_step, memory=predictor.gaps)


def beyond(point: Point) -> Predictor:
    """Return the predictor of the branch beyond a point."""
    return Predictor(point.d, point.gaps, point.rate, point.previous)
