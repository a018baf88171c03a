"""Method sharp, many gaps: the tree of gaps against the dense solution, and what it costs."""

import numpy as np
import pytest

from adhesis import Problem
from adhesis.solver._kernels import (
    FieldModel,
    LoadingDevice,
    count_negative,
    set_up_response,
    solve_field,
)
from adhesis.solver.sharp.continuation.descent import Descents
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.mechanics import FIXED_SEPARATION, EdgeMechanics
from adhesis.solver.sharp.method import SharpMethod
from tests.support.dense import dense_residual, dense_tangent, solve_densely
from tests.support.scenes import HALF_SPACE, of_paper

PROFILE = of_paper(1, ratio=10)


def random_gaps(count, contact, spread, seed=0):
    """Gaps and patches of log-normal widths, the patches covering ``contact`` of the period."""
    widths = np.exp(spread * np.random.default_rng(seed).standard_normal((count, 2)))
    widths *= 2 * np.pi * np.array([1 - contact, contact]) / widths.sum(axis=0)
    ends = 0.1 + np.cumsum(widths.ravel())
    return np.concatenate([[0.1], ends[:-1]]).reshape(-1, 2)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8])
@pytest.mark.parametrize("gaps", [(5, 0.3, 0.5), (41, 0.3, 0.5), (24, 0.01, 0.5), (32, 0.2, 2.0)])
def test_field_equals_the_dense_one(gaps, tolerance):
    """From a few gaps to many, even and uneven, narrow patches and wide: to the tolerance."""
    source = StressSource(PROFILE, tolerance)
    separation = 0.5 * PROFILE.h_max * PROFILE.q0
    ends = random_gaps(*gaps)
    model = FieldModel(FIXED_SEPARATION, -np.log(tolerance), source.panels)
    tree = solve_field(ends, separation, model)
    dense = solve_densely(ends, separation, model)
    scale = np.abs(dense.edge_opening).max()
    assert np.abs(tree.edge_opening - dense.edge_opening).max() < 2 * tolerance * scale
    assert tree.pressure == pytest.approx(dense.pressure, rel=2 * tolerance)
    assert tree.unit_mean == pytest.approx(dense.unit_mean, rel=2 * tolerance)


def test_work_grows_as_the_number_of_gaps():
    """Charges, and the entries of all matrices of the tree, per gap, from 100 to 3,200 gaps."""
    edges = mechanics(1e-5)
    share = []
    for count in (100, 3200):
        response = set_up_response(random_gaps(count, 0.3, 0.7), 1e-3, edges.law, edges.model)
        charges = response.charges.astype(float)
        share.append([charges.sum() / count, (charges**3).sum() / count])
    # once the tree is deep its upper levels, with their few more charges, hold few runs
    assert share[1][0] < 1.1 * share[0][0]
    assert share[1][1] < 1.25 * share[0][1]


def mechanics(tolerance):
    """Edges with the critical opening of a crack one shortest wave long."""
    source = StressSource(PROFILE, tolerance)
    scale = np.sqrt(source.m2 * 2 * np.pi / source.top)
    return EdgeMechanics(source, scale, tolerance)


def test_newton_step_and_stability_equal_the_dense_ones():
    """Steps of all edges to 1e-3, and the same verdict, on stable and unstable states."""
    edges = mechanics(1e-9)
    separation = 3 * PROFILE.h_max * PROFILE.q0
    verdicts = set()
    for seed in range(12):
        gaps = random_gaps(6, 0.1 + 0.06 * seed, 0.1, seed)
        solution = solve_densely(gaps, separation, edges.model)
        assert solution.edge_opening.min() > 0
        tangent = dense_tangent(gaps, separation, edges)
        step = np.linalg.solve(tangent, -dense_residual(gaps, separation, edges))
        by_edge = solution.edge_opening[:, None] * tangent
        stable = bool(np.linalg.eigvalsh(by_edge + by_edge.T)[0] > 0)
        response = set_up_response(gaps, separation, edges.law, edges.model)
        found = response.solve(separation, edges.law, edges.model)
        assert np.abs(found.motion - step).max() < 1e-3 * np.abs(step).max()
        assert found.stable == stable
        verdicts.add(stable)
    assert False in verdicts


@pytest.mark.parametrize("device", [FIXED_SEPARATION, LoadingDevice(1.0, 0.7)])
def test_the_tangent_of_some_edges_is_the_dense_one_of_all_condensed(device):
    """Some edges held, all others following: a Schur complement of the tangent of all edges."""
    edges = mechanics(1e-9)
    edges.model = FieldModel(device, edges.model.digits, edges.model.panels)
    gaps = random_gaps(9, 0.5, 0.3, 3)
    separation = 3 * PROFILE.h_max * PROFILE.q0
    response = set_up_response(gaps, separation, edges.law, edges.model)
    whole = dense_tangent(gaps, separation, edges)
    for some in (np.array([3]), np.array([2, 3, 11]), np.arange(5, 9), np.arange(gaps.size)):
        found = response.tangent_between(gaps, some, separation, edges.law, edges.model)
        rest = np.setdiff1d(np.arange(gaps.size), some)
        others = np.linalg.solve(whole[np.ix_(rest, rest)], whole[np.ix_(rest, some)])
        exact = whole[np.ix_(some, some)] - whole[np.ix_(some, rest)] @ others
        assert np.abs(found - exact).max() < 1e-4 * np.abs(exact).max()


