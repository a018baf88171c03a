"""The range of adhesion below which the zero-range limit holds: largest tension inside patches."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from adhesis import (
    HalfSpace,
    LoopResult,
    Method,
    Problem,
    Profile,
    make_method,
    run_loop,
    run_loops,
    run_path,
    single_wave,
)
from adhesis.solver.loading.zero_range import (
    TOUCHES,
    _narrowest_moved,
    beyond_limit,
    range_warnings,
    touch_stress,
)
from adhesis.solver.method import PathError
from adhesis.solver.model.control import Control
from adhesis.solver.model.jump import Jump
from adhesis.solver.references.single_wave import SingleWave
from tests.support import scenes
from tests.support.dugdale_wave import DugdaleWave
from tests.support.exact_wave import ExactWave
from tests.support.explicit_solution import explicit_openings, explicit_solution, scaled_stress

PERIOD = 2e-3
ROUGH = scenes.rough(2, 8, 0)


def method_of(profile: Profile, young: float, gamma: float = 0.04, name="sharp") -> Method:
    return make_method(name, Problem(profile, HalfSpace(young, 0.5), gamma))


@cache
def loop_of(young: float, ratio: int = 8, seed: int = 0) -> LoopResult:
    method = method_of(scenes.rough(2, ratio, seed), young)
    return run_loop(method, max_penetration=0.9, load_steps=20)


def test_the_tension_is_that_of_an_independent_solution():
    """From the openings of the Riemann-Hilbert solution, with the kernel of the half-space."""
    waves = Profile(PERIOD, np.array([0.0, 0.15 * np.exp(0.5j), 0.5]) * 1e-6)
    method = method_of(waves, 1e6, 0.05)
    state = method.detached(waves.h_max)
    for penetration in (0.0, 0.5, 0.9, 0.97):
        state = method.follow(state, method.problem.separation(penetration)).states[-1]
    assert state.patches == 1  # the shallower trough is closed, and the deeper one nearly so
    profile, unit = method.problem.profile, method.problem.half_space.modulus / 2
    gaps = state.internal.gaps
    theta, opening = explicit_openings(profile, gaps, state.separation * profile.q0)
    half = (gaps[0, 1] - gaps[0, 0]) / 2
    angle = np.linspace(0, np.pi, theta.shape[1])  # θ = centre - half cos
    weight = half * np.sin(angle) * np.pi / (theta.shape[1] - 1)
    full, pressure = scaled_stress(profile), state.mean_stress / unit
    constants, _ = explicit_solution(full, gaps, state.separation * profile.q0, 96)
    # its basis has each factor sin(·/2) half as large as the product of the edges has
    assert abs(constants[0]) / 2 == pytest.approx(abs(pressure), rel=1e-6)
    found = method.largest_tension([state])
    places = found.position * profile.q0 + np.linspace(-0.02, 0.02, 5)
    kernel = np.sin((places[:, None] - theta[0]) / 2) ** -2
    tension = (kernel @ (opening[0] * weight)) / (4 * np.pi) - full(places) - pressure
    assert found.tension == pytest.approx(unit * tension[2], rel=1e-5)
    assert tension.argmax() == 2  # a maximum indeed


@pytest.mark.parametrize("name", ["exact", "sharp", "grid"])
def test_tension_falls_from_the_edges_of_a_single_wave(name):
    problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
    method = ExactWave(problem) if name == "exact" else make_method(name, problem)
    loop = run_loop(method, max_penetration=0.8, load_steps=10)
    assert loop.interior is None
    assert (loop.largest_interior_tension, loop.valid_range) == (0.0, math.inf)
    assert not any("zero-range" in text for text in loop.warnings)


@pytest.mark.parametrize(("young", "seed"), [(1e6, 1), (1e9, 2)])
def test_no_state_that_is_left_out_has_more_tension(young, seed):
    loop = loop_of(young, seed=seed)
    states = [state for state in loop.contact_states if state.patches]
    everywhere = loop.new_method().largest_tension(states)
    assert loop.largest_interior_tension == pytest.approx(everywhere.tension, rel=0.02)


def test_grid_and_sharp_agree():
    sharp = loop_of(1e8, 4, 1)
    method = make_method("grid", sharp.problem, nodes_per_wave=32)
    grid = run_loop(method, max_penetration=0.9, load_steps=20)
    assert grid.valid_range == pytest.approx(sharp.valid_range, rel=0.03)
    assert grid.interior.position == pytest.approx(sharp.interior.position, abs=1e-3 * PERIOD)


def test_a_stiff_scene_is_doubtful_and_a_soft_one_is_not():
    """One sentence for the range, one for a loss that adhesion cannot explain."""
    assert loop_of(1e7).warnings == ()
    stiff = loop_of(1e11, 4)
    range_, loss = stiff.warnings
    assert stiff.least_range == stiff.valid_range
    assert range_.startswith(f"valid_range is {1e9 * stiff.valid_range:.3g} nm")
    assert "times the work of adhesion of the largest contact" in loss


def test_strains_that_are_not_small_are_doubtful():
    problem = loop_of(1e7).problem
    young, period = problem.half_space.young, problem.profile.period
    patches, stress = np.array([1, 0]), np.array([-0.4 * young, 0.0])
    states = replace(loop_of(1e7), mean_stress=stress, patches=patches)
    (tension,) = replace(states, separation=np.array([0.0, period])).strain_warnings()
    assert "is 0.4 of Young's modulus: small strain does not hold" in tension
    long, weak = np.array([0.5, 9.0]) * period, 0.5 * stress
    (neck,) = replace(states, mean_stress=weak, separation=long).strain_warnings()
    assert ", 0.5 of the period: small strain does not hold" in neck


def test_either_reason_makes_a_loss_doubtful():
    wrong = beyond_limit([0.9e-9, 1.1e-9, math.inf, math.nan], [0.1, 0.1, 0.3, 0.1], 0.02, 0.5)
    assert wrong.tolist() == [True, False, True, False]
    assert not beyond_limit(math.inf, 1.0, 0.0, 0.5)  # nothing adheres


@pytest.mark.parametrize("stiffness", [1e5, 4e6])
def test_a_loss_of_a_soft_machine_is_not_taken_for_that_of_closed_valleys(stiffness):
    """Its spring loses p̄²/(2k) at pull-off, most of the loss."""
    control = Control(stiffness)
    problem = Problem(single_wave(1e-6, PERIOD), HalfSpace(1e6, 0.5), 1e-3, control)
    loop = run_loop(make_method("sharp", problem), max_penetration=0.5, load_steps=4)
    assert loop.loss > 20 * 1e-3 * loop.largest_contact_fraction
    assert loop.pull_off_stress**2 / (2 * stiffness) == pytest.approx(loop.loss, rel=0.3)
    assert loop.range_warnings() == []
    (doubt,) = replace(loop, patches=np.ones_like(loop.patches)).range_warnings()
    assert "valleys" in doubt  # what stays in contact has lost none of it


def test_where_and_when_are_those_of_a_state_also_of_a_path_and_of_one_loading_branch():
    method, loop = method_of(ROUGH, 1e8), loop_of(1e8)
    path = run_path(method, [0.9], load_steps=20)
    assert path.interior == loop.interior
    assert path.narrowest_length == loop.narrowest_length
    assert path.warnings == ()
    found = loop.interior
    assert ((loop.branch == found.branch) & (loop.penetration == found.penetration)).any()
    assert found.branch == "unloading"
    assert 0 <= found.position < PERIOD
    assert loop.valid_range == loop.problem.work_of_adhesion / found.tension
    (shared,) = run_loops(method, max_penetration=[0.9], load_steps=20)
    assert shared == loop
    assert replace(path, interior=replace(found, tension=1e9)).warnings


def test_the_cohesive_zone_of_the_edge_range_is_as_long_as_the_narrowest_length():
    """Dugdale: (π/8)(K/σ_th)² with K² = 2E*γ and σ_th = γ/δ."""
    loop = loop_of(1e8)
    modulus, gamma = loop.problem.half_space.modulus, loop.problem.work_of_adhesion
    strength = gamma / loop.edge_range
    zone = np.pi / 8 * 2 * modulus * gamma / strength**2
    assert zone == pytest.approx(loop.narrowest_length)
    assert loop.narrowest_length <= loop.problem.profile.shortest_wavelength


@pytest.mark.parametrize(
    ("before", "after", "narrowest"),
    [
        ([[0.1, 0.2], [0.5, 0.8]], [[0.5, 0.8]], 0.1),  # a patch is lost
        ([[0.1, 0.2], [0.5, 0.8]], [[0.1, 0.2], [0.6, 0.8]], 0.3),  # one edge recedes
        ([[0.1, 0.4], [0.45, 0.8]], [[0.1, 0.8]], 0.05),  # a gap closes
        ([[0.3, 0.95]], [[0.3, 1.2]], 0.35),  # over the end of the period
        ([[0.9, 1.1]], [[0.9, 1.1]], math.inf),  # nothing moves
        ([[0.1, 0.3]], np.empty((0, 2)), 0.2),  # pull-off
        (np.empty((0, 2)), [[0.1, 0.3]], math.inf),  # first touch
    ],
)
def test_the_narrowest_length_is_beside_an_edge_that_moves(before, after, narrowest):
    assert _narrowest_moved(np.array(before), np.array(after), 1.0) == pytest.approx(narrowest)


@cache
def dugdale_scene(alpha: float) -> tuple[LoopResult, SingleWave]:
    """One wave of 1 µm and A = 10 nm, E* = 1 GPa, with zero range and in closed form."""
    wave = SingleWave.with_alpha(alpha, 1e-8, 1e-6, 1e9)
    problem = Problem(single_wave(1e-8, 1e-6), HalfSpace(1e9, 0.0), wave.work_of_adhesion)
    return run_loop(make_method("sharp", problem), max_penetration=0.8, load_steps=20), wave


@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.5])
def test_the_exact_loss_is_off_by_a_hundredth_at_the_touch_range_and_little_at_the_least(alpha):
    loop, wave = dugdale_scene(alpha)
    assert loop.valid_range == math.inf
    ranges = loop.touch_range, 0.5 * loop.least_range
    touching, least = (1 - DugdaleWave(wave, range_).loss / wave.loop.loss for range_ in ranges)
    assert touching == pytest.approx(0.01, rel=0.1)
    assert abs(least) < 0.1


def test_a_single_wave_whose_touches_come_earlier_is_doubtful():
    """α = 0.3: its loss is 22 % less at a range of 1 nm."""
    loop, wave = dugdale_scene(0.3)
    assert loop.touch_range < 1e-10
    (doubt,) = (text for text in loop.warnings if "zero-range limit" in text)
    assert doubt.startswith(f"touch_range is {1e9 * loop.touch_range:.3g} nm")
    exact = DugdaleWave(wave, 1e-9).loss
    assert exact / wave.loop.loss == pytest.approx(0.784, abs=2e-3)


def test_a_range_of_adhesion_longer_than_edges_or_touches_allow_is_doubtful():
    loop, _ = dugdale_scene(0.3)
    gamma = loop.problem.work_of_adhesion
    for share, doubtful in ((0.9, False), (1.1, True)):
        problem = replace(loop.problem, strength=gamma / (share * loop.least_range))
        found = range_warnings(
            *(problem, math.inf, loop.loss, loop.contact_fraction),
            *(loop.edge_range, loop.touch_range),
        )
        assert len(found) == doubtful
        marked = beyond_limit(
            *(math.inf, loop.loss, gamma, loop.largest_contact_fraction),
            *(problem.strength, loop.edge_range, loop.touch_range),
        )
        assert bool(marked) == doubtful


def test_the_touch_range_is_that_of_all_jumps_in_which_a_gap_closes():
    loop = loop_of(1e8)
    before = loop.states_before_jumps()
    change = np.abs(np.diff(loop.mean_stress))
    touches = [
        change[k] for jump, k in zip(loop.jumps, before, strict=True) if jump.kind in TOUCHES
    ]
    assert len(touches) > 1
    assert loop.touch_range == pytest.approx(0.01 * loop.loss / sum(touches))
    numbers = loop.numbers()
    ranges = [numbers[name] for name in ("valid_range", "edge_range", "touch_range")]
    assert numbers["turn_range"] is None  # it is longer
    assert loop.least_range == min(ranges)
    assert f"less than {1e9 * min(ranges):.3g} nm (tension" in loop.range_summary()


def test_a_soft_control_moves_the_touches_by_what_it_gives():
    """With a spring k the touch comes sooner by dx/ds; under a load first touch moves nothing."""
    states = np.array([2.0, 1.0, 0.9]), np.array([0.0, 0.5, 0.7]), np.array([1, 1, 2])
    jump = Jump("loading", 1.0, 1.0, "snap-in", 1, 2, 0.1, 0.2, 1.0)
    assert touch_stress([jump], [1], *states, Control()) == pytest.approx(0.2)
    spring = touch_stress([jump], [1], *states, Control(2.0))  # x = s - p/k: 1.25 of s
    assert spring == pytest.approx(1.25 * 0.2)
    assert touch_stress([jump], [1], *states, Control(0.0)) == pytest.approx(0.5 * 0.1)
    free = np.array([1.0, 1.0]), np.array([0.0, 0.0]), np.array([0, 1])
    assert touch_stress([jump], [0], *free, Control(0.0)) == 0


def next_touch() -> float:
    """Δ/h_max of the second snap-in of a loop, which takes a quarter of its loss."""
    loop = loop_of(1e7)
    (_, jump) = (jump for jump in loop.jumps if jump.kind == "snap-in")
    return float(loop.problem.penetration(jump.separation))


def test_a_jump_just_beyond_the_turning_point_bounds_the_range():
    """A loop that turns by 10 nm deeper loses half as much again: that range is not zero."""
    method, jump = method_of(ROUGH, 1e7), next_touch()
    way = 10e-9 / method.problem.profile.h_max
    before, after = run_loops(method, max_penetration=[jump - way, jump + way], load_steps=20)
    assert after.loss > 1.5 * before.loss
    assert before.turn_range == pytest.approx(10e-9, rel=1e-6)
    assert before.least_range == before.turn_range < before.touch_range
    assert after.turn_range == math.inf
    assert "; beyond the turn: 10 nm)" in before.range_summary()
    assert "beyond the turn" not in after.range_summary()


def test_a_turning_point_within_a_nanometre_of_a_jump_is_doubtful():
    method, jump = method_of(ROUGH, 1e7), next_touch()
    way = 0.5e-9 / method.problem.profile.h_max
    loop = run_loop(method, max_penetration=jump - way, load_steps=20)
    (doubt,) = loop.warnings
    assert doubt.startswith("turn_range is 0.5 nm")
    assert "jumps that lie just beyond the turning point would come before it" in doubt
    own = replace(loop.problem, strength=loop.problem.work_of_adhesion / 1e-9)
    (doubt,) = range_warnings(own, math.inf, loop.loss, loop.contact_fraction, *loop.outer_ranges)
    assert "1 nm, is longer than turn_range, 0.5 nm" in doubt
    of_loop = (loop.loss, 0.04, loop.largest_contact_fraction)
    assert beyond_limit(math.inf, *of_loop, turn_range=loop.turn_range)
    assert beyond_limit(math.inf, *of_loop, own.strength, turn_range=loop.turn_range)
    assert not beyond_limit(math.inf, *of_loop)


def test_a_turn_nearer_to_a_jump_than_its_place_is_known_is_doubtful():
    """The grid's jumps lie elsewhere by its own error: one may come before a turn at 2 nm."""
    at = next_touch() - 2e-9 / ROUGH.h_max
    sharp, grid = (
        run_loop(method_of(ROUGH, 1e7, 0.04, name), max_penetration=at, load_steps=20)
        for name in ("sharp", "grid")
    )
    assert sharp.turn_range == pytest.approx(2e-9, rel=1e-6)
    assert grid.turn_range == 0.0
    assert any(warning.startswith("turn_range is 0 nm") for warning in grid.warnings)


