"""Scenes far from the ordinary, as `make fuzz` draws them, and those that once misled a path."""

from dataclasses import replace

import numpy as np
import pytest

from adhesis import HalfSpace, Problem, Profile
from tests.support.scenes import HALF_SPACE, loops_at, of_paper, rough
from tools.hostile import Scene, draw, judge


@pytest.mark.parametrize("number", [2, 3, 4, 7])
def test_a_hostile_loop_keeps_every_promise(number):
    scene = draw(5, number)
    found = judge(scene, number)
    assert found["wrong"] == []
    assert found["kind"] == ("tight" if number % 4 == 0 else "loop")


def test_touches_are_as_exact_as_a_short_range():
    """By the field of zero range one of them was 3e-3 of the range late."""
    assert judge(draw(906000, 174, "range"), 174)["wrong"] == []


@pytest.mark.parametrize(("number", "flagged"), [(21, True), (2, False)])
def test_tension_above_the_strength_is_stated(number, flagged):
    """No state has more inside a patch unless the loss is doubtful for it."""
    found = judge(draw(41270, number, "range"), number)
    assert found["wrong"] == []
    assert found["flagged"] == (found["excess"] > 1.01) == flagged


OF_MANY_PATCHES = Scene(
    hurst=0.772, n0=14, ratio=39, seed=779993, amplitudes="rayleigh", h_rms=1e-6,
    g=0.5935246633443851, max_penetration=0.6572167384925119, load_steps=28, accuracy=1e-3,
)  # fmt: skip
PERIOD = 2e-3 * np.pi
TWO_WAVES = 1e-6 * np.array([0, 0.212617666 + 0.431181519j, -0.0647779269 + 0.108238956j])
PINNED = Problem(
    Profile(1e-4, TWO_WAVES), HALF_SPACE, 0.003851, work_of_adhesion_open=0.005139147130894255
)
SIX_PARTS = np.zeros(19, dtype=complex)
SIX_PARTS[6::6] = np.array([6.29675005e-7, 2.74081965e-7, 1.68488766e-7]) * np.exp(
    1j * np.array([2.53786772, -1.69909405, 1.32173731])
)
UNEVEN = rough(6, 2, 432018, hurst=0.269, h_rms=7.815913146729246e-5)


def of_scene(scene: Scene, finer: float = 0.1, **turn: float):
    """Return problem, path, and the accuracies of a drawn loop and of a finer one."""
    problem = scene.problem()
    path = {"load_steps": scene.load_steps, **(turn or scene.turn(problem))}
    return problem, path, (scene.accuracy, finer * scene.accuracy)


def to_depth(problem: Problem, depth: float, load_steps: int, *accuracies: float):
    return problem, {"max_penetration": depth, "load_steps": load_steps}, accuracies


