"""Dense linear algebra of method ``sharp``, in what it solves."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis import self_affine_profile
from adhesis.solver._kernels import FieldModel, distance_to_minimum, implicit_step, solve_field
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.system.edge_problem import FIXED_SEPARATION
from tests.support.dense import solve_densely


@pytest.mark.parametrize("n", [1, 7, 8, 9, 41])
def test_solutions(n):
    """Sizes around a block of eight rows; without a limit a step solves the system."""
    random = np.random.default_rng(n)
    a = random.normal(size=(n, n))
    a = a @ a.T + n * np.eye(n)
    load = random.normal(size=n)
    assert a @ implicit_step(a, load, 1e15, False) == pytest.approx(load, abs=1e-12)


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


def test_definite_is_what_has_positive_eigenvalues():
    random = np.random.default_rng(1)
    vectors, _ = np.linalg.qr(random.normal(size=(20, 20)))
    for least, definite in ((1e-3, True), (-1e-3, False)):
        a = (vectors * np.append(least, np.arange(1.0, 20))) @ vectors.T
        a = 0.5 * (a + a.T)
        assert np.isfinite(distance_to_minimum(a, np.ones(20))) == definite
