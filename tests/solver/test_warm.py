"""What is compiled ahead is all that loops call, whatever holds the half-space."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from adhesis.solver.loading.loop import run_loop
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import self_affine_profile
from adhesis.solver.precompile import small_problem, warm, watch_compilation
from adhesis.solver.registry import make_method
from adhesis.solver.sharp.method import SharpMethod


@pytest.mark.parametrize(
    ("method", "stiffness"),
    [("sharp", math.inf), ("sharp", 1e10), ("sharp", 0.0), ("grid", math.inf)],
)
def test_after_warming_up_loops_and_fields_compile_nothing(method, stiffness):
    warm([method], many_gaps=False)
    with watch_compilation() as seen:
        problem = replace(small_problem(0.01), control=Control(stiffness))
        turning = {"max_stress": 2e3} if stiffness == 0 else {"max_penetration": 0.9}
        states = []
        chosen = make_method(method, problem)
        run_loop(chosen, **turning, load_steps=7, on_state=lambda _, state: states.append(state))
        chosen.fields(max(states, key=lambda state: state.patches), chosen.nodes or 512)
    assert seen.functions == 0


@pytest.mark.parametrize("method", ["sharp", "grid"])
@pytest.mark.parametrize("work_of_adhesion", [0.04, 0.0])
def test_the_loops_that_compile_everything_end(method, work_of_adhesion):
    """Whatever is compiled already: with and without adhesion the small problem has its loop."""
    chosen = make_method(method, small_problem(work_of_adhesion))
    loop = run_loop(chosen, max_penetration=0.8, load_steps=2)
    assert (loop.loss > 1e-3) is (work_of_adhesion > 0)


def test_after_warming_up_loops_with_many_gaps_compile_nothing():
    warm(["sharp"])
    profile = self_affine_profile(0.7, period=2e-3 * np.pi, n0=10, ratio=6, seed=2, h_rms=1e-6)
    method = SharpMethod(Problem(profile, HalfSpace(young=1e6, poisson=0.5), 0.003))
    with watch_compilation() as seen:
        loop = run_loop(method, max_penetration=0.6, load_steps=6)
    assert loop.patches.max() > 7
    assert seen.functions == 0
