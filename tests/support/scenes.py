"""What several tests use: a solid, a pattern, profiles, loops of one problem."""

from typing import Any

import numpy as np

from adhesis import (
    AdhesionPattern,
    HalfSpace,
    LoopResult,
    Problem,
    Profile,
    make_method,
    run_loop,
    self_affine_profile,
)
from adhesis.solver.grid.method import GridMethod
from adhesis.solver.registry import MethodName

HALF_SPACE = HalfSpace(young=1e6, poisson=0.5)
UNEVEN = AdhesionPattern([0, 0.1 - 0.1j, 0, 0.05j, 0, 0, 0, 0.08])


def rough(n0: int, ratio: int, seed: int, **others: Any) -> Profile:
    """Make a self-affine profile, of H = 0.8, 2 mm and an rms height of 1 µm if not given."""
    values = {"hurst": 0.8, "period": 2e-3, "h_rms": 1e-6} | others
    return self_affine_profile(n0=n0, ratio=ratio, seed=seed, **values)


def of_paper(seed: int, hurst: float = 0.8, *, ratio: int = 100) -> Profile:
    """Make a profile of the paper's, which has 10 to 1000 waves in 2π mm."""
    return rough(10, ratio, seed, hurst=hurst, period=2e-3 * np.pi)


def loop_of(
    problem: Problem,
    name: MethodName = "sharp",
    *,
    accuracy: float = 1e-3,
    nodes_per_wave: int | None = None,
    **path: Any,
) -> LoopResult:
    """Run a loop by a method, over the path of ``run_loop``."""
    method = make_method(name, problem, accuracy=accuracy, nodes_per_wave=nodes_per_wave)
    return run_loop(method, **path)


def grid_of(problem: Problem, nodes: int, accuracy: float = 1e-3) -> GridMethod:
    """Make the method on a grid of ``nodes`` nodes, a power of two."""
    per_wave = nodes // problem.profile.highest_harmonic
    method = GridMethod(problem, accuracy=accuracy, nodes_per_wave=per_wave)
    assert method.nodes == nodes
    return method


def loops_at(problem: Problem, *accuracies: float, **path: Any) -> list[LoopResult]:
    """Run a loop by the method ``sharp`` at each accuracy, over the path of ``run_loop``."""
    return [loop_of(problem, accuracy=accuracy, **path) for accuracy in accuracies]
