"""Loops that turn where the mean stress reaches a preload, and states by their mean stress."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from adhesis import Control, PathError, Problem, make_method, run_loop, run_loops, single_wave
from adhesis.solver.loading.loop import LoadingBranch
from adhesis.solver.loading.mean_stress_event import up_to
from adhesis.solver.method import ContactState, Method, Path
from adhesis.solver.model.jump import Jump
from adhesis.solver.references.single_wave import SingleWave
from tests.support.exact_wave import ExactWave
from tests.support.scenes import HALF_SPACE, loop_of
from tests.support.scenes import rough as rough_profile

PERIOD, AMPLITUDE = 1e-3, 1e-9  # A q0 = 6e-6: flat and arc measure agree to 3e-11
WAVE = SingleWave.with_alpha(0.2, AMPLITUDE, PERIOD, HALF_SPACE.modulus)
PROFILE = rough_profile(4, 5, 1)
GAMMA, PRELOAD = 0.005, 500.0
FIXED, SOFT = Control(), Control(1e9)


def rough(control: Control = FIXED, gamma: float = GAMMA) -> Problem:
    return Problem(PROFILE, HALF_SPACE, gamma, control)


def of_wave(control: Control = FIXED) -> Problem:
    wave = single_wave(AMPLITUDE, PERIOD)
    return Problem(wave, HALF_SPACE, WAVE.work_of_adhesion, control)


def method_of(name: str, problem: Problem) -> Method:
    if name == "exact":
        return ExactWave(problem)
    return make_method(name, problem, nodes_per_wave=128 if name == "grid" else None)


def stress_range() -> tuple[float, float]:
    """Half-width at which Johnson's mean stress at fixed separation is largest, and that stress."""
    a = np.linspace(1e-3, 0.499, 20_001) * PERIOD
    stress = WAVE.mean_stress(a)
    return float(a[stress.argmax()]), float(stress.max())


def johnson(preload: float) -> tuple[float, float]:
    """Half-width and penetration Δ/h_max of the wave where its mean stress rises to a preload."""
    widest, _ = stress_range()
    a = np.linspace(1e-3, 0.4, 20_001) * PERIOD
    least = float(a[WAVE.mean_stress(a).argmin()])
    a = brentq(lambda a: float(WAVE.mean_stress(a)) - preload, least, widest, xtol=1e-18)
    return a, 1 - float(WAVE.separation(a)) / AMPLITUDE


@pytest.mark.parametrize(("name", "near"), [("exact", 1e-9), ("sharp", 1e-5), ("grid", 3e-3)])
@pytest.mark.parametrize("stiffness", [np.inf, 2.0])
def test_a_wave_turns_where_the_closed_form_has_the_preload(name, near, stiffness):
    """With a stiffness in units of p*/A; the loss does not depend on the depth."""
    control = Control(stiffness * WAVE.full_contact_stress / AMPLITUDE)
    method = method_of(name, of_wave(control))
    _, largest = stress_range()
    for share in (0.2, 0.9):
        preload = share * largest
        _, penetration = johnson(preload)
        loop = run_loop(method, preload=preload, load_steps=10)
        assert loop.preload_reached
        assert loop.preload == preload
        # the mean stress of edges at nodes has steps, and the first that is high enough is taken
        assert loop.turning_stress >= preload * (1 - 1e-9)
        assert loop.turning_stress == pytest.approx(preload, rel=1e-3 if name == "grid" else 1e-8)
        assert loop.max_penetration == pytest.approx(penetration, abs=near)
        displacement = 0.0 if control.is_fixed else preload / control.stiffness / AMPLITUDE
        assert loop.turning_point == pytest.approx(penetration + displacement, abs=near)
        if control.is_fixed and name != "grid":
            assert loop.loss_from_drops == pytest.approx(WAVE.loop.loss, rel=1e-4)
        assert not loop.preload_warnings


@pytest.mark.parametrize("control", [FIXED, SOFT])
def test_a_preload_is_the_two_step_solution(control):
    """Find the turning point by root-finding over loops of given depth, and compare that loop."""
    method = make_method("sharp", rough(control))
    loop = run_loop(method, preload=PRELOAD, max_penetration=0.95, load_steps=20)

    def excess(depth: float) -> float:
        return run_loop(method, max_penetration=depth, load_steps=20).turning_stress - PRELOAD

    near = loop.turning_point
    depth = brentq(excess, near - 1e-2, near + 1e-2, xtol=1e-11, rtol=1e-11)
    assert loop.turning_point == pytest.approx(depth, abs=1e-7)
    two_step, _ = run_loops(method, max_penetration=[depth, 0.95], load_steps=20)
    assert loop.loss == pytest.approx(two_step.loss, rel=1e-6)
    assert loop.loss_from_drops == pytest.approx(two_step.loss_from_drops, rel=1e-6)
    assert len(loop.jumps) == len(two_step.jumps)


