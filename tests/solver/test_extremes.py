"""Adhesion, turning points and controls at either end of what can be followed, and sharing."""

import copy
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier

import numpy as np
import pytest

from adhesis import (
    ContactState,
    Control,
    LoopResult,
    Problem,
    make_method,
    run_loop,
    run_loops,
    run_path,
    single_wave,
)
from adhesis.solver.method import Method, PathError
from adhesis.solver.sharp.continuation.descent import Descents, NoState
from adhesis.solver.sharp.method import SharpMethod
from tests.support.exact_wave import ExactWave
from tests.support.scenes import HALF_SPACE, grid_of, loop_of, rough

WAVE = single_wave(1e-6, 1e-3)
FULL = Problem(WAVE, HALF_SPACE, 0.0).full_contact_energy


def wave_problem(share: float, stiffness: float = np.inf, young: float = 1e6) -> Problem:
    """γ is ``share`` of the energy of full contact, at 1 MPa; the stiffness is in p*/A."""
    unit = np.pi * HALF_SPACE.modulus / WAVE.period
    half_space = replace(HALF_SPACE, young=young)
    return Problem(WAVE, half_space, share * FULL, Control(stiffness * unit))


@pytest.mark.parametrize("name", ["sharp", "grid"])
def test_shallow_and_deep_loops_tend_to_limits(name):
    """At first touch alone, and next to full contact, where only the last gap closes further."""
    problem = Problem(rough(2, 3, 4, period=1e-3), HALF_SPACE, 0.02)
    accuracy = 1e-2 if name == "grid" else 1e-3

    def loss(turn: float) -> tuple[float, float]:
        loop = loop_of(problem, name, accuracy=accuracy, max_penetration=turn, load_steps=6)
        assert abs(loop.loss - loop.loss_from_drops) < loop.loss_error
        return loop.loss, loop.loss_error

    for near, nearest in ((1e-6, 1e-12), (1 - 1e-4, 1 - 1e-6)):
        (one, error), (other, further) = loss(near), loss(nearest)
        assert abs(one - other) < error + further


def test_a_load_that_is_next_to_none_ends():
    """Unloading by steps that vanish beside the tension at which contact is lost."""
    problem = wave_problem(1e-3, stiffness=0.0)
    loop, deep = (loop_of(problem, max_stress=turn, load_steps=6) for turn in (1e-30, 1e-3))
    assert loop.loss == pytest.approx(deep.loss, rel=1e-3)


@pytest.mark.parametrize("name", ["sharp", "grid", "auto"])
@pytest.mark.parametrize(
    ("share", "young", "advice"),
    [
        (1e-9, 1e6, "or take 0"),
        (1e-20, 1e6, "or take 0"),
        (1.0, 1e15, "or take 0"),
        (1e13, 1e6, "check the units"),
        (1e9, 1e-3, "check the units"),
        (1e30, 1e6, "check the units"),
    ],
)
def test_adhesion_that_no_method_resolves_is_refused(name, share, young, advice):
    rule = rf"work_of_adhesion is \S+ J/m².* takes from \S+ to \S+ J/m².*{advice}"
    with pytest.raises(ValueError, match=rule):
        make_method(name, wave_problem(share, young=young))


@pytest.mark.parametrize("share", [1.0, 1e4, 1e8, 1e10])
def test_adhesion_of_every_accepted_strength_ends_in_an_audited_loss(share):
    loop = loop_of(wave_problem(share), max_penetration=0.5, load_steps=1)
    assert abs(loop.audit_residual) < 1e-3
    assert loop.loss_error < 1e-3 * loop.loss


AUDIT = {"sharp": 1e-3, "grid": 5e-3}


def loop_by(name: str, gamma: float, depth: float = 0.9, **profile: float) -> LoopResult:
    """Run a rough loop at the accuracy at which both methods take about as long."""
    rough_profile = rough(**{"n0": 2, "ratio": 6, "seed": 4, "period": 1e-3} | profile)
    accuracy = 1e-2 if name == "grid" else 1e-3
    problem = Problem(rough_profile, HALF_SPACE, gamma)
    return loop_of(problem, name, accuracy=accuracy, max_penetration=depth, load_steps=10)


