"""Dense linear algebra of method ``sharp``: factors, solutions and modes, to rounding."""

from __future__ import annotations

import numpy as np
import pytest

from solver.sharp.eigen import symmetric_modes
from solver.sharp.linear import cholesky, factor_rows, is_definite, solve_column, solve_factored


@pytest.mark.parametrize("n", [1, 7, 8, 9, 41])
def test_factors_and_solutions(n):
    """Sizes around a block of eight rows; one, three and many right-hand sides."""
    random = np.random.default_rng(n)
    a = random.normal(size=(n, n))
    a = a @ a.T + n * np.eye(n)
    factor, definite = cholesky(a)
    lower = np.tril(factor[:, :n])
    assert definite
    assert lower.T @ lower == pytest.approx(a, rel=1e-13)
    for columns in (1, 3, 17):
        load = random.normal(size=(n, columns))
        x = load.copy()
        solve_factored(factor, x)
        assert a @ x == pytest.approx(load, abs=1e-12)
    x = load[:, 0].copy()
    solve_column(factor, x)
    assert a @ x == pytest.approx(load[:, 0], abs=1e-12)


def test_definite_is_what_has_positive_eigenvalues():
    random = np.random.default_rng(1)
    vectors, _ = np.linalg.qr(random.normal(size=(20, 20)))
    for least, definite in ((1e-3, True), (-1e-3, False)):
        a = (vectors * np.append(least, np.arange(1.0, 20))) @ vectors.T
        a = 0.5 * (a + a.T)
        assert is_definite(a) == definite
        assert not factor_rows(a.copy(), 0.1)


@pytest.mark.parametrize("kind", ["random", "repeated", "graded", "diagonal", "corner"])
@pytest.mark.parametrize("n", [1, 2, 3, 24])
def test_modes_of_symmetric_matrices(kind, n):
    """Orthonormal vectors, and values that rise and are the library's."""
    random = np.random.default_rng(n)
    vectors, _ = np.linalg.qr(random.normal(size=(n, n)))
    if kind == "diagonal":
        a = np.diag(random.normal(size=n))
    elif kind == "corner":
        a = np.zeros((n, n))
        a[0, -1] = a[-1, 0] = 1.0
    else:
        values = {
            "random": random.normal(size=n),
            "repeated": random.integers(0, 2, size=n).astype(float),
            "graded": 10.0 ** random.uniform(-12, 3, size=n),
        }[kind]
        a = (vectors * values) @ vectors.T
        a = 0.5 * (a + a.T)
    found, modes = symmetric_modes(a)
    size = max(np.abs(a).max(), 1e-300)
    assert np.all(np.diff(found) >= 0)
    assert found == pytest.approx(np.linalg.eigvalsh(a), abs=1e-13 * size * n)
    assert modes.T @ modes == pytest.approx(np.eye(n), abs=1e-13)
    assert a @ modes == pytest.approx(modes * found, abs=1e-13 * size * n)


def test_modes_of_what_is_no_number_are_none():
    values, _ = symmetric_modes(np.full((3, 3), np.nan))
    assert np.isnan(values).all()