def test_the_turning_point_is_the_first_state_with_the_preload_and_on_no_axis_of_load_steps():
    method = make_method("sharp", rough())
    loop = run_loop(method, preload=PRELOAD)
    loading = loop.mean_stress[loop.branch == "loading"]
    assert loading[:-1].max() < PRELOAD * (1 - 1e-9)
    assert loading[-1] == pytest.approx(PRELOAD, rel=1e-8)
    assert loop.load_steps == np.count_nonzero(loop.load_step & (loop.branch == "loading")) - 1
    with pytest.raises(ValueError, match="between two load steps"):
        loop.on_axis("loading", loop.mean_stress)


def test_loops_of_several_preloads_are_those_of_each_alone():
    method = make_method("sharp", rough())
    preloads = [800.0, 200.0, 1e9]
    loops = run_loops(method, preload=preloads, max_penetration=0.9, load_steps=20)
    for preload, loop in zip(preloads, loops, strict=True):
        alone = run_loop(method, preload=preload, max_penetration=0.9, load_steps=20)
        assert loop.preload == preload
        assert loop.preload_reached == alone.preload_reached == (preload < 1e9)
        assert loop.turning_point == pytest.approx(alone.turning_point, rel=1e-8)
        assert loop.loss == pytest.approx(alone.loss, rel=1e-5)
        assert loop.load_steps == alone.load_steps
    deep = run_loop(method, max_penetration=0.9, load_steps=20)
    assert loops[2].loss == pytest.approx(deep.loss, rel=1e-5)


def test_a_preload_that_is_never_reached_is_said_and_the_turning_point_named():
    """At fixed separation the mean stress has a maximum; with strong adhesion it is a tension."""
    _, largest = stress_range()
    loop = run_loop(make_method("sharp", of_wave()), preload=1.01 * largest, load_steps=20)
    assert loop.preload_reached is False
    assert loop.turning_point == 0.999
    (text,) = loop.preload_warnings
    assert loop.warnings[0] == text
    assert "is not reached: on loading the mean stress is at most" in text
    assert "the loop turns at Δ/h_max = 0.999" in text
    strong = loop_of(rough(gamma=0.05), preload=PRELOAD, max_penetration=0.7)
    assert strong.turning_point == 0.7
    assert "a tension in every state of contact; the loop turns at Δ/h_max = 0.7" in str(strong)


@pytest.mark.parametrize("name", ["sharp", "grid"])
def test_a_preload_before_the_contact_snaps_through_is_reached_and_one_beyond_is_refused(name):
    """A soft machine snaps through after the largest mean stress; one load step goes beyond."""
    control = Control(2.0 * WAVE.full_contact_stress / AMPLITUDE)
    method = method_of(name, of_wave(control))
    _, largest = stress_range()
    in_one, in_many = (
        run_loop(method, preload=0.99 * largest, load_steps=steps) for steps in (1, 10)
    )
    assert in_one.turning_point == pytest.approx(
        in_many.turning_point, rel=1e-6 if name == "sharp" else 3e-3
    )
    with pytest.raises(PathError, match=r"full contact before .* less than the preload"):
        run_loop(method, preload=1.05 * largest, load_steps=10)
    strong = method_of(name, Problem(single_wave(1e-6, PERIOD), HALF_SPACE, 1.0, Control(1e9)))
    with pytest.raises(PathError, match=r"full contact .* less than the preload"):
        run_loop(strong, preload=500.0, load_steps=10)


def test_a_jump_beyond_the_preload_ends_the_leg_at_its_end():
    def state(separation: float, contact: float, stress: float) -> ContactState:
        edges = np.array([[0.0, contact * PERIOD]])
        return ContactState(separation, edges, stress, 0.0, 0.0, contact)

    start, before, after = state(3e-9, 0.1, 1.0), state(2e-9, 0.2, 2.0), state(2e-9, 0.3, 5.0)
    jump = Jump("loading", 2e-9, 0.1, "spreading", 1, 1, 0.2, 0.3, 1e-4)
    path = Path((before, after, state(1e-9, 0.4, 6.0)), (jump,), 0.25)
    method = ExactWave(of_wave())
    part, reached = up_to(method, start, path, lambda s: s.mean_stress / 3.0 - 1)
    assert (part.states, part.jumps, reached) == ((before, after), (jump,), True)
    part, reached = up_to(method, start, path, lambda s: s.mean_stress / 2.0 - 1)
    assert (part.states, part.jumps, reached) == ((before,), (), True)
    part, reached = up_to(method, start, path, lambda s: s.mean_stress / 7.0 - 1)
    assert (part, reached) == (path, False)


