"""Kernels in C++ against the functions that numba compiles: equal to rounding."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis import HalfSpace, Problem, self_affine_profile
from adhesis.solver import _kernels
from adhesis.solver.sharp import native
from adhesis.solver.sharp.descent import implicit_flow
from adhesis.solver.sharp.equilibrium import (
    condensed,
    hierarchical_newton,
    renewal,
    response_setup,
)
from adhesis.solver.sharp.field import hierarchical_solver, separate_gaps
from adhesis.solver.sharp.gap.chebyshev_moments import gap_moments
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.ends import with_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, choose_orders
from adhesis.solver.sharp.method import SharpMethod

# numbers of gaps, contact, and spread of the widths
_SCENES = [
    *((1, 0.3, 0.5), (2, 0.3, 0.5), (5, 0.3, 0.5), (41, 0.3, 0.5)),
    *((24, 0.01, 0.5), (32, 0.2, 2.0)),
]
_ROUNDING = 1e-9  # of sums of some thousand terms in another order, through ill-conditioned blocks


@pytest.fixture(scope="module")
def edges():
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=10, ratio=10, h_rms=1e-6, seed=1)
    return SharpMethod(Problem(profile, HalfSpace(1e6, 0.5), 0.01)).edges


def random_gaps(count, contact, spread, seed=0):
    """Gaps and patches of log-normal widths, the patches covering ``contact`` of the period."""
    widths = np.exp(spread * np.random.default_rng(seed).standard_normal((count, 2)))
    widths *= 2 * np.pi * np.array([1 - contact, contact]) / widths.sum(axis=0)
    ends = 0.1 + np.cumsum(widths.ravel())
    return np.concatenate([[0.1], ends[:-1]]).reshape(-1, 2)


def close(one, other):
    one, other = np.asarray(one), np.asarray(other)
    scale = max(float(np.abs(other).max(initial=0.0)), 1e-300)
    assert one.shape == other.shape
    assert np.abs(one - other).max(initial=0.0) <= _ROUNDING * scale


def orders_of(gaps, edges):
    return choose_orders(map_gaps(gaps), edges.model.digits, GAUSS_RULES.counts)


@pytest.mark.parametrize("scene", _SCENES)
def test_moments(edges, scene):
    table = map_gaps(random_gaps(*scene))
    for k, order in enumerate(orders_of(random_gaps(*scene), edges)):
        modes = int(GAUSS_RULES.counts[order])
        for fields in (1, 2):
            s, ends = np.empty((modes, fields)), np.empty((2, fields))
            gap_moments(table[k], edges.model.panels, s, ends)
            ours, loads = _kernels.gap_moments(
                table, k, native.model_of(edges.model), modes, fields
            )
            close(ours, s)
            close(loads[:, :fields], ends)


@pytest.mark.parametrize("scene", _SCENES)
def test_field(edges, scene):
    gaps, separation = random_gaps(*scene), 1e-3
    orders = orders_of(gaps, edges)
    theirs = hierarchical_solver.solve_many(gaps, separation, orders, 1, edges.model)[0]
    ours, _ = native.solve_many(gaps, separation, orders, 1, edges.model)
    for name in ("pressure", "separation", "scaled_opening", "opening"):
        close(getattr(ours, name), getattr(theirs, name))
    close(ours.mean, theirs.mean)
    close(ours.nodes.table, theirs.nodes.table)
    close(ours.nodes.theta, theirs.nodes.theta)


def responses(gaps, separation, edges):
    given = gaps, separation, orders_of(gaps, edges), edges.law, edges.model
    return response_setup.set_up_response(*given), native.set_up_response(*given)


def same_solution(theirs, ours, gaps, separation, edges):
    """Compare the edges and their tangent."""
    every = np.arange(2 * len(ours.nodes.orders))
    given = gaps, every, separation, edges.law, edges.model
    close(native.tangent_between(ours, *given), condensed.tangent_between(theirs, *given))
    close(ours.opening, theirs.opening)


@pytest.mark.parametrize("scene", _SCENES)
def test_response(edges, scene):
    """Set up, with a gap more, and renewed where edges have moved."""
    gaps, separation = random_gaps(*scene), 1e-3
    (theirs, has_field), (ours, also) = responses(gaps, separation, edges)
    assert has_field
    assert also
    same_solution(theirs, ours, gaps, separation, edges)
    moved = gaps.copy()
    moved[0, 1] += 0.02 * (moved[0, 1] - moved[0, 0]) * scene[1]
    given = moved, separation, edges.law, edges.model
    assert renewal.settle_response(theirs, *given)
    assert native.settle_response(ours, *given)
    same_solution(theirs, ours, moved, separation, edges)
    left = gaps[0, 0]
    patch = left - (gaps[-1, 1] - 2 * np.pi)
    more = with_gaps(moved, np.array([left - 0.5 * patch]), np.array([0.3 * patch]))
    none = np.empty(0, dtype=np.int64)
    given = more, separation, none, edges.law, edges.model
    (theirs, has_field), (ours, also) = (
        response_setup.update_response(theirs, *given),
        native.update_response(ours, *given),
    )
    assert has_field
    assert also
    same_solution(theirs, ours, more, separation, edges)


@pytest.mark.parametrize("scene", _SCENES)
@pytest.mark.parametrize("equal_speeds", [False, True])
def test_descent_and_equilibrium(edges, scene, equal_speeds):
    """From gaps out of balance to the next event, and the equilibrium there."""
    gaps, separation = random_gaps(*scene), 1e-3
    (theirs, _), (ours, _) = responses(gaps, separation, edges)
    runs, running = (
        implicit_flow.Running(np.zeros(gaps.size, dtype=bool), gaps, 12.0) for _ in range(2)
    )
    end = implicit_flow.descend(
        theirs, gaps, separation, 40, equal_speeds, runs, edges.law, edges.model
    )
    also = native.descend(
        ours, gaps, separation, 40, equal_speeds, running, edges.law, edges.model
    )
    assert (end.event, end.steps, end.raced) == (also.event, also.steps, also.raced)
    assert np.array_equal(runs.edges, running.edges)
    close(also.gaps, end.gaps)
    if end.event == implicit_flow.AT_REST:
        given = end.gaps, separation, 0.1, True, edges.law, edges.model
        found = hierarchical_newton.equilibrium_many(theirs, *given)
        same = native.equilibrium_many(ours, *given)
        assert (found.found, found.corrections) == (same.found, same.corrections)
        for name in ("gaps", "rate", "pressure", "slope"):
            close(getattr(same, name), getattr(found, name))
        if len(gaps) > 1:  # else there are no others, and their potential is rounding
            close(same.potential, found.potential)


@pytest.mark.parametrize("scene", _SCENES)
def test_separate_gaps(edges, scene):
    gaps, separation = random_gaps(*scene), 1e-3
    orders, n = orders_of(gaps, edges), 0
    n = int(GAUSS_RULES.counts[orders].sum())
    potential = 1e-3 * np.random.default_rng(1).standard_normal(n)
    given = gaps, map_gaps(gaps), orders, potential, -0.02, separation, edges.model
    ours, theirs = native.solve_separately(*given), separate_gaps.solve_separately(*given)
    for name in ("pressure", "separation", "scaled_opening", "opening"):
        close(getattr(ours, name), getattr(theirs, name))
