"""Where surfaces touch: which of several places gets a patch, and how wide its seed is."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis import Problem, single_wave
from solver.references.single_wave import SingleWave
from solver.sharp.method import SharpMethod
from solver.sharp.touch import Minima, Nucleation, Touch
from tests.support.scenes import HALF_SPACE

AMPLITUDE, PERIOD = 1e-6, 1e-3


def nucleation(gamma: float) -> Nucleation:
    method = SharpMethod(Problem(single_wave(AMPLITUDE, PERIOD), HALF_SPACE, gamma))
    return method.nucleation


def places(of: Nucleation, overlaps: list[float]) -> list[float]:
    """Places that get a patch, of minima at θ = 0, 1, … with openings in units of h_max."""
    opening = np.array(overlaps) * AMPLITUDE * 2 * np.pi / PERIOD
    theta, curvature = np.arange(len(overlaps), dtype=float), np.full(len(overlaps), 1e-3)
    return [touch.theta for touch in of.ready(Minima(theta, opening, curvature))]


def test_the_deepest_place_gets_a_patch_and_those_that_equal_it() -> None:
    adhesive = nucleation(0.01)
    assert places(adhesive, [1e-3, 2e-3]) == []
    assert places(adhesive, [-1e-5, -3e-5, 1e-3, -2e-5]) == [1]
    assert places(adhesive, [-3e-5, -3e-5, -2e-5]) == [0, 1]
    # Without adhesion nothing runs, so that the order does not matter.
    assert places(nucleation(0.0), [-1e-2, -3e-2, 1.0, -2e-2]) == [0, 1, 3]


@pytest.mark.parametrize("gamma", [1e-5, 1e-4])
def test_a_seed_is_narrower_than_the_first_equilibrium_that_it_grows_to(gamma: float) -> None:
    wave = SingleWave(AMPLITUDE, PERIOD, HALF_SPACE.modulus, gamma)
    q0 = 2 * np.pi / PERIOD
    gaps = nucleation(gamma).seeded(np.empty((0, 2)), [Touch(0.0, 0.0, AMPLITUDE * q0)])
    width = (2 * np.pi - (gaps[0, 1] - gaps[0, 0])) / q0
    assert 0.2 < width / (2 * wave.half_width(AMPLITUDE)) < 0.6
