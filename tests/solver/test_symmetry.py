"""Invariances of every kind of loop, mirror-symmetric profiles, and both measures of adhesion."""

from functools import cache

import numpy as np
import pytest

from adhesis import Control, HalfSpace, LoopResult, Problem, Profile, run_loop, stripes
from adhesis.solver.model.problem import Measure
from adhesis.solver.registry import MethodName
from tests.support.scenes import HALF_SPACE as SOFT
from tests.support.scenes import UNEVEN, grid_of, loop_of, loops_at, rough

SHIFT = np.exp(1e-7j)
DEEP = {"max_penetration": 0.7}
# Problem, turning point, and how near the losses are: by the accuracy with which jumps are found.
SCENES: dict[str, tuple[Problem, dict[str, float], float]] = {
    "stiff": (Problem(rough(2, 8, 0), HalfSpace(1e8, 0.5), 0.04), DEEP, 1e-3),
    "range": (Problem(rough(3, 3, 1), HalfSpace(1e8, 0.5), 0.04, strength=2e6), DEEP, 1e-4),
    "separation": (Problem(rough(3, 8, 4), SOFT, 0.01), DEEP, 1e-5),
    "stiffness": (Problem(rough(3, 8, 4), SOFT, 0.01, Control(1e10)), DEEP, 1e-5),
    "load": (Problem(rough(3, 8, 4), SOFT, 0.01, Control(0.0)), {"max_stress": 500.0}, 1e-5),
    "preload": (Problem(rough(4, 5, 1), SOFT, 0.005), {"preload": 500.0}, 1e-4),
    "pattern": (Problem(rough(2, 6, 3), SOFT, 2e-3, pattern=UNEVEN), DEEP, 1e-5),
    "two works": (Problem(rough(2, 3, 3), SOFT, 2e-3, work_of_adhesion_open=4e-3), DEEP, 1e-5),
}


@pytest.mark.parametrize("name", SCENES)
def test_mirror_shift_and_scale_change_nothing(name):
    """Of profile, material, interface and control; a loop of its own units, from the other side."""
    lengths, stresses = 2.0, 3.0
    problem, turn, near = SCENES[name]
    profile, pattern, opened = problem.profile, problem.pattern, problem.work_of_adhesion_open
    other = Problem(
        profile.mirrored().shifted(0.3 * profile.period).scaled(lengths, lengths),
        HalfSpace(stresses * problem.half_space.young, 0.5),
        lengths * stresses * problem.work_of_adhesion,
        Control(problem.control.stiffness * stresses / lengths),
        strength=None if np.isinf(problem.strength) else stresses * problem.strength,
        work_of_adhesion_open=opened and lengths * stresses * opened,
        pattern=pattern and pattern.mirrored().shifted(0.3),
    )
    scale = 1.0 if "max_penetration" in turn else stresses
    path = {"accuracy": 1e-4, "load_steps": 10}
    here = loop_of(problem, **path, **turn)
    there = loop_of(other, **path, **{k: scale * v for k, v in turn.items()})
    assert [jump.kind for jump in there.jumps] == [jump.kind for jump in here.jumps]
    assert len(here.jumps) > 2
    scale = stresses if "max_stress" in turn else 1.0
    assert there.turning_point == pytest.approx(scale * here.turning_point, rel=1e-6)
    for value in ("loss", "friction"):
        expected = lengths * stresses * getattr(here, value)
        assert getattr(there, value) == pytest.approx(expected, rel=near, abs=0)
    for value in ("valid_range", "edge_range", "touch_range"):
        assert getattr(there, value) == pytest.approx(lengths * getattr(here, value), rel=1e-3)


def bumpy(wave: int, amplitude: float, shift: complex = 1.0) -> Profile:
    """One wave of 1 mm with a small one on it, E* = 1 and q0 = 1."""
    coefficients = np.zeros(wave + 1, dtype=complex)
    coefficients[1], coefficients[wave] = 5e-4, amplitude / 2 * shift
    return Profile(2 * np.pi, coefficients)


def loop_of_bumps(wave: int, amplitude: float, gamma: float, shift: complex) -> LoopResult:
    problem = Problem(bumpy(wave, amplitude, shift), HalfSpace(1.0, 0.0), gamma)
    return loop_of(problem, accuracy=1e-4, max_penetration=0.8, load_steps=30)


@pytest.mark.parametrize(
    ("wave", "amplitude", "gamma"), [(8, 5e-5, 2.75e-6), (8, 6e-5, 2.5e-6), (12, 4e-5, 4e-6)]
)
def test_a_patch_that_rocks_within_the_error_of_the_field_comes_to_rest(wave, amplitude, gamma):
    """It went to and fro beside a shallow minimum until the loop was refused."""
    symmetric, shifted = (loop_of_bumps(wave, amplitude, gamma, by) for by in (1.0, SHIFT))
    assert abs(symmetric.loss - shifted.loss) < symmetric.loss_error + shifted.loss_error


