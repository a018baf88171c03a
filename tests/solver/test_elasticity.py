"""The elastic half-space on a grid: single waves, symmetry, inverse, energies."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis.solver.grid.elasticity import ElasticGrid

PERIOD, MODULUS, N = 2e-3, 1.3e6, 256


@pytest.fixture
def grid() -> ElasticGrid:
    return ElasticGrid(N, PERIOD, MODULUS)


@pytest.mark.parametrize("harmonic", [1, 7, N // 2 - 1])
def test_a_stress_wave_displaces_by_twice_stress_over_modulus_and_wave_number(grid, harmonic):
    q = 2 * np.pi * harmonic / PERIOD
    wave = np.cos(q * np.arange(N) * PERIOD / N + 0.3)
    expected = 2 / (MODULUS * q) * wave
    np.testing.assert_allclose(grid.displacement(wave), expected, atol=1e-13 * abs(expected).max())


def test_compliance_is_symmetric_and_its_kernel_even(grid):
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((2, N))
    assert a @ grid.displacement(b) == pytest.approx(b @ grid.displacement(a), rel=1e-12)
    kernel = grid.kernel()
    np.testing.assert_allclose(kernel[1:], kernel[:0:-1], rtol=0, atol=1e-14 * kernel[0])
    unit = np.zeros(N)
    unit[5] = 1.0
    shifted = np.roll(kernel, 5)
    np.testing.assert_allclose(grid.displacement(unit), shifted, rtol=0, atol=1e-14 * kernel[0])


def test_the_preconditioner_undoes_displacement_up_to_the_mean(grid):
    stress = np.random.default_rng(2).standard_normal(N)
    back = grid.precondition(grid.displacement(stress).copy())
    np.testing.assert_allclose(back, stress - stress.mean(), atol=1e-12)
