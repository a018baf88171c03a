"""Two works of adhesion: an edge advances at γ, recedes at γ_open, and is pinned between both."""

from dataclasses import replace

import numpy as np
import pytest

from adhesis import Control, PathError, Problem, Profile, make_method, run_path, single_wave
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.sharp.continuation.descent import NoState
from adhesis.solver.sharp.continuation.follower import Follower
from adhesis.solver.sharp.method import SharpMethod
from tests.support.scenes import HALF_SPACE as SOLID
from tests.support.scenes import loop_of, rough
from tools.hostile import draw

A, PERIOD, GAMMA = 1e-6, 1e-4, 0.004
WAVE = single_wave(A, PERIOD)


def wave(ratio: float, control: Control | None = None) -> Problem:
    gamma_open = ratio * GAMMA
    return Problem(WAVE, SOLID, GAMMA, control or Control(), work_of_adhesion_open=gamma_open)


@pytest.mark.parametrize(("half_width", "ways"), [(0.05, 2), (0.5, 0)], ids=["saddle", "minimum"])
def test_a_saddle_is_left_by_edges_that_are_not_pinned(half_width, ways):
    """One wave, about its crest: states narrower than that of the fold are not stable."""
    method = SharpMethod(wave(2.0))
    edges = method.edges
    gaps, memory = (np.array([[a, 2 * np.pi - a]]) for a in (half_width, 0.9 * half_width))
    law = edges.law_at(memory)
    here, there = (edges.solution(gaps, d).edge_opening for d in (0.0, 1e-3))
    d = 1e-3 * ((law.critical_of(gaps, here) - here) / (there - here))[0]
    assert len(method.jumps.descents.ways_off_saddle(gaps, d, law)) == ways


@pytest.mark.parametrize("number", [84, 112, 116])
def test_the_error_of_a_loss_counts_the_whole_way_beyond_a_fold(number):
    """Just beyond the last fold descents come to rest up to three times before contact is lost."""
    scene = draw(771101, number, "open", "separation")
    problem, turn = scene.problem(), {"load_steps": scene.load_steps}
    turn |= scene.turn(problem)
    loop = loop_of(problem, accuracy=1e-4, **turn)
    exact = loop_of(problem, accuracy=1e-6, **turn)
    assert 0.1 * loop.loss_error < abs(loop.loss - exact.loss) < loop.loss_error


def test_the_error_counts_how_a_mirrored_patch_leaves_its_symmetry():
    """One of its edges goes first, without a jump: the loss was off by four times its error."""
    profile = Profile(PERIOD, A * np.array([0, 0.24, -0.22, -0.11, 0.05, 0.05, -0.02], complex))
    problem = Problem(profile, SOLID, 0.042, work_of_adhesion_open=0.0525)
    path = {"max_penetration": 0.57, "load_steps": 8}
    loop, exact = (loop_of(problem, accuracy=a, **path) for a in (1e-3, 3e-5))
    assert (loop.races, loop.patches.max()) == (0, 1)
    assert abs(loop.loss - exact.loss) < loop.loss_error


@pytest.mark.parametrize(("ratio", "depth"), [(1.1, 0.6), (2.0, 0.6), (4.0, 0.3)])
def test_loss_of_a_wave_is_the_closed_form(ratio, depth):
    loop = loop_of(wave(ratio), accuracy=1e-4, max_penetration=depth, load_steps=20)
    closes = SingleWave(A, PERIOD, SOLID.modulus, GAMMA, "arc")
    opens = SingleWave(A, PERIOD, SOLID.modulus, ratio * GAMMA, "arc")
    turn = closes.half_width(A * (1 - depth))
    adhesive_length = -closes.adhesion_energy(turn) / GAMMA
    friction = (ratio - 1) * GAMMA * adhesive_length / PERIOD
    gained = closes.energy(closes.half_width(A))
    lost = opens.energy(opens.fold_half_width)
    loss = (lost - gained) / PERIOD + friction
    assert loop.loss == pytest.approx(loss, rel=1e-4)
    assert loop.loss_from_drops == pytest.approx(loss, rel=1e-4)
    assert loop.friction == pytest.approx(friction, rel=1e-4)
    assert abs(loop.audit_residual) < 1e-4
    assert loop.warnings == ()
    assert 0 < loop.friction < loop.loss


def test_equal_works_of_adhesion_give_the_same_bits_as_one():
    one = Problem(WAVE, SOLID, GAMMA)
    both = wave(1.0)
    assert both == one
    assert both.work_of_adhesion_open is None
    assert (both.pinning, both.gamma_open) == (0.0, GAMMA)
    loop, other = (loop_of(p, max_penetration=0.6, load_steps=10) for p in (one, both))
    assert loop == other
    assert loop.friction == 0.0
    assert loop.edge_friction is None
    assert "edge_friction" not in loop.columns()


@pytest.mark.parametrize("control", [Control(), Control(1e11)])
def test_a_minor_loop_within_the_pinned_range_is_reversible(control):
    """Its edges do not move, so nothing is lost; a longer one is audited with its friction."""
    method = make_method("sharp", wave(2.0, control), accuracy=1e-4)
    path = run_path(method, [0.3, 0.28, 0.3, -0.3, 0.3], load_steps=20)
    short, long = path.minor_loops
    assert (short.turn, long.turn) == (0.28, -0.3)
    assert short.closes
    assert abs(short.loss) < 1e-6 * long.loss
    assert abs(short.loss_from_drops) < 1e-6 * long.loss
    assert long.loss > 0.1 * path.work
    assert abs(long.audit_residual) < 1e-4 * long.loss
    assert abs(path.audit_residual) < 1e-4
    assert path.friction > long.loss_from_drops


