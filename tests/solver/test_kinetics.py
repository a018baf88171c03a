"""Rule of descent: linear kinetics of the edges, in both methods, and the way off a saddle."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from adhesis import Control, Problem, Profile, run_loop
from adhesis.solver.grid.method import GridMethod
from adhesis.solver.sharp.continuation.descent import NoState, leaving_step
from adhesis.solver.sharp.continuation.jump import Jumps
from adhesis.solver.sharp.method import SharpMethod
from tests.support.scenes import HALF_SPACE as SOLID
from tests.support.scenes import grid_of, loop_of, loops_at, of_paper, rough

PHASES = [
    0.07427745862364432, 2.8303468781729233, -2.2358110930610913, 2.8189476143269747,
    -1.1822978560010347, -0.4817541292647971, 2.0590161226172397, -0.5705186522445032,
    0.3116063297162208, -2.9684336381820478, 1.5928698396029661, 0.23966150518651785,
    -1.0698271771715926, 1.8122509915502087, -1.2365633569567,
]  # fmt: skip


def race() -> Problem:
    """Profile on which the rule of descent decides the first snap-in."""
    m = np.arange(2, 17)
    a = np.zeros(17, dtype=complex)
    a[2:] = m**-1.3 * np.exp(1j * np.array(PHASES))
    profile = Profile(0.4e-3 * np.pi, a)
    return Problem(profile.scaled(1e-6 / profile.h_rms), SOLID, 0.07)


@pytest.mark.parametrize("turn", range(4))
def test_equivalent_edges_give_equivalent_ways_off_a_saddle(turn):
    """Four equal edges on a ring: the way out is the same but for the place of its leader."""
    ring = -np.eye(4) + 0.3 * (np.roll(np.eye(4), 1, 0) + np.roll(np.eye(4), -1, 0))
    ring += 1e-12 * np.diag(np.arange(4.0))
    first = np.roll(np.arange(4.0), turn)
    step = leaving_step(ring, np.full(4, 0.1), first)
    lead = int(np.argmin(first))
    reference = leaving_step(ring, np.full(4, 0.1), np.arange(4.0))
    np.testing.assert_allclose(np.roll(step, -lead), reference, atol=1e-9)
    assert step[lead] == pytest.approx(0.1)


@pytest.mark.parametrize("share", [1.0, 0.2, None], ids=["sharp", "shorter steps", "grid"])
def test_a_race_ends_where_gradient_flow_does_and_is_flagged_with_what_is_at_stake(share):
    """Explicit gradient flow with short steps: contact 0.3202 after the snap-in.

    It gave a loss of 5.178224 with jumps located to 5e-5 h_max. The loss is that at accuracy 1e-6.
    """
    method = SharpMethod(race()) if share else GridMethod(race(), nodes_per_wave=32)
    if share:
        method.edges.law.longest_step *= share
    result = run_loop(method, max_penetration=0.8, load_steps=20)
    first = result.jumps[0]
    assert first.contact_after == pytest.approx(0.3202, abs=1e-4 if share else 2e-3)
    assert result.loss_dimensionless == pytest.approx(5.178119, rel=1e-5 if share else 5e-3)
    # equal speeds end elsewhere: the losses, 5.178 and 5.70, differ by about a tenth, and so do the
    # energies of one jump
    assert first.raced
    assert 0.01 * result.loss < first.at_stake < result.loss
    assert result.races >= 1
    assert result.energy_at_stake == pytest.approx(sum(j.at_stake for j in result.jumps))


@pytest.mark.parametrize("swapped", [False, True])
def test_finer_steps_decide_next_to_a_separatrix(swapped):
    """At accuracy 1e-5 first steps and equal speeds end on its other side, 5e-5 of the loss off.

    Swapped, finer steps end where equal speeds lead, with more energy: that is a race as well.
    """
    method = SharpMethod(Problem(of_paper(1), SOLID, 0.04), accuracy=1e-5)
    if swapped:
        relax = method.jumps.descents.relax
        method.jumps.descents.relax = lambda gaps, d, share=1.0, **_: relax(
            gaps, d, equal_speeds=share < 1
        )
    loop = run_loop(method, max_penetration=0.9)
    # of accuracy 1e-6, with its error
    assert loop.loss == pytest.approx(0.122149467, abs=loop.loss_error + 6.5e-8)
    assert loop.races == 1
    assert swapped or len(loop.jumps) == 133


def test_finer_steps_that_come_to_no_rest_are_a_race():
    """As equal speeds are: where they would have ended is not known."""
    method = SharpMethod(race())
    relax = method.jumps.descents.relax

    def never_at_rest(gaps, d, share=1.0, equal_speeds=False, **how):
        if share < 1:
            raise NoState("edges that descend in energy do not come to rest", d)
        return relax(gaps, d, **how)

    method.jumps.descents.relax = never_at_rest
    first = run_loop(method, max_penetration=0.8, load_steps=20).jumps[0]
    assert first.raced
    assert first.at_stake == 0


def test_under_a_load_the_speeds_of_the_edges_decide_nothing():
    """There the advance of one edge helps all others (docs/paths.md)."""
    problem = replace(race(), work_of_adhesion=0.01, control=Control(0.0))
    methods = [SharpMethod(problem) for _ in range(2)]
    relax = methods[1].jumps.descents.relax
    methods[1].jumps.descents.relax = lambda *where, **how: relax(*where, equal_speeds=True)
    one, other = (run_loop(method, max_stress=2e3, load_steps=6) for method in methods)
    assert len(one.jumps) == len(other.jumps) > 2
    assert other.loss == pytest.approx(one.loss, rel=1e-7)


def test_under_a_load_no_other_order_of_events_is_followed(monkeypatch):
    """Two folds lie so near to each other here that at a fixed separation both orders are."""
    asked = []
    monkeypatch.setattr(Jumps, "_end_of", lambda *where: asked.append(where))
    profile = rough(4, 2, 453976, hurst=0.5, amplitudes="rayleigh")
    problem = Problem(profile, SOLID, 0.0034070872, Control(0.0))
    loop = loop_of(problem, max_stress=1243.6, load_steps=3)
    assert len(loop.jumps) == 7
    assert loop.races == 0
    assert asked == []


@pytest.mark.parametrize(
    ("profile", "gamma"),
    [
        (rough(3, 20, 11, hurst=0.5, period=1e-3), 0.03),  # a patch goes or stays
        (rough(2, 16, 25, period=1e-3), 0.01),  # contact is lost or stays on a crest
        (rough(2, 16, 2, period=1e-3), 0.1),  # a shallow minimum
        *((rough(5, 8, s, period=2e-3 * np.pi), g) for s, g in ((1, 0.02), (2, 0.1))),
    ],
)
def test_the_length_of_the_steps_does_not_decide_where_a_jump_ends(profile, gamma):
    def loss_with(share: float) -> float:
        method = SharpMethod(Problem(profile, SOLID, gamma))
        method.edges.law.longest_step *= share
        return run_loop(method, max_penetration=0.9, load_steps=20).loss

    losses = [loss_with(share) for share in (2.0, 1.0, 0.25)]
    assert losses == pytest.approx([losses[1]] * 3, rel=1e-5)


def jumps_on_loading(problem: Problem, accuracy: float, depth: float, stops: int):
    """Follow the loading branch alone, over equally spaced stops, and return its jumps."""
    method, h_max = SharpMethod(problem, accuracy=accuracy), problem.profile.h_max
    state, jumps = method.detached(h_max), []
    for penetration in np.linspace(0.0, depth, stops):
        path = method.follow(state, h_max * (1 - penetration))
        state = path.states[-1]
        jumps += path.jumps
    return jumps


def test_a_touch_and_a_fold_too_near_to_be_told_apart_are_a_race():
    """At a finer accuracy the fold comes first, and another loss: the coarser path states it."""
    profile = rough(14, 72, 468326, hurst=0.756, amplitudes="rayleigh")
    problem = Problem(profile, SOLID, work_of_adhesion=0.04262480422968221)
    coarse, fine = (jumps_on_loading(problem, a, 0.892824341, 24) for a in (1e-3, 2e-4))
    raced = max(coarse, key=lambda jump: jump.at_stake)
    assert raced.raced
    same = min(fine, key=lambda jump: abs(jump.separation - raced.separation))
    assert raced.separation == pytest.approx(same.separation, abs=1e-5 * profile.h_max)
    # the two ways differ by that, at the same separation
    assert same.energy_drop - raced.energy_drop == pytest.approx(raced.at_stake, rel=0.05)


@pytest.mark.parametrize(
    ("hurst", "n0", "ratio", "seed", "adhesion", "depth", "load_steps"),
    [
        (0.815, 8, 46, 849858, 0.3660918153358999, 0.8667227826221429, 31),
        (0.813, 12, 44, 538639, 0.9431944887625059, 0.7226418526188358, 33),
    ],
    ids=["which of two folds is first", "whether there is a minimum on the way"],
)
def test_what_the_error_of_the_field_decides_is_a_race(
    hurst, n0, ratio, seed, adhesion, depth, load_steps
):
    """At a finer accuracy a jump ends elsewhere, with another loss: the coarser loop says so."""
    profile = rough(n0, ratio, seed, hurst=hurst, amplitudes="rayleigh")
    problem = Problem(profile, SOLID, adhesion * SOLID.modulus * 1e-12 * profile.q0 * n0)
    coarse, fine = loops_at(problem, 1e-3, 1e-4, max_penetration=depth, load_steps=load_steps)
    assert abs(coarse.loss - fine.loss) > 3 * (coarse.loss_error + fine.loss_error)
    (raced,) = (jump for jump in coarse.jumps if jump.raced)
    same = min(fine.jumps, key=lambda jump: abs(jump.separation - raced.separation))
    assert raced.separation == pytest.approx(same.separation, abs=5e-5 * profile.h_max)
    # the drops differ by what is at stake
    apart = abs(same.energy_drop - raced.energy_drop)
    assert apart == pytest.approx(raced.at_stake, rel=0.05)


@pytest.mark.parametrize(("method", "ratio"), [(SharpMethod, 8), (GridMethod, 3)])
def test_nothing_races_where_the_rules_agree(method, ratio):
    profile = rough(5, ratio, 3, period=2e-3 * np.pi)
    result = run_loop(method(Problem(profile, SOLID, 0.02)), max_penetration=0.9, load_steps=9)
    assert len(result.jumps) > 5
    assert (result.races, result.energy_at_stake) == (0, 0)


def equal_waves(n0: int, seed: int, g: float, shift: float = 0.0) -> Problem:
    profile = rough(n0, 1, seed)
    gamma = g * SOLID.modulus * 1e-12 * profile.q0 * n0
    return Problem(profile.shifted(shift * 2e-3), SOLID, gamma)


def loss(problem: Problem, accuracy: float = 1e-3) -> float:
    path = {"max_penetration": 0.8, "load_steps": 10}
    return loop_of(problem, accuracy=accuracy, **path).loss_dimensionless


def five_equal_parts(shift: float) -> Problem:
    a = np.zeros(21, complex)
    a[5:21:5] = np.arange(1, 5) ** -1.5 * np.exp(1j * np.array([0.0, 2.1, -1.3, 0.7]))
    profile = Profile(2e-3, a)
    profile = profile.scaled(1e-6 / profile.h_rms)
    gamma = 0.02 * SOLID.modulus * 1e-12 * profile.q0 * 5
    return Problem(profile.shifted(shift * 2e-3), SOLID, gamma)


@pytest.mark.parametrize(
    ("problem_at", "where", "near"),
    [
        # the sign of the mode that has softened at a fold decided: 1 and 2 % of the loss
        (partial(equal_waves, 5, 189692, 0.0227), [(0.0, 1e-5), (0.1234, 1e-3)], 1e-4),
        (partial(equal_waves, 9, 53930, 0.0119), [(0.1234, 1e-3), (0.37, 1e-3)], 1e-4),
        # where they touch, and at a fold, the error of the field parted them: 1 % of the loss
        (five_equal_parts, [(0.0, 1e-3), (0.37, 1e-3), (0.0, 1e-4)], 2e-4),
    ],
)
def test_equal_parts_are_left_alike_at_every_accuracy_and_wherever_they_lie(
    problem_at, where, near
):
    losses = [loss(problem_at(shift), accuracy) for shift, accuracy in where]
    assert losses == pytest.approx([losses[-1]] * len(where), rel=near)


def parts_alike(count: int, waves: list[float], gamma: float) -> Problem:
    a = np.zeros(count * len(waves) + 1, complex)
    a[count::count] = waves
    return Problem(Profile(2e-3 * np.pi, a), SOLID, gamma)


def test_edges_that_race_to_one_minimum_are_no_race():
    """In three of these seven jumps the other end is the same but for the field's error."""
    waves = [6.634e-6, 5.035e-6, -1.749e-7, 1.316e-6, 7.82e-8, 3.573e-7]
    problem = parts_alike(3, waves, 0.0057)
    loop = loop_of(problem, accuracy=3e-3, max_penetration=0.99999, load_steps=20)
    assert (loop.races, loop.energy_at_stake) == (4, 0)


