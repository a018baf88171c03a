"""Parts of a descent in energy, each without the others: steps, their size, judgement, events."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from adhesis import HalfSpace, Problem, self_affine_profile, single_wave
from adhesis.solver._kernels import (
    STEP_GROWTH,
    STEP_REDUCTION,
    Descent,
    DescentEvent,
    EdgeLaw,
    EdgeModel,
    ModelFlow,
    Running,
    distance_to_minimum,
    implicit_step,
    model_error,
    next_reach,
)
from adhesis.solver.sharp.equilibrium.griffith import imbalance, leaving_step
from adhesis.solver.sharp.errors import NoState
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.method import SharpMethod
from tests.support.dense import DenseSolution, dense_tangent, solve_densely

SOLID = HalfSpace(1e6, 0.5)


# ------------------------------------------------------------------ off a saddle


def test_a_saddle_is_left_along_the_softest_mode_within_every_limit():
    vectors = np.linalg.qr(np.random.default_rng(3).normal(size=(4, 4)))[0]
    matrix = vectors @ np.diag([-0.5, 1.0, 2.0, 3.0]) @ vectors.T
    limit = np.array([0.1, 0.2, 0.3, 0.4])
    step = leaving_step(matrix, limit, np.arange(4.0))
    assert step is not None
    assert step @ matrix @ step < 0  # the energy falls
    assert np.abs(step / limit).max() == pytest.approx(1)
    assert step[np.argmax(np.abs(vectors[:, 0]))] > 0  # the leading edge goes outwards
    np.testing.assert_allclose(np.abs(step / np.linalg.norm(step)), np.abs(vectors[:, 0]))
    assert leaving_step(np.eye(4), limit, np.arange(4.0)) is None


# ------------------------------------------------------------------ model of the openings


class Solved(NamedTuple):
    """Edges with their field."""

    gaps: np.ndarray
    separation: float
    edges: EdgeMechanics
    solution: DenseSolution

    @property
    def residual(self) -> np.ndarray:
        """C - C_c."""
        return imbalance(self.solution.opening, self.gaps, self.edges.law)

    @property
    def force(self) -> np.ndarray:
        """C_c² - C |C|."""
        opening = self.solution.opening
        return (opening - self.residual) ** 2 - opening * np.abs(opening)

    def openings(self, motion: np.ndarray) -> np.ndarray:
        """Openings of the field after outward motions."""
        return self.moved(motion).solution.opening

    def moved(self, motion: np.ndarray) -> Solved:
        """The same after outward motions."""
        gaps = self.gaps + (motion * np.tile([1.0, -1.0], len(self.gaps))).reshape(-1, 2)
        return self.with_gaps(gaps)

    def with_gaps(self, gaps: np.ndarray) -> Solved:
        """Other edges, solved."""
        solution = solve_densely(gaps, self.separation, self.edges.model)
        return self._replace(gaps=gaps, solution=solution)

    @property
    def tangent(self) -> np.ndarray:
        """∂(C_e - C_c)/∂n_f."""
        return dense_tangent(self.gaps, self.separation, self.edges)

    def model(self) -> EdgeModel:
        """Make the model about the edges."""
        law, panels, every = self.edges.law, self.edges.model.panels, np.arange(self.gaps.size)
        return EdgeModel(every, self.gaps, self.residual, self.tangent, law, panels)

    def model_openings(self, motion: np.ndarray, steps: int = 400) -> np.ndarray:
        """Openings of the model after outward motions in many equal steps."""
        model = self.model()
        for _ in range(steps):
            model.advance(motion / steps)
        return model.opening


WAVE = 2 * np.pi / 240  # the shortest of ``rough``


@pytest.fixture(scope="module")
def rough() -> Solved:
    """Five gaps of a rough profile, one of them narrow, with waves much shorter than the gaps."""
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=4, ratio=60, seed=1, h_rms=1e-6)
    method = SharpMethod(Problem(profile, SOLID, 0.02), accuracy=1e-6)
    gaps = np.array([[0.3, 0.8], [0.9, 2.0], [2.2, 3.1], [3.3, 4.1], [4.3, 6.4]])
    separation = 0.5 * profile.h_max * profile.q0
    solution = solve_densely(gaps, separation, method.edges.model)
    return Solved(gaps, separation, method.edges, solution)


def test_edges_open_as_half_plane_cracks_that_interact(rough):
    """Error of the model: second order in the motions, and small over a whole shortest wave."""
    motion = WAVE * np.array([1.0, 0.1, -0.4, 0.3, 0.0, 1.0, -0.7, 0.2, 0.5, -1.0])
    before = rough.solution.opening
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
    model.advance(motion)
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
    before, exact = here.solution.opening, here.openings(motions)
    error = np.abs(here.model_openings(motions, 10) - exact).max()
    assert error < 0.2 * np.abs(exact - before).max()


def test_the_model_is_that_of_the_tangent_about_its_edges(rough):
    """Its forces are those of the field, and its Hessian their derivative, from the tangent."""
    opening, model = rough.solution.opening, rough.model()
    edges, matrix = opening.size, model.hessian
    np.testing.assert_allclose(model.forces, rough.force, rtol=1e-12)
    np.testing.assert_allclose(matrix, matrix.T)
    # C² - C_c² from C - C_c: 2 C dC - 2 C_c dC_c
    by_tangent = 2 * opening[:, None] * rough.tangent
    _, drift = rough.edges.law.critical_openings(rough.gaps.ravel())
    drift = drift * np.tile([1, -1], len(rough.gaps))
    by_tangent[np.diag_indices(edges)] += 2 * rough.residual * drift
    is_open = opening > 0  # edges beside an overlap act on no others
    assert 4 <= is_open.sum() < edges
    among = np.ix_(is_open, is_open)
    largest = np.abs(by_tangent).max()
    np.testing.assert_allclose(matrix[among], by_tangent[among], atol=1e-6 * largest)


# ------------------------------------------------------------------ flow through the model


def exact_flow_through(rough: Solved, limit: np.ndarray) -> np.ndarray:
    """Motions when the first edge is at its limit, from ``scipy.integrate.solve_ivp``."""
    law, panels = rough.edges.law, rough.edges.model.panels
    opening, edges = rough.solution.opening, rough.gaps.size
    start, places = rough.model(), rough.gaps.ravel()
    sides = np.tile([1.0, -1.0], edges // 2)
    grows = np.tile([-1, 1], edges // 2)  # the gap or patch after an edge, when contact grows
    after = np.roll(np.arange(edges), -1)

    def lengths(theta: np.ndarray) -> np.ndarray:
        return np.diff(np.append(theta, theta[0] + 2 * np.pi))

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        motion, now, own = y.reshape(3, edges)
        theta, coupling = places + motion * sides, start.coupling
        length = lengths(theta)
        for e, f in enumerate(after):
            coupling[[e, f], [f, e]] *= lengths(places)[e] / length[e]
        critical, _ = law.critical_openings(theta)
        slopes = np.stack([panels.half_plane_opening(theta, side)[1] for side in (0, 1)])
        rate = own + sides * slopes[np.arange(edges) % 2, np.arange(edges)]
        speed = critical**2 - now * np.abs(now)
        turned = np.zeros(edges)
        for e, f in enumerate(after):
            for one, other in ((e, f), (f, e)):
                mutual = coupling[one, other]
                mixed = mutual**2 * now[one] - grows[e] * mutual / length[e] * now[other]
                turned[one] += mixed * (speed[other] if grows[e] < 0 else speed[e] + speed[f])
        opened = rate * speed + coupling @ (now * speed)
        return np.concatenate([speed, opened, turned])

    def at_limit(_: float, y: np.ndarray) -> float:
        return float((np.abs(y[:edges]) / limit).max() - 1)

    at_limit.terminal = True  # type: ignore[attr-defined]
    first = np.concatenate([np.zeros(edges), opening, start.own])
    speed = np.abs(rough.force).max()
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
    law = rough.edges.law
    errors = []
    for share in (1.0, 0.5, 0.25):
        finer = EdgeLaw(law)
        finer.longest_step *= share
        flow = rough.model().flow(limit, False, True, 0.0, finer)
        assert np.diff(flow.lengths, prepend=0.0).max() <= finer.longest_step * 1.001
        assert np.abs(flow.motion).max() == pytest.approx(WAVE)
        errors.append(np.abs(flow.motion - exact).max() / WAVE)
    assert errors[0] < 0.1
    assert errors[2] < 0.4 * errors[0]


@pytest.mark.parametrize("equal_speeds", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_an_implicit_step_is_downhill_and_within_its_length(seed, equal_speeds):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 7))
    root = rng.normal(size=(count, count))
    matrix = root + root.T + np.diag(10.0 ** rng.uniform(0, 1.5, count))  # stiff, some unstable
    force = rng.normal(size=count)
    step = implicit_step(matrix, force, 0.01, equal_speeds)
    assert 0 < np.abs(step).max() <= 0.01 * (1 + 1e-12)
    assert force @ step > 0
    definite = root @ root.T + np.eye(count)
    # no limit in reach: Newton's step
    step = implicit_step(definite, force, 1e9, equal_speeds)
    np.testing.assert_allclose(step, np.linalg.solve(definite, force), rtol=1e-6)


def test_a_model_without_a_minimum_has_none_at_any_distance():
    """A soft mode with a small force is far from rest, though its first step is short."""
    matrix, force = np.diag([1.0, 1e-6]), np.array([1e-3, 1e-7])
    size = np.abs(implicit_step(matrix, force, 1e-3, False)).max()
    assert size < 1e-2 * distance_to_minimum(matrix, force)
    assert distance_to_minimum(matrix, force) == pytest.approx(0.1)
    assert distance_to_minimum(-matrix, force) == np.inf


# ------------------------------------------------------------------ judgement of a step


def test_openings_of_the_model_may_be_wrong_by_more_far_from_balance(rough):
    law, edges = rough.edges.law, np.arange(2)
    opening = rough.solution.opening[:2]
    wrong = opening + np.array([0.01 * law.critical, 0.0])

    def error(opened: np.ndarray, *unbalance: float) -> float:
        count = len(unbalance)
        lengths = np.arange(1.0, 1 + count) / count
        residuals = law.critical * np.transpose([unbalance, np.ones(count)])
        flow = ModelFlow(np.ones(2), opened, lengths, residuals)
        return float(model_error(flow, rough.residual[:2], edges, rough.gaps, law))

    assert error(wrong, 0.0) > 1 > error(wrong, 1.0)
    # balanced half way
    assert error(wrong, 0.0, 1.0) == pytest.approx(error(wrong, 0.0) / 4, rel=0.01)
    assert error(opening, 0.0) == pytest.approx(0, abs=1e-9)


# ------------------------------------------------------------------ step size


def test_the_reach_of_long_steps_follows_the_root_of_their_error():
    assert 0.3 * 10 < next_reach(10.0, 10.0, 4.0) < 0.5 * 10  # at half of it it is what is allowed
    assert next_reach(10.0, 10.0, np.inf) == pytest.approx(STEP_REDUCTION * 10)
    assert next_reach(10.0, 10.0, 0.0) == STEP_GROWTH * 10
    assert next_reach(10.0, 1.0, 1e-4) == 10  # edges came to rest: no reason to shorten


# ------------------------------------------------------------------ events


@pytest.fixture(scope="module")
def wave() -> SharpMethod:
    return SharpMethod(Problem(single_wave(1e-6, 1e-3), SOLID, 0.02))


def run(method: SharpMethod, gaps: list[list[float]], separation: float, most: int) -> Descent:
    """Descend on a single wave of amplitude 1 µm, at a separation in amplitudes."""
    edges, ends = method.edges, np.array(gaps, dtype=float)
    prescribed = separation * 2 * np.pi * 1e-3
    none = Running(ends)
    while True:
        near = edges.kept.near(ends, prescribed, None)
        assert near is not None
        found = near.descend(ends, prescribed, most, False, none, edges.law, edges.model)
        if found.event != DescentEvent.OUTGROWN:
            return found
        edges.kept.forget()
        ends = found.gaps


NARROW = [[0.2, 2 * np.pi - 0.2]]  # one narrow patch on the crest at θ = 0
SLIVER = [[0.05, 2 * np.pi - 0.05]]


def test_edges_come_to_rest_in_the_equilibrium_that_newton_finds(wave):
    found = run(wave, NARROW, 0.5, 1000)
    assert found.event == DescentEvent.AT_REST
    point = wave.edges.equilibrium(found.gaps, 0.5 * 2 * np.pi * 1e-3, 0.05 * wave.edges.wave)
    assert point is not None
    np.testing.assert_allclose(point.gaps, found.gaps, atol=2 * wave.edges.law.rest_step)


def test_a_descent_in_pieces_keeps_the_reach_to_which_its_model_led(wave):
    """Begun anew with the first reach it would take the same step too far, again and again."""
    edges, ends = wave.edges, np.array(NARROW)
    prescribed, running = 0.5 * 2 * np.pi * 1e-3, Running(np.array(NARROW))
    for _ in range(30):
        near = edges.kept.near(ends, prescribed, None)
        assert near is not None
        found = near.descend(ends, prescribed, 2, False, running, edges.law, edges.model)
        ends = found.gaps
        if found.event == DescentEvent.OUTGROWN:
            edges.kept.forget()
        if found.event == DescentEvent.AT_REST:
            break
    assert found.event == DescentEvent.AT_REST
    whole = run(wave, NARROW, 0.5, 1000)
    np.testing.assert_allclose(ends, whole.gaps, atol=2 * edges.law.rest_step)


def test_a_patch_vanishes_where_the_surfaces_are_far_apart(wave):
    found = run(wave, SLIVER, 5.0, 1000)
    assert found.event == DescentEvent.VANISHED
    patch = found.gaps[0, 0] + 2 * np.pi - found.gaps[0, 1]
    assert 0 < patch < wave.edges.law.smallest


def test_a_descent_ends_at_its_limit_of_steps_and_where_there_is_no_field(wave):
    found = run(wave, NARROW, 0.5, 3)
    assert (found.event, found.steps) == (DescentEvent.STEP_LIMIT, 3)
    with pytest.raises(NoState, match="no field"):
        wave.edges.relax(np.array([[0.2, np.nan]]), 3e-3, 0.1)
