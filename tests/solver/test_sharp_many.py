"""Method sharp, many gaps: the tree of gaps against the dense solution, and what it costs."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis import self_affine_profile
from solver.sharp.coordinate import map_gaps
from solver.sharp.far import solve_many
from solver.sharp.field import FIXED, RULES, Solution, choose_kinds, solve_plain
from solver.sharp.source import StressSource
from solver.sharp.tree import plant


@pytest.fixture(scope="module")
def profile():
    return self_affine_profile(0.8, period=2e-3 * np.pi, n0=10, ratio=10, h_rms=1e-6, seed=1)


def random_gaps(count, contact, spread, seed=0):
    """Gaps and patches of log-normal widths, the patches covering ``contact`` of the period."""
    widths = np.exp(spread * np.random.default_rng(seed).standard_normal((count, 2)))
    widths *= 2 * np.pi * np.array([1 - contact, contact]) / widths.sum(axis=0)
    ends = 0.1 + np.cumsum(widths.ravel())
    return np.concatenate([[0.1], ends[:-1]]).reshape(-1, 2)


def solved(source, gaps, separation, tolerance):
    digits = -np.log(tolerance)
    kinds = choose_kinds(map_gaps(gaps), digits, RULES.counts)
    return solve_many(gaps, separation, FIXED, kinds, digits, 2, RULES, source.panels)[0], kinds


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8])
@pytest.mark.parametrize("gaps", [(5, 0.3, 0.5), (41, 0.3, 0.5), (24, 0.01, 0.5), (32, 0.2, 2.0)])
def test_field_equals_the_dense_one(profile, gaps, tolerance):
    """From a few gaps to many, even and uneven, narrow patches and wide: to the tolerance."""
    source = StressSource(profile, tolerance)
    separation = 0.5 * profile.h_max * profile.q0
    ends = random_gaps(*gaps)
    tree, kinds = solved(source, ends, separation, tolerance)
    dense = Solution(*solve_plain(ends, separation, FIXED, kinds, 2, RULES, source.panels))
    scale = np.abs(dense.opening).max()
    assert np.abs(tree.opening - dense.opening).max() < 2 * tolerance * scale
    assert tree.pressure == pytest.approx(dense.pressure, rel=2 * tolerance)
    assert tree.unit_mean == pytest.approx(dense.unit_mean, rel=2 * tolerance)


def test_same_bits(profile):
    """No order of sums depends on anything but the gaps."""
    source = StressSource(profile, 1e-5)
    ends = random_gaps(33, 0.2, 1.0)
    one, two = (solved(source, ends, 1e-3, 1e-5)[0] for _ in range(2))
    assert one.opening.tobytes() == two.opening.tobytes()


def test_work_grows_as_the_number_of_gaps():
    """Charges, and the entries of all matrices of the tree, per gap, from 100 to 3,200 gaps."""
    share = []
    for count in (100, 3200):
        table = map_gaps(random_gaps(count, 0.3, 0.7))
        places = np.linspace(table[:, 0], table[:, 1], 10)[1:-1].T.ravel()
        tree = plant(
            table, 8 * np.arange(count + 1), places, np.ones(8 * count), -np.log(1e-5), True
        )
        share.append([len(tree.theta) / count, (tree.rank.astype(float) ** 3).sum() / count])
    # once the tree is deep its upper levels, with their few more charges, hold few runs
    assert share[1][0] < 1.1 * share[0][0]
    assert share[1][1] < 1.25 * share[0][1]