@pytest.mark.parametrize(("name", "rounding"), [("sharp", 1e-12), ("grid", 1e-8)])
def test_no_loss_without_adhesion(name, rounding):
    """γ = 0: the state is unique, the way back is the way there, and nothing jumps."""
    result = loop_by(name, 0.0)
    assert result.jumps == ()
    assert abs(result.loss_dimensionless) < rounding
    assert result.pull_off_penetration == pytest.approx(0.0, abs=1e-12)
    assert result.mean_stress.min() > -1e-3 * result.mean_stress.max()
    assert result.interior is None
    assert result.valid_range == result.turn_range == np.inf
    assert result.warnings == ()
    assert result.patches.max() > 3


@pytest.mark.parametrize("name", ["sharp", "grid"])
@pytest.mark.parametrize(
    ("gamma", "depth", "hurst"), [(0.01, 0.9, 0.05), (0.01, 0.9, 0.999), (5.0, 0.5, 0.8)]
)
def test_any_hurst_exponent_and_strong_adhesion_give_an_audited_loop(name, gamma, depth, hurst):
    """By strong adhesion one jump closes all but the last gap, which stays as the mean gap is s."""
    result = loop_by(name, gamma, depth, hurst=hurst)
    assert result.loss > 0
    assert abs(result.audit_residual) < AUDIT[name]
    assert result.contact_fraction.max() < 1
    first = result.jumps[0]
    assert (first.kind, first.contact_after > 0.85) == ("snap-in", gamma == 5.0)


@pytest.mark.parametrize(("name", "near"), [("sharp", 1e-5), ("grid", 1e-2)])
def test_partial_loops_close(name, near):
    """Unload half-way from a state that a jump reached, reload: the same state returns."""
    problem = Problem(rough(2, 6, 4, period=1e-3), HALF_SPACE, 0.005)
    method = make_method(name, problem, accuracy=1e-2 if name == "grid" else 1e-3)
    h_max = problem.profile.h_max

    def go(state: ContactState, *penetrations: float) -> ContactState:
        for penetration in penetrations:
            state = method.follow(state, h_max * (1 - penetration)).states[-1]
        return state

    turned = go(method.detached(h_max), 0.0, 0.3, 0.6)
    once = go(turned, 0.2, 0.6)
    assert once.energy <= turned.energy + 1e-9 * abs(turned.energy)
    again = go(once, 0.2, 0.6)
    assert again.mean_stress == pytest.approx(once.mean_stress, rel=near)
    assert again.patches == once.patches
    # a state is immutable: following from it once more gives the same bits
    assert go(turned, 0.2, 0.6).mean_stress == once.mean_stress


def test_no_adhesion_at_all_is_accepted_whatever_the_modulus():
    for young in (1e-3, 1e15):
        problem = wave_problem(0.0, young=young)
        loop = loop_of(problem, "auto", max_penetration=0.3, load_steps=2)
        assert abs(loop.loss_dimensionless) < 1e-9


@pytest.mark.parametrize(
    ("share", "stiffness", "turn", "load_steps"),
    [
        (0.9, np.inf, 1e-6, 1),  # shallow: thousands of strokes to pull-off
        (1e-5, np.inf, 1e-6, 3),
        (50.0, np.inf, 0.999999, 1),
        (0.9, np.inf, 0.8, 6),  # 0.8 * 6 / 6 is not 0.8
        (0.2, 1.0, 1e-2, 1),
        (0.2, 0.0, 0.1, 4),
    ],
)
def test_a_plain_path_is_a_loop_bit_by_bit(share, stiffness, turn, load_steps):
    problem = wave_problem(share, stiffness)
    point = turn * (problem.stress_scale if stiffness == 0 else 1.0)
    name = "max_stress" if stiffness == 0 else "max_penetration"
    method = ExactWave(problem, states_per_step=1)
    loop = run_loop(method, **{name: point}, load_steps=load_steps)
    (other,) = run_loops(method, **{name: [point]}, load_steps=load_steps)
    path = run_path(method, [point], load_steps=load_steps)
    assert path.work == loop.loss == other.loss > 0
    assert path.loss_from_drops == loop.loss_from_drops
    assert (path.energy_change, path.ends_out, path.minor_loops) == (0, True, ())
    for column in ("separation", "mean_stress", "contact_fraction", "load_step"):
        assert np.array_equal(getattr(path, column), getattr(loop, column))
        assert np.array_equal(getattr(other, column), getattr(loop, column))
    assert loop.patches[-1] == 0