@pytest.fixture(scope="module")
def loaded():
    """Many patches in equilibrium, under weak adhesion: method and state."""
    method = SharpMethod(Problem(PROFILE, HALF_SPACE, 1e-3), accuracy=1e-4)
    state = method.detached(PROFILE.h_max)
    for depth in (0.0, 0.3, 0.5):
        state = method.follow(state, PROFILE.h_max * (1 - depth)).states[-1]
    return method, state


@pytest.fixture
def many_gaps(loaded):
    method, state = loaded
    edges = method.edges
    return edges, edges.equilibrium(state.internal.gaps, state.separation * method.q0, edges.wave)


def test_an_equilibrium_of_many_gaps_is_the_dense_one(loaded, many_gaps):
    """Edges and rates against a field a hundred times as accurate, where dense edges balance."""
    method, _ = loaded
    edges, point = many_gaps
    exact = SharpMethod(method.problem, accuracy=1e-6).edges
    dense = exact.equilibrium(point.gaps, point.d, exact.wave)
    assert len(point.gaps) >= 10
    assert np.abs(dense_residual(dense.gaps, dense.d, exact)).max() < 1e-3 * exact.critical
    # the error of the field moves an equilibrium by up to edges.field_error
    assert np.abs(point.gaps - dense.gaps).max() < 0.5 * edges.field_error
    assert np.abs(point.rate - dense.rate).max() < 1e-4 * np.abs(dense.rate).max()
    assert point.field.nearly[0] == pytest.approx(dense.field.nearly[0], rel=10 * edges.tolerance)


@pytest.mark.parametrize("motion", [1e-5, 1e-3, 1e-2, 0.1, 0.3])
def test_an_equilibrium_does_not_depend_on_the_response_that_was_known(many_gaps, motion):
    """References move with edges that go near and far, are passed on, and come back: one state.

    Openings, rates and pressure are those of a response set up there from nothing.
    """
    edges, point = many_gaps
    d = point.d
    edges.forget()
    anew = edges.equilibrium(point.gaps, d, edges.wave)
    moved = point.gaps.copy()
    moved[2::5] += motion * edges.wave * np.array([-0.5, 1.0])
    assert edges.response_at(moved, d, edges.law) is not None
    back = edges.equilibrium(point.gaps, d, edges.wave)
    assert np.abs(back.gaps - anew.gaps).max() < 0.1 * edges.field_error
    assert np.abs(back.rate - anew.rate).max() < 1e-3 * np.abs(anew.rate).max()
    assert back.field.nearly[0] == pytest.approx(anew.field.nearly[0], rel=1e-6)
    scale = np.abs(anew.field.edge_opening).max()
    assert np.abs(back.field.edge_opening - anew.field.edge_opening).max() < 1e-5 * scale


def test_an_equilibrium_of_other_gaps_is_found_on_the_response_of_these(many_gaps):
    """A patch less, and one more: with the same result as without any response."""
    edges, point = many_gaps
    gaps, d = point.gaps, point.d
    fewer = np.concatenate([gaps[:4], [[gaps[4, 0], gaps[5, 1]]], gaps[6:]])
    end, _ = Descents(edges, None).relax(fewer, d)
    assert len(end.gaps) < len(gaps)
    for known, wanted in ((gaps, end.gaps), (end.gaps, gaps)):
        edges.forget()
        anew = edges.equilibrium(wanted, d, edges.wave)
        edges.forget()
        edges.response_at(known, d, edges.law)
        again = edges.equilibrium(wanted, d, edges.wave)
        assert np.abs(again.gaps - anew.gaps).max() < 0.1 * edges.field_error
        assert np.abs(again.rate - anew.rate).max() < 1e-3 * np.abs(anew.rate).max()


@pytest.mark.parametrize("negative", range(4))
def test_negative_eigenvalues_that_appear_together_are_counted(negative):
    """Of a pair of halves whose first one has none, and all directions of which are alike."""
    rng = np.random.default_rng(negative)
    n = 12
    root, _ = np.linalg.qr(rng.standard_normal((n, n)))
    softest = np.where(np.arange(n) < negative, 1.5, 0.5)  # of the interaction over the stiffness
    response = root @ np.diag(np.linspace(1, 2, n)) @ root.T
    inverse_root = np.linalg.inv(np.linalg.cholesky(response))
    other, _ = np.linalg.qr(rng.standard_normal((n, n)))
    interaction = inverse_root.T @ other @ np.diag(softest) @ other.T @ inverse_root
    both = np.block([[interaction, np.eye(n)], [np.eye(n), response]])
    assert (np.linalg.eigvalsh(both) < 0).sum() == n - negative
    assert count_negative(interaction, response) == n - negative
