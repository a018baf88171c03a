"""Parts of a descent in energy, each without the others: steps, their size, judgement, events."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from adhesis.solver.sharp.descent.bound_constrained_step import bound_constrained_step
from adhesis.solver.sharp.descent.edge_forces import (
    FlowProblem,
    Forces,
    energy_rises,
    forces_at,
)
from adhesis.solver.sharp.descent.gradient_flow import (
    AT_REST,
    NO_FIELD,
    REJOINED,
    STEP_LIMIT,
    VANISHED,
    Descent,
    descend,
)
from adhesis.solver.sharp.descent.linear_kinetics import flow_step
from adhesis.solver.sharp.descent.trajectory import Comparison, distance_to, update_comparison
from adhesis.solver.sharp.field.exterior import NO_EXTERIOR
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_triangular
from scipy.optimize import brentq, lsq_linear

from adhesis import HalfSpace, Problem, self_affine_profile, single_wave
from adhesis.solver.sharp.descent.edge_model import (
    EdgeModel,
    advance,
    evaluate,
    follow_lengths,
    model_about,
    model_forces,
    model_hessian,
)
from adhesis.solver.sharp.descent.model_flow import ModelFlow, flow_through, implicit_step
from adhesis.solver.sharp.descent.saddle import softest_step
from adhesis.solver.sharp.descent.step_size import (
    StepSize,
    after_long_step,
    after_short_step,
    initial_size,
    may_raise,
    model_error,
)
from adhesis.solver.sharp.equilibrium.griffith import edge_tangent
from adhesis.solver.sharp.field.cholesky import padded
from adhesis.solver.sharp.field.solution import no_solution
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import choose_orders
from adhesis.solver.sharp.method import SharpMethod
from adhesis.solver.sharp.tolerances import (
    COMPARISONS,
    LEAST_STEP_SHARE,
    LONGEST_REACH,
    MODEL_STEP,
    REACH_CUT,
    REACH_GROWTH,
)

SOLID = HalfSpace(1e6, 0.5)


# ------------------------------------------------------------------ steps


def exact_flow(matrix: np.ndarray, force: np.ndarray, time: float) -> np.ndarray:
    """Solution of ṅ = f - Hn, n(0) = 0, by the exponential of an augmented matrix."""
    n = force.size
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[:n, n] = -matrix, force
    return expm(augmented * time)[:n, n]


@pytest.mark.parametrize("seed", range(5))
def test_a_flow_step_is_a_point_of_the_exact_flow_near_the_limit_of_an_edge(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 7))
    root = rng.normal(size=(count, count))
    matrix = root + root.T + np.diag(10.0 ** rng.uniform(0, 1.5, count))  # stiff, some unstable
    force, limit = rng.normal(size=count), rng.uniform(0.001, 0.01, count)
    step = flow_step(*np.linalg.eigh(matrix), force, limit, 0.0)
    reach = np.abs(step / limit).max()
    assert 0.97 <= reach <= 1
    edge = int(np.argmax(np.abs(step / limit)))

    def overshoot(time: float) -> float:
        return float(abs(exact_flow(matrix, force, time)[edge]) - abs(step[edge]))

    late = 1e-3 * limit[edge] / abs(force[edge])
    while overshoot(late) < 0:
        late *= 1.2
    time = brentq(overshoot, late / 1.2, late, xtol=1e-16)
    np.testing.assert_allclose(step, exact_flow(matrix, force, time), atol=1e-8 * limit.min())


@pytest.mark.parametrize(("count", "seed"), [(1, 0), (2, 1), (4, 2), (8, 3), (8, 4), (12, 5)])
def test_a_step_with_equal_speeds_solves_the_quadratic_programme(count, seed):
    """½ yᵀMy - bᵀy in bounds, M = LLᵀ, is least squares of Lᵀy - L⁻¹b in bounds."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(count, count))
    matrix = root @ root.T + 0.1 * np.eye(count)
    scale, force = rng.uniform(0.5, 2, count), rng.normal(size=count)
    limit = rng.uniform(0.05, 0.5, count)
    lower = np.linalg.cholesky(matrix)
    bound = limit * scale
    best = lsq_linear(
        lower.T, solve_triangular(lower, force * scale, lower=True), (-bound, bound),
        method="bvls", tol=1e-14,
    )  # fmt: skip
    step = bound_constrained_step(matrix, scale, force, limit)
    np.testing.assert_allclose(step * scale, best.x, atol=1e-7 * bound.max())
    assert count == 1 or (np.abs(step) > 0.999 * limit).any()  # some bound is active


