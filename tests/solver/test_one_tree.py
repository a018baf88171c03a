"""All gaps on one tree and one implicit flow, against dense matrices, closed forms, the default."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis import Control, HalfSpace, Problem, self_affine_profile, single_wave
from adhesis.solver.loading.loop import run_loop
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.griffith import edge_tangent, imbalance, symmetrise
from adhesis.solver.sharp.field.cholesky import is_definite
from adhesis.solver.sharp.field.dense_solver import solve
from adhesis.solver.sharp.field.exterior import NO_EXTERIOR
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, choose_orders
from adhesis.solver.sharp.method import SharpMethod
from adhesis.solver.sharp.one_tree.running_tangent import (
    is_stable,
    stiffness_of,
    tangent_between,
    undamped,
)
from adhesis.solver.sharp.one_tree.saddle_step import step_off
from adhesis.solver.sharp.one_tree.tree_renewal import condense_gaps, damp_edges
from adhesis.solver.sharp.one_tree.tree_response import solve_response
from adhesis.solver.sharp.one_tree.tree_setup import set_up_response
from tests.solver.test_kinetics import equal_waves, race

SOLID = HalfSpace(young=1e6, poisson=0.5)
CONTROLS = {
    "separation": Control(),
    "load": Control(stiffness=0.0),
    "spring": Control(stiffness=3e11),
}


def rough(gamma: float, control: Control, ratio: int = 10, **options: float) -> Problem:
    """Problem on a self-affine profile with up to a dozen patches."""
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=10, ratio=ratio, seed=1, h_rms=1e-6)
    return Problem(profile, SOLID, gamma, control=control, **options)


def loaded(problem: Problem, share: float) -> tuple[SharpMethod, Point]:
    """Load to a share of h_max, or of the load there, and return the point of the state."""
    fixed = SharpMethod(Problem(problem.profile, SOLID, problem.work_of_adhesion))
    h_max = problem.profile.h_max
    state = fixed.detached(h_max)
    for penetration in np.linspace(0.0, share, 5)[1:]:
        state = fixed.follow(state, h_max * (1 - penetration)).states[-1]
    method = SharpMethod(problem, one_tree=True)
    at = method.states.prescribed_of(state)
    point = method.edges.equilibrium(state.internal.gaps, at, method.edges.wave)
    assert point is not None
    return method, point


def dense_tangent(method: SharpMethod, point: Point) -> np.ndarray:
    """∂(C_e - C_c)/∂n_f of all edges, at the prescribed quantity, by dense matrices."""
    edges = method.edges
    model = edges.model._replace(digits=edges.model.digits + 4)
    orders = choose_orders(map_gaps(point.gaps), model.digits, GAUSS_RULES.counts)
    solution = solve(point.gaps, point.at, orders, 2, model, NO_EXTERIOR)
    _, drift = imbalance(solution, edges.law, model.panels)
    return np.asarray(edge_tangent(solution, drift, GAUSS_RULES)[0])


@pytest.mark.parametrize("control", CONTROLS)
def test_the_tangent_of_a_few_edges_is_a_schur_complement_of_the_dense_one(control):
    """All other edges follow; from one edge to all of them."""
    method, point = loaded(rough(0.004, CONTROLS[control]), 0.5)
    matrix = dense_tangent(method, point)
    edges = method.edges
    response = edges.responses.at(point.gaps, point.at).response
    assert len(point.gaps) >= 5
    for some in ([3], [1, 2], [0, 3, 4, 7], list(range(len(matrix)))):
        chosen = np.array(some)
        found = tangent_between(response, chosen, point.at, edges.law, edges.model.device)
        expected = np.linalg.inv(np.linalg.inv(matrix)[np.ix_(some, some)])
        np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_damping_takes_no_part_in_the_tangent():
    """Damped edges are stiffer by just that, and their tangent is what it was."""
    method, point = loaded(rough(0.004, Control()), 0.5)
    edges, some = method.edges, np.array([1, 2, 5])
    law, model = edges.law, edges.model
    response = edges.responses.at(point.gaps, point.at).response
    expected = tangent_between(response, some, point.at, law, model.device)
    damping = np.zeros(point.gaps.size)
    damping[[1, 5]] = 3.0, 40.0
    condense_gaps(response, damp_edges(response, point.gaps, damping), model)
    now = solve_response(response, point.at, law, model.device)
    stiffness = stiffness_of(response, some, now, model.device)
    np.testing.assert_allclose(stiffness - expected, np.diag([3.0, 0.0, 40.0]), atol=1e-2)
    found = undamped(stiffness, response, some)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("control", CONTROLS)
def test_the_inertia_of_the_tree_is_that_of_the_dense_hessian(control):
    """At a state of a loop, and with other edges in tension, where few are stable."""
    method, point = loaded(rough(0.004, CONTROLS[control]), 0.5)
    edges, rng, seen = method.edges, np.random.default_rng(0), set()
    model, law = edges.model, edges.law
    for size in (0.0, *np.repeat([0.1, 0.5], 12)):
        gaps = point.gaps + size * edges.wave * rng.uniform(-1, 1, point.gaps.shape)
        at = point.at + 10 * size * rng.uniform() * method.resolution.h_max
        orders = choose_orders(map_gaps(gaps), model.digits, GAUSS_RULES.counts)
        solution = solve(gaps, at, orders, 2, model, NO_EXTERIOR)
        if not solution.opening.min() > 0.1 * edges.critical:
            continue
        _, drift = imbalance(solution, law, model.panels)
        tangent = edge_tangent(solution, drift, GAUSS_RULES)[0]
        _, matrix = symmetrise(solution, tangent, law.overlap_limit)
        if abs(np.linalg.eigvalsh(matrix)[0]) < 0.02 * np.abs(np.diag(matrix)).mean():
            continue  # on the fold itself neither can tell
        response, _ = set_up_response(gaps, at, orders, law, model)
        stable = is_stable(response, at, law, model.device)
        assert stable == is_definite(matrix)
        seen.add(bool(stable))
    assert seen == {True, False}


LOOPS = {
    "strong adhesion": rough(0.04, Control()),
    "weak adhesion": rough(0.002, Control()),
    "load": rough(0.01, Control(stiffness=0.0), 6),
    "spring": rough(0.01, Control(stiffness=3e11), 6),
    "openings": rough(0.01, Control(), 6, strength=2.5e5),
}


@pytest.mark.parametrize("name", LOOPS)
def test_a_loop_is_that_of_the_default_mechanics(name):
    """Losses within both errors, the same jumps but for negligible ones, and the audit closes."""
    problem = LOOPS[name]
    turn = {"max_stress": 3e3} if problem.control.is_load else {"max_penetration": 0.8}
    loops = [
        run_loop(SharpMethod(problem, one_tree=one_tree), load_steps=10, **turn)
        for one_tree in (False, True)
    ]
    default, tree = loops
    assert tree.loss == pytest.approx(default.loss, abs=default.loss_error + tree.loss_error)
    kinds = [[j.kind for j in loop.jumps if j.energy_drop > 1e-6 * loop.loss] for loop in loops]
    assert kinds[0] == kinds[1]
    assert tree.races == default.races
    assert abs(tree.audit_residual) < 1e-3


@pytest.mark.parametrize("accuracy", [1e-3, 1e-5])
def test_a_wave_loses_what_its_closed_form_does(accuracy):
    """Its two jumps are a touch and the fold at which the last patch is lost."""
    wave = SingleWave(1e-6, 1e-3, SOLID.modulus, 0.02, measure="arc")
    problem = Problem(single_wave(1e-6, 1e-3), SOLID, 0.02)
    loop = run_loop(
        SharpMethod(problem, accuracy=accuracy, one_tree=True), max_penetration=0.8, load_steps=8
    )
    assert loop.loss == pytest.approx(wave.loop.loss, abs=loop.loss_error)
    assert loop.loss == pytest.approx(wave.loop.loss, rel=0.2 * accuracy)


def test_a_race_ends_where_gradient_flow_does_and_is_flagged():
    """Contact 0.3202 by linear kinetics, 0.6011 by equal speeds; see test_kinetics."""
    result = run_loop(SharpMethod(race(), one_tree=True), max_penetration=0.8, load_steps=20)
    first = result.jumps[0]
    assert first.contact_after == pytest.approx(0.3202, abs=1e-4)
    assert result.loss_dimensionless == pytest.approx(5.178119, rel=1e-4)
    assert first.raced
    assert 0.01 * result.loss < first.at_stake < result.loss


def test_equal_crests_are_left_alike_wherever_they_lie():
    losses = []
    for shift in (0.0, 0.1234, 0.771):
        method = SharpMethod(equal_waves(4, 499277, 0.00879, shift), one_tree=True)
        losses.append(run_loop(method, max_penetration=0.8, load_steps=10).loss)
    assert losses == pytest.approx([losses[0]] * 3, rel=1e-4)


@pytest.mark.parametrize("turn", range(4))
def test_equivalent_edges_give_equivalent_ways_off_a_saddle(turn):
    """Four equal edges on a ring: the way out is the same but for the place of its leader."""
    ring = -np.eye(4) + 0.3 * (np.roll(np.eye(4), 1, 0) + np.roll(np.eye(4), -1, 0))
    hessian, limit = ring + 1e-12 * np.diag(np.arange(4.0)), np.full(4, 0.1)
    first = np.roll(np.arange(4.0), turn)
    step, reference = (step_off(hessian, limit, order) for order in (first, np.arange(4.0)))
    lead = int(np.argmin(first))
    np.testing.assert_allclose(np.roll(step, -lead), reference, atol=1e-9)
    assert step[lead] == pytest.approx(0.1)
    assert step_off(np.eye(4), limit, first) is None
