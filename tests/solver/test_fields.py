"""Density of the gap, against closed forms and brute force."""

import numpy as np
import pytest
from scipy.optimize import brentq

from adhesis import ContactState, Method, Opening, Problem, make_method, run_loop, single_wave
from adhesis.solver.observables import gap_shares
from adhesis.solver.references.single_wave import SingleWave
from tests.support.scenes import HALF_SPACE as SOFT
from tests.support.scenes import rough

PERIOD = 2e-3
BINS = np.logspace(-4, 2, 97)


def loaded(method: Method, penetration: float) -> ContactState:
    loop = run_loop(method, max_penetration=penetration, load_steps=4)
    s = method.problem.separation(penetration)
    return next(state for state in loop.contact_states if abs(state.separation - s) < 1e-9 * s)


def shares_of(method: Method, state: ContactState) -> np.ndarray:
    problem = method.problem
    bins = BINS * problem.profile.h_max
    return gap_shares(method.openings(state), problem.profile.period, bins)


@pytest.mark.parametrize(
    ("name", "options", "accuracy"),
    [("sharp", {"accuracy": 1e-5}, 5e-4), ("grid", {"nodes_per_wave": 1024}, 0.03)],
)
@pytest.mark.parametrize("alpha", [0.1, 0.4])
def test_density_of_the_gap_is_that_of_johnsons_wave(name, options, accuracy, alpha):
    wave = SingleWave.with_alpha(alpha, 1e-9, PERIOD, SOFT.modulus)
    problem = Problem(single_wave(1e-9, PERIOD), SOFT, wave.work_of_adhesion)
    method = make_method(name, problem, **options)
    state = loaded(method, 0.4)
    a = wave.half_width(state.separation)
    middle = PERIOD / 2
    highest = float(wave.gap(middle, a))

    def below(t: float) -> float:
        """Share of the period with a gap of at most t, contact left out."""
        if t >= highest:
            return 1 - 2 * a / PERIOD
        x = brentq(lambda x: float(wave.gap(x, a)) - t, a, middle, xtol=1e-18)
        return 2 * (x - a) / PERIOD

    exact = [below(t * 1e-9) for t in BINS[1:]]
    found = np.cumsum(shares_of(method, state))
    np.testing.assert_allclose(found, exact, rtol=accuracy)


def test_density_of_the_gap_on_a_rough_profile_is_a_converged_one():
    """Wide gaps: counted on very many nodes. Narrow ones: Griffith's opening of every edge."""
    profile, gamma = rough(4, 25, 1), 0.005
    method = make_method("sharp", Problem(profile, SOFT, gamma), accuracy=1e-4)
    state = loaded(method, 0.4)
    assert state.patches > 5
    shares = shares_of(method, state)
    assert shares.sum() == pytest.approx(1 - state.contact_fraction, rel=1e-12)
    nodes = 1 << 16
    gap = method.fields(state, nodes).gap / profile.h_max
    counted = np.cumsum(np.histogram(gap[gap > 0], BINS)[0])
    enough = counted > 1000
    assert BINS[1:][enough].min() < 0.08
    np.testing.assert_allclose(np.cumsum(shares)[enough], counted[enough] / nodes, rtol=0.02)
    tough = gamma * np.sqrt(1 + profile.at(state.edges, derivative=1) ** 2)
    for t in (1e-3, 1e-2):
        k = int(np.argmin(np.abs(BINS - t)))
        reach = np.pi * SOFT.modulus * (BINS[k] * profile.h_max) ** 2 / (16 * tough)
        assert np.cumsum(shares)[k - 1] == pytest.approx(reach.sum() / PERIOD, rel=0.01)
    mean = np.sum(shares * np.sqrt(BINS[:-1] * BINS[1:])) * profile.h_max
    assert mean == pytest.approx(state.separation, rel=0.01)


def test_openings_of_both_methods_are_one():
    problem = Problem(rough(2, 8, 3), SOFT, 0.02)
    found = []
    for name, options in (("sharp", {"accuracy": 1e-4}), ("grid", {"nodes_per_wave": 32})):
        method = make_method(name, problem, **options)
        state = loaded(method, 0.5)
        openings = method.openings(state)
        assert len(openings) == state.patches
        for opening in openings:
            assert opening.gap[0] == opening.gap[-1] == 0
            assert (np.diff(opening.x) > 0).all()
        found.append(np.cumsum(shares_of(method, state)))
    narrow = (BINS[1:] > 1e-3) & (found[0] > 0)
    np.testing.assert_allclose(found[1][narrow], found[0][narrow], rtol=0.03)


def test_shares_of_a_square_root_are_exact_between_few_points():
    phi = np.array([0.0, 0.4, 2.0, 3.0, np.pi])
    t = np.array([0.0, 0.2, 1.0, 0.1, 0.0])
    bins = np.array([0.0, 0.05, 0.5, 0.9, 2.0])
    shares = gap_shares([Opening(1 - np.cos(phi), t)], 4.0, bins)
    dense = np.linspace(0, np.pi, 400_001)
    place, gap = 1 - np.cos(dense), np.interp(dense, phi, t)
    middle = (gap[1:] + gap[:-1]) / 2
    expected, _ = np.histogram(middle, bins, weights=np.diff(place) / 4)
    np.testing.assert_allclose(shares, expected, rtol=1e-4)
    assert shares.sum() == pytest.approx(0.5, rel=1e-14)
