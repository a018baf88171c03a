"""What several tests use: a solid, a pattern, loops of one problem at several accuracies."""

from typing import Any

from adhesis import AdhesionPattern, HalfSpace, LoopResult, Problem, run_loop
from adhesis.solver.sharp.method import SharpMethod

HALF_SPACE = HalfSpace(young=1e6, poisson=0.5)
UNEVEN = AdhesionPattern([0, 0.1 - 0.1j, 0, 0.05j, 0, 0, 0, 0.08])


def loops_at(problem: Problem, *accuracies: float, **path: Any) -> list[LoopResult]:
    """Run a loop by the method ``sharp`` at each accuracy, over the path of ``run_loop``."""
    return [run_loop(SharpMethod(problem, accuracy=accuracy), **path) for accuracy in accuracies]
