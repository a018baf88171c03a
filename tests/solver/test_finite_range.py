"""The judge of benchmarks/finite_range.py, beside exact loops of one wave under Dugdale's law."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis.solver.references.single_wave import SingleWave
from benchmarks.finite_range import GridLoop
from tests.support.dugdale_wave import DugdaleWave

WAVE = SingleWave(1.0, 2 * np.pi, 1.0, 0.09 * np.pi / 4)  # α = 0.3; lengths in 1/q0, E* = 1


def loss_on_grid(delta: float, nodes_of_zone: float, places: float = 0.1) -> float:
    zone = np.pi / 4 * delta**2 / WAVE.work_of_adhesion
    nodes = 2 * round(np.pi * nodes_of_zone / zone)
    height = np.cos(2 * np.pi * np.arange(nodes) / nodes + places)
    grid = GridLoop(height, WAVE.work_of_adhesion, delta)
    return float(grid.loss(0.5, delta, 0.01 * WAVE.loop.loss))


def test_the_loss_of_a_wave_is_that_of_dugdales_law():
    """Zero range is 6 % off."""
    exact = DugdaleWave(WAVE, 0.03).loss
    assert loss_on_grid(0.03, 4.0) == pytest.approx(exact, rel=0.015)
    assert WAVE.loop.loss > 1.05 * exact


def test_neither_nodes_nor_their_places_matter():
    losses = [loss_on_grid(0.1, *one) for one in ((4.0, 0.1), (4.0, 0.11), (8.0, 0.1))]
    np.testing.assert_allclose(losses, losses[0], rtol=1e-2)
