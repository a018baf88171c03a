"""Method sharp on scenes that mislead a path: overlaps, late touches, weak and steep ones."""

import numpy as np
import pytest

from adhesis import Problem, Profile, single_wave
from adhesis.solver.method import ContactState
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.sharp.gap.full_contact_stress import patches_between
from adhesis.solver.sharp.method import SharpMethod
from tests.support.explicit_solution import between, explicit_openings
from tests.support.scenes import HALF_SPACE as SOLID
from tests.support.scenes import loop_of, rough

PERIOD = 2e-3


def profile_of(hurst, n0, ratio, seed, amplitudes="deterministic", h_rms=1e-6):
    return rough(n0, ratio, seed, hurst=hurst, amplitudes=amplitudes, h_rms=h_rms)


def loop(profile, gamma, **path):
    return loop_of(Problem(profile, SOLID, gamma), **path)


def least_gap(profile: Profile, state: ContactState) -> float:
    """Least gap of a state in m, by the Riemann-Hilbert solution for its edges."""
    if not state.patches:
        return state.separation - profile.h_max
    gaps = between(state.edges * profile.q0)
    _, opening = explicit_openings(profile, gaps, state.separation * profile.q0)
    return float(opening.min() / profile.q0)


def test_surfaces_that_touch_on_unloading_nucleate():
    """A jump on unloading brings a free crest into the solid; it pulls off at -0.22, as on grids.

    Without contact there from then on, it would come off at Δ/h_max = +0.13 with a clean audit.
    """
    profile = profile_of(0.35, 3, 2, 7496, "rayleigh")
    gamma = 0.0827 * SOLID.modulus * 1e-12 * 2 * np.pi / PERIOD * 3
    result = loop(profile, gamma, max_penetration=0.844, load_steps=15)
    assert -0.3 < result.pull_off_penetration < -0.2
    assert "snap-in" in {j.kind for j in result.jumps if j.branch == "unloading"}
    method = result.new_method()
    for state in result.contact_states[::4]:
        assert method.fields(state, 512).gap.min() > -1e-6 * profile.h_max


