"""Loops under every control: the single wave against its closed form; audits: test_ledger.py."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad

from adhesis import (
    Control,
    HalfSpace,
    LoopResult,
    PathError,
    Problem,
    Profile,
    make_method,
    run_loop,
    run_loops,
    single_wave,
)
from adhesis.solver.references.single_wave import SingleWave
from tests.support import scenes

AMPLITUDE, PERIOD = 1e-6, 1e-3
HALF_SPACE = HalfSpace(1e6, 0.0)
ROUGH = scenes.rough(3, 8, 4, period=PERIOD)


def wave_of(alpha: float) -> SingleWave:
    return SingleWave.with_alpha(alpha, AMPLITUDE, PERIOD, 1e6, "arc")


@cache
def loop_of(
    profile: Profile, work_of_adhesion: float, stiffness: float, turn: float, **options: float
) -> LoopResult:
    """Loop by sharp to the turning point in units of h_max, under a load of σ~ = 1."""
    problem = Problem(profile, HALF_SPACE, work_of_adhesion, Control(stiffness))
    return scenes.loop_of(problem, **turn_at(turn, problem), load_steps=6, **options)


def turn_at(turn: float, problem: Problem) -> dict[str, float]:
    if problem.control.is_load:
        return {"max_stress": turn * problem.stress_scale}
    return {"max_penetration": turn}


@pytest.mark.parametrize("relative", [np.inf, 100.0, 1.0, 0.1, 0.0])  # in p*/A
def test_the_work_of_each_branch_of_a_wave_is_that_of_the_closed_form(relative):
    wave = wave_of(0.2)
    stiffness = relative * wave.full_contact_stress / AMPLITUDE
    profile = single_wave(AMPLITUDE, PERIOD)
    loop = loop_of(profile, wave.work_of_adhesion, stiffness, 0.1, accuracy=1e-6)

    def power(a: float) -> float:  # p̄ du_tot/da; at the two jumps no work is done
        spring = wave.mean_stress_slope(a) / stiffness if stiffness else 0.0
        return float(wave.mean_stress(a) * (spring - wave.separation_slope(a)))

    assert [j.kind for j in loop.jumps] == ["snap-in", "pull-off"]
    exact = wave.loop_under(stiffness)
    turn = float(loop.contact_fraction.max()) * PERIOD / 2
    gained = -quad(power, exact.touch_half_width, turn, epsabs=0, epsrel=1e-10)[0]
    spent = quad(power, turn, exact.fold_half_width, epsabs=0, epsrel=1e-10)[0]
    bound = 1e-5 * exact.loss  # as for the loss
    assert loop.work_gained == pytest.approx(gained, abs=bound)
    assert loop.work_spent == pytest.approx(spent, abs=bound)


def test_jumps_under_a_weight_do_work_on_their_branch():
    loop = loop_of(ROUGH, 0.01, 0.0, 0.4)
    before = [k for k in loop.states_before_jumps() if loop.branch[k] == "loading"]
    assert np.abs(loop.mean_stress[before]).max() > 0
    depth = ROUGH.h_max - loop.separation
    for branch, work in (("loading", -loop.work_gained), ("unloading", loop.work_spent)):
        chosen = loop.branch == branch
        by_states = np.trapezoid(loop.mean_stress[chosen], depth[chosen])
        assert work == pytest.approx(by_states, rel=3e-3)
    assert loop.work_spent - loop.work_gained == pytest.approx(loop.loss, rel=1e-12)


@pytest.mark.parametrize("relative", [np.inf, 1.0, 0.0])
def test_the_two_methods_agree_under_every_control(relative):
    profile = scenes.rough(2, 4, 2, period=PERIOD)
    unit = Problem(profile, HALF_SPACE, 0.0).stress_scale / profile.h_max
    problem = Problem(profile, HALF_SPACE, 0.01, Control(relative * unit))
    turn = turn_at(0.4 if relative else 0.3, problem)
    grid = scenes.loop_of(problem, "grid", nodes_per_wave=128, load_steps=4, **turn)
    sharp = scenes.loop_of(problem, load_steps=4, **turn)
    assert abs(grid.audit_residual) < 2e-3
    assert grid.loss == pytest.approx(sharp.loss, rel=2e-3)
    assert grid.pull_off_stress == pytest.approx(sharp.pull_off_stress, rel=0.01)


@pytest.mark.parametrize("seed", [2, 4, 5])
def test_the_error_of_the_grid_holds_where_a_weight_falls_off(seed):
    """Up to 1.6 errors lay between the methods: the place of the fall is known to a node alone."""
    problem = Problem(scenes.rough(2, 2, seed), scenes.HALF_SPACE, 5e-4, Control(0.0))
    path = {"max_stress": 100.0, "load_steps": 5}
    sharp = scenes.loop_of(problem, **path)
    grid = scenes.loop_of(problem, "grid", nodes_per_wave=32, **path)
    assert abs(grid.loss - sharp.loss) < grid.loss_error


@pytest.mark.parametrize("stiffness", [0.0, 1e6])
def test_a_wave_without_adhesion_carries_a_weight_as_westergaard_has_it(stiffness):
    """What holds the solid is so soft that first touch carries next to nothing."""
    pressed = 300.0
    control = Control(stiffness)
    turn = {"preload": pressed} if stiffness else {"max_stress": pressed}
    problem = Problem(single_wave(AMPLITUDE, PERIOD), HALF_SPACE, 0.0, control)
    with pytest.raises(PathError, match="without adhesion the method 'sharp' finds no first"):
        run_loop(make_method("sharp", problem), **turn, load_steps=5)
    turns = {name: [0.43 * stress, stress] for name, stress in turn.items()}
    _, loop = run_loops(make_method("grid", problem), **turns, load_steps=5)
    share = pressed / (np.pi * 1e6 * AMPLITUDE / PERIOD)
    turning = int(np.argmax(loop.mean_stress))
    assert loop.turning_stress == pytest.approx(pressed)
    contact = 2 / np.pi * np.arcsin(np.sqrt(share))
    assert loop.contact_fraction[turning] == pytest.approx(contact, rel=0.02)
    assert loop.penetration[turning] == pytest.approx(share - share * np.log(share), rel=1e-4)
    stored = pressed * (AMPLITUDE + (pressed / stiffness if stiffness else 0.0))
    assert abs(loop.loss) <= (1e-9 if control.is_load else 1e-4) * stored
    if control.is_load:
        assert loop.pull_off_penetration == pytest.approx(0.0, abs=1e-6)


def test_a_stiff_machine_gives_the_loop_at_fixed_separation():
    unit = Problem(ROUGH, HALF_SPACE, 0.0).stress_scale / ROUGH.h_max
    fixed = loop_of(ROUGH, 0.01, np.inf, 0.6)
    stiff = loop_of(ROUGH, 0.01, 1e7 * unit, 0.6)
    assert stiff.loss == pytest.approx(fixed.loss, rel=1e-4)
    assert [j.kind for j in stiff.jumps] == [j.kind for j in fixed.jumps]
    soft = [loop_of(ROUGH, 0.01, k * unit, 0.6).loss for k in (10.0, 1.0)]
    assert fixed.loss < soft[0] < soft[1]