def test_a_saddle_is_left_along_the_softest_mode_within_every_limit():
    vectors = np.linalg.qr(np.random.default_rng(3).normal(size=(4, 4)))[0]
    matrix = vectors @ np.diag([-0.5, 1.0, 2.0, 3.0]) @ vectors.T
    limit = np.array([0.1, 0.2, 0.3, 0.4])
    step = softest_step(matrix, np.ones(4), limit)
    assert step @ matrix @ step < 0  # the energy falls
    assert np.all(np.abs(step) <= limit)
    assert np.abs(step).max() == pytest.approx(0.1)
    assert step[np.argmax(np.abs(step))] > 0  # the leading edge goes outwards
    np.testing.assert_allclose(np.abs(step / np.linalg.norm(step)), np.abs(vectors[:, 0]))


# ------------------------------------------------------------------ model of the openings


class Solved(NamedTuple):
    """Edges with their field."""

    gaps: np.ndarray
    separation: float
    system: FlowProblem
    forces: Forces

    def openings(self, motion: np.ndarray) -> np.ndarray:
        """Openings of the field after outward motions."""
        return self.moved(motion).forces.solution.opening

    def moved(self, motion: np.ndarray) -> Solved:
        """The same after outward motions."""
        gaps = self.gaps + (motion * np.tile([1.0, -1.0], len(self.gaps))).reshape(-1, 2)
        return self.with_gaps(gaps)

    def with_gaps(self, gaps: np.ndarray) -> Solved:
        """Other edges, solved."""
        forces = solved(self.system, gaps, self.separation)
        return self._replace(gaps=gaps, forces=forces)

    def model(self) -> EdgeModel:
        """Make the model about the edges."""
        law, panels = self.system.law, self.system.model.panels
        tangent, _ = edge_tangent(self.forces.solution, self.forces.drift, self.system.model.rules)
        return model_about(self.gaps, self.forces, tangent, law, panels)

    def model_openings(self, motion: np.ndarray, steps: int = 400) -> np.ndarray:
        """Openings of the model after outward motions in many equal steps."""
        law, panels = self.system.law, self.system.model.panels
        model = self.model()
        for _ in range(steps):
            advance(model, motion / steps)
            evaluate(model, law, panels)
        np.testing.assert_allclose(model.motion, motion)
        return model.opening


def solved(system: FlowProblem, gaps: np.ndarray, separation: float) -> Forces:
    orders = choose_orders(map_gaps(gaps), system.model.digits, system.model.rules.counts)
    none = np.empty(0, dtype=np.int64)
    before = no_solution(map_gaps(gaps), none, system.model.device)
    return forces_at(gaps, separation, orders, before, system)


WAVE = 2 * np.pi / 240  # the shortest of ``rough``


@pytest.fixture(scope="module")
def rough() -> Solved:
    """Five gaps of a rough profile, one of them narrow, with waves much shorter than the gaps."""
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=4, ratio=60, seed=1, h_rms=1e-6)
    method = SharpMethod(Problem(profile, SOLID, 0.02), accuracy=1e-6)
    system = FlowProblem(method.edges.law, method.edges.model, NO_EXTERIOR)
    gaps = np.array([[0.3, 0.8], [0.9, 2.0], [2.2, 3.1], [3.3, 4.1], [4.3, 6.4]])
    separation = 0.5 * profile.h_max * profile.q0
    return Solved(gaps, separation, system, solved(system, gaps, separation))