def test_no_state_overlaps_where_narrow_gaps_close_fast():
    """Contact 0.85: a narrow gap closes seven times as fast as the mean gap, in one load step.

    Asked of an independent solution of the field. With touches missed there, surfaces overlapped
    by 0.1 h_max, and the loss was 6 % too low.
    """
    profile = profile_of(0.503, 8, 2, 765057, "rayleigh", h_rms=9.94e-6)
    gamma = 3.217 * SOLID.modulus * 9.94e-6**2 * profile.q0 * 8
    losses = []
    for steps in (1, 12):
        result = loop(profile, gamma, max_penetration=0.906, load_steps=steps)
        losses.append(result.loss)
        states = result.contact_states
        for state in states[:: max(1, len(states) // 20)]:
            assert least_gap(profile, state) > -1e-5 * profile.h_max  # that of the field's error
    assert losses[0] == pytest.approx(losses[1], rel=1e-3)


def test_states_come_in_the_order_of_the_path_at_any_accuracy():
    """A touch is located before states beyond it are recorded; the audit falls with accuracy."""
    profile = profile_of(0.209, 5, 13, 675982, "rayleigh")
    gamma = 4.71 * SOLID.modulus * 1e-12 * 2 * np.pi / PERIOD * 5
    audits = []
    for accuracy in (1e-3, 1e-5, 1e-6):
        result = loop(profile, gamma, max_penetration=0.9918, load_steps=20, accuracy=accuracy)
        for branch, way in (("loading", 1), ("unloading", -1)):
            assert (way * np.diff(result.penetration[result.branch == branch])).min() > -1e-12
        audits.append(abs(result.audit_residual))
    assert audits[0] < 3e-5
    assert audits[1] < audits[0] / 5
    assert audits[2] < audits[1] / 3


@pytest.mark.parametrize("alpha", [0.01, 0.03, 0.05, 0.1, 0.3, 0.6])
def test_the_loss_is_as_accurate_as_asked_for_and_its_error_is_told(alpha):
    """Single wave, weak adhesion included: within the accuracy, and within the reported error."""
    amplitude, period = 1e-8, 1e-3
    wave = SingleWave.with_alpha(alpha, amplitude, period, SOLID.modulus)
    result = loop(
        single_wave(amplitude, period), wave.work_of_adhesion, max_penetration=0.5, load_steps=10
    )
    error = abs(result.loss - wave.loop.loss)
    assert error < 5e-4 * wave.loop.loss
    assert error < result.loss_error < 1e-3 * wave.loop.loss


def test_vanishing_adhesion_ends_and_is_known_as_well():
    """γ = 1e-7 and 1e-8 on the same crests, each a parabola of its own.

    A single parabola's loss falls with γ^(4/3) but for a logarithm that weakens it. At 1e-8 the
    loss is a small difference of works, and as accurate.
    """
    profile = profile_of(0.8, 2, 12, 3)
    fair, faint = (
        loop(profile, gamma, max_penetration=0.25, load_steps=5) for gamma in (1e-7, 1e-8)
    )
    assert abs(fair.audit_residual) < 1e-3
    for result in (fair, faint):
        (text,) = result.warnings  # only of so short a range of adhesion
        assert "nm" in text
        assert result.loss_error < 1e-3 * result.loss
        assert min(jump.energy_drop for jump in result.jumps) > 0
        assert abs(result.loss - result.loss_from_drops) < result.loss_error
    assert 10 ** (4 / 3 - 0.1) < fair.loss / faint.loss < 10 ** (4 / 3)


@pytest.mark.parametrize(
    ("max_penetration", "gamma", "load_steps"),
    [(1e-3, 0.04, 20), (1e-4, 0.005, 20), (0.0097, 0.1, 40), (0.999999, 0.04, 20)],
)
def test_small_and_extreme_turning_points(max_penetration, gamma, load_steps):
    """They detach, in a number of states that follows from what happens and not from the step.

    Load steps that are skipped are interpolated on the axis.
    """
    profile = profile_of(0.8, 2, 12, 3)
    result = loop(profile, gamma, max_penetration=max_penetration, load_steps=load_steps)
    assert result.patches[-1] == 0
    assert abs(result.audit_residual) < 1e-4
    assert len(result.penetration) < 1500
    axis = result.on_axis("unloading", result.penetration)
    assert np.allclose(np.diff(axis), -max_penetration / load_steps, rtol=1e-6)
    assert axis[-1] == pytest.approx(result.penetration[-1])


def test_load_steps_along_a_branch_cost_no_fields_but_those_of_their_states():
    """Each begins with the point before its own: it once began straight, with a short step."""
    profile = rough(2, 16, 1, period=1e-3)

    def newton_steps(load_steps: int) -> int:
        method = SharpMethod(Problem(profile, SOLID, 0.03))
        state = method.follow(method.detached(profile.h_max), 0.5 * profile.h_max).states[-1]
        before = method.report().newton_steps
        for share in np.linspace(0.5, 0.6, load_steps + 1)[1:]:
            path = method.follow(state, share * profile.h_max)
            assert not path.jumps
            state = path.states[-1]
        return method.report().newton_steps - before

    assert newton_steps(4) <= newton_steps(1) + 3


def test_a_steep_profile_is_measured_exactly():
    """Rms slope 0.96: edges once ran to and fro for ever between two panels of sqrt(1 + h'²)."""
    profile = profile_of(0.227, 6, 5, 684946, "rayleigh", h_rms=2e-5)
    gamma = 1.15 * SOLID.modulus * 4e-10 * 2 * np.pi / PERIOD * 6
    result = loop(profile, gamma, max_penetration=0.9774, load_steps=20, accuracy=1e-2)
    assert abs(result.audit_residual) < 1e-4
    method = SharpMethod(Problem(profile, SOLID, gamma), accuracy=1e-2)
    left, right = np.array([0.3, 2.0]), np.array([1.1, 5.9])
    x = np.linspace(left, right, 20_001, axis=1) / profile.q0
    measure = np.sqrt(1 + profile.at(x, 1) ** 2)
    exact = np.trapezoid(measure, x * profile.q0, axis=1).sum()
    gaps = np.array([[1.1, 2.0], [5.9, 0.3 + 2 * np.pi]])
    assert patches_between(gaps) == pytest.approx(np.stack([left, right], axis=1), rel=1e-14)
    assert method.edges.adhesion.contact_work(gaps) == pytest.approx(exact, rel=1e-8)


def test_a_slope_of_37_ends_in_a_loss_and_a_warning():
    """It once crashed the process: sqrt(1 + h'²) is steep everywhere, and edges race along it."""
    profile = profile_of(0.591, 7, 129, 804443, h_rms=2e-4)
    result = loop(profile, 1853.12, max_penetration=0.5085, load_steps=2)
    assert result.patches[-1] == 0
    assert abs(result.audit_residual) < 1e-3
    assert result.loss_error < 1e-3 * result.loss
    assert any("rms slope is 36" in text or "rms slope is 37" in text for text in result.warnings)


def test_the_error_told_covers_the_error_made_on_random_scenes():
    """Against a run at a tenth of the accuracy; and it is not ten times too large."""
    rng = np.random.default_rng(11)
    ratios = []
    for _ in range(4):
        n0, ratio = int(rng.integers(2, 4)), int(rng.choice([2, 3]))
        profile = profile_of(rng.uniform(0.2, 0.9), n0, ratio, int(rng.integers(10**6)), "rayleigh")
        share = 10 ** rng.uniform(-2.5, 0.3)
        gamma = share * SOLID.modulus * 1e-12 * 2 * np.pi / PERIOD * n0
        depth = rng.uniform(0.3, 0.95)
        result, tight = (
            loop(profile, gamma, max_penetration=depth, load_steps=8, accuracy=accuracy)
            for accuracy in (1e-3, 1e-4)
        )
        error = abs(result.loss - tight.loss_from_drops)
        assert error < result.loss_error
        assert min(jump.energy_drop for jump in result.jumps) > 0
        ratios.append(result.loss_error / error)
    assert np.median(ratios) < 10
