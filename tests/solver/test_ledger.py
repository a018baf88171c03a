"""The ledger of a path: every interval balances, and all losses are sums over it."""

import numpy as np
import pytest

from adhesis import Control, Problem, make_method, run_path
from adhesis.solver.loading.ledger import Ledger, states_before_jumps
from adhesis.solver.model.jump import Jump
from tests.support.scenes import HALF_SPACE, UNEVEN, rough

ROUGH = rough(2, 6, 3)
INTERFACES = {
    "separation": {},
    "stiffness": {"control": Control(1e9)},
    "stiff and uneven": {"control": Control(1e10), "pattern": UNEVEN},
    "load": {"control": Control(0.0)},
    "two works": {"work_of_adhesion_open": 0.004},
    "uneven": {"pattern": UNEVEN},
}


@pytest.mark.parametrize("name", INTERFACES)
def test_every_interval_of_a_path_balances(name):
    """Work is rise and loss: to the error of the loss in jumps and between them."""
    problem = Problem(ROUGH, HALF_SPACE, 0.002, **INTERFACES[name])
    is_load = problem.control.is_load
    points = [800.0, 0.0, 400.0] if is_load else [0.7, 0.2, 0.5]
    path = run_path(make_method("sharp", problem), points, load_steps=10)
    ledger = path.ledger
    rest = ledger.works - np.diff(ledger.stored) - ledger.losses
    assert np.abs(rest).max() < path.loss_error
    assert (path.work, path.energy_change) == (ledger.work, ledger.rise)
    assert path.loss_from_drops == ledger.loss
    drops = sum(jump.energy_drop for jump in path.jumps)
    assert ledger.losses[path.states_before_jumps()].sum() == pytest.approx(drops, rel=1e-12)
    assert (path.friction > 0) == (name == "two works")
    assert len(path.jumps) > 5
    lost = path.jumps[-1:] if is_load else ()  # under a load it is U, of either sign
    assert min(jump.energy_drop for jump in path.jumps if jump not in lost) >= 0
    assert abs(path.audit_residual) < 1e-4
    (minor,) = path.minor_loops
    assert (minor.start, minor.turn, minor.branch) == (*points[1:], "loading")
    assert minor.audit_residual == pytest.approx(0, abs=path.loss_error)
    assert minor.loss >= -1e-6 * path.work
    assert set(path.leg) == {0, 1, 2, 3}


def test_a_ledger_states_work_jump_and_friction_of_each_interval():
    """p̄ = s³ is integrated exactly, by its slopes; of the friction a jump's is in its drop."""
    problem = Problem(ROUGH, HALF_SPACE, 0.002, work_of_adhesion_open=0.003)
    s = np.array([1.0, 0.6, 0.6, 0.9])
    contact, none = np.array([0.1, 0.2, 0.4, 0.3]), np.zeros(4)
    jump = Jump("loading", 0.6, 5.0, "spreading", 1, 1, 0.2, 0.4, 1e-3)
    period = problem.profile.period
    ledger = Ledger.of(
        problem,
        [jump],
        separation=s,
        mean_stress=s**3,
        tangent=3 * s**2,
        contact_fraction=contact,
        elastic_energy=period * s**4,
        adhesion_energy=none,
        edge_friction=1e-3 * period * np.array([0.0, 1.0, 3.0, 6.0]),
    )
    np.testing.assert_allclose(ledger.works, -np.diff(s**4) / 4, atol=1e-15)
    np.testing.assert_allclose(ledger.friction, 1e-3 * np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(ledger.losses, [1e-3, 5.0, 3e-3])
    assert ledger.loss == pytest.approx(5.004)
    assert ledger.rise == pytest.approx(0.9**4 - 1)
    assert ledger.residual == pytest.approx(ledger.work - ledger.rise - ledger.loss)
    part = ledger.part(1, 3)
    assert (part.loss, part.rise, part.work) == (5.0, 0.0, 0.0)


def jump_at(s: float, before: float, after: float) -> Jump:
    return Jump("loading", s, 1.0, "spreading", 1, 1, before, after, 1e-3)


def test_jumps_are_found_in_their_order_and_each_between_states_of_its_own():
    """Two like jumps once shared an interval, and one that was not found had the last one."""
    s = np.array([1.0, 0.5, 0.5, 0.5, 0.5, 0.2])
    contact = np.array([0.1, 0.2, 0.3, 0.2, 0.3, 0.4])
    there, back = jump_at(0.5, 0.2, 0.3), jump_at(0.5, 0.3, 0.2)
    assert states_before_jumps([there, back, there], s, contact) == [1, 2, 3]
    assert states_before_jumps([there, there], s, contact) == [1, 3]
    assert states_before_jumps([], s[:1], contact[:1]) == []
    for missing in ([jump_at(0.5, 0.2, 0.4)], [back, back], [there, there, there]):
        with pytest.raises(ValueError, match=r"jump at s = 0\.5 m: a method has to return both"):
            states_before_jumps(missing, s, contact)
