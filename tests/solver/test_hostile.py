"""Scenes far from the ordinary, as `make fuzz` draws them."""

from dataclasses import replace

import pytest

from tests.support.scenes import loops_at
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


@pytest.mark.parametrize(("number", "flagged"), [(21, True), (9, False)])
def test_tension_above_the_strength_is_stated(number, flagged):
    """No state has more inside a patch unless the loss is doubtful for it."""
    found = judge(draw(41270, number, "range"), number)
    assert found["wrong"] == []
    assert found["openings"] > 0
    assert found["flagged"] == (found["excess"] > 1.01) == flagged


OF_MANY_PATCHES = Scene(
    hurst=0.772, n0=14, ratio=39, seed=779993, amplitudes="rayleigh", h_rms=1e-6,
    g=0.5935246633443851, max_penetration=0.6572167384925119, load_steps=28, accuracy=1e-3,
)  # fmt: skip
UNDER_A_LOAD = replace(draw(31, 23), stiffness=0.0)


@pytest.mark.parametrize(
    ("scene", "finer", "max_stress"),
    [
        # one fold makes the loss, and the error of the field displaces it
        *((draw(77001, 60), 1e-2, None), (draw(77001, 460), 1e-2, None)),
        (UNDER_A_LOAD, 1e-2, 7.1),  # the loop is closed short of such a fold
        (draw(308, 90), 1e-2, None),  # the energy's trapezium misses the minimum of a lone edge
        (draw(5202, 90, "open"), 1e-2, None),  # an edge recedes by less than Newton's tolerance
        # an edge turns back within a step: a jump came 9e-5 h_max early
        (replace(draw(5202, 32, "open"), accuracy=1e-4), 1e-2, None),
        # after a jump one edge was predicted to move by 3 λ_min, and a state found there was taken
        (OF_MANY_PATCHES, 0.3, None),
    ],
)
def test_the_error_covers_a_loop_that_is_followed_with_more_accuracy(scene, finer, max_stress):
    problem = scene.problem()
    turn = scene.turn(problem) if max_stress is None else {"max_stress": max_stress}
    path = {"load_steps": scene.load_steps, **turn}
    loop, reference = loops_at(problem, scene.accuracy, finer * scene.accuracy, **path)
    assert abs(loop.loss - reference.loss_from_drops) < loop.loss_error
    assert loop.loss_error < scene.accuracy * loop.loss