@pytest.mark.parametrize(
    ("problem", "path", "accuracies"),
    [
        # one fold makes the loss, and the error of the field displaces it
        *(of_scene(draw(77001, number)) for number in (60, 460)),
        # the loop is closed short of such a fold
        of_scene(replace(draw(31, 23), stiffness=0.0), max_stress=7.1),
        of_scene(draw(308, 90)),  # the energy's trapezium misses the minimum of a lone edge
        of_scene(draw(5202, 90, "open")),  # an edge recedes by less than Newton's tolerance
        # an edge turns back within a step: a jump came 9e-5 h_max early
        of_scene(replace(draw(5202, 32, "open"), accuracy=1e-4), finer=1e-2),
        # edges at their memory but for rounding did not stay pinned: no rest was found
        to_depth(
            Problem(rough(4, 16, 6, hurst=0.5), HALF_SPACE, 0.01, work_of_adhesion_open=0.05),
            *(0.9, 40, 1e-4, 1e-5),
        ),
        # edges begin to move together, and the error of an equilibrium pins some again, by turns
        of_scene(replace(draw(9001, 0, "open"), accuracy=1e-4, load_steps=40)),
        # a branch ended where all edges were pinned: the error of the field displaces that, too
        of_scene(replace(draw(5560, 89, "open"), opening=3.3183, accuracy=1e-3)),
        # edges that turned back were pinned by 1e-5 λ_min behind their places: 2.8 times the error
        of_scene(replace(draw(5560, 762, "open"), opening=9.359, accuracy=1e-3, load_steps=15)),
        # after a jump one edge was predicted to move by 3 λ_min, and a state found there was taken
        of_scene(OF_MANY_PATCHES, finer=0.3),
        # a fold of receding edges: at 1e-3 it came late, at 1e-5 contact was never lost
        to_depth(PINNED, 0.8668, 20, 1e-3, 1e-4, 1e-5),
        # the error of the field mixed the soft modes of equal parts: the loss was 5e-4 off
        to_depth(
            Problem(Profile(2e-3, SIX_PARTS), HALF_SPACE, 9.93808898912e-4),
            *(0.7399679303, 10, 1e-3, 1e-4),
        ),
        *(  # edges that race make a path sensitive
            to_depth(Problem(rough(5, 8, s, period=PERIOD), HALF_SPACE, g), 0.9, 20, 1e-3, 1e-5)
            for s, g in ((1, 0.02), (2, 0.1))
        ),
        # a step after which a gap needs more nodes passed a minimum: one jump less, 3e-3 off
        to_depth(
            Problem(UNEVEN, HALF_SPACE, 56.953749479986186, strength=7.224849617527944e7),
            *(0.8079232131592422, 18, 1e-3, 1e-4),
        ),
        # a branch that is steep, but does not fold, had a jump of 3e-9 J/m²
        to_depth(Problem(of_paper(3, ratio=10), HALF_SPACE, 0.0025), 0.9, 40, 1e-2, 1e-3),
        # surfaces touch at s = 0.10517 h_max, just before a branch that is followed finely ends
        to_depth(Problem(of_paper(5), HALF_SPACE, 0.04), 0.9, 20, 1e-3, 1e-5),
    ],
)
def test_the_error_covers_a_loop_that_is_followed_with_more_accuracy(problem, path, accuracies):
    """Wherever the loss lies within the error of the finer loop."""
    *loops, finer = loops_at(problem, *accuracies, **path)
    for accuracy, loop in zip(accuracies, loops, strict=False):
        assert abs(loop.loss - finer.loss_from_drops) + finer.loss_error < loop.loss_error
        assert loop.loss_error < accuracy * loop.loss
        if len(loop.jumps) < 100:  # of more a small one may be found as two
            assert [jump.kind for jump in loop.jumps] == [jump.kind for jump in finer.jumps]
    assert finer.method.newton_steps < 20_000  # several times as many where edges ran to and fro


@pytest.mark.parametrize(
    ("problem", "path", "accuracies"),
    [
        # a minimum at a fold that the field's error hides and shows again, from step to step
        to_depth(
            Problem(
                rough(4, 10, 798665, hurst=0.43401581445546505, period=PERIOD),
                *(HALF_SPACE, 0.16417912944464388),
            ),
            *(0.5263623158621008, 20, 1e-4),
        ),
        to_depth(Problem(rough(5, 8, 1511, period=PERIOD), HALF_SPACE, 0.01), 0.9, 20, 1e-3),
        # in stiff contact surfaces come together beside an edge, at a minimum that appears
        *(
            to_depth(Problem(rough(1, 10, seed), HalfSpace(1e12, 0.5), 0.04), 0.9, 4, 1e-2)
            for seed in (1, 9)
        ),
        # the third derivative is large beside the curvature: the parabola errs by 5e-5 h_max
        to_depth(Problem(of_paper(2384431779287079, 0.9), HALF_SPACE, 0.04), 0.6, 40, 1e-3),
        # two gaps close at once, one fast, one slowly
        to_depth(Problem(of_paper(1734347148937202, 0.7), HALF_SPACE, 0.04), 0.6, 40, 1e-3),
        # the cubic between two points of the branch begins no equilibrium, their tangents do
        to_depth(Problem(of_paper(8788061040437920, 0.8), HALF_SPACE, 0.01), 0.9, 40, 1e-3),
    ],
)
def test_a_loop_that_once_did_not_end_or_missed_a_touch_closes_its_audit(problem, path, accuracies):
    (loop,) = loops_at(problem, *accuracies, **path)
    assert abs(loop.audit_residual) < 1e-4
    assert loop.loss_error < accuracies[0] * loop.loss
