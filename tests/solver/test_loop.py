"""The loading path and the energy audit, with a method that is exact (Johnson's single wave)."""

from dataclasses import replace

import numpy as np
import pytest

from adhesis import ContactState, Control, Path, Problem, run_loop, single_wave
from adhesis.solver.loading.ledger import estimated_error
from adhesis.solver.method import PathError
from adhesis.solver.model.jump import Jump
from adhesis.solver.references.single_wave import SingleWave
from tests.support.exact_wave import ExactWave
from tests.support.scenes import HALF_SPACE

PERIOD, AMPLITUDE = 1e-3, 1e-9  # A q0 = 6e-6: flat and arc measure agree to 3e-11


def exact(alpha: float, **options) -> ExactWave:
    wave = SingleWave.with_alpha(alpha, AMPLITUDE, PERIOD, HALF_SPACE.modulus)
    problem = Problem(single_wave(AMPLITUDE, PERIOD), HALF_SPACE, wave.work_of_adhesion)
    return ExactWave(problem, **options)


def test_audit_residual_falls_with_the_square_of_the_state_spacing():
    residuals = [
        run_loop(exact(0.2, states_per_step=k), max_penetration=0.8, load_steps=10).audit_residual
        for k in (4, 8, 16, 32)
    ]
    assert abs(residuals[0]) < 1e-2
    orders = np.log2(np.abs(residuals[:-1]) / np.abs(residuals[1:]))
    assert orders == pytest.approx(2.0, abs=0.3)


def test_path_starts_and_ends_detached_and_keeps_the_axis():
    result = run_loop(exact(0.2), max_penetration=0.6, load_steps=12)
    loading, unloading = result.states("loading"), result.states("unloading")
    assert loading[-1] + 1 == unloading[0]
    assert result.patches[0] == 0
    assert result.patches[-1] == 0
    assert result.penetration[0] == 0
    assert np.all(np.diff(result.penetration[loading]) >= 0)
    assert np.all(np.diff(result.penetration[unloading]) <= 0)
    axis = result.penetration[result.states("loading", load_steps_only=True)]
    assert axis == pytest.approx(0.6 * np.arange(13) / 12, abs=1e-15)
    back = result.penetration[result.states("unloading", load_steps_only=True)]
    assert back == pytest.approx(0.6 * np.arange(12, 12 - len(back), -1) / 12, abs=1e-14)
    # The turning point is the same state on both branches.
    for values in (result.mean_stress, result.energy, result.contact_fraction):
        assert values[loading[-1]] == values[unloading[0]]
    # It goes on to below first touch and stops one step after pull-off.
    assert result.jumps[-1].separation == pytest.approx(1.25204901072 * AMPLITUDE, rel=1e-9)
    assert -0.252 - 0.05 < result.pull_off_penetration < -0.252


def test_callers_see_every_state_and_every_step():
    seen, steps = [], []
    result = run_loop(
        exact(0.2),
        max_penetration=0.5,
        load_steps=5,
        on_state=lambda branch, state: seen.append((branch, state.separation)),
        progress=lambda branch, penetration, state: steps.append(penetration),
    )
    assert [s for _, s in seen] == list(result.separation)
    assert [b for b, _ in seen] == list(result.branch)
    assert len(steps) == np.count_nonzero(result.load_step) - 1  # the turning point counts once


def test_audit_catches_energy_drops_that_are_not_the_loss():
    """A method claims drops 10 % too large."""

    class Untrue(ExactWave):
        def follow(self, state: ContactState, separation: float) -> Path:
            path = super().follow(state, separation)
            jumps = (replace(jump, energy_drop=1.1 * jump.energy_drop) for jump in path.jumps)
            return Path(path.states, tuple(jumps))

    result = run_loop(Untrue(exact(0.2).problem), max_penetration=0.8, load_steps=20)
    assert result.audit_residual == pytest.approx(-0.1, abs=1e-3)
    assert result.loss_error > abs(result.loss - result.loss_from_drops)  # whichever is larger


def test_a_loop_without_contact_below_the_crests_has_no_loss():
    """There is no such state: the loop ends with an error, not with a number."""

    class FallingHalfWayUp(ExactWave):
        def follow(self, state: ContactState, separation: float) -> Path:
            if separation > state.separation and separation > 0.7 * self.problem.profile.h_max:
                return Path((self.detached(separation),), ())
            return super().follow(state, separation)

    with pytest.raises(PathError, match=r"without contact at s = 0\.7"):
        run_loop(FallingHalfWayUp(exact(0.2).problem), max_penetration=0.8, load_steps=10)


def test_a_negative_drop_counts_in_the_error_and_is_said():
    """It is neither hidden from the sum of drops, which closes here, nor taken for nothing.

    A method claims a second jump with each, to an energy higher by a tenth.
    """

    class Upwards(ExactWave):
        def follow(self, state: ContactState, separation: float) -> Path:
            path = super().follow(state, separation)
            states, jumps = list(path.states), []
            for jump in path.jumps:
                after = next(k for k, s in enumerate(states) if s.separation == jump.separation) + 2
                states[after:after] = states[after - 2 : after]
                jumps += [replace(jump, energy_drop=f * jump.energy_drop) for f in (1.1, -0.1)]
            return Path(tuple(states), tuple(jumps), 0.0)

    result = run_loop(Upwards(exact(0.2).problem), max_penetration=0.8, load_steps=20)
    assert abs(result.audit_residual) < 1e-3
    assert min(jump.energy_drop for jump in result.jumps) < 0
    assert result.loss_error == pytest.approx(0.1 * result.loss, rel=0.02)
    assert any("numerical error of the loss" in text for text in result.warnings)


@pytest.mark.parametrize(
    ("stiffness", "kind", "error"),
    [
        (0.0, "pull-off", 0.0),
        (0.0, "merging", 0.5),
        (1e9, "pull-off", 0.5),
        (np.inf, "pull-off", 0.5),
        (np.inf, "opening", 0.5),
    ],
)
def test_only_the_last_drop_under_a_load_may_be_negative_without_an_error(stiffness, kind, error):
    """It is U there; any other drop below zero is an error."""
    problem = replace(exact(0.2).problem, control=Control(stiffness))
    drops = (("snap-in", 2.0), (kind, -0.5))
    jumps = [Jump("unloading", 0.0, drop, name, 1, 0, 0.1, 0.0, 0.0) for name, drop in drops]
    assert estimated_error(0.0, jumps, 0.0, problem) == error
    assert estimated_error(0.25, jumps, -0.125, problem) == error + 0.375


def test_a_drop_is_the_difference_of_the_energies_whatever_its_sign():
    low, high = (ContactState(1e-6, np.array([[0, 1e-4]]), 0.0, u, 0.0, 0.1) for u in (1.0, 3.0))
    assert Jump.between(low, high, "loading", 2.0).energy_drop == -1.0
    assert Jump.between(high, low, "loading", 2.0).energy_drop == 1.0
    opening = Jump.between(high, low, "loading", 2.0, opens=True)
    assert (opening.kind, opening.small_scale, opening.energy_drop) == ("opening", False, 1.0)


def test_a_contact_that_never_detaches_is_reported():
    class Sticking(ExactWave):
        def follow(self, state: ContactState, separation: float) -> Path:
            patch = np.array([[0.0, 1e-4]])
            return Path((ContactState(separation, patch, -1.0, 0.0, 0.0, 0.1),), ())

    with pytest.raises(PathError, match="still in contact"):
        run_loop(Sticking(exact(0.2).problem), max_penetration=0.5, load_steps=2)
