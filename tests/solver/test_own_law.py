"""A law of edges that is written here alone: what the contract in ``edge_law.hpp`` promises."""

import numpy as np
import pytest

from adhesis import HalfSpace, Problem, run_loop, single_wave
from adhesis.solver._kernels import PythonAdhesion
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.sharp.method import SharpMethod

A, PERIOD, GAMMA, SOLID = 1e-6, 1e-4, 0.004, HalfSpace(1e6, 0.5)


class TwoWorks:
    """Edges advance at γ and recede at ``ratio`` times it, in the flat measure."""

    def __init__(self, ratio: float) -> None:
        self.ratio, self.asked = ratio, 0
        self.law = PythonAdhesion(ratio > 1, 1.0, ratio, self.work, self.work_up_to)

    def work(self, theta: float, recedes: bool) -> tuple[float, float]:
        self.asked += 1
        return (self.ratio if recedes else 1.0), 0.0

    def work_up_to(self, theta: float, recedes: bool) -> float:
        return self.work(theta, recedes)[0] * theta


@pytest.mark.parametrize("ratio", [1.0, 1.5, 4.0])
def test_a_law_of_its_own_meets_its_closed_form(ratio: float) -> None:
    own = TwoWorks(ratio)
    problem = Problem(single_wave(A, PERIOD), SOLID, GAMMA, measure="flat")
    method = SharpMethod(problem, accuracy=1e-4, adhesion=own.law)
    loop = run_loop(method, max_penetration=0.5, load_steps=20)
    closes, opens = (SingleWave(A, PERIOD, SOLID.modulus, r * GAMMA) for r in (1.0, ratio))
    a_in, a_out = closes.half_width(A), opens.fold_half_width
    friction = (ratio - 1) * GAMMA * 2 * closes.half_width(0.5 * A) / PERIOD
    loss = (opens.energy(a_out) - closes.energy(a_in)) / PERIOD + friction
    assert own.asked > 1000
    assert loop.loss == pytest.approx(loss, rel=1e-5)
    assert loop.loss_from_drops == pytest.approx(loss, rel=1e-5)
    assert loop.friction == pytest.approx(friction, rel=1e-5)
    assert abs(loop.audit_residual) < 1e-5


def test_an_error_of_a_law_is_raised_where_the_path_is_followed() -> None:
    def fails(theta: float, recedes: bool) -> tuple[float, float]:
        raise ZeroDivisionError(f"at {np.sign(abs(theta))}")

    problem = Problem(single_wave(A, PERIOD), SOLID, GAMMA)
    law = PythonAdhesion(False, 1.0, 1.0, fails, TwoWorks(1.0).work_up_to)
    with pytest.raises(ZeroDivisionError, match=r"at 1\.0"):
        run_loop(SharpMethod(problem, adhesion=law), max_penetration=0.5, load_steps=5)
