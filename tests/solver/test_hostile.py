"""Scenes far from the ordinary, as `make fuzz` draws them."""

from dataclasses import replace

import pytest

from adhesis import Control
from tests.support.scenes import loops_at
from tools.hostile import draw, judge


@pytest.mark.parametrize("number", [2, 3, 4, 7])
def test_a_hostile_loop_keeps_every_promise(number):
    scene = draw(5, number)
    found = judge(scene, number)
    assert found["wrong"] == []
    assert found["kind"] == ("tight" if number % 4 == 0 else "loop")


def test_touches_are_as_exact_as_a_short_range():
    """By the field of zero range one of them was 3e-3 of the range late."""
    assert judge(draw(906000, 174, "range"), 174)["wrong"] == []


@pytest.mark.parametrize(("number", "flagged"), [(21, True), (9, False)])
def test_tension_above_the_strength_is_stated(number, flagged):
    """No state has more inside a patch unless the loss is doubtful for it."""
    found = judge(draw(41270, number, "range"), number)
    assert found["wrong"] == []
    assert found["openings"] > 0
    assert found["flagged"] == (found["excess"] > 1.01) == flagged


@pytest.mark.parametrize(
    ("seed", "number", "max_stress"), [(77001, 60, None), (77001, 460, None), (31, 23, 7.1)]
)
def test_the_error_covers_a_loop_whose_loss_one_fold_makes(seed, number, max_stress):
    """The error of the field displaces it; under a load the loop is closed short of it."""
    scene = draw(seed, number)
    problem = scene.problem()
    turning_point = {"max_penetration": scene.max_penetration}
    if max_stress:
        problem = replace(problem, control=Control(stiffness=0))
        turning_point = {"max_stress": max_stress}
    path = {"load_steps": scene.load_steps, **turning_point}
    loop, reference = loops_at(problem, scene.accuracy, 1e-2 * scene.accuracy, **path)
    assert abs(loop.loss - reference.loss_from_drops) < loop.loss_error
    assert loop.loss_error < scene.accuracy * loop.loss


def test_an_edge_that_leaps_to_and_fro_over_a_minimum_comes_to_rest():
    """A lone edge, whose minimum the energy's trapezium misses."""
    scene = draw(308, 90)
    path = {"max_penetration": scene.max_penetration, "load_steps": scene.load_steps}
    loop, finer = loops_at(scene.problem(), scene.accuracy, 0.1 * scene.accuracy, **path)
    assert abs(loop.loss - finer.loss) < loop.loss_error
