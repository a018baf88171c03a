"""Dense linear algebra of method ``sharp``: factors and solutions, to rounding."""

from __future__ import annotations

import numpy as np
import pytest
from adhesis.solver.sharp.field.cholesky import (
    cholesky,
    factor_rows,
    is_definite,
    solve_column,
    solve_factored,
)


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
