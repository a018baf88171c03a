"""Adhesion of a finite range: loops of ``sharp`` against closed forms and other solutions."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize_scalar

from adhesis import Control, HalfSpace, LoopResult, Problem, make_method, run_path, single_wave
from adhesis.solver.loading.zero_range import beyond_limit, range_warnings
from adhesis.solver.model.profile import Array
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.sharp.continuation.jump import Jumps
from adhesis.solver.sharp.mechanics import Point
from adhesis.solver.sharp.nucleation.nucleation import Touch
from tests.support import scenes
from tests.support.dugdale_wave import DugdaleWave
from tests.support.explicit_solution import between, explicit_openings

A, PERIOD, SOLID = 1e-6, 1e-3, HalfSpace(1e6, 0.0)
GAMMA = 0.04


def wave_of(alpha: float) -> SingleWave:
    gamma = 0.5 * (alpha * np.pi * A / PERIOD) ** 2 * SOLID.modulus * PERIOD
    return SingleWave(A, PERIOD, SOLID.modulus, gamma)


@cache
def loop_at(
    alpha: float, share: float, control: Control | None = None, turn: float = 0.7
) -> LoopResult:
    """Loop of a wave at a range of this share of its amplitude, or at zero range."""
    control = control or Control()
    problem = Problem(
        single_wave(A, PERIOD), SOLID, wave_of(alpha).work_of_adhesion, control,
        adhesion_range=share * A or None, measure="flat",
    )  # fmt: skip
    turning = {"max_stress": 500.0} if control.is_load else {"max_penetration": turn}
    return scenes.loop_of(problem, accuracy=1e-5, load_steps=10, **turning)


@cache
def rough_loop(range_: float | None) -> LoopResult:
    profile = scenes.rough(3, 5, 1, hurst=0.7)
    problem = Problem(profile, HalfSpace(1e8, 0.5), GAMMA, adhesion_range=range_)
    return scenes.loop_of(problem, accuracy=1e-4, max_penetration=0.6, load_steps=10)


@cache
def dugdale_loss(alpha: float, share: float) -> float:
    return DugdaleWave(wave_of(alpha), share * A).loss


def touching_at(wave: SingleWave, range_: float, stiffness: float = np.inf) -> float:
    """Loss if surfaces jump together at a gap of ``range_``, edges being those of zero range."""

    def prescribed(a: float | Array) -> Array:
        return wave.separation(a) - wave.mean_stress(a) / stiffness

    most = 0.49 * wave.period if np.isinf(stiffness) else wave.stable_range(stiffness)[1]
    fold = minimize_scalar(
        lambda a: -prescribed(a), bounds=(1e-4 * most, most), method="bounded",
        options={"xatol": 1e-10 * most},
    )  # fmt: skip
    touched = brentq(lambda a: prescribed(a) - wave.amplitude - range_, fold.x, most)
    widths = np.linspace(fold.x, touched, 4001)
    return float(np.trapezoid(wave.mean_stress(widths), prescribed(widths)))


# Shares of edge_range, which is 0.042, 0.160 and 0.292 A: at half of it the smeared edges make
# half a hundredth of the loss of zero range, at a quarter less than a thousandth.
@pytest.mark.parametrize(
    ("alpha", "share", "off"),
    [
        (0.1, 0.01, 3e-4),
        (0.1, 0.02, 5e-3),
        (0.3, 0.05, 6e-4),
        (0.3, 0.1, 8e-3),
        (0.5, 0.05, 1e-4),
        (0.5, 0.2, 1e-2),
    ],
)
def test_a_wave_loses_what_dugdales_law_has_it_lose(alpha, share, off):
    wave, loop = wave_of(alpha), loop_at(alpha, share)
    assert abs(loop.loss - dugdale_loss(alpha, share)) < off * wave.loop.loss
    assert loop.loss == pytest.approx(touching_at(wave, share * A), rel=1e-5)
    assert abs(loop.loss - loop.loss_from_drops) < loop.loss_error
    assert loop.jumps[0].separation == pytest.approx((1 + share) * A, rel=1e-12)
    assert loop.touch_range == np.inf


@pytest.mark.parametrize("stiffness", [3e9, 5e8])
def test_a_machine_pulls_surfaces_together_at_the_range_too(stiffness):
    loop = loop_at(0.3, 0.1, Control(stiffness))
    assert loop.loss == pytest.approx(touching_at(wave_of(0.3), 0.1 * A, stiffness), rel=2e-5)
    assert abs(loop.loss - loop.loss_from_drops) < loop.loss_error


def test_a_weight_loses_what_it_loses_without_a_range():
    """It falls together from any distance at once, and no work is done on the way."""
    ranged, without = (loop_at(0.3, share, Control(0.0)) for share in (0.1, 0.0))
    assert ranged.jumps[0].separation == pytest.approx(1.1 * A, rel=1e-12)
    assert abs(ranged.loss - without.loss) < ranged.loss_error + without.loss_error


@pytest.mark.parametrize(
    ("alpha", "share", "doubtful"), [(0.1, 0.02, False), (0.3, 0.1, False), (0.5, 0.2, True)]
)
def test_a_loop_says_what_zones_at_its_edges_change(alpha, share, doubtful):
    wave, loop = wave_of(alpha), loop_at(alpha, share)
    left_out = 100 * (loop.loss - dugdale_loss(alpha, share)) / wave.loop.loss
    said = re.search(r"edges, left out, change the loss by about (\S+) %", loop.range_summary())
    assert "e" not in said[1]
    assert 0.6 < float(said[1]) / left_out < 1.6
    assert 0.6 < 100 * loop.zone_error / wave.loop.loss / left_out < 1.6
    assert any("0.67 of edge_range" in text for text in loop.warnings) == doubtful


def test_surfaces_that_would_part_again_touch_from_nearer_by():
    """The wave has contact up to s = 1.117 A, which has less energy than none up to 1.085 A."""
    loop = loop_at(0.1, 0.098, turn=0.3)
    wave = wave_of(0.1)
    touch, *_ = loop.jumps
    assert touch.separation < 1.09 * A
    assert 0 <= touch.energy_drop < 1e-4 * wave.loop.loss
    assert abs(float(wave.energy(wave.half_width(touch.separation)))) < 1e-9 * PERIOD
    assert any("edge_range" in warning for warning in loop.warnings)


def test_a_second_loop_of_a_method_has_the_bits_of_the_first():
    """First touch is found once, by descents that the first path must not depend on."""
    profile = scenes.rough(2, 8, 6, period=1e-3)
    problem = Problem(profile, HalfSpace(1e6, 0.5), 0.001, adhesion_range=3e-8)
    method = make_method("sharp", problem)
    first, second = (run_path(method, [0.5], load_steps=5) for _ in range(2))
    assert first == second


def test_the_loss_falls_with_the_range_as_stress_changes_at_touches():
    zero = rough_loop(None)
    range_ = 0.05 * zero.touch_range
    ranged = rough_loop(range_)
    assert [jump.kind for jump in ranged.jumps] == [jump.kind for jump in zero.jumps]
    touches = [k for k, jump in enumerate(zero.jumps) if jump.kind == "snap-in"]
    assert len(touches) >= 3
    change = np.diff(zero.mean_stress)[zero.states_before_jumps()]
    sooner = [ranged.jumps[k].separation - zero.jumps[k].separation for k in touches]
    assert min(sooner) > 0.5 * range_
    expected = -float(np.dot(sooner, change[touches]))
    assert zero.loss - ranged.loss == pytest.approx(expected, rel=0.02)


def test_a_gap_is_as_wide_as_the_range_where_it_touches():
    """By another solution of the field, in the state before each jump to a new patch."""
    range_ = 2e-8
    loop = rough_loop(range_)
    profile = loop.problem.profile
    touches = 0
    for jump, k in zip(loop.jumps, loop.states_before_jumps(), strict=True):
        state = loop.contact_states[k]
        if jump.kind == "snap-in" and state.patches:
            gaps = between(state.edges * profile.q0)
            both = explicit_openings(profile, gaps, state.separation * profile.q0, 600)
            curves = [CubicSpline(*gap) for gap in zip(*both, strict=True)]
            least = np.concatenate([t(t.derivative().roots(extrapolate=False)) for t in curves])
            assert np.abs(least / profile.q0 - range_).min() < 1e-3 * range_
            touches += 1
    assert touches >= 2


def test_a_touch_that_does_not_hold_is_tried_again_from_nearer_by(monkeypatch):
    reference, refused, has_gained = rough_loop(2e-8), [], Jumps.has_gained

    def hold(self: Jumps, before: Point, after: Point | None, touches: list[Touch]) -> bool:
        if not refused:
            refused.append(before)
            return False
        return has_gained(self, before, after, touches)

    monkeypatch.setattr(Jumps, "has_gained", hold)
    loop = rough_loop.__wrapped__(2e-8)
    assert [jump.kind for jump in loop.jumps] == [jump.kind for jump in reference.jumps]
    later = [a.separation - b.separation for a, b in zip(reference.jumps, loop.jumps, strict=True)]
    assert 0.003 < max(later) / 2e-8 < 0.02
    assert sum(abs(way) > 1e-4 * 2e-8 for way in later) == 1
    assert abs(loop.loss - reference.loss) < min(1e-3 * reference.loss, loop.loss_error)


def test_tension_above_the_strength_inside_patches_makes_a_loss_doubtful():
    """Patches would open there, which is left out: such a loss is that of closed valleys."""
    problem = Problem(scenes.rough(2, 8, 0), HalfSpace(1e9, 0.5), GAMMA, strength=4e6)
    loop = scenes.loop_of(problem, max_penetration=0.9, load_steps=20)
    assert loop.largest_interior_tension > 1.2 * 4e6
    assert loop.openings == 0
    (excess,) = (text for text in loop.warnings if "inside patches" in text)
    assert "times the strength (4e+06 Pa): patches would open from inside there" in excess
    assert "take the method 'zones' (--method zones" in excess
    assert range_warnings(problem, GAMMA / (1.005 * 4e6), 1.0, [0.5]) == []
    assert len(range_warnings(problem, GAMMA / (1.02 * 4e6), 1.0, [0.5])) == 1
    valid_range, strength = 0.02 / (1e9 * np.array([1.005, 1.02, 1.02])), [1e9, 1e9, np.nan]
    assert beyond_limit(valid_range, 1.0, 0.02, 0.5, strength).tolist() == [False, True, False]


def test_a_range_is_a_strength_and_a_short_one_changes_nothing():
    zero, short = rough_loop(None), rough_loop(1e-15)
    assert short.problem.strength == GAMMA / 1e-15
    assert short.problem == replace(zero.problem, strength=GAMMA / 1e-15)
    assert replace(short.problem, work_of_adhesion=0.02).strength == short.problem.strength
    assert replace(zero.problem, work_of_adhesion=0.0, strength=1e6).strength == np.inf
    assert [jump.kind for jump in short.jumps] == [jump.kind for jump in zero.jumps]
    assert abs(short.loss - zero.loss) < short.loss_error + zero.loss_error


def test_a_minor_loop_inside_the_range_closes():
    problem = loop_at(0.3, 0.05).problem
    path = run_path(make_method("sharp", problem), [0.7, 0.1, 0.5], load_steps=10)
    assert [loop.closes for loop in path.minor_loops] == [True]
    assert path.work == pytest.approx(loop_at(0.3, 0.05).loss, rel=1e-4)
