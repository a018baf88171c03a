"""Patches that open from inside at a finite strength of the interface.

Where a trough opens, and the barrier of its crack: validation of ``sharp`` in test_validate.py.
"""

import math
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from adhesis import Control, HalfSpace, LoopResult, Problem, Profile, make_method
from adhesis.solver.loading.zero_range import beyond_limit, range_warnings
from adhesis.solver.references.last_gap import LastGap
from adhesis.solver.references.periodic_punch import pull_off_stress
from adhesis.solver.sharp.continuation.branch import StableBranch
from adhesis.solver.sharp.errors import NoState
from adhesis.solver.sharp.nucleation.crack import Crack, judge_maximum
from adhesis.solver.sharp.tolerances import TRAPEZOID_FAR
from tests.support.scenes import HALF_SPACE, loop_of, rough

# Two troughs, of which the one at x = λ/2 is the shallower.
TROUGHS = Profile(1e-3, np.array([0.0, -0.15, -0.5]) * 1e-9)
STIFF = HalfSpace(1e9, 0.5)
GAMMA, STRENGTH = 1e-10, 4.0
PROBLEM = Problem(TROUGHS, HALF_SPACE, GAMMA, strength=STRENGTH)


@cache
def rough_loop(strength: float, ratio: int = 8) -> LoopResult:
    problem = Problem(rough(2, ratio, 0), STIFF, 0.04, strength=strength)
    return loop_of(problem, max_penetration=0.9, load_steps=20)


def test_the_largest_excess_opens_first_with_what_equals_it():
    choose = make_method("sharp", PROBLEM).follower.cracks.choose
    cracks = [Crack(float(i), value) for i, value in enumerate((0.1, -0.2, -0.1, -0.2))]
    assert [crack.position for crack in choose(cracks)] == [1.0, 3.0]
    assert choose(cracks[:1]) == []


def test_the_last_gap_between_flat_surfaces_is_koiters_crack():
    flat = Profile(1e-3, np.array([0.0, 1e-20]))
    found = LastGap(flat, 1e6, 0.02).mean_stress(1e-4)
    assert found == pytest.approx(float(pull_off_stress(4e-4, 1e-3, 1e6, 0.02)), rel=1e-9)


def test_a_strength_that_is_never_reached_asks_for_no_finer_steps():
    zero_range, strong = rough_loop(math.inf, 3), rough_loop(1e12, 3)
    assert strong.openings == 0
    assert strong.method.field_tolerance == zero_range.method.field_tolerance
    assert strong.method.energies < 1.1 * zero_range.method.energies
    assert [jump.kind for jump in strong.jumps] == [jump.kind for jump in zero_range.jumps]
    assert abs(strong.loss - zero_range.loss) < strong.loss_error + zero_range.loss_error


def test_no_state_that_is_kept_is_above_the_strength_inside():
    """But those from which patches open, which are at it."""
    loop = rough_loop(4e6)
    assert loop.openings > 0
    assert abs(loop.audit_residual) < 1e-4
    opened = {jump.separation for jump in loop.jumps if jump.kind == "opening"}
    states = (state for state in loop.contact_states if state.patches)
    found = loop.new_method().largest_tension([s for s in states if s.separation not in opened])
    assert found.tension < 4e6 * (1 + 1e-3)
    # energy rises in no jump but by a barrier
    assert all(jump.energy_drop > -jump.barrier - 1e-9 * loop.loss for jump in loop.jumps)
    assert all((jump.barrier > 0) == (jump.kind == "opening") for jump in loop.jumps)
    # and valleys that are held closed lose more
    assert loop.loss < 0.8 * rough_loop(math.inf).loss


@pytest.mark.parametrize(
    ("control", "turning_point"),
    [
        (Control(stiffness=3e13), {"max_penetration": 0.98}),
        (Control(stiffness=0), {"max_stress": 4e6}),
    ],
    ids=("stiffness", "load"),
)
def test_patches_open_under_every_control(control, turning_point):
    problem = Problem(rough(2, 3, 1), STIFF, 0.04, strength=3e6, control=control)
    loop = loop_of(problem, **turning_point, load_steps=20)
    assert loop.openings > 0
    assert abs(loop.audit_residual) < 1e-4
    opened = [jump for jump in loop.jumps if jump.kind == "opening"]
    assert all(jump.energy_drop > -jump.barrier for jump in opened)


