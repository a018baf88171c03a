"""Sine transforms against their definition."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis.solver._kernels import fast_size, sine_sums


@pytest.mark.parametrize("count", [4, 8, 12, 20, 36, 60, 64, 96, 100, 108, 144, 240, 500])
def test_sine_sums_are_sums_of_sines(count: int) -> None:
    x = np.random.default_rng(count).normal(size=count - 1)
    out = sine_sums(x)
    j = np.arange(1, count)
    np.testing.assert_allclose(out, np.sin(np.pi * np.outer(j, j) / count) @ x, atol=1e-12 * count)


def test_sizes_are_enough_and_have_small_factors() -> None:
    for fewest in range(64, 5000, 7):
        size = fast_size(fewest)
        assert fewest <= size < 1.52 * fewest
        rest = size + 1
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        assert rest == 1
        assert (size + 1) % 4 == 0
