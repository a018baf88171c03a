"""Dense linear algebra of method ``sharp``: solutions and inverses, to rounding."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis.solver._kernels import invert_definite, solve_definite


@pytest.mark.parametrize("n", [1, 7, 8, 9, 41])
def test_solutions_and_inverses(n):
    """Sizes around a block of eight rows."""
    random = np.random.default_rng(n)
    a = random.normal(size=(n, n))
    a = a @ a.T + n * np.eye(n)
    load = random.normal(size=n)
    assert a @ solve_definite(a, load) == pytest.approx(load, abs=1e-12)
    inverse = invert_definite(a)
    assert a @ inverse == pytest.approx(np.eye(n), abs=1e-12)
    assert inverse.tobytes() == inverse.T.tobytes()


def test_definite_is_what_has_positive_eigenvalues():
    random = np.random.default_rng(1)
    vectors, _ = np.linalg.qr(random.normal(size=(20, 20)))
    for least, definite in ((1e-3, True), (-1e-3, False)):
        a = (vectors * np.append(least, np.arange(1.0, 20))) @ vectors.T
        a = 0.5 * (a + a.T)
        assert (solve_definite(a, np.ones(20)) is not None) == definite
        assert (invert_definite(a) is not None) == definite