def test_a_difference_of_the_fields_halves_no_later_step_of_the_branch():
    """It halved each of them once, so that none grew again: such a loop did not end."""
    branch = SimpleNamespace(
        _states=SimpleNamespace(
            of_point=lambda point: point, energy_residual=lambda before, after: after.error
        ),
        _output=SimpleNamespace(d=0.0),
        _at_output=None,
        _resolution=SimpleNamespace(jump=1e-6, work=1.0),
        _work_of_fields=0.0,
    )

    def judged(*trials: tuple[float, float]) -> list[float]:
        branch._work_before = (0.0, math.inf)  # the step before was accepted
        points = (SimpleNamespace(d=d, error=error) for d, error in trials)
        return [StableBranch._work_error(branch, point) for point in points]

    assert judged((1.0, 100.0), (0.5, 20.0)) == [100.0, 20.0]  # a shorter step reduces it
    assert judged((1.0, 100.0), (0.5, 100.0)) == [100.0, TRAPEZOID_FAR]
    assert judged((2.0, 100.0)) == [TRAPEZOID_FAR]


def test_patches_that_open_from_the_same_edges_again_end_the_path():
    """They would without end, unless a touch that did not hold meanwhile is not tried again."""
    follower = make_method("sharp", PROBLEM).follower
    gaps = np.array([[1.0, 6.0]])
    points = [SimpleNamespace(d=0.5, gaps=gaps + by, field=None) for by in (0.0, 0.2, 1e-5, 2e-5)]
    follower.cracks = SimpleNamespace(
        is_possible=True, minimum=lambda field: (-1.0, []), choose=lambda found: []
    )
    follower._crack_jump = lambda located, target: located.point
    for point in points[:2]:
        assert follower._cracks_at(point, None) is point
    follower.nucleation.heals += 1
    assert follower._cracks_at(points[2], None) is points[2]
    with pytest.raises(NoState, match="open and close in turn"):
        follower._cracks_at(points[3], None)
    points[3].d = 0.4
    assert follower._cracks_at(points[3], None) is points[3]


def test_work_and_energy_agree_between_openings():
    """Between two folds the slopes at the ends of a step hide the error of its integral."""
    loop = loop_of(PROBLEM, max_penetration=0.99, load_steps=5)
    assert loop.openings > 0
    assert abs(loop.audit_residual) < 1e-5


def test_no_crack_is_tried_beyond_the_length_at_which_the_release_rate_falls():
    tried: list[float] = []

    def release(half: float) -> float:
        tried.append(half)
        return half / (1 + half**2)

    crack = judge_maximum(0.0, 1.0, 0.5, 1.0, release, 0.5, 10.0)
    assert crack.value == pytest.approx(1 - math.sqrt(0.5 / 1.1), rel=1e-3)
    assert 1.0 < tried[-1] < 1.3


def test_openings_at_a_range_and_tensions_that_are_not_small_make_a_loss_doubtful():
    for strength, opens in ((4e6, True), (1e12, False)):
        found = " ".join(rough_loop(strength).range_warnings())
        assert ("patches open from inside: a real" in found) == opens
    assert range_warnings(PROBLEM, GAMMA / (1.005 * STRENGTH), 1.0, [0.5]) == []
    assert len(range_warnings(PROBLEM, GAMMA / (1.02 * STRENGTH), 1.0, [0.5])) == 1
    (excess,) = range_warnings(PROBLEM, GAMMA / (2 * STRENGTH), 1.0, [0.5])
    assert "reaches 8 Pa, 2 times the strength (4 Pa)" in excess
    # excess, openings; the last has zero range, one an unknown strength
    wrong = beyond_limit(
        0.02 / (1e9 * np.array([1.005, 1.02, 0.5, 0.5, 1.02, 1e3])),
        *([1.0] * 6, 0.02, 0.5),
        [1e9, 1e9, 1e9, 1e9, math.nan, math.inf],
        [0.0, 0.0, 0.0, 0.01, math.nan, 0.0],
        0.02 / (1e9 * 0.5),
    )
    assert wrong.tolist() == [False, True, False, True, False, True]


def test_a_range_is_a_strength():
    problem = Problem(TROUGHS, HALF_SPACE, 1e-4, adhesion_range=1e-10)
    assert problem.strength == 1e6
    assert problem == Problem(TROUGHS, HALF_SPACE, 1e-4, strength=1e6)
    assert replace(problem, work_of_adhesion=2e-4).strength == 1e6
    assert Problem(TROUGHS, HALF_SPACE, 0.0, adhesion_range=1e-10).strength == math.inf
