"""What is compiled ahead is all that loops call, whatever holds the half-space."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from solver.control import Control
from solver.loop import run_loop
from solver.registry import make_method
from solver.warm import small_problem, warm, watch_compilation


@pytest.mark.parametrize(
    ("method", "stiffness"),
    [("sharp", math.inf), ("sharp", 1e10), ("sharp", 0.0), ("grid", math.inf)],
)
def test_after_warming_up_loops_and_fields_compile_nothing(method, stiffness):
    warm([method])
    with watch_compilation() as seen:
        problem = replace(small_problem(0.01), control=Control(stiffness))
        turning = {"max_stress": 2e3} if stiffness == 0 else {"max_penetration": 0.9}
        states = []
        chosen = make_method(method, problem)
        run_loop(chosen, **turning, load_steps=7, on_state=lambda _, state: states.append(state))
        chosen.fields(max(states, key=lambda state: state.patches), chosen.nodes or 512)
    assert seen.functions == 0