@pytest.mark.parametrize(
    ("wave", "amplitude", "gamma"), [(8, 6e-5, 3e-6), (12, 3e-5, 2e-6)], ids=["8", "12"]
)
def test_a_symmetric_state_is_left_where_its_antisymmetric_mode_softens(wave, amplitude, gamma):
    """On one patch that rocks from bump to bump; 1.2e-4 and 9e-5 apart where it was held."""
    symmetric, shifted = (loop_of_bumps(wave, amplitude, gamma, by) for by in (1.0, SHIFT))
    assert abs(symmetric.loss - shifted.loss) < symmetric.loss_error
    assert symmetric.method.newton_steps < 2 * shifted.method.newton_steps
    # which side it takes is a convention: a race whose other end has the same energy
    assert symmetric.races > 0
    assert symmetric.energy_at_stake == pytest.approx(0.0, abs=1e-9 * symmetric.loss)


@pytest.mark.parametrize(
    ("seed", "accuracy"), [(0, 1e-2), (1, 1e-3), (2, 1e-4), (3, 1e-3), (0, 1e-4), (1, 1e-2)]
)
def test_a_random_symmetric_profile_loses_what_one_hardly_asymmetric_does(seed, accuracy):
    """Of touches and folds that are mirror images one comes first, in both."""
    rng = np.random.default_rng(seed)
    waves = int(np.round(2 * 12 ** rng.uniform()))
    m = np.arange(1, waves + 1)
    amplitude = np.append(0.0, m ** -rng.uniform(0.7, 1.4) * rng.choice([-1, 1], waves))
    amplitude *= 1e-6 / np.sqrt(2 * np.sum(amplitude**2))
    unit = SOFT.modulus * 1e-12 * 2 * np.pi / 2e-3
    gamma, depth = 10 ** rng.uniform(-2, 0) * unit, rng.uniform(0.3, 0.95)
    shifted = amplitude.astype(complex)
    shifted[rng.integers(2, waves + 1)] *= SHIFT
    path = {"accuracy": accuracy, "max_penetration": depth, "load_steps": 10}
    profiles = Profile(2e-3, amplitude.astype(complex)), Profile(2e-3, shifted)
    one, other = (loop_of(Problem(profile, SOFT, gamma), **path) for profile in profiles)
    assert abs(one.loss - other.loss) < one.loss_error
    assert one.method.newton_steps < 2 * other.method.newton_steps


def test_parts_that_may_go_one_after_the_other_are_a_race_with_what_is_at_stake():
    """Of six equal parts several modes soften at once: which lead depends on the accuracy."""
    amplitudes = np.zeros(13, dtype=complex)
    amplitudes[[6, 12]] = 1e-6 * np.array([0.648, 0.282]) * np.exp([-1.22j, 1.99j])
    problem = Problem(Profile(2e-3, amplitudes), SOFT, 1.7e-4)
    coarse, fine = loops_at(problem, 1e-3, 1e-4, max_penetration=0.75, load_steps=10)
    apart = abs(coarse.loss - fine.loss)
    assert apart < max(coarse.loss_error, coarse.energy_at_stake, fine.energy_at_stake)
    # ends that differ by a turn are one
    raced = [j for j in (*coarse.jumps, *fine.jumps) if j.raced]
    assert all(j.at_stake > 1e-3 * coarse.loss for j in raced)


@pytest.mark.parametrize(
    ("amplitudes", "gamma", "depth"),
    [((0.57, -0.418), 8.77e-4, 0.529), ((-0.576, -0.41), 4.22e-3, 0.749)],
)
def test_two_equal_parts_that_are_mirrored_lose_the_same_wherever_they_lie(
    amplitudes, gamma, depth
):
    """Of two equal patches one goes; rounding decided whether it slid to a crest: 40 and 58 %."""
    coefficients = np.zeros(5, dtype=complex)
    coefficients[[2, 4]] = 1e-6 * np.array(amplitudes)
    even = Profile(2e-3, coefficients)
    coefficients[4] *= SHIFT
    profiles = [even.shifted(share * even.period) for share in (0.0, 0.1234, 0.3777, 0.61)]
    losses = [
        loop_of(Problem(profile, SOFT, gamma), max_penetration=depth, load_steps=10).loss
        for profile in (*profiles, Profile(2e-3, coefficients))
    ]
    np.testing.assert_allclose(losses, losses[0], rtol=1e-4)