def test_edges_open_as_half_plane_cracks_that_interact(rough):
    """Error of the model: second order in the motions, and small over a whole shortest wave."""
    motion = WAVE * np.array([1.0, 0.1, -0.4, 0.3, 0.0, 1.0, -0.7, 0.2, 0.5, -1.0])
    before = rough.forces.solution.opening
    lengths = np.array([0.05, 0.1, 0.2, 1.0])
    errors, changes = [], []
    for length in lengths:
        exact = rough.openings(length * motion)
        errors.append(np.abs(exact - rough.model_openings(length * motion)).max())
        changes.append(np.abs(exact - before).max())
    orders = np.diff(np.log(errors)) / np.diff(np.log(lengths))
    assert np.all(orders[:2] > 1.8)
    assert errors[-1] < 0.02 * changes[-1]


NEIGHBOURS = {  # edges on both sides of a patch, and of a gap, half a shortest wave wide
    "patch": (1, 2, [[0.3, 0.8], [0.8 + WAVE / 2, 2.0], [2.2, 3.1], [3.3, 4.1], [4.3, 6.4]]),
    "gap": (0, 1, [[0.3, 0.3 + WAVE / 2], [0.9, 2.0], [2.2, 3.1], [3.3, 4.1], [4.3, 6.4]]),
}


@pytest.mark.parametrize("narrow", NEIGHBOURS)
def test_neighbours_interact_by_the_length_between_them(rough, narrow):
    """Coupling, and the edge's own rate by its neighbour's motion, against a model made there."""
    e, f, gaps = NEIGHBOURS[narrow]
    here = rough.with_gaps(np.array(gaps))
    motion = np.zeros(10)
    motion[f] = 0.02 * WAVE
    there, model, first = here.moved(motion).model(), here.model(), here.model()
    follow_lengths(model, motion)
    coupling = there.coupling[e, f] - first.coupling[e, f]
    assert model.coupling[e, f] - first.coupling[e, f] == pytest.approx(coupling, rel=0.15)
    own = there.own[e] - first.own[e]
    assert model.own[e] - first.own[e] == pytest.approx(own, rel=0.15)


@pytest.mark.parametrize(("narrow", "motion"), [("patch", 0.3), ("patch", -0.2), ("gap", -0.3)])
def test_openings_beside_a_narrow_patch_or_gap(rough, narrow, motion):
    """Its length changes by 80 to 120 %; with coupling and rates kept errors are 0.3 to 0.6."""
    e, f, gaps = NEIGHBOURS[narrow]
    here = rough.with_gaps(np.array(gaps))
    motions = np.zeros(10)
    motions[[e, f]] = motion * WAVE
    before, exact = here.forces.solution.opening, here.openings(motions)
    error = np.abs(here.model_openings(motions, 10) - exact).max()
    assert error < 0.2 * np.abs(exact - before).max()


def test_the_model_is_that_of_the_tangent_about_its_edges(rough):
    """Its forces are those of the field, and its Hessian their derivative, from the tangent."""
    opening, model = rough.forces.solution.opening, rough.model()
    edges = opening.size
    matrix, force = np.empty((edges, edges)), np.empty(edges)
    model_hessian(model, matrix)
    model_forces(model, force)
    np.testing.assert_allclose(force, -rough.forces.slope, rtol=1e-12)
    np.testing.assert_allclose(matrix, matrix.T)
    tangent, _ = edge_tangent(rough.forces.solution, rough.forces.drift, rough.system.model.rules)
    # C² - C_c² from C - C_c: 2 C dC - 2 C_c dC_c
    by_tangent = 2 * opening[:, None] * tangent
    drift = rough.forces.drift * np.tile([1, -1], len(rough.gaps))
    by_tangent[np.diag_indices(edges)] += 2 * rough.forces.residual * drift
    is_open = opening > 0  # edges beside an overlap act on no others
    assert 4 <= is_open.sum() < edges
    among = np.ix_(is_open, is_open)
    largest = np.abs(by_tangent).max()
    np.testing.assert_allclose(matrix[among], by_tangent[among], atol=1e-6 * largest)


