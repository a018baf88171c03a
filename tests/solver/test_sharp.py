"""Method sharp, whole loops: exact losses, the grid's limit, invariances and hard cases."""

from dataclasses import replace

import numpy as np
import pytest

from adhesis import Problem, Profile, make_method, single_wave
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.sharp.continuation.branch import Fold, StableBranch, Target
from adhesis.solver.sharp.method import SharpMethod
from tests.support.scenes import HALF_SPACE, of_paper, rough

PERIOD = 2e-3 * np.pi


PROFILE = rough(5, 8, 3, period=PERIOD)


@pytest.mark.parametrize("resolution", [1e-3, 1e-5, 1e-7, 1e-9])
def test_a_branch_ends_in_its_fold_at_the_resolution_that_is_asked(resolution):
    """In steps that no integral shortens, from half of the depth of a wave, in units of h_max."""
    amplitude = 1e-8
    wave = SingleWave.with_alpha(0.2, amplitude, 1e-3, HALF_SPACE.modulus, "arc")
    problem = Problem(single_wave(amplitude, 1e-3), HALF_SPACE, wave.work_of_adhesion)
    method = SharpMethod(problem, accuracy=1e-8)
    edges, h_max = method.edges, method.resolution.h_max
    state = method.follow(method.detached(amplitude), 0.5 * amplitude).states[-1]
    point = edges.equilibrium(state.internal.gaps, 0.5 * h_max, edges.wave)
    finer = replace(method.resolution, jump=resolution * h_max, bend=np.inf)
    target = Target(3 * h_max, 3 * amplitude, "unloading")
    branch, places = StableBranch(edges, finer, point, target), []
    before = edges.count.newton_steps
    while not isinstance(event := branch.advance(), Fold):
        places.append(event.point.d)
    assert event.point.d < method.q0 * wave.loop.fold_separation < event.d
    assert event.d - event.point.d < 2 * finer.jump
    assert edges.count.newton_steps - before < 45  # 30 to 37
    assert places == sorted(places)


def test_ten_thousand_waves():
    """Wave numbers 10 … 10,000: the field needs no more modes than before."""
    profile = of_paper(1, ratio=1000)
    method = make_method("sharp", Problem(profile, HALF_SPACE, 0.01))
    path = method.follow(method.detached(profile.h_max), profile.h_max)
    assert path.jumps[0].kind == "snap-in"
    assert path.jumps[0].energy_drop > 0


@pytest.mark.parametrize(("waves", "penetration"), [(210, 0.1), (60, 0.1), (60, 0.15)])
def test_hundreds_of_patches_appear_and_grow(waves, penetration):
    """Equal crests touch together; each carries what one of as many in the period does."""
    coefficients = np.zeros(waves + 1, dtype=complex)
    coefficients[waves] = 5e-9
    profile = Profile(PERIOD, coefficients)
    method = make_method("sharp", Problem(profile, HALF_SPACE, 0.0), accuracy=1e-2)
    separation = (1 - penetration) * profile.h_max
    state = method.follow(method.detached(profile.h_max), separation).states[-1]
    assert state.patches == waves
    y = np.sin(np.pi * state.contact_fraction / 2) ** 2
    p_star = np.pi * HALF_SPACE.modulus * profile.h_max * waves / PERIOD
    assert state.mean_stress == pytest.approx(p_star * y, rel=1e-4)


def test_settling_at_the_same_separation_returns_the_state():
    method = make_method("sharp", Problem(PROFILE, HALF_SPACE, 0.01))
    state = method.follow(method.detached(PROFILE.h_max), 0.5 * PROFILE.h_max).states[-1]
    path = method.follow(state, state.separation)
    assert path.jumps == ()
    assert path.states[-1].mean_stress == pytest.approx(state.mean_stress, rel=1e-6)


def test_fields_obey_the_boundary_conditions():
    """Gap open and stress-free outside, closed inside; means are p̄ and s; energy is ½∫σ(h-s)."""
    method = make_method("sharp", Problem(PROFILE, HALF_SPACE, 0.01), accuracy=1e-5)
    state = method.follow(method.detached(PROFILE.h_max), 0.4 * PROFILE.h_max).states[-1]
    n = 1 << 15
    fields = method.fields(state, n)
    contact = fields.gap == 0
    assert contact.mean() == pytest.approx(state.contact_fraction, abs=4 / n)
    assert np.all(fields.gap >= 0)
    assert np.all(fields.stress[~contact] == 0)
    assert fields.gap.mean() == pytest.approx(state.separation, rel=1e-4)
    assert abs(fields.displacement.mean()) < 1e-4 * PROFILE.h_rms
    # sums over nodes miss the square-root edges: error ~ sqrt(dx)
    assert fields.stress.mean() == pytest.approx(state.mean_stress, rel=0.05)