@pytest.mark.parametrize("method", ["sharp", "grid"])
def test_of_equal_crests_that_with_the_largest_work_of_adhesion_touches_first(method):
    """Wherever the period begins: rounding chose one, and losses differed by 7e-3."""
    grooves, stripe = Profile(2e-3, np.array([0, 0, 5e-7])), stripes(1, 0.4, 2.5)
    nodes = 16 if method == "grid" else None
    losses = [
        loop_of(
            Problem(grooves.shifted(share * 2e-3), SOFT, 2e-3, pattern=stripe.shifted(share)),
            method,
            nodes_per_wave=nodes,
            max_penetration=0.6,
            load_steps=5,
        ).loss
        for share in (0.0, 0.25, 0.5625, 0.625)  # whole nodes: crests are at nodes
    ]
    np.testing.assert_allclose(losses, losses[0], rtol=1e-5)


def test_two_patches_that_are_mirror_images_part_as_soon_as_they_are_a_saddle():
    """Newton's iteration finds them beyond that, too: a step of 4e-3 h_max led 4e-4 too far."""
    problem = Problem(Profile(2e-3, np.array([0, 0, 0, 5e-7])), SOFT, 3e-3)
    coarse, fine = loops_at(problem, 1e-4, 1e-5, max_penetration=0.7, load_steps=10)
    one, other = (loop.jumps[2] for loop in (coarse, fine))
    assert (one.kind, one.patches_before) == (other.kind, other.patches_before) == ("vanishing", 2)
    assert one.separation == pytest.approx(other.separation, abs=2e-5 * problem.profile.h_max)


def test_grid_takes_mirror_images_one_after_the_other_too():
    """Two outer crests of one height, which touch at once; the trough between them stays open."""
    profile = Profile(2e-3, np.array([0, 1e-7, -4e-7, -1e-7], dtype=complex))
    assert len(profile.crests().position) == 2
    problem = Problem(profile, SOFT, 2e-4)
    sharp = loop_of(problem, max_penetration=0.5, load_steps=10)
    grid = run_loop(grid_of(problem, nodes=512), max_penetration=0.5, load_steps=10)
    for loop in (sharp, grid):
        assert loop.jumps[0].patches_after == 1
    assert sharp.jumps[0].raced
    assert abs(grid.loss - sharp.loss) < grid.loss_error + sharp.loss_error


def test_axes_and_equal_parts_of_a_profile():
    even = bumpy(8, 6e-5)
    assert even.mirror_axes.tolist() == [0.0]
    np.testing.assert_allclose(even.shifted(0.3).mirror_axes, [0.3])
    assert len(bumpy(8, 6e-5, np.exp(0.1j)).mirror_axes) == 0
    # noise of a wave that is longer than all others settles no axis
    flat = Profile(1.0, np.array([0, 0, 0, 0, 1e-6, 2e-7, 1e-7]))
    for odd, found in ((1e-9, 1), (0.9e-6, 1), (1.1e-6, 0)):
        noise = flat.h_max * odd * np.array([0, 1j, 0, 0, 0, 0, 0])
        assert len(Profile(1.0, flat.coefficients + noise).mirror_axes) == found
    assert even.equal_parts == 1
    assert Profile(1.0, np.array([0, 0, 0, 0, 1e-6, 0, 1e-7])).equal_parts == 2


PERIOD = 1e-3
STEEP = Profile(PERIOD, 1e-5 * np.array([0, 1, 0.5j, -0.4, 0.3j, 0.2]))  # rms slope 0.12


@cache
def loop_in(
    profile: Profile, gamma: float, measure: Measure, method: MethodName = "sharp"
) -> LoopResult:
    problem = Problem(profile, SOFT, gamma, measure=measure)
    nodes_per_wave = 16 if method == "grid" else None
    path = {"max_penetration": 0.4, "load_steps": 2}
    return loop_of(problem, method, nodes_per_wave=nodes_per_wave, **path)


@pytest.mark.parametrize("method", ["sharp", "grid"])
def test_losses_in_the_flat_measure_obey_the_law_of_scaling_exactly(method):
    """Profiles c times as high at c² times γ lose c² times as much; in the arc measure not."""
    losses = {
        measure: [
            loop_in(STEEP.scaled(high, wide), 0.3 * high**2 / wide, measure, method).loss
            / (high**2 / wide)
            for high, wide in ((1, 1), (3, 1), (1, 0.25))[:scales]
        ]
        for measure, scales in (("flat", 3), ("arc", 2))
    }
    np.testing.assert_allclose(losses["flat"], losses["flat"][0], rtol=1e-7)
    assert losses["arc"][1] > 1.01 * losses["arc"][0]
