"""The parts of the stepper, each without the others: predictor, step size, branch, trail, history.

The branch here is one gap whose half-width is a = a0 + sqrt(d - d_fold), with a fold at d_fold, or
a = a0 + slope·d without a fold; no elastic field is solved.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, cast

import numpy as np
import pytest

from adhesis.solver.model.jump import Branch as BranchName
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.continuation.branch import (
    Accepted,
    Branch,
    Fold,
    Resolution,
    Target,
    Trail,
)
from adhesis.solver.sharp.continuation.predictor import Predictor, carry_previous
from adhesis.solver.sharp.continuation.step_size import StepSize
from adhesis.solver.sharp.equilibrium.branch_point import Point, PreviousPoint
from adhesis.solver.sharp.nucleation.location import Solve, equilibrium_between, locate

WAVE, FOLD = 1.0, 0.2


@dataclass
class Curve:
    """Stands for the mechanics of edges: equilibria are those of a known curve."""

    fold: float | None = FOLD
    smallest: float = 1e-9
    critical: float = 1.0
    wave: float = WAVE
    is_load: bool = False
    closing_factor: float = 1.0
    asked: int = 0
    pins: bool = False
    source: ClassVar[Any] = SimpleNamespace(is_patterned=False)

    def half_width(self, at: float) -> float:
        """Half of the gap's length."""
        return 0.5 + (0.1 * at if self.fold is None else float(np.sqrt(at - self.fold)))

    def rate(self, at: float) -> float:
        """Derivative of the half-width by d."""
        return 0.1 if self.fold is None else 0.5 / float(np.sqrt(at - self.fold))

    def point(self, at: float, clearance: float = 0.0) -> Point:
        """Point of the curve."""
        a = self.half_width(at)
        gaps = np.array([[3 - a, 3 + a]])
        field = SimpleNamespace(gaps=gaps, nearly=(-at * at, at), separation=at)
        # n is the outward motion of the contact: the gap opens with d
        rate = np.full(2, -self.rate(at))
        return Point(at, cast(Any, field), rate, -2 * at, clearance)

    def equilibrium(
        self, gaps: Any, at: float, reach: float, memory: Array | None = None
    ) -> Point | None:
        """Point of the curve, if it is within reach."""
        self.asked += 1
        if self.fold is not None and at <= self.fold:
            return None
        point = self.point(at)
        return point if np.abs(point.gaps - gaps).max() < reach else None


def resolution(jump: float = 1e-6, bend: float = 1e-3) -> Resolution:
    return Resolution(jump, bend, np.inf, 1.0, 1e-9, 0.5, 0.0, 0.05)


def branch(
    curve: Curve,
    start: float,
    target: float,
    towards: BranchName = "loading",
    before: float | None = None,
    **options: float,
) -> Branch:
    closing = SimpleNamespace(between=lambda point, reached, name: abs(reached.at - point.at))
    aim = Target(target, target, towards)
    point = curve.point(start)
    if before is not None:
        earlier = curve.point(before)
        point = point.with_previous(PreviousPoint(before, earlier.rate, earlier.gaps))
    return Branch(cast(Any, curve), cast(Any, closing), resolution(**options), point, aim)


# ---------------------------------------------------------------------- predictor


@pytest.mark.parametrize("before", [0.9, 0.5, 0.3])
def test_a_predictor_sees_the_fold_of_a_square_root(before):
    curve = Curve()
    here = 0.25
    earlier = curve.point(before)
    point = curve.point(here).with_previous(PreviousPoint(earlier.at, earlier.rate, earlier.gaps))
    predictor = Predictor(point)
    assert predictor.fold_distance == pytest.approx(here - FOLD, rel=1e-9)
    at = 0.22
    np.testing.assert_allclose(predictor.gaps(at), curve.point(at).gaps, rtol=1e-9)


def test_a_predictor_is_straight_beyond_one_point_and_sees_no_fold():
    point = Curve().point(0.5)
    predictor = Predictor(point)
    assert np.isinf(predictor.fold_distance)
    np.testing.assert_array_equal(predictor.gaps(0.48), point.extrapolate(0.48))