# ------------------------------------------------------------------ flow through the model


def exact_flow_through(rough: Solved, limit: np.ndarray) -> np.ndarray:
    """Motions when the first edge is at its limit, from ``scipy.integrate.solve_ivp``."""
    law, panels = rough.system.law, rough.system.model.panels
    opening, edges = rough.forces.solution.opening, rough.gaps.size
    start = rough.model()
    grows = np.tile([-1, 1], edges // 2)  # the gap or patch after an edge, when contact grows
    after = np.roll(np.arange(edges), -1)

    def lengths(theta: np.ndarray) -> np.ndarray:
        return np.diff(np.append(theta, theta[0] + 2 * np.pi))

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        motion, now, own = y.reshape(3, edges)
        model = rough.model()._replace(own=own)
        model.theta[:] += motion * np.tile([1.0, -1.0], edges // 2)
        length = lengths(model.theta)
        for e, f in enumerate(after):
            model.coupling[[e, f], [f, e]] *= lengths(start.theta)[e] / length[e]
        evaluate(model, law, panels)
        speed = model.critical**2 - now * np.abs(now)
        turned = np.zeros(edges)
        for e, f in enumerate(after):
            for one, other in ((e, f), (f, e)):
                coupling = model.coupling[one, other]
                mixed = coupling**2 * now[one] - grows[e] * coupling / length[e] * now[other]
                turned[one] += mixed * (speed[other] if grows[e] < 0 else speed[e] + speed[f])
        opened = model.rate * speed + model.coupling @ (now * speed)
        return np.concatenate([speed, opened, turned])

    def at_limit(_: float, y: np.ndarray) -> float:
        return float((np.abs(y[:edges]) / limit).max() - 1)

    at_limit.terminal = True  # type: ignore[attr-defined]
    first = np.concatenate([np.zeros(edges), opening, start.own])
    speed = np.abs(rough.forces.slope).max()
    way = solve_ivp(
        rates, (0.0, 1e3 * limit.max() / speed), first, "LSODA", events=at_limit,
        rtol=1e-8, atol=1e-10,
    )  # fmt: skip
    assert way.status == 1  # an edge came to its limit
    return np.asarray(way.y[:edges, -1])


def test_steps_through_the_model_converge_to_its_flow(rough):
    """Linearly implicit Euler steps: the error falls in proportion to their length."""
    limit = np.full(10, WAVE)
    exact = exact_flow_through(rough, limit)
    opening, law = rough.forces.solution.opening, rough.system.law
    panels = rough.system.model.panels
    errors = []
    for share in (1.0, 0.5, 0.25):
        finer = law._replace(longest_step=share * law.longest_step)
        flow = flow_through(rough.model(), limit, False, 0.0, finer, panels)
        ways = np.abs(np.diff(np.vstack([rough.gaps.ravel(), flow.points]), axis=0))
        assert ways.max() <= MODEL_STEP * finer.longest_step * (1 + 1e-9)
        assert np.abs(flow.motion).max() == pytest.approx(WAVE)
        errors.append(np.abs(flow.motion - exact).max() / WAVE)
    assert errors[0] < 0.1
    assert errors[2] < 0.4 * errors[0]
    # what the edges took from each other and from themselves is the change of their forces
    critical = opening - rough.forces.residual
    before = opening * np.abs(opening) - critical**2
    critical = flow.opening - flow.residuals[-1]
    after = flow.opening * np.abs(flow.opening) - critical**2
    taken = flow.interaction.sum(axis=1)
    np.testing.assert_allclose(taken, after - before, atol=0.1 * np.abs(after - before).max())


@pytest.mark.parametrize("equal_speeds", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_an_implicit_step_is_downhill_and_within_its_length(seed, equal_speeds):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 7))
    root = rng.normal(size=(count, count))
    matrix = root + root.T + np.diag(10.0 ** rng.uniform(0, 1.5, count))  # stiff, some unstable
    force, step = rng.normal(size=count), np.empty(count)
    factor = np.empty((count, padded(count)))
    size = implicit_step(matrix, force, 0.01, equal_speeds, factor, step)
    assert size == pytest.approx(np.abs(step).max())
    assert 0 < size <= 0.01 * (1 + 1e-12)
    assert force @ step > 0
    definite = root @ root.T + np.eye(count)
    # no limit in reach: Newton's step
    implicit_step(definite, force, 1e9, equal_speeds, factor, step)
    np.testing.assert_allclose(step, np.linalg.solve(definite, force), rtol=1e-6)


def test_with_equal_speeds_edges_move_alike_whatever_their_forces():
    force, step = np.array([1.0, -0.3, 0.001]), np.empty(3)
    for equal_speeds, wanted in ((True, [0.1, -0.1, 0.01]), (False, [0.1, -0.03, 0.0001])):
        factor = np.empty((3, padded(3)))
        implicit_step(np.zeros((3, 3)), force, 0.1, equal_speeds, factor, step)
        np.testing.assert_allclose(step, wanted)


# ------------------------------------------------------------------ judgement of a step


JUDGED = {
    "falls": ([-1.0, 0.0], [-0.5, 0.0], [0.1, 0.0], False),
    "rises": ([-1.0, 0.0], [1.5, 0.0], [0.1, 0.0], True),
    "one edge rises, the other falls more": ([-1.0, -1.0], [1.5, -1.0], [0.1, 0.1], False),
    "rises by rounding": ([-1.0, 1.0], [-1.0, 1.0 + 1e-6], [0.1, 0.1], False),
    "rises by more": ([-1.0, 1.0], [-1.0, 1.0 + 1e-2], [0.1, 0.1], True),
    "stands": ([-1.0, 1.0], [1.5, 1.0], [0.0, 0.0], False),
}


@pytest.mark.parametrize("case", JUDGED)
def test_the_energy_of_a_step_rises_where_the_work_of_its_forces_says_so(case):
    before, after, step, rises = JUDGED[case]
    assert energy_rises(np.array(before), np.array(after), np.array(step)) == rises


def test_openings_of_the_model_may_be_wrong_by_more_far_from_balance():
    field, model, nothing = np.array([1.0, 2.0]), np.array([1.01, 2.0]), np.zeros((1, 2))

    def error(*unbalance: float) -> float:
        count = len(unbalance)
        lengths = np.arange(1.0, 1 + count) / count
        residuals = np.transpose([unbalance, np.ones(count)])
        flow = ModelFlow(model - field, model, residuals, lengths, residuals, nothing, False)
        return float(model_error(flow, field, 1.0))

    assert error(0.0) > 1 > error(1.0)
    assert error(0.0, 1.0) == pytest.approx(error(0.0) / 4)  # balanced half way
    same = ModelFlow(field, field, nothing, np.ones(1), nothing, nothing, False)
    assert model_error(same, field, 1.0) == 0


# ------------------------------------------------------------------ step size


def test_short_steps_halve_when_the_energy_rises_and_double_when_it_falls():
    size = initial_size()
    for _ in range(20):
        size = after_short_step(size, False)
    assert may_raise(size)
    assert size.share < LEAST_STEP_SHARE
    again = after_short_step(size, True)
    assert again.share == 2 * size.share
    for _ in range(20):
        again = after_short_step(again, True)
    assert again.share == 1
    assert not may_raise(again)


def test_the_reach_of_long_steps_follows_the_root_of_their_error():
    size = StepSize(1.0, 10.0)
    rejected = after_long_step(size, 10.0, 4.0)
    assert 0.3 * 10 < rejected.reach < 0.5 * 10  # at half of it the error is what is allowed
    assert after_long_step(size, 10.0, np.inf).reach == pytest.approx(REACH_CUT * 10)
    assert after_long_step(size, 10.0, 0.0).reach == REACH_GROWTH * 10
    assert after_long_step(size, 90.0, 0.0).reach == LONGEST_REACH
    assert after_long_step(size, 1.0, 1e-4).reach == 10  # edges came to rest: no reason to shorten
    assert after_short_step(StepSize(1.0, 1.0), True).reach > 1  # long steps are tried again


# ------------------------------------------------------------------ trajectories


def test_a_descent_has_rejoined_after_so_many_comparisons_on_the_trajectory():
    """Not before it has left it; on it means near a segment, not near a point."""
    track = np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.1]])
    assert distance_to(track, np.array([0.05, 0.01]), 0.1) == pytest.approx(0.01)
    assert distance_to(track, np.array([9.0, 0.01]), 0.1) == np.inf
    comparison = Comparison(track, False, 0)
    on, off = np.array([[0.05, 0.01]]), np.array([[0.05, 0.06]])
    matches = []
    for gaps in (on, on, off, on, on, off, on, on, on):
        comparison = update_comparison(comparison, gaps, 0.1)
        matches.append(comparison.matches)
    assert matches == [0, 0, 0, 1, 2, 0, 1, 2, 3]
    assert comparison.matches == COMPARISONS