@pytest.mark.parametrize("name", ["sharp", "grid"])
def test_every_turn_of_a_path_is_followed_beyond(name):
    """The first of two turns lies before the jump, which the second has passed."""
    gamma, jump = 0.04, next_touch()
    method = method_of(ROUGH, 1e7, gamma, name)
    way = 20e-9 / method.problem.profile.h_max
    path = run_path(method, [jump - way, 0.3, 0.6], load_steps=20)
    # the jump of the grid lies elsewhere by its own error
    assert path.turn_range == pytest.approx(20e-9, rel=1e-6 if name == "sharp" else 0.5)
    last = run_path(method, [0.6, 0.3, jump - way], load_steps=20, out=False)
    assert last.turn_range == math.inf  # the gap is closed already


@pytest.mark.parametrize("control", [Control(1e13), Control(0.0)], ids=["stiffness", "load"])
def test_the_way_beyond_a_turn_is_one_of_the_separation(control):
    """Under a soft control the same touch comes at the same separation."""
    loop = loop_of(1e7)
    before = next(k for k in loop.states_before_jumps()[1:])
    touch = loop.contact_states[before]
    problem = replace(loop.problem, control=control)
    h_max = problem.profile.h_max
    wanted = control.prescribed(touch.separation, touch.mean_stress)
    if control.is_load:
        turn = {"max_stress": -wanted - 20.0}
    else:
        turn = {"max_penetration": 1 - wanted / h_max - 5e-3}
    found = run_loop(make_method("sharp", problem), load_steps=20, **turn)
    turned = found.separation[found.branch == "unloading"][0]
    assert found.turn_range == pytest.approx(turned - touch.separation, rel=1e-3)
    assert 0 < found.turn_range < found.touch_range


def test_nothing_is_known_beyond_a_path_that_cannot_be_followed(monkeypatch):
    method, jump = method_of(ROUGH, 1e7), next_touch()
    loop = run_loop(method, max_penetration=jump - 0.03, load_steps=20)
    assert loop.turn_range == math.inf
    h_max, follow = loop.problem.profile.h_max, type(method).follow
    way = 1e-3 * h_max  # 0.04 of a load step, found in shorter ones

    def stopped(self, state, separation):
        if separation < (1 - jump + 0.03) * h_max - way:
            raise PathError("no state")
        return follow(self, state, separation)

    monkeypatch.setattr(type(method), "follow", stopped)
    loop = run_loop(method, max_penetration=jump - 0.03, load_steps=20)
    assert loop.turn_range == pytest.approx(way, rel=0.1)


def test_full_contact_bounds_the_range_beyond_the_turn():
    """Nothing is followed into it: at most the mean gap is known to be free of jumps."""
    loop = run_loop(method_of(ROUGH, 1e6), max_penetration=0.99, load_steps=20)
    gap = 0.01 * loop.problem.profile.h_max
    assert gap < loop.touch_range
    assert 0 < loop.turn_range < gap