# ---------------------------------------------------------------------- step size


def fixed_predictor(fold_distance: float = np.inf, reach: float = 0.1) -> Any:
    return SimpleNamespace(
        fold_distance=fold_distance,
        point=SimpleNamespace(at=1.0),
        reach=lambda motion, finest: reach,
        across=lambda finest: 1.1 * fold_distance + 0.2 * finest,
    )


def _gaps_at(at: float, rates: Any) -> Any:
    """Three gaps whose edges move outwards with these rates."""
    gaps = np.array([[0.5, 1.0], [2.0, 2.6], [4.0, 5.0]])
    return gaps + np.array([1.0, -1.0]) * np.reshape(rates, (3, 2)) * at


def _point_of(gaps: Any, at: float, rate: Any) -> Point:
    return Point(at, cast(Any, SimpleNamespace(gaps=gaps)), np.asarray(rate), 0.0)


def test_edges_that_a_jump_hardly_moves_go_on_as_before_it():
    """The others, and those of a gap that is new, are straight."""
    rate = np.array([0.1, 0.1, 0.1, 0.2, 0.1, 0.1])
    earlier = PreviousPoint(1.0, 0.5 * rate, _gaps_at(1.0, rate))
    before = _point_of(_gaps_at(1.2, rate), 1.2, rate)
    jumped = before.gaps.copy()
    jumped[0, 1] -= 0.3  # far
    jumped[2, 0] += 1e-3  # hardly
    after = _point_of(
        np.insert(jumped, 2, [[3.0, 3.1]], axis=0), 1.2, [*rate[:4], 0.05, 0.05, *rate[4:]]
    )
    previous = carry_previous(earlier, before, after, 0.01).previous
    assert previous is not None
    assert previous.at == pytest.approx(1.0)
    kept = 0.5
    assert previous.rate == pytest.approx(
        [kept * 0.1, 0.1, kept * 0.1, kept * 0.2, 0.05, 0.05, kept * 0.1, kept * 0.1]
    )
    motion = np.array([1.0, -1.0]) * after.rate.reshape(-1, 2) * 0.2
    assert after.gaps - previous.gaps == pytest.approx(motion, abs=1e-12)


def test_a_second_fold_is_that_of_other_gaps():
    """Gaps 0 and 3 go as sqrt(d - d_fold), each with its own; gap 1, beside the first, with it."""
    folds = np.array([0.200, 0.200, -np.inf, 0.195, -np.inf])

    def gaps(at: float) -> Any:
        half = 0.2 + 0.01 * np.sqrt(np.where(folds > 0, at - folds, at + 1))
        return np.arange(0.6, 6.0, 1.2)[:, None] + half[:, None] * np.array([-1.0, 1.0])

    def rate(at: float) -> Any:
        slope = 0.005 / np.sqrt(np.where(folds > 0, at - folds, at + 1))
        return np.repeat(-slope, 2)

    here, before = 0.21, 0.22
    point = _point_of(gaps(here), here, rate(here))
    ahead = Predictor(point.with_previous(PreviousPoint(before, rate(before), gaps(before))))
    assert ahead.fold_distance == pytest.approx(0.01, rel=0.05)
    assert ahead.other_fold().distance == pytest.approx(0.015, rel=0.05)
    assert math.isinf(Predictor(point).other_fold().distance)


def test_nothing_is_carried_across_a_jump_that_moved_the_fastest_edge():
    rate = np.array([0.1, 0.1, 0.1, 0.2, 0.1, 0.1])
    earlier = PreviousPoint(1.0, rate, _gaps_at(1.0, rate))
    before = _point_of(_gaps_at(1.2, rate), 1.2, rate)
    jumped = before.gaps.copy()
    jumped[1, 1] += 0.3
    after = _point_of(jumped, 1.2, rate)
    assert carry_previous(earlier, before, after, 0.01) is after