def test_a_loop_of_many_patches_closes_its_audit_and_its_friction_only_grows():
    """Most of its gaps lie apart in the tree, and some edges are pinned at most of its states."""
    problem = Problem(rough(10, 4, 3), SOLID, 2e-3, work_of_adhesion_open=3e-3)
    loop = loop_of(problem, max_penetration=0.8, load_steps=10)
    assert loop.patches.max() >= 12
    assert 0.05 * loop.loss < loop.friction < loop.loss
    assert abs(loop.audit_residual) < 1e-3
    assert loop.loss_from_drops == pytest.approx(loop.loss, rel=1e-3)
    assert np.all(np.diff(loop.edge_friction) >= 0)
    assert loop.to_dataframe().attrs["units"]["edge_friction"] == "J/m"
    data = loop.to_xarray()
    assert data.attrs["friction"] == loop.friction
    np.testing.assert_array_equal(data.edge_friction, loop.edge_friction)


@pytest.mark.parametrize(
    ("control", "turn"),
    [
        (Control(), {"max_penetration": 0.8}),
        (Control(1e9), {"max_penetration": 0.8}),
        (Control(0.0), {"max_stress": 600.0}),
    ],
)
def test_no_jump_dissipates_more_by_friction_than_it_loses(control, turn):
    """Under a load the fall of the solid made it several times the loss."""
    problem = Problem(rough(4, 4, 3), SOLID, 2e-3, control, work_of_adhesion_open=2e-2)
    loop = loop_of(problem, load_steps=10, **turn)
    by_friction = loop.ledger.friction[loop.states_before_jumps()]
    drops = np.array([jump.energy_drop for jump in loop.jumps])
    assert np.all(drops - by_friction > -loop.loss_error)
    assert 0 < loop.friction < loop.loss


def test_friction_is_known_of_every_state_where_no_edge_recedes_before_the_fall():
    """The column was left out, as with one work of adhesion."""
    problem = Problem(
        single_wave(A, 1e-3), SOLID, 2e-4, Control(0.0), work_of_adhesion_open=60 * 2e-4
    )
    loop = loop_of(problem, max_stress=300.0, load_steps=10)
    assert not loop.patches[-1]
    assert loop.friction == 0.0
    np.testing.assert_array_equal(loop.columns()["edge_friction"], np.zeros(len(loop.separation)))


def test_edges_that_are_pinned_at_both_thresholds_at_once_are_at_rest():
    """By the response of the edges on the way they moved and were pinned by turns: a refusal."""
    scene = draw(8804, 20, "pattern", decades=1.28)
    problem = scene.problem()
    loop = loop_of(problem, load_steps=scene.load_steps, **scene.turn(problem))
    assert abs(loop.audit_residual) < 1e-4


def test_auto_takes_sharp_for_two_works():
    assert make_method("auto", wave(2.0)).name == "sharp"
    assert make_method("grid", wave(1.0)).name == "grid"


def test_equal_patches_of_two_works_are_doubted() -> None:
    """Which of them goes first, and when, differs between accuracies by more than the error."""
    equal = replace(wave(3.0), profile=Profile(PERIOD, np.array([0, 0, 0.5 * A], complex)))
    problems = (equal, replace(equal, work_of_adhesion_open=None), wave(3.0))
    loops = [loop_of(problem, max_penetration=0.8, load_steps=10) for problem in problems]
    assert [any("are alike" in text for text in loop.warnings) for loop in loops] == [1, 0, 0]


def test_under_a_load_the_solid_falls_off_at_the_largest_tension_of_the_larger_work() -> None:
    problem = wave(2.0, Control(0.0))
    loop = loop_of(problem, accuracy=1e-4, max_stress=2000.0, load_steps=20)
    opens = SingleWave(A, PERIOD, SOLID.modulus, 2.0 * GAMMA, "arc")
    tension = -opens.mean_stress(np.linspace(1e-3, 0.4, 40_000) * PERIOD).min()
    assert loop.pull_off_stress == pytest.approx(tension, rel=1e-5)
    assert abs(loop.audit_residual) < 1e-5


def test_a_loop_under_a_load_does_not_creep() -> None:
    """Edges that move by less than Newton's tolerance once held each other to shortest steps.

    A loop then took tens of thousands of them.
    """
    problem = Problem(rough(2, 6, 3), SOLID, 0.002, Control(0.0), work_of_adhesion_open=0.004)
    loop = loop_of(problem, max_stress=800.0, load_steps=10)
    assert loop.method.newton_steps < 1000
    assert abs(loop.audit_residual) < 1e-4
    assert loop.friction > 0


@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_a_refusal_names_another_method_only_where_it_takes_the_problem(ratio, monkeypatch):
    def refuse(*_):
        raise NoState("no state", 1.0)

    monkeypatch.setattr(Follower, "run", refuse)
    with pytest.raises(PathError, match="another accuracy") as refused:
        loop_of(wave(ratio), max_penetration=0.5, load_steps=2)
    assert ("or the other method" in str(refused.value)) is (ratio == 1)
    assert "grid" not in str(refused.value)