# ------------------------------------------------------------------ events


@pytest.fixture(scope="module")
def wave() -> SharpMethod:
    return SharpMethod(Problem(single_wave(1e-6, 1e-3), SOLID, 0.02))


def run(
    method: SharpMethod, gaps, separation: float, *, fields=1000, track=None, has_left=False,
    equal_speeds=False,
) -> Descent:  # fmt: skip
    """Descend on a single wave of amplitude 1 µm, at a separation in amplitudes."""
    gaps = np.array(gaps, dtype=float)
    system = FlowProblem(method.edges.law, method.edges.model, NO_EXTERIOR)
    track = np.empty((0, gaps.size)) if track is None else track
    comparison = Comparison(track, has_left, 0)
    prescribed = separation * 2 * np.pi * 1e-3
    none = np.empty(0, dtype=np.int64)
    return descend(gaps, prescribed, fields, none, equal_speeds, system, comparison)


NARROW = [[0.2, 2 * np.pi - 0.2]]  # one narrow patch on the crest at θ = 0
SLIVER = [[0.05, 2 * np.pi - 0.05]]


def test_edges_come_to_rest_in_the_equilibrium_that_newton_finds(wave):
    found = run(wave, NARROW, 0.5)
    assert found.event == AT_REST
    point = wave.edges.equilibrium(found.gaps, 0.5 * 2 * np.pi * 1e-3, 0.05 * wave.edges.wave)
    assert point is not None
    np.testing.assert_allclose(point.gaps, found.gaps, atol=2 * wave.edges.law.rest_step)
    np.testing.assert_array_equal(found.trajectory[0], np.ravel(NARROW))
    np.testing.assert_array_equal(found.trajectory[-1], found.gaps.ravel())


def test_a_patch_vanishes_where_the_surfaces_are_far_apart(wave):
    found = run(wave, SLIVER, 5.0)
    assert found.event == VANISHED
    patch = found.gaps[0, 0] + 2 * np.pi - found.gaps[0, 1]
    assert 0 < patch < wave.edges.law.smallest


def test_a_descent_ends_at_its_limit_of_fields_and_where_there_is_no_field(wave):
    found = run(wave, NARROW, 0.5, fields=3)
    assert (found.event, found.fields) == (STEP_LIMIT, 3)
    assert run(wave, [[0.2, np.nan]], 0.5).event == NO_FIELD


def test_a_descent_that_comes_back_to_another_trajectory_has_rejoined_it(wave):
    first = run(wave, NARROW, 0.5)
    second = run(wave, NARROW, 0.5, track=first.trajectory, has_left=True, equal_speeds=True)
    assert second.event == REJOINED
    assert second.fields < first.fields
    never_away = run(wave, NARROW, 0.5, track=first.trajectory, equal_speeds=True)
    assert never_away.event == AT_REST
    assert not never_away.has_left