def test_the_edge_with_the_nearest_fold_leads_though_it_is_slower():
    """One edge goes as sqrt(d - 0.2) with a small factor, the other, faster, straight."""

    def gaps(at: float) -> Any:
        return np.array([[1 - 0.02 * np.sqrt(at - FOLD), 2.0 + 0.05 * at]])

    def rate(at: float) -> Any:
        return np.array([-0.01 / np.sqrt(at - FOLD), -0.05])

    here, before = 0.4, 0.5
    point = _point_of(gaps(here), here, rate(here))
    ahead = Predictor(point.with_previous(PreviousPoint(before, rate(before), gaps(before))))
    assert abs(rate(here)[0]) < abs(rate(here)[1])
    assert ahead.fold_distance == pytest.approx(here - FOLD, rel=0.03)


def test_steps_end_at_the_target_and_shrink_after_failures():
    steps, predictor = StepSize(1e-3), fixed_predictor()
    assert steps.next(predictor, 0.0, 0.1) == -0.1
    assert steps.next(predictor, 0.95, 0.1) == pytest.approx(-0.05)
    assert steps.next(predictor, 1.04, 0.1) == pytest.approx(0.04)
    sizes = []
    while steps.reject(step := steps.next(predictor, 0.0, 0.1), predictor):
        sizes.append(-step)
    assert sizes == sorted(sizes, reverse=True)
    assert abs(step) <= 1e-3  # the smallest step failed, and no fold is seen that it could cross


def test_a_fold_that_is_seen_is_crossed_by_one_step():
    steps, predictor = StepSize(1e-3), fixed_predictor(fold_distance=1.2e-3, reach=0.9e-3)
    assert steps.reject(steps.next(predictor, 0.0, 0.1), predictor)
    assert steps.crosses_fold
    across = steps.next(predictor, 0.0, 0.1)
    assert 1.2e-3 < -across < 2e-3
    assert not steps.reject(across, predictor)


def test_an_accepted_step_may_grow_twofold_and_a_bend_halves_it():
    steps, predictor = StepSize(1e-3), fixed_predictor(reach=10.0)
    steps.accept(-0.01, predictor)
    assert steps.next(predictor, 0.0, 0.1) == -0.02
    steps.halve(-0.02)
    assert steps.next(predictor, 0.0, 0.1) == -0.01
    steps.refine(1e-5)
    assert steps.finest == 1e-5
    assert -steps.next(predictor, 0.0, 0.1) == 1e-5


# ---------------------------------------------------------------------- branch


def events(of: Branch, target: float) -> list[Accepted | Fold]:
    out: list[Accepted | Fold] = []
    while of.point.at != target:
        out.append(of.advance())
        assert len(out) < 1000
        if isinstance(out[-1], Fold):
            break
    return out


def test_a_branch_ends_in_its_fold_at_the_resolution_that_is_asked():
    for jump in (1e-3, 1e-6, 1e-9):
        curve = Curve()
        found = events(branch(curve, 0.9, 0.0, jump=jump), 0.0)
        fold = found[-1]
        assert isinstance(fold, Fold)
        assert fold.at < FOLD < fold.point.at
        assert fold.point.at - fold.at < 2 * jump
        assert curve.asked < 80  # a bisection alone would need as many points for each digit
        places = [event.point.at for event in found]
        assert places == sorted(places, reverse=True)


def test_a_branch_without_a_fold_reaches_the_target_exactly():
    found = events(branch(Curve(fold=None), 0.9, 0.123), 0.123)
    last = found[-1]
    assert isinstance(last, Accepted)
    assert last.point.at == 0.123
    assert last.is_output


def test_a_load_step_begins_with_the_point_before_unless_the_path_turns_back():
    """Beyond one point alone the first step is short."""

    def first_step(target: float, towards: BranchName, before: float | None) -> float:
        of = branch(Curve(), 2.0, target, towards, before, bend=1e9)
        of.advance()
        return abs(of.point.at - 2.0)

    assert first_step(0.5, "loading", 2.05) > 2 * first_step(0.5, "loading", None)
    assert first_step(4.0, "unloading", 2.05) == first_step(4.0, "unloading", None)


