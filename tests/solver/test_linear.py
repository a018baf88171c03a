"""Dense linear algebra of method ``sharp``, in what it solves."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis import self_affine_profile
from adhesis.solver._kernels import FieldModel, solve_field
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.system.edge_problem import FIXED_SEPARATION
from tests.support.dense import solve_densely


@pytest.mark.parametrize("order", range(22))
def test_inverses(order):
    """One gap, solved by the inverse of its block, of 4 to 128 nodes."""
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=4, ratio=5, h_rms=1e-6, seed=2)
    model = FieldModel(FIXED_SEPARATION, 20.0, StressSource(profile).panels)
    gaps, separation = np.array([[1.0, 5.5]]), 0.6 * profile.h_max * profile.q0
    field = solve_field(gaps, separation, model, np.array([order]))
    dense = solve_densely(gaps, separation, model, np.array([order]))
    assert field.pressure == pytest.approx(dense.pressure, rel=1e-11)
    np.testing.assert_allclose(
        field.opening, dense.opening, atol=1e-11 * np.abs(dense.opening).max()
    )
