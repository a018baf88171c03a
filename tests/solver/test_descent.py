"""Parts of a descent in energy, each without the others: steps, their size, judgement, events."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, solve_triangular
from scipy.optimize import brentq, lsq_linear

from adhesis import HalfSpace, Problem, single_wave
from adhesis.solver.sharp.descent.bound_constrained_step import bound_constrained_step
from adhesis.solver.sharp.descent.edge_forces import FlowProblem
from adhesis.solver.sharp.descent.flow_state import (
    LongStep,
    State,
    accepted,
    accepted_share,
    taken_back,
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
from adhesis.solver.sharp.descent.saddle import softest_step
from adhesis.solver.sharp.descent.step_size import (
    StepSize,
    after_turn,
    keeps_tangent,
    next_lengths,
    turns_back,
)
from adhesis.solver.sharp.descent.trajectory import Comparison, compared, distance_to
from adhesis.solver.sharp.field.exterior import NO_EXTERIOR
from adhesis.solver.sharp.method import SharpMethod
from adhesis.solver.sharp.tolerances import (
    COMPARISONS,
    LEAST_STEP_SHARE,
    LONGEST_STRIDE,
    LONGEST_STRIDE_ALONE,
    REUSES,
    REUSES_ALONE,
    TURNS,
    TURNS_FACTOR,
    UNCHECKED_ALONE,
)

SOLID = HalfSpace(1e6, 0.5)
NO_LONG_STEP = LongStep(np.empty(0, dtype=np.int64), np.empty(0))


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


# ------------------------------------------------------------------ judgement of a step


def state_of(slope, step, *, share=1.0) -> State:
    start = np.array([[1.0, 2.0]])
    step = np.array(step)
    gaps = start + (step * [1.0, -1.0]).reshape(1, 2)
    return State(
        gaps, start, step, np.array(slope), NO_LONG_STEP, StepSize(share, 2.0, 1, 1, 0)
    )


JUDGED = {
    "falls": ([-1.0, 0.0], [-0.5, 0.0], [0.1, 0.0], 1.0, 1.0),
    "rises": ([-1.0, 0.0], [1.5, 0.0], [0.1, 0.0], 1.0, 0.0),
    "one edge rises, the other falls more": ([-1.0, -1.0], [1.5, -1.0], [0.1, 0.1], 1.0, 1.0),
    "rises by rounding": ([-1.0, 1.0], [-1.0, 1.0 + 1e-6], [0.1, 0.1], 1.0, 1.0),
    "rises by more": ([-1.0, 1.0], [-1.0, 1.0 + 1e-2], [0.1, 0.1], 1.0, 0.0),
    "rises, but steps are the shortest": ([-1.0, 0.0], [1.5, 0.0], [0.1, 0.0], 0.01, 1.0),
    "stands": ([-1.0, 1.0], [1.5, 1.0], [0.0, 0.0], 1.0, 1.0),
}


@pytest.mark.parametrize("case", JUDGED)
def test_a_step_that_raises_the_energy_is_rejected(case):
    before, after, step, share, wanted = JUDGED[case]
    assert accepted_share(state_of(before, step, share=share), np.array(after), 1.0) == wanted


def test_a_rejected_step_is_halved_and_a_cut_one_ends_at_the_minimum():
    state = state_of([-1.0, 0.0], [0.1, 0.0])
    rejected = taken_back(state, accepted_share(state, np.array([1.5, 0.0]), 1.0))
    assert np.array_equal(rejected.gaps, state.start)
    assert (rejected.size.share, rejected.size.running) == (0.5, 0)
    cut = taken_back(state, accepted_share(state, np.array([1.5, 0.0]), 0.25))
    np.testing.assert_allclose(cut.gaps, [[1.025, 2.0]])
    assert (cut.size.share, cut.size.stride, cut.size.running) == (1.0, 0.0, 0)
    assert not cut.step.any()
    assert not rejected.step.any()
    kept = accepted(rejected._replace(step=np.array([0.05, 0.0])), np.array([-0.5, 0.0]))
    assert kept.size.share == 1.0  # doubled once the energy has fallen
    assert accepted(rejected, np.array([-0.5, 0.0])).size.share == 0.5  # not where edges stood


# ------------------------------------------------------------------ step size


def test_steps_grow_while_edges_run_and_no_further():
    for running, unchecked, longest in (
        (1, UNCHECKED_ALONE, LONGEST_STRIDE_ALONE),
        (3, 1.0, LONGEST_STRIDE),
    ):
        size = StepSize(1.0, 0.0, running, 0, 0)
        reached = []
        for _ in range(5):
            size, lengths = next_lengths(size, 0.1)
            assert lengths.unchecked == pytest.approx(0.1 * unchecked)
            reached.append(lengths.reach)
        assert np.all(np.diff(reached) >= 0)
        assert reached[0] == pytest.approx(0.1 * unchecked)
        assert reached[-1] == pytest.approx(0.1 * longest)
    standing, lengths = next_lengths(StepSize(1.0, 4.0, 0, 0, 0), 0.1)
    assert lengths.reach == pytest.approx(0.1)
    assert next_lengths(StepSize(0.5, 0.0, 0, 0, 0), 0.1)[1].reach == pytest.approx(0.05)
    assert not keeps_tangent(standing)


@pytest.mark.parametrize(("running", "steps"), [(1, REUSES_ALONE), (2, REUSES)])
def test_a_tangent_serves_so_many_further_steps(running, steps):
    size = StepSize(1.0, 0.0, running, 0, 0)
    served = 0
    while keeps_tangent(size):
        size, _ = next_lengths(size, 0.1)
        served += 1
    assert served == steps
    assert next_lengths(size, 0.1)[0].reuses == 0


def test_an_edge_that_turns_to_and_fro_takes_shorter_steps():
    size = StepSize(1.0, 0.0, 1, 0, 0)
    for turn in range(1, TURNS + 100):
        size = after_turn(size)._replace(running=1)
        factor = max(TURNS_FACTOR ** max(turn - TURNS, 0), LEAST_STEP_SHARE)
        assert next_lengths(size, 0.1)[1].longest == pytest.approx(0.1 * factor)
    assert after_turn(StepSize(1.0, 0.0, 2, 0, 0)).turns == 0  # several edges may turn
    last = np.array([0.1, -0.1])
    assert turns_back(np.array([-0.1, -0.1]), last, 0.2)
    assert not turns_back(np.array([-0.01, -0.1]), last, 0.2)  # a short way back


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
        comparison = compared(comparison, gaps, 0.1)
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
    assert len(found.forces) == len(found.trajectory) - 1
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
    second = run(
        wave, NARROW, 0.5, track=first.trajectory, has_left=True, equal_speeds=True
    )
    assert second.event == REJOINED
    assert second.fields < first.fields
    never_away = run(wave, NARROW, 0.5, track=first.trajectory, equal_speeds=True)
    assert never_away.event == AT_REST
    assert not never_away.has_left