@pytest.mark.parametrize(
    ("waves", "gamma", "turn", "load_steps", "accuracies", "most"),
    [
        # where Newton's iteration found no minimum one of two edges was moved on: 8 % of the loss
        ([1.122e-7, -2.432e-8, 7.455e-9], 1.0588e-5, 0.99999, 40, (1e-3, 4e-3, 5e-3), 10),
        # rests taken for minima at once made two to five jumps more; never taken, none was found
        (
            [2.387e-7, -4.39e-8, -4.86e-9, 7.34e-8, 5.52e-8, 5.57e-8],
            1.88e-5,
            0.9,
            10,
            (1e-3, 2e-3, 5e-3),
            14,
        ),
    ],
)
def test_two_equal_parts_that_rest_beside_a_fold_go_on_alike_at_every_accuracy(
    waves, gamma, turn, load_steps, accuracies, most
):
    path = {"max_penetration": turn, "load_steps": load_steps}
    problem = parts_alike(2, waves, gamma)
    fine, *coarse = loops_at(problem, *accuracies, **path)
    for loop in coarse:
        assert len(loop.jumps) <= most
        assert abs(loop.loss - fine.loss) < loop.loss_error + fine.loss_error


def test_a_mode_that_has_softened_is_left_like_one_that_is_unstable():
    """At a fold the error of the field decides the sign of its stiffness."""
    soft = np.array([1.0, -1.0]) / np.sqrt(2)
    order, limit = np.arange(2.0), np.full(2, 0.1)

    def step(stiffness: float, balanced: float) -> np.ndarray | None:
        return leaving_step(
            np.eye(2) - (1 - stiffness) * np.outer(soft, soft), limit, order, balanced
        )

    assert step(1e-6, 0.0) is None
    assert step(1e-2, 1e-3) is None
    np.testing.assert_allclose(step(1e-6, 1e-3), step(-1e-6, 0.0), atol=1e-12)
    # the leading edge is ahead
    np.testing.assert_allclose(step(-1e-6, 0.0), [0.1, -0.1 / 1.001], atol=1e-12)


def test_grid_leaves_equal_crests_as_sharp_does_and_a_coarse_one_tells_what_it_misses():
    """128 nodes: 4 in the first equilibrium width, and the loss is a quarter off."""
    problem = equal_waves(4, 499277, 0.00879)
    path = {"max_penetration": 0.8, "load_steps": 10}
    sharp = loop_of(problem, **path)
    coarse, fine = (run_loop(grid_of(problem, nodes=nodes), **path) for nodes in (128, 2048))
    # all touch together; apart they are unstable before all could leave together: one leads
    steps = [(jump.patches_before, jump.patches_after) for jump in sharp.jumps]
    assert (steps[0], steps[-1]) == ((0, 4), (1, 0))
    assert [(jump.patches_before, jump.patches_after) for jump in fine.jumps] == steps
    exact = sharp.loss_dimensionless
    assert fine.loss_dimensionless == pytest.approx(exact, rel=5e-3)
    reported = coarse.loss_error / coarse.loss
    assert abs(coarse.loss_dimensionless / exact - 1) < reported < 0.5
    assert any("numerical error of the loss" in text for text in coarse.warnings)
