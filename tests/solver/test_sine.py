"""Sine transforms of openings against sums of their modes."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis import self_affine_profile
from adhesis.solver._kernels import Field, FieldModel, solve_field
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.system.edge_problem import FIXED_SEPARATION

GAPS = np.array([[0.3, 0.8], [1.0, 2.0], [2.3, 5.1]])


@pytest.fixture(scope="module")
def field() -> Field:
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=4, ratio=25, h_rms=1e-6, seed=2)
    model = FieldModel(FIXED_SEPARATION, 20.0, StressSource(profile).panels)
    return solve_field(GAPS, 0.5 * profile.h_max * profile.q0, model)


@pytest.mark.parametrize("k", range(3))
def test_openings_at_fine_nodes_are_sums_of_their_modes(field: Field, k: int) -> None:
    """Numbers of nodes with each of the small factors, all of them enough."""
    sizes = set()
    for per_wave in np.geomspace(0.1, 15, 50):
        theta, opening, _, modes = field.fine_opening(k, per_wave)
        size = len(theta)
        assert len(opening) == len(modes) == size
        sizes.add(size)
        exact = field.sum_modes(k, theta, modes)
        np.testing.assert_allclose(opening, exact, atol=1e-12 * np.abs(exact).max())
    for size in sizes:
        rest = size + 1
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        assert rest == 1
        assert (size + 1) % 4 == 0
    if k == 2:  # of many nodes
        assert all(any((size + 1) % factor == 0 for size in sizes) for factor in (9, 10, 15))
