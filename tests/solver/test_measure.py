"""Adhesion on the length of a profile, or on its projection: the arc and the flat measure."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis import HalfSpace, LoopResult, Problem, Profile, make_method, run_loop
from adhesis.solver.model.problem import Measure
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.registry import MethodName

SOFT = HalfSpace(1e6, 0.5)
PERIOD = 1e-3
ROUGH = Profile(PERIOD, 1e-5 * np.array([0, 1, 0.5j, -0.4, 0.3j, 0.2]))  # rms slope 0.12


def loop_of(
    profile: Profile, gamma: float, measure: Measure, method: MethodName = "sharp"
) -> LoopResult:
    problem = Problem(profile, SOFT, gamma, measure=measure)
    nodes_per_wave = 16 if method == "grid" else None
    chosen = make_method(method, problem, nodes_per_wave=nodes_per_wave)
    return run_loop(chosen, max_penetration=0.7, load_steps=5)


@pytest.mark.parametrize("method", ["sharp", "grid"])
def test_losses_in_the_flat_measure_obey_the_law_of_scaling_exactly(method):
    """Profiles c times as high at c² times γ lose c² times as much; in the arc measure not."""
    losses = {
        measure: [
            loop_of(ROUGH.scaled(high, wide), 0.3 * high**2 / wide, measure, method).loss
            / (high**2 / wide)
            for high, wide in ((1, 1), (3, 1), (1, 0.25))
        ]
        for measure in ("flat", "arc")
    }
    np.testing.assert_allclose(losses["flat"], losses["flat"][0], rtol=1e-7)
    assert losses["arc"][1] > 1.01 * losses["arc"][0]
    assert losses["arc"][2] > 1.01 * losses["arc"][0]


def test_the_measures_agree_for_small_slopes():
    """They differ by the order of m2, so a hundredth of the heights leaves 1e-4 of it."""
    steep, shallow = (
        loop_of(profile, gamma, "arc").loss / loop_of(profile, gamma, "flat").loss - 1
        for profile, gamma in ((ROUGH, 0.3), (ROUGH.scaled(0.01), 0.3e-4))
    )
    assert 0.1 * ROUGH.m2 < steep < 3 * ROUGH.m2
    assert shallow == pytest.approx(1e-4 * steep, rel=0.2)


def test_a_steep_wave_in_the_flat_measure_is_johnsons():
    """Slope 0.6, where the arc measure loses a tenth more."""
    wave = SingleWave.with_alpha(0.3, 1e-4, PERIOD, SOFT.modulus)
    profile = Profile(PERIOD, np.array([0, 0.5e-4]))
    found = loop_of(profile, wave.work_of_adhesion, "flat")
    assert found.loss == pytest.approx(wave.loop.loss, rel=1e-4)
    assert loop_of(profile, wave.work_of_adhesion, "arc").loss > 1.03 * found.loss
