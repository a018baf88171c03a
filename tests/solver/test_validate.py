"""The validation itself: an exact method passes, a slightly wrong one fails; then the real ones."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import adhesis.solver.validate.claims as validation
import adhesis.solver.validate.judge as judging
from adhesis import ContactState, Problem
from adhesis.ensemble.command.main import main
from adhesis.solver.validate.claims import METHODS, Row, validate
from tests.support.exact_wave import ExactWave

WAVE_CLAIMS = tuple(
    claim
    for claim in validation.CLAIMS
    if claim.__name__ not in ("order", "full_contact", "audit")  # not one wave or grid
)
WITHOUT_CONTROLS = tuple(claim for claim in WAVE_CLAIMS if claim is not validation.controls)


@pytest.fixture
def judged(monkeypatch):
    """Judge a method in the place of ``sharp``, held to its promises, on the single wave."""

    def judge(method, claims=WAVE_CLAIMS) -> dict[str, Row]:
        monkeypatch.setattr(judging, "make_method", lambda name, problem, **_: method(problem))
        monkeypatch.setattr(validation, "CLAIMS", claims)
        return {row.claim: row for row in validate(("sharp",))}

    return judge


def exact(problem: Problem) -> ExactWave:
    return ExactWave(problem, states_per_step=64)  # 1e-5 of the loop integral


def failed(rows: dict[str, Row]) -> str:
    return " | ".join(claim for claim, row in rows.items() if not row.passed)


def test_the_exact_method_keeps_every_bound_of_the_wave(judged):
    rows = judged(exact)
    assert failed(rows) == ""
    assert len(rows) > 20
    drops = [row for claim, row in rows.items() if "sum of drops" in claim]
    assert len(drops) == 11  # seven α, and four controls
    assert max(row.error for row in drops) < 1e-9  # the difference of the measures: 3e-11
    # the bound of the parabola is the difference of the closed forms, and no loose one
    parabola = [row for claim, row in rows.items() if "parabola" in claim]
    assert parabola
    assert all(row.error > 0.5 * row.bound for row in parabola)


def wrong(change: Callable[[ExactWave, ContactState], dict[str, float]]) -> type[ExactWave]:
    """Make a method that is exact but for some values of its states of contact."""

    class Wrong(ExactWave):
        def _state_of(self, *values: float) -> ContactState:
            state = super()._state_of(*values)
            return replace(state, **change(self, state)) if state.patches else state

    return Wrong


def edges_too_far_out(method: ExactWave, state: ContactState) -> dict[str, float]:
    return {"contact_fraction": state.contact_fraction + 2e-4}


def energy_missing(method: ExactWave, state: ContactState) -> dict[str, float]:
    missing = 1e-3 * method.wave.period * method.problem.work_of_adhesion
    return {"elastic_energy": state.elastic_energy - missing}


def too_tense(method: ExactWave, state: ContactState) -> dict[str, float]:
    return {"mean_stress": 1.001 * state.mean_stress}


def stickier(problem: Problem) -> ExactWave:
    return exact(replace(problem, work_of_adhesion=1.001 * problem.work_of_adhesion))


def stiffer(problem: Problem) -> ExactWave:
    young = 1.001 * problem.half_space.young
    return exact(replace(problem, half_space=replace(problem.half_space, young=young)))


@pytest.mark.parametrize(
    ("method", "caught"),
    [
        (
            wrong(edges_too_far_out),
            ("Johnson, all α: half-width", "Westergaard: half-width", "punch", "parabola"),
        ),
        (wrong(energy_missing), ("Johnson, all α: energy",)),
        (wrong(too_tense), ("Johnson, all α: mean stress", "Westergaard: mean stress", "punch")),
        (stickier, ("α = 0.05, sum", "α = 0.6, sum", "mean stress / p*", "s_out", "punch")),
        (stiffer, ("α = 0.05, sum", "α = 0.6, sum", "Westergaard: highest stress")),
    ],
)
def test_a_slightly_wrong_method_is_caught_where_it_is_wrong(method, caught, judged, monkeypatch):
    monkeypatch.setattr(validation, "ALPHAS", (0.05, 0.6))
    text = failed(judged(method, WITHOUT_CONTROLS))
    for part in caught:
        assert part in text


def test_a_method_that_gives_up_is_a_failed_claim_and_the_rest_goes_on(judged):
    class GivesUp(ExactWave):
        def follow(self, state, separation):
            if self.wave.work_of_adhesion == 0:
                raise RuntimeError("edges still move")
            return super().follow(state, separation)

    rows = judged(lambda problem: GivesUp(problem, states_per_step=64), WITHOUT_CONTROLS)
    (claim,) = [claim for claim, row in rows.items() if not row.passed]
    assert claim == "Contact without adhesion against Westergaard"
    assert rows[claim].note == "did not finish: edges still move"
    assert len(rows) > 20


def test_a_method_without_any_contact_does_not_pass_for_want_of_states(judged):
    class Detached(ExactWave):
        def follow(self, state, separation):
            path = super().follow(self.detached(2 * self.wave.amplitude), 3 * self.wave.amplitude)
            return replace(path, states=(self.detached(separation),))

    rows = judged(Detached, claims=(validation.punch, validation.parabola))
    assert rows
    assert not any(row.passed for row in rows.values())


def test_order_of_convergence_is_measured_from_the_losses(monkeypatch):
    """A method whose losses are off by exactly 1/n has order 1; by n^-½, order ½."""

    def of_order(power):
        class Coarse(ExactWave):
            nodes = 4096

            def follow(self, state, separation):
                path = super().follow(state, separation)
                excess = 1 + 0.1 * self.nodes**-power
                jumps = tuple(replace(j, energy_drop=excess * j.energy_drop) for j in path.jumps)
                return replace(path, jumps=jumps)

        def make(name, problem, *, accuracy, nodes_per_wave):
            method = Coarse(problem, states_per_step=2)
            method.nodes = nodes_per_wave
            return method

        monkeypatch.setattr(judging, "make_method", make)
        monkeypatch.setattr(validation, "ALPHAS", (0.05, 0.6))
        (row,) = validation.order(judging.Judge("grid"))
        return row

    first, half = of_order(1.0), of_order(0.5)
    assert first.error == pytest.approx(0.0, abs=1e-3)
    assert first.note.startswith("order 1.00")
    assert half.error == pytest.approx(0.5, abs=1e-3)
    assert first.passed
    assert not half.passed


def test_the_command_prints_error_against_bound_and_fails_with_one(monkeypatch, capsys):
    good = Row("loss", "grid", "64 nodes", 1e-4, 5e-3)
    bad = Row("width", "grid", "64 nodes", 1e-2, 5e-3, "note")
    lost = Row("punch", "grid", "64 nodes", float("nan"), float("nan"), "did not finish")
    for rows, code in (([good], 0), ([good, bad], 1), ([lost], 1)):

        def judged(names, on_row, rows=rows):
            for row in rows:
                on_row(row)
            return rows

        monkeypatch.setattr(validation, "validate", judged)
        assert main(["validate", "--method", "grid"]) == code
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) == len(rows) + 1
        assert lines[-1] == f"{sum(r.passed for r in rows)} of {len(rows)} claims hold"
        assert main(["validate", "--method", "grid", "--json"]) == code
        records = json.loads(capsys.readouterr().out)
        assert [record["passed"] for record in records] == [row.passed for row in rows]
    assert records[0]["error"] is None


@pytest.mark.parametrize("name", METHODS)
def test_every_claim_about_the_method_holds(name, capsys, request, monkeypatch):
    """The whole of ``adhesis validate``; without --slow a part of the long claims.

    On a grid of a quarter as many nodes, whose edges are known a quarter as well. Other α are in
    test_sharp_path.py, controls in test_control_loops.py, audits of rough loops in test_extremes.py
    and test_hostile.py.
    """
    alphas = validation.ALPHAS
    if not request.config.getoption("--slow"):
        alphas = (0.05, 0.6)
        monkeypatch.setattr(validation, "ALPHAS", alphas)
        monkeypatch.setattr(validation, "GRIDS", judging.GRIDS[:-2])
        nodes, standard = judging.GRIDS[-3], judging.STANDARDS["grid"]
        coarser = replace(standard, nodes=nodes, edge=1 / nodes)
        monkeypatch.setitem(judging.STANDARDS, "grid", coarser)
        elsewhere = (validation.controls, validation.audit)
        kept = tuple(claim for claim in validation.CLAIMS if claim not in elsewhere)
        monkeypatch.setattr(validation, "CLAIMS", kept)
    code = main(["validate", "--method", name, "--json"])
    records = json.loads(capsys.readouterr().out)
    assert [r["claim"] for r in records if not r["passed"]] == []
    assert code == 0
    losses = [
        r["error"] for r in records if r["claim"].startswith("loss of") and "drops" in r["claim"]
    ]
    assert len(losses) == len(alphas)
    assert np.max(losses) < {"grid": 5e-3, "sharp": 1e-8}[name]