def test_turning_points_far_below_first_touch_are_marks_of_the_way_out():
    """Unloading that skips load steps still ends one at the points where minor loops begin."""
    problem = wave_problem(0.9)
    path = run_path(ExactWave(problem, states_per_step=4), [1e-2, -0.3, -0.1], load_steps=1)
    (minor,) = path.minor_loops
    assert (minor.start, minor.turn) == (-0.3, -0.1)
    assert minor.closes
    assert path.work == pytest.approx(path.loss_from_drops, rel=1e-4)


def test_a_state_that_is_not_found_is_reported_in_the_units_of_the_turning_point(monkeypatch):
    def lost(self, gaps, prescribed, *args, **options):
        raise NoState("edges that descend in energy do not come to rest", prescribed)

    monkeypatch.setattr(Descents, "relax", lost)
    for stiffness, place in (
        (np.inf, r"Δ/h_max = 0 \(mean gap 1e-06 m\)"),
        (1.0, r"u_tot/h_max = 0 \(u_tot = 0 m\)"),
        (0.0, "a mean stress of 0 Pa"),
    ):
        method = SharpMethod(wave_problem(0.5, stiffness))
        turn = {"max_stress": 1.0} if stiffness == 0 else {"max_penetration": 0.5}
        with pytest.raises(PathError, match=rf"no state at {place}: edges .* or the other method"):
            run_loop(method, **turn, load_steps=2)


@pytest.mark.parametrize(
    ("share", "max_stress", "where"),
    [
        (
            1e3,
            1e12,
            r"at first touch \(γ = .*, E = 1e6 Pa\): for a machine .* give a preload in place of "
            r"max_stress, or prescribe the separation$",
        ),
        (0.2, 1e12, r"before a mean stress of 5e\+11 Pa"),
    ],
)
def test_full_contact_is_reported_with_where_it_happens(share, max_stress, where):
    method = SharpMethod(wave_problem(share, 0.0))
    with pytest.raises(PathError, match=f"drawn into full contact {where}"):
        run_loop(method, max_stress=max_stress, load_steps=2)


def methods(problem: Problem) -> list[Method]:
    return [grid_of(problem, nodes=64), SharpMethod(problem)]


@pytest.mark.parametrize("index", [0, 1])
def test_threads_that_share_a_method_get_the_bits_of_one_alone(index):
    problem = wave_problem(1.0)
    turns = [0.3, 0.5, 0.7]

    def loss(method: Method, turn: float) -> tuple[float, float]:
        loop = run_loop(method, max_penetration=turn, load_steps=2)
        return loop.loss, loop.loss_from_drops

    alone = [loss(methods(problem)[index], turn) for turn in turns]
    shared = methods(problem)[index]
    together = Barrier(len(turns))

    def in_thread(turn: float) -> tuple[float, float]:
        together.wait()
        return loss(shared, turn)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        with ThreadPoolExecutor(len(turns)) as pool:
            assert list(pool.map(in_thread, turns)) == alone
    finally:
        sys.setswitchinterval(interval)


@pytest.mark.parametrize(
    "duplicate", [copy.copy, copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing))]
)
def test_copies_follow_the_same_paths_bit_by_bit(duplicate):
    problem = wave_problem(1.0)
    assert duplicate(WAVE).h_max == WAVE.h_max
    for method in [*methods(problem), ExactWave(problem)]:
        other = duplicate(method)
        assert type(other) is type(method)
        loops = [run_loop(m, max_penetration=0.4, load_steps=2) for m in (method, other)]
        assert np.array_equal(loops[0].energy, loops[1].energy)
        assert duplicate(loops[0]).loss == loops[0].loss
        # a state of one is one of the other
        state = duplicate(method.follow(method.detached(WAVE.h_max), WAVE.h_max).states[-1])
        onwards = [m.follow(state, 0.5 * WAVE.h_max).states[-1].energy for m in (method, other)]
        assert onwards[0] == onwards[1]
