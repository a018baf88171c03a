"""Parts of a descent in energy, each without the others: model, steps, events."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from adhesis import Problem, single_wave
from adhesis.solver._kernels import (
    Descent,
    DescentEvent,
    EdgeModel,
    distance_to_minimum,
    implicit_step,
)
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.method import SharpMethod
from tests.support import scenes
from tests.support.dense import DenseSolution, dense_tangent, solve_densely
from tests.support.scenes import HALF_SPACE, of_paper


class Solved(NamedTuple):
    gaps: np.ndarray
    separation: float
    edges: EdgeMechanics
    solution: DenseSolution

    @property
    def residual(self) -> np.ndarray:
        opening = self.solution.edge_opening
        return opening - self.edges.law.critical_of(self.gaps, opening)

    def openings(self, motion: np.ndarray) -> np.ndarray:
        gaps = self.gaps + (motion * np.tile([1.0, -1.0], len(self.gaps))).reshape(-1, 2)
        return self.with_gaps(gaps).solution.edge_opening

    def with_gaps(self, gaps: np.ndarray) -> Solved:
        solution = solve_densely(gaps, self.separation, self.edges.model)
        return self._replace(gaps=gaps, solution=solution)

    def model(self) -> EdgeModel:
        law, panels, every = self.edges.law, self.edges.model.panels, np.arange(self.gaps.size)
        tangent = dense_tangent(self.gaps, self.separation, self.edges)
        return EdgeModel(every, self.gaps, self.residual, tangent, law, panels)

    def model_openings(self, motion: np.ndarray, steps: int = 400) -> np.ndarray:
        model = self.model()
        for _ in range(steps):
            model.advance(motion / steps)
        return model.opening


WAVE = 2 * np.pi / 240  # the shortest of ``rough``


@pytest.fixture(scope="module")
def rough() -> Solved:
    """Five gaps of a rough profile, one of them narrow, with waves much shorter than the gaps."""
    profile = scenes.rough(4, 60, 1, period=2e-3 * np.pi)
    method = SharpMethod(Problem(profile, HALF_SPACE, 0.02), accuracy=1e-6)
    gaps = np.array([[0.3, 0.8], [0.9, 2.0], [2.2, 3.1], [3.3, 4.1], [4.3, 6.4]])
    separation = 0.5 * profile.h_max * profile.q0
    solution = solve_densely(gaps, separation, method.edges.model)
    return Solved(gaps, separation, method.edges, solution)


def test_edges_open_as_half_plane_cracks_that_interact(rough):
    """Error of the model: second order in the motions, and small over a whole shortest wave."""
    motion = WAVE * np.array([1.0, 0.1, -0.4, 0.3, 0.0, 1.0, -0.7, 0.2, 0.5, -1.0])
    before = rough.solution.edge_opening
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


@pytest.mark.parametrize(("narrow", "motion"), [("patch", 0.3), ("patch", -0.2), ("gap", -0.3)])
def test_openings_beside_a_narrow_patch_or_gap(rough, narrow, motion):
    """Its length changes by 80 to 120 %; with coupling and rates kept errors are 0.3 to 0.6."""
    e, f, gaps = NEIGHBOURS[narrow]
    here = rough.with_gaps(np.array(gaps))
    motions = np.zeros(10)
    motions[[e, f]] = motion * WAVE
    before, exact = here.solution.edge_opening, here.openings(motions)
    error = np.abs(here.model_openings(motions, 10) - exact).max()
    assert error < 0.2 * np.abs(exact - before).max()


@pytest.mark.parametrize("equal_speeds", [False, True])
@pytest.mark.parametrize("count", [1, 3, 7, 8, 9, 41])  # kernels take blocks of eight rows
def test_an_implicit_step_is_downhill_and_within_its_length(count, equal_speeds):
    rng = np.random.default_rng(count)
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


@pytest.fixture(scope="module")
def wave() -> SharpMethod:
    return SharpMethod(Problem(single_wave(1e-6, 1e-3), HALF_SPACE, 0.02))


def run(method: SharpMethod, half_width: float, separation: float) -> Descent:
    """Descend from one patch on the crest at θ = 0 of a wave, at a separation in amplitudes."""
    edges, ends = method.edges, np.array([[half_width, 2 * np.pi - half_width]])
    prescribed = separation * 2 * np.pi * 1e-3
    near = edges.response_near(ends, prescribed)
    return near.descend(ends, ends, prescribed, 1000, False, edges.law, edges.model)


def test_edges_come_to_rest_in_the_equilibrium_that_newton_finds(wave):
    found = run(wave, 0.2, 0.5)
    assert found.event == DescentEvent.AT_REST
    point = wave.edges.equilibrium(found.gaps, 0.5 * 2 * np.pi * 1e-3, 0.05 * wave.edges.wave)
    np.testing.assert_allclose(point.gaps, found.gaps, atol=2 * wave.edges.law.rest_step)


def test_later_steps_after_which_a_gap_needs_more_nodes_are_judged():
    """Without that the gap beside a new patch closed beyond a minimum: the loss was 4 % off."""
    profile = of_paper(5, ratio=10)
    method = SharpMethod(Problem(profile, HALF_SPACE, 0.01), accuracy=1e-6)
    path = method.follow(method.detached(profile.h_max), 0.1022 * profile.h_max)
    assert (path.jumps[-1].kind, path.states[-1].patches) == ("snap-in", 13)


def test_a_patch_vanishes_where_the_surfaces_are_far_apart(wave):
    found = run(wave, 0.05, 5.0)
    assert found.event == DescentEvent.VANISHED
    patch = found.gaps[0, 0] + 2 * np.pi - found.gaps[0, 1]
    assert 0 < patch < wave.edges.law.smallest
