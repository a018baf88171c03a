"""Where surfaces touch: which of several places gets a patch, and how wide its seed is."""

import numpy as np

from adhesis import Problem, single_wave
from adhesis.solver._kernels import SearchedGaps, SearchLengths, local_minima, search
from adhesis.solver.sharp.gap.ends import with_patches
from adhesis.solver.sharp.method import SharpMethod
from adhesis.solver.sharp.nucleation.nucleation import Minima, Nucleation
from tests.support.scenes import HALF_SPACE, rough

AMPLITUDE, PERIOD = 1e-6, 1e-3


def nucleation(gamma: float) -> Nucleation:
    method = SharpMethod(Problem(single_wave(AMPLITUDE, PERIOD), HALF_SPACE, gamma))
    return method.nucleation


def places(of: Nucleation, overlaps: list[float]) -> list[float]:
    """Places that get a patch, of minima at θ = 0, 1, … with openings in units of h_max."""
    opening = np.array(overlaps) * AMPLITUDE * 2 * np.pi / PERIOD
    theta, width = np.arange(len(overlaps), dtype=float), np.full(len(overlaps), 1e-3)
    return [touch.theta for touch in of.choose(Minima(theta, opening, width, opening))]


def test_the_deepest_place_gets_a_patch_and_of_equal_ones_the_first_from_the_crest_on() -> None:
    adhesive = nucleation(0.01)
    assert places(adhesive, [1e-3, 2e-3]) == []
    assert places(adhesive, [-1e-5, -3e-5, 1e-3, -2e-5]) == [1]
    assert places(adhesive, [-3e-5, -3e-5, -2e-5]) == [0]  # the crest is at θ = 0
    # Without adhesion nothing runs, so that the order does not matter.
    assert places(nucleation(0.0), [-1e-2, -3e-2, 1.0, -2e-2]) == [0, 1, 3]


def test_seeds_that_meet_are_one_patch() -> None:
    """In a gap from 1 to 2: seeds apart, that meet each other, that meet the patches beside."""
    gaps, widths = np.array([[1.0, 2.0], [3.0, 7.0]]), np.array([0.1, 0.1])

    def first_gap(*centres: float) -> list[float]:
        found = with_patches(gaps, np.array(centres), widths)
        return [round(float(end), 6) for end in found[:-1].ravel()]

    assert first_gap(1.3, 1.6) == [1.0, 1.25, 1.35, 1.55, 1.65, 2.0]
    assert first_gap(1.35, 1.4) == [1.0, 1.3, 1.45, 2.0]
    assert first_gap(1.02, 1.98) == [1.07, 1.93]


def test_what_the_parabola_of_a_minimum_may_be_wrong_by_covers_a_cubic() -> None:
    """Nodes that are not quite evenly spaced, minima anywhere between them."""
    rng = np.random.default_rng(7)
    for _ in range(50):
        nodes = np.linspace(1, -1, 12) + rng.uniform(-0.01, 0.01, 12)
        at, half, third = rng.uniform(-0.5, 0.5), rng.uniform(0.2, 1), rng.uniform(-0.6, 0.6)
        opening = 1 + half * (nodes - at) ** 2 + third * (nodes - at) ** 3
        (place,), (low,), (error,) = local_minima(nodes, opening)
        assert abs(place - at) < 0.3
        assert abs(low - 1) <= error


def test_a_minimum_is_the_lowest_opening_around_it() -> None:
    """Where the third derivative is large one in eighty was too high, by up to 4e-4 h_max."""
    profile = rough(4, 60, 1)
    edges = SharpMethod(Problem(profile, HALF_SPACE, 0.02)).edges
    h_max = profile.h_max * profile.q0
    lengths = SearchLengths(
        wave=1.0, closing_per_motion=1.0, surface=1.0, narrowest=1e-3, longest_step=1.0,
        range=100 * h_max,  # all minima are located finely
    )  # fmt: skip
    around = 0.04 * edges.wave * np.linspace(-1, 1, 161)
    for shift in np.linspace(0.0, 1.0, 10):
        gaps = np.array([[0.3, 2.0], [2.2, 4.1], [4.3, 6.4]]) + shift
        field = edges.field(gaps, 0.5 * h_max)
        _, _, (place, low, *_), _ = search(field.solution, SearchedGaps(), lengths)
        for k, (left, right) in enumerate(gaps):
            inside = (place > left) & (place < right)
            near = place[inside, None] + around
            near = np.clip(near, left, right).ravel()
            opening = field.solution.sum_modes(k, near, field.fine_opening(k).modes)
            lowest = opening.reshape(-1, len(around)).min(axis=1)
            assert np.all(low[inside] <= lowest + 1e-9 * h_max)