@pytest.mark.parametrize("name", ["exact", "sharp"])
def test_a_state_at_a_mean_stress_has_the_contact_and_the_gap_of_the_closed_form(name):
    method = method_of(name, of_wave())
    _, largest = stress_range()
    loop = run_loop(method, max_penetration=0.6, load_steps=10)
    wanted = 0.2 * largest
    a, penetration = johnson(wanted)
    for branch in ("loading", "unloading"):
        state = loop.at_stress(wanted, branch)
        assert state.separation == state.state.separation
        assert state.branch == branch
        assert not state.after_jump
        assert state.mean_stress == pytest.approx(wanted, rel=1e-8)
        assert state.penetration == pytest.approx(penetration, abs=1e-5)
        assert state.contact_fraction == pytest.approx(2 * a / PERIOD, abs=1e-5)
        fields = state.fields(256)
        assert fields.gap == pytest.approx(WAVE.gap(fields.x, a), abs=1e-4 * AMPLITUDE)
        assert fields.gap.mean() == pytest.approx(state.state.separation, rel=1e-3)
    (opening,) = loop.at_stress(wanted).openings()
    assert opening.x[-1] - opening.x[0] == pytest.approx(PERIOD - 2 * a, abs=1e-5 * PERIOD)


def test_a_mean_stress_that_a_branch_does_not_have_is_refused():
    loop = run_loop(make_method("sharp", rough()), preload=PRELOAD, load_steps=10)
    tension = -0.5 * loop.pull_off_stress
    assert loop.at_stress(tension).mean_stress == pytest.approx(tension, rel=1e-8)
    assert loop.at_stress(PRELOAD).state.separation == pytest.approx(
        loop.problem.separation(loop.turning_point), rel=1e-12
    )
    with pytest.raises(ValueError, match=r"stress is 600 Pa: on the loading branch .* 500 Pa"):
        loop.at_stress(600.0, "loading")
    with pytest.raises(ValueError, match="stress is nan"):
        loop.at_stress(np.nan)
    with pytest.raises(TypeError, match="stress is '10 kPa': it must be a finite number, in Pa"):
        loop.at_stress("10 kPa")
    with pytest.raises(ValueError, match="holds no contact states"):
        replace(loop, contact_states=()).at_stress(100.0)


def test_a_closing_drop_that_is_negative_is_doubted():
    problem = Problem(rough_profile(3, 6, 4, period=1e-3), HALF_SPACE, 0.012, Control(0.0))
    for max_stress, count in ((500.0, 0), (2000.0, 1)):  # the same branch, turned early and late
        loop = loop_of(problem, max_stress=max_stress, load_steps=5)
        assert loop.closing_drop == loop.jumps[-1].energy_drop
        assert (loop.closing_drop < 0) == bool(count)
        doubts = [text for text in loop.warnings if "at which the weight falls off" in text]
        assert len(doubts) == count
        before = sum(jump.energy_drop for jump in loop.jumps[:-1])
        assert loop.drops(small_scale=True) + loop.drops(small_scale=False) == pytest.approx(before)
        assert f"drops before the fall {1e3 * before:.3g} mJ/m²" in loop.loss_note
    machine = run_loop(make_method("sharp", rough()), preload=PRELOAD, load_steps=5)
    assert machine.closing_drop == 0
    assert machine.fall_warnings() == []


def test_a_branch_that_is_interrupted_goes_on_with_the_same_bits():
    method = make_method("sharp", rough())
    preloads = [200.0, 800.0]

    def branch() -> LoadingBranch:
        return LoadingBranch(method, preloads, load_steps=20, latest=0.9)

    whole, broken = branch(), branch()
    calls = []

    def stop(*of_step: object) -> None:
        calls.append(of_step)
        if len(calls) == 6:
            raise TimeoutError

    with pytest.raises(TimeoutError):
        broken.loop(800.0, progress=stop)
    loops = [one.loop(800.0) for one in (whole, broken)]
    assert loops[0] == loops[1]
    with pytest.raises(ValueError, match="this loading branch has passed 200"):
        broken.loop(200.0)
    with pytest.raises(ValueError, match="is not a turning point of this loading branch"):
        broken.loop(300.0)
