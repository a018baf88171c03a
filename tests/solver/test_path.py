"""Paths of several legs: shared loading branches, minor loops, memory, and their audits."""

from dataclasses import replace

import numpy as np
import pytest

from adhesis import Problem, make_method, run_loop, run_loops, run_path, single_wave
from adhesis.solver.loading.path_record import Axis
from tests.solver.test_control_loops import AMPLITUDE, HALF_SPACE, PERIOD, ROUGH, wave_of
from tests.support.exact_wave import ExactWave

PROBLEM = Problem(ROUGH, HALF_SPACE, 0.01)
WAVE = wave_of(0.2)
OF_WAVE = Problem(single_wave(AMPLITUDE, PERIOD), HALF_SPACE, WAVE.work_of_adhesion)


def test_load_steps_of_a_leg_are_multiples_and_marks():
    axis = Axis(0.9, 3)
    assert axis.between(0.0, 0.9) == pytest.approx([0.0, 0.3, 0.6, 0.9])
    assert axis.between(0.9, 0.2) == pytest.approx([0.9, 0.6, 0.3, 0.2])
    assert axis.between(0.2, 0.8, [0.5, 0.95]) == pytest.approx([0.2, 0.3, 0.5, 0.6, 0.8])
    assert axis.between(0.0, 0.6 + 1e-12)[-1] == 0.6 + 1e-12  # gives way to the end
    assert len(axis.between(0.0, 0.6 + 1e-12)) == 3


def test_loops_of_one_loading_branch_are_the_separate_loops():
    turns = [0.3, 0.55, 0.8]
    together = run_loops(make_method("sharp", PROBLEM), max_penetration=turns, load_steps=8)
    for turn, loop in zip(turns, together, strict=True):
        alone = run_loop(make_method("sharp", PROBLEM), max_penetration=turn, load_steps=8)
        assert loop.max_penetration == turn
        # other load steps, so jumps are found elsewhere within their resolution
        assert loop.loss == pytest.approx(alone.loss, rel=1e-4)
        assert [j.kind for j in loop.jumps] == [j.kind for j in alone.jumps]
        assert abs(loop.audit_residual) < 1e-4
    # the last one has the load steps of a loop of its own
    on_axis = together[-1].penetration[together[-1].states("loading", load_steps_only=True)]
    assert set(np.round(np.arange(9) * 0.1, 12)) <= set(np.round(on_axis, 12))


def test_unloading_from_between_two_load_steps_ends_at_each_load_step_below():
    low, _ = run_loops(ExactWave(OF_WAVE), max_penetration=[0.55, 0.8], load_steps=8)
    path = run_path(ExactWave(OF_WAVE), [0.8, 0.3, 0.55], load_steps=8)
    for result, chosen in ((low, low.branch == "unloading"), (path, path.leg == 3)):
        on_axis = result.penetration[chosen & result.load_step]
        way = [0.55, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0]
        np.testing.assert_allclose(on_axis[: len(way)], way, atol=1e-12)


def test_nested_minor_loops_close_from_the_inside():
    path = run_path(make_method("sharp", PROBLEM), [0.8, 0.2, 0.7, 0.4, 0.6], load_steps=8)
    assert [(m.start, m.turn) for m in path.minor_loops] == [(0.4, 0.6), (0.2, 0.7)]
    assert abs(path.audit_residual) < 1e-4


def test_doubt_of_a_path_is_said_as_that_of_a_loop():
    path = run_path(make_method("sharp", PROBLEM), [0.5], load_steps=5)
    assert path.warnings == ()
    wrong = replace(path, work=1.1 * path.work)
    assert [text[:18] for text in wrong.warnings] == ["the audit residual"]
    uncertain = replace(path, loss_error=0.01 * path.work)
    (text,) = uncertain.warnings
    assert text.startswith("the numerical error of the work")
    steep = replace(PROBLEM, profile=ROUGH.scaled(30))
    steep_path = run_path(make_method("sharp", steep), [0.1], load_steps=2)
    assert any("linear elasticity itself" in text for text in steep_path.warnings)


def test_a_method_without_adhesion_remembers_no_path_before():
    method = make_method("sharp", replace(PROBLEM, work_of_adhesion=0.0))
    first, again = (run_path(method, [0.4, 0.2, 0.4], load_steps=4) for _ in range(2))
    assert again == first
    assert np.all(np.diff(first.separation[first.leg == 3]) >= 0)
