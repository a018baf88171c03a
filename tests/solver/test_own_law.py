"""A law of adhesion that is written here alone: what the contract in ``edge_law.hpp`` promises."""

import pickle
from typing import Any

import numpy as np
import pytest

from adhesis import HalfSpace, Problem, Profile, run_loop, single_wave, stripes
from adhesis.solver._kernels import PythonAdhesion
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.sharp.method import SharpMethod

A, PERIOD, GAMMA, SOLID = 1e-6, 1e-4, 0.004, HalfSpace(1e6, 0.5)
FLAT = Problem(single_wave(A, PERIOD), SOLID, GAMMA, measure="flat")


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
    method = SharpMethod(FLAT, accuracy=1e-4, adhesion=own.law)
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


def test_a_method_with_a_law_of_its_own_is_pickled_with_it() -> None:
    own = TwoWorks(1.5)
    method = SharpMethod(FLAT, adhesion=own.law)
    copy = pickle.loads(pickle.dumps(method))
    one, other = (run_loop(m, max_penetration=0.5, load_steps=5) for m in (method, copy))
    assert other.loss == one.loss
    assert copy.edges.adhesion.largest == 1.5
    law = PythonAdhesion(False, 1.0, 1.0, lambda a, r: (1.0, 0.0), lambda a, r: a)
    with pytest.raises((pickle.PicklingError, AttributeError), match="lambda"):
        pickle.dumps(SharpMethod(FLAT, adhesion=law))


def test_an_error_of_a_law_is_raised_where_the_path_is_followed() -> None:
    own = TwoWorks(1.0)

    def fails(theta: float, recedes: bool) -> tuple[float, float]:
        if following:
            raise ZeroDivisionError("here")
        return own.work(theta, recedes)

    following = False
    problem = Problem(single_wave(A, PERIOD), SOLID, GAMMA)
    law = PythonAdhesion(False, 1.0, 1.0, fails, own.work_up_to)
    method = SharpMethod(problem, adhesion=law)
    following = True
    with pytest.raises(ZeroDivisionError, match="here"):
        run_loop(method, max_penetration=0.5, load_steps=5)


def wavy(theta: float, recedes: bool) -> tuple[float, float]:
    """Return w that varies, and its slope."""
    return 1 + 0.5 * np.sin(theta), 0.5 * np.cos(theta)


def wavy_up_to(theta: float, recedes: bool) -> float:
    """Integrate w that varies."""
    return float(theta + 0.5 - 0.5 * np.cos(theta))


@pytest.mark.parametrize("phase", [0.0, 0.5])
def test_equal_parts_and_mirror_images_are_those_that_a_law_of_its_own_shares(phase: float) -> None:
    """Both crests were taken to be alike, and to touch at once, although adhesion parts them."""

    def work(theta: float, recedes: bool) -> tuple[float, float]:
        return 1 + 0.3 * np.cos(theta + phase), -0.3 * np.sin(theta + phase)

    def up_to(theta: float, recedes: bool) -> float:
        return float(theta + 0.3 * (np.sin(theta + phase) - np.sin(phase)))

    profile = Profile(PERIOD, np.array([0, 0, 0.5 * A]))
    law = PythonAdhesion(False, 0.7, 1.3, work, up_to)
    pattern = stripes(1, 0.3, phase)
    own = SharpMethod(Problem(profile, SOLID, GAMMA, measure="flat"), adhesion=law)
    usual = SharpMethod(Problem(profile, SOLID, GAMMA, measure="flat", pattern=pattern))
    assert own.edges.symmetry.parts == usual.edges.symmetry.parts == 1
    np.testing.assert_array_equal(own.edges.symmetry.axes, usual.edges.symmetry.axes)
    one, other = (run_loop(m, max_penetration=0.5, load_steps=10) for m in (own, usual))
    assert [jump.kind for jump in one.jumps] == [jump.kind for jump in other.jumps]
    assert one.loss == pytest.approx(other.loss, rel=1e-9)


@pytest.mark.parametrize(
    ("work", "up_to", "pins", "rule"),
    [
        (lambda a, r: (np.sin(a), np.cos(a)), lambda a, r: 1 - np.cos(a), False, "be positive"),
        (
            *(lambda a, r: (wavy(a, r)[0] + 0.8, wavy(a, r)[1]),),
            *(lambda a, r: wavy_up_to(a, r) + 0.8 * a, False, "be at most 2, its largest"),
        ),
        (lambda a, r: (wavy(a, r)[0] - 0.2, wavy(a, r)[1]), wavy_up_to, False, "be at least 0.5"),
        (lambda a, r: (1 + 0.01 * a, 0.01), lambda a, r: a + 5e-3 * a**2, False, "period 2π"),
        (lambda a, r: (wavy(a, r)[0], 0.0), wavy_up_to, False, "slope"),
        (wavy, lambda a, r: a, False, "derivative of work_up_to"),
        (lambda a, r: (2.0 - r, 0.0), lambda a, r: (2 - r) * a, True, "must not have a smaller w"),
        (lambda a, r: (1.0 + r, 0.0), lambda a, r: (1 + r) * a, False, "must pin"),
    ],
)
def test_a_law_that_breaks_its_contract_is_refused(
    work: Any, up_to: Any, pins: bool, rule: str
) -> None:
    with pytest.raises(ValueError, match=f"law of adhesion.*{rule}"):
        SharpMethod(FLAT, adhesion=PythonAdhesion(pins, 0.5, 2.0, work, up_to))


def test_a_law_that_pins_does_not_act_over_a_range() -> None:
    problem = Problem(single_wave(A, PERIOD), SOLID, GAMMA, measure="flat", adhesion_range=1e-9)
    with pytest.raises(ValueError, match="cannot act over a range"):
        SharpMethod(problem, adhesion=TwoWorks(2.0).law)
