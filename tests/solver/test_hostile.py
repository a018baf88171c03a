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
    ("seed", "number", "law", "max_stress"),
    [
        # one fold makes the loss, and the error of the field displaces it
        *((77001, 60, "one", None), (77001, 460, "one", None)),
        (31, 23, "one", 7.1),  # under a load the loop is closed short of it
        (308, 90, "one", None),  # the energy's trapezium misses the minimum of a lone edge
        (5202, 90, "open", None),  # an edge recedes by less than Newton's tolerance
    ],
)
def test_the_error_covers_a_loop_that_is_followed_with_more_accuracy(seed, number, law, max_stress):
    scene = draw(seed, number, law)
    problem = scene.problem()
    turning_point = {"max_penetration": scene.max_penetration}
    if max_stress:
        problem = replace(problem, control=Control(stiffness=0))
        turning_point = {"max_stress": max_stress}
    path = {"load_steps": scene.load_steps, **turning_point}
    loop, reference = loops_at(problem, scene.accuracy, 1e-2 * scene.accuracy, **path)
    assert abs(loop.loss - reference.loss_from_drops) < loop.loss_error
    assert loop.loss_error < scene.accuracy * loop.loss
