"""Method ``zones``: Dugdale's law against closed forms, and what it promises of its states."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from adhesis import (
    Control,
    HalfSpace,
    LoopResult,
    Problem,
    make_method,
    profile_from_heights,
    run_loop,
    self_affine_profile,
    single_wave,
)
from adhesis.solver.zones.descent import Descent
from adhesis.solver.zones.surface import Surface
from tests.solver.test_finite_range import PERIOD, SOLID, A, wave_of
from tests.support import scenes
from tests.support.dugdale_wave import DugdaleWave


def problem_of(alpha: float, share: float, control: Control | None = None) -> Problem:
    return Problem(
        single_wave(A, PERIOD), SOLID, wave_of(alpha).work_of_adhesion, control or Control(),
        adhesion_range=share * A, measure="flat",
    )  # fmt: skip


@cache
def wave_loop(alpha: float, share: float, **numbers: float) -> LoopResult:
    return scenes.loop_of(
        problem_of(alpha, share), "zones", max_penetration=0.5, load_steps=20, **numbers
    )


# At α = 0.1 and in the last of α = 0.3 surfaces part, and at the longest ranges also come together,
# by way of states in which they attract each other and do not touch.
@pytest.mark.parametrize(
    ("alpha", "share"),
    [(0.1, 0.05), (0.1, 0.2), (0.3, 0.1), (0.3, 0.2), (0.5, 0.2)],
)
def test_a_wave_loses_what_dugdales_law_has_it_lose(alpha, share):
    wave, loop = wave_of(alpha), wave_loop(alpha, share)
    exact = DugdaleWave(wave, share * A).loss
    assert abs(loop.loss - exact) < loop.loss_error < 2e-3 * wave.loop.loss
    assert abs(loop.loss_from_drops - exact) < loop.loss_error
    kinds = [jump.kind for jump in loop.jumps if jump.energy_drop > 0.01 * exact]
    assert kinds == ["snap-in", "pull-off"]
    assert loop.jumps[0].separation == pytest.approx((1 + share) * A, abs=5e-3 * A)
    assert loop.range_warnings() == []
    fine = wave_loop(alpha, share, nodes_per_wave=1024, accuracy=1e-4)
    assert abs(fine.loss_from_drops - exact) < 1e-4 * wave.loop.loss


def test_a_short_contact_of_dugdales_wave_is_maugis_line_contact():
    """Johnson and Greenwood, J. Phys. D 41 (2008) 155315, with half-widths a, c = m a."""
    wave, delta, modulus = wave_of(0.005), 5e-4 * A, SOLID.modulus
    radius, strength = 1 / (A * (2 * np.pi / PERIOD) ** 2), wave.work_of_adhesion / delta
    a, exact = 0.5 * np.sqrt(radius * delta), DugdaleWave(wave, delta)
    m = exact.zone_end(a) / a
    rise, angle = np.sqrt(m**2 - 1), np.arccosh(m)
    gap = a**2 / (2 * radius) * (m * rise - angle)
    gap += 4 * strength * a / (np.pi * modulus) * (rise * angle - m * np.log(m))
    assert gap == pytest.approx(delta, rel=1e-4)
    force = np.pi * modulus * a**2 / (4 * radius) - 2 * strength * a * rise
    assert exact.state(a)[1] * PERIOD == pytest.approx(force, rel=1e-4)


def test_the_loss_of_a_wave_converges_with_the_square_of_the_nodes():
    """Zones of 5 and of 14 nodes."""
    exact = DugdaleWave(wave_of(0.2), 0.05 * A).loss
    loops = [wave_loop(0.2, 0.05, nodes_per_wave=n, accuracy=1e-4) for n in (512, 1440)]
    errors = [abs(loop.loss_from_drops - exact) for loop in loops]
    assert errors[1] < 0.2 * errors[0]
    assert errors[0] < loops[0].loss_error < 3e-3 * exact


def test_no_jump_hides_in_a_step():
    """A small jump may lose in its step what slopes make up for; Y shows it."""
    profile = self_affine_profile(0.31, h_rms=1e-6, period=2e-3, n0=1, ratio=28, seed=784853)
    problem = Problem(profile, HalfSpace(1e6, 0.0), 3.52e-4, adhesion_range=3.48e-7)
    coarse, fine = (
        scenes.loop_of(problem, "zones", accuracy=accuracy, max_penetration=0.23, load_steps=10)
        for accuracy in (1e-3, 1e-4)
    )
    assert abs(coarse.loss - fine.loss) < coarse.loss_error < 0.02 * fine.loss


def test_where_jumps_end_does_not_depend_on_the_nodes():
    """Descents that follow whatever direction lowers the energy end 1.2 % apart."""
    profile = self_affine_profile(0.4456, h_rms=1e-6, period=2e-3, n0=3, ratio=16, seed=65119)
    problem = Problem(profile, HalfSpace(1e6, 0.0), 7.286e-3, Control(2.486e8), adhesion_range=5e-7)
    turn = {"accuracy": 1e-2, "max_penetration": 0.8, "load_steps": 2}
    coarse, fine = (scenes.loop_of(problem, "zones", nodes_per_wave=n, **turn) for n in (24, 40))
    assert [jump.kind for jump in coarse.jumps] == [jump.kind for jump in fine.jumps]
    assert abs(coarse.loss - fine.loss) < coarse.loss_error + fine.loss_error
    assert coarse.races == fine.races == 0


@pytest.mark.parametrize(("shift", "raced"), [(A, True), (0.0, False)])
def test_a_jump_that_a_viscous_interface_ends_elsewhere_is_a_race(monkeypatch, shift, raced):
    """At stake is the difference of the energies; a fold that is not passed is no other end."""
    run = Descent.run

    def elsewhere(self, gap, x, least=-np.inf, *, by_interface=False):
        end = run(self, gap, x, least)
        if not by_interface:
            return end
        return replace(end, gap=end.gap + shift if shift else gap, potential=end.potential + 1e-6)

    monkeypatch.setattr(Descent, "run", elsewhere)
    loop = scenes.loop_of(problem_of(0.3, 0.2), "zones", max_penetration=0.5, load_steps=2)
    assert loop.races == raced * len(loop.jumps) == 2 * raced
    assert loop.energy_at_stake == pytest.approx(2e-6 * raced)


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_states_are_those_of_dugdales_branch(share):
    """Mean stress and contact at a separation, on the way to the loss of contact."""
    exact, loop = DugdaleWave(wave_of(0.3), share * A), wave_loop(0.3, share, nodes_per_wave=1024)
    unloading = np.flatnonzero((loop.branch == "unloading") & (loop.contact_fraction > 0.05))
    for i in unloading[:: len(unloading) // 4]:
        half = 0.5 * loop.contact_fraction[i] * PERIOD
        s, p = exact.state(half)
        assert s == pytest.approx(loop.separation[i], abs=1e-3 * A)
        assert p == pytest.approx(loop.mean_stress[i], abs=5e-4 * wave_of(0.3).full_contact_stress)


@pytest.mark.parametrize("control", [Control(3e9), Control(5e8), Control(0.0)])
def test_audits_hold_under_a_machine_and_under_a_weight(control):
    turn = {"max_stress": 100.0} if control.is_load else {"max_penetration": 0.5}
    problem = problem_of(0.3, 0.1, control)
    loop = scenes.loop_of(problem, "zones", nodes_per_wave=1024, load_steps=10, **turn)
    assert abs(loop.loss - loop.loss_from_drops) < loop.loss_error < 0.03 * loop.loss
    x = control.prescribed(loop.separation, loop.mean_stress)
    for jump, before in zip(loop.jumps, loop.states_before_jumps(), strict=True):
        if control.is_load and 0 in (jump.patches_before, jump.patches_after):
            continue  # out of contact nothing carries a weight
        assert x[before] == pytest.approx(x[before + 1], rel=1e-12, abs=1e-12 * np.abs(x).max())
        assert jump.energy_drop > -0.01 * loop.loss


def test_a_stiff_machine_loses_what_a_fixed_separation_does():
    """It loads a contact that does not follow far more than one that does."""
    turn = {"max_penetration": 0.5, "load_steps": 4}
    controls = Control(1e12), Control()
    stiff, fixed = (scenes.loop_of(problem_of(0.1, 0.5, one), "zones", **turn) for one in controls)
    assert abs(stiff.loss - fixed.loss) < stiff.loss_error + fixed.loss_error


def test_the_error_under_a_load_counts_where_contact_is_lost():
    """The separation varies as a square root of the load there: 0.8 % of the loss, 512 nodes."""
    weight, turn = problem_of(0.1, 0.05, Control(0.0)), {"max_stress": 100.0, "load_steps": 2}
    coarse, fine = (scenes.loop_of(weight, "zones", nodes_per_wave=n, **turn) for n in (512, 1024))
    assert abs(coarse.loss - fine.loss) < coarse.loss_error < 0.02 * fine.loss


def test_before_a_stiff_solid_touches_it_is_pulled_as_a_rigid_one_by_bradley_and_derjaguin():
    """The tension is the strength where the gap is within the range."""
    method = make_method("zones", problem_of(0.005, 0.5))
    states = method.follow(method.detached(1.6 * A), 1.05 * A).states[2:]
    assert {(state.contact_fraction, state.patches) for state in states} == {(0.0, 1)}
    s, p = np.transpose([(state.separation, state.mean_stress) for state in states])
    within, strength = np.arccos(s / A - 0.5) / np.pi, method.problem.strength
    assert p == pytest.approx(-strength * within, abs=3e-4 * strength)


def test_forces_are_the_derivatives_of_the_energy():
    surface = Surface(problem_of(0.3, 0.2), 96)
    rng = np.random.default_rng(5)
    gap = 1.1 * A - surface.height + 0.02 * A * rng.standard_normal(96)
    way = 1e-4 * A * rng.standard_normal(96)
    energies, tensions = zip(
        *(surface.attract(gap + side * way)[:2] for side in (-0.5, 0.5)), strict=True
    )
    _, tension, ends = surface.attract(gap)
    assert energies[1] - energies[0] == pytest.approx(float(tension @ way) / 96, rel=1e-5)
    change = np.zeros(96)
    ends.force_by(way, change)
    assert tensions[1] - tensions[0] == pytest.approx(change, abs=1e-2 * np.abs(change).max())


def test_patches_open_from_inside_at_the_strength():
    """With or without a jump; the method sharp keeps pressed troughs shut, and says so."""
    theta = 2 * np.pi * np.arange(128) / 128
    profile = profile_from_heights(A * (np.cos(theta) + 0.3 * np.cos(5 * theta + 0.3)), PERIOD)
    problem = Problem(profile, SOLID, wave_of(0.15).work_of_adhesion, adhesion_range=0.05 * A)
    turn = {"accuracy": 1e-2, "max_penetration": 0.9, "load_steps": 6}
    loop, shut = (scenes.loop_of(problem, method, **turn) for method in ("zones", "sharp"))
    assert (np.diff(loop.patches[loop.branch == "unloading"]) > 0).any()
    assert loop.loss < 0.3 * shut.loss
    assert loop.interior is None or loop.interior.tension < 1.01 * loop.problem.strength
    assert any("take the method 'zones'" in text for text in shut.range_warnings())
    assert loop.range_warnings() == []


def test_fields_balance():
    """Tension is the strength in zones, none beyond them, and nowhere more."""
    method = make_method("zones", problem_of(0.3, 0.1), accuracy=1e-2)
    loop = run_loop(method, max_penetration=0.5, load_steps=4)
    state = loop.contact_states[len(loop.contact_states) // 2]
    fields, problem = method.fields(state, method.nodes), method.problem
    far = fields.gap > 2 * problem.attraction_range
    in_zone = (fields.gap > 0) & (fields.gap < problem.attraction_range)
    zone = np.all([np.roll(in_zone, shift) for shift in range(-2, 3)], axis=0)
    assert zone.sum() >= 4
    assert np.abs(fields.stress[far]).max() < 1e-5 * problem.strength
    assert fields.stress[zone] == pytest.approx(-problem.strength, rel=1e-4)
    assert fields.stress.min() > -1.001 * problem.strength
    assert fields.stress.mean() == pytest.approx(state.mean_stress, rel=1e-9)
    assert fields.gap.min() == 0
    few = method.fields(state, 64)
    assert few.gap == pytest.approx(few.displacement - few.height + state.separation, abs=1e-12 * A)


def test_a_symmetric_profile_loses_what_a_hardly_asymmetric_one_does():
    theta = 2 * np.pi * np.arange(64) / 64
    losses = []
    for shift in (0.0, 1e-4):
        heights = A * (np.cos(theta) + 0.06 * np.cos(8 * theta + shift))
        profile = profile_from_heights(heights, PERIOD)
        problem = Problem(
            profile, SOLID, 0.06 * SOLID.modulus * profile.q0 * A**2, adhesion_range=0.1 * A
        )
        loop = scenes.loop_of(problem, "zones", accuracy=1e-2, max_penetration=0.8, load_steps=4)
        losses.append(loop)
    assert abs(losses[1].loss - losses[0].loss) < losses[0].loss_error + losses[1].loss_error


def test_the_choice_follows_from_zones_and_strength():
    assert make_method("auto", problem_of(0.1, 0.1)).name == "zones"
    short = make_method("auto", problem_of(0.3, 0.005))
    assert short.name == "sharp"
    assert "are short" in short.chosen
    assert make_method("auto", problem_of(0.3, 0.005), nodes_per_wave=64).name == "zones"
    assert "would need" in make_method("auto", problem_of(0.01, 1.7e-4)).chosen
    without = Problem(single_wave(A, PERIOD), SOLID, 0.0, adhesion_range=1e-9)
    assert make_method("zones", without).name == "grid"


@pytest.mark.parametrize(
    ("method", "given", "sentence"),
    [
        ("zones", {}, "method is 'zones' without a range or strength of adhesion"),
        ("grid", {"adhesion_range": 1e-7}, "or take the method 'zones'"),
        ("zones", {"adhesion_range": 1e-13}, "take the method 'sharp', for ranges that are so"),
    ],
)
def test_a_method_that_does_not_have_the_law_is_refused(method, given, sentence):
    problem = Problem(single_wave(A, PERIOD), SOLID, wave_of(0.3).work_of_adhesion, **given)
    with pytest.raises(ValueError, match=sentence):
        make_method(method, problem)
