"""Numbers with units and errors, as commands print them."""

from __future__ import annotations

from math import inf, nan

import pytest

from adhesis.ensemble.quantities import bytes_text, with_error


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (9705.0, 19317.0, "10000 ± 19000"),
        (9705.0, 612.0, "9700 ± 600"),
        (35.12, 4.2, "35 ± 4"),
        (0.03512, 0.00123, "0.0351 ± 0.0012"),
        (0.5144, 0.112, "0.51 ± 0.11"),
        (-3.0, 0.96, "-3.0 ± 1.0"),
        (4.0, 1e-12, "4 ± 1e-12"),
        (4.0, 0.0, "4 ± 0"),
        (4.0, inf, "4 ± inf"),
        (4.0, nan, "4 ± nan"),
    ],
)
def test_a_value_has_the_digits_of_its_error(value: float, error: float, text: str) -> None:
    assert with_error(value, error) == text


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.995, 0.020, "0.995, from 0.975 to 1.000"),
        (0.6, 0.7, "0.6, from 0.0 to 1.0"),
        (0.5, 0.112, "0.50 ± 0.11"),
        (1.0, 0.0, "1 ± 0"),
        (0.98, 0.02, "0.980 ± 0.020"),
        (1.2, 0.112, "1.20 ± 0.11"),
    ],
)
def test_no_interval_leaves_the_bounds_of_its_quantity(
    value: float, error: float, text: str
) -> None:
    """A fraction of contact of more than 1 is not printed, unless it was given."""
    assert with_error(value, error, 0.0, 1.0) == text


def test_a_small_size_is_not_zero() -> None:
    assert [bytes_text(size) for size in (0, 345_678, 12_345_678)] == ["0 kB", "346 kB", "12 MB"]