def test_states_are_handed_out_as_densely_as_the_trapezoidal_rule_needs():
    counts = []
    for bend in (1e-2, 1e-4):
        found = events(branch(Curve(fold=None), 0.9, 0.1, bend=bend), 0.1)
        counts.append(sum(isinstance(e, Accepted) and e.is_output for e in found))
    # the rule is of second order: a hundredth of the error at ten times the states
    assert 4 < counts[1] / counts[0] < 20


def test_a_vanished_patch_is_an_event():
    curve = Curve(fold=None)
    curve.smallest = 2 * np.pi - 2 * curve.half_width(0.5)
    of = branch(curve, 0.1, 0.9, "unloading")
    found = [cast(Accepted, e) for e in events(of, 0.9)]
    vanished = [e.remaining is not None for e in found]
    assert vanished == [e.point.at > 0.5 for e in found]
    assert 0 < sum(vanished) < len(vanished)
    assert all(e.may_touch for e in found if e.remaining is not None)


def test_a_branch_tells_where_the_fold_ahead_is_and_what_is_surely_beyond():
    of = branch(Curve(), 0.9, 0.1)
    assert np.isinf(of.fold_ahead[0])  # one point shows none
    while not abs(of.fold_ahead[0] - FOLD) < 1e-4:
        assert isinstance(of.advance(), Accepted)
    assert of.point.at > FOLD > of.fold_ahead[1]


# ---------------------------------------------------------------------- location


class Clearance:
    """Clear down to d = 0.6 by ``before``, and from there on an overlap of ``after``."""

    tolerance = 1e-6

    def __init__(self, before: float, after: float) -> None:
        self.before, self.after = before, after

    def minimum(self, field: Any) -> tuple[float, float]:
        """Value at a field, and its place."""
        at = field.separation
        return (at - 0.6 + self.before if at > 0.6 else at - 0.6 - self.after), at

    def choose_seeds(self, place: float) -> list[float]:
        """Seed at a place."""
        return [place]

    def is_located(self, value: float, near: bool) -> bool:
        """Whether the overlap is small."""
        return near and value > -0.5 * self.tolerance

    def track_between(self, clear: Point, hit: Point) -> None:
        """Few gaps."""

    def validate_location(self, value: float, at: float) -> None:
        """Nothing to check."""


def between(curve: Curve) -> Solve:
    """Solve points of a known curve."""
    return equilibrium_between(cast(Any, curve))


def test_a_touch_is_located_to_the_resolution_and_the_overlap_that_is_allowed():
    curve = Curve(fold=None)
    trail = [curve.point(at) for at in (0.8, 0.5)]
    found, _ = locate(cast(Any, Clearance(0.0, 0.0)), between(curve), trail, 1e-4, 0.0)
    assert found is not None
    assert 0 <= 0.6 - found.point.at < 0.5e-6
    assert found.late < 1e-4


def test_a_touch_where_the_clearance_leaps_is_at_the_last_clear_point():
    """By the error of the field: no smaller step makes the overlap small."""
    curve = Curve(fold=None)
    trail = [curve.point(at) for at in (0.8, 0.5)]
    found, _ = locate(cast(Any, Clearance(1e-5, 1e-5)), between(curve), trail, 1e-4, 0.0)
    assert found is not None
    assert 0 < found.point.at - 0.6 < 1e-15
    assert (found.seeds, found.late) == ([0.6], 0.0)


def test_a_trail_begins_anew_at_its_last_point():
    curve = Curve()
    trail = Trail(curve.point(0.9, clearance=0.5))
    trail.add(curve.point(0.8), 0.1)
    trail.add(curve.point(0.7), 0.2)
    assert ([p.at for p in trail.points], trail.clearance) == ([0.9, 0.8, 0.7], 0.5)
    assert trail.closed == pytest.approx(0.3)
    trail.restart(0.4)
    assert ([p.at for p in trail.points], trail.clearance, trail.closed) == ([0.7], 0.4, 0.0)
