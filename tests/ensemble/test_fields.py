"""Fields of chosen states: bins, densities, and the rows that only some tasks have."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.results.layout import create
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DATASETS
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.task.compute import Runner, make_problem
from adhesis.ensemble.task.dataset import KEPT
from adhesis.ensemble.task.fields import GAP_EDGES, HEIGHT_EDGES, field_plan, field_row
from adhesis.solver.loading.loop import run_loop
from adhesis.solver.registry import make_method
from tests.support.campaign_support import campaign_text
from tests.support.fake_run import fake_result

KEPT_COLUMNS = [column.name for column in DATASETS if column.dims[0] == KEPT]


def campaign_with(output: str = "", **changes: str):
    return parse_campaign(campaign_text(**changes) + output)


def test_every_harmonic_below_the_last_node_lies_in_one_bin():
    plan = field_plan(campaign_with(ratio="100"))
    edges = plan.harmonic_edges
    assert edges[0] == 1
    assert edges[-1] == plan.nodes // 2
    assert (np.diff(edges) >= 1).all()
    q0 = 2 * np.pi / plan.period
    inside = (edges[:-1] * q0 <= plan.wave_number) & (plan.wave_number <= (edges[1:] - 1) * q0)
    np.testing.assert_array_equal(inside | np.isclose(plan.wave_number, edges[:-1] * q0), True)
    assert plan.nodes >= 8 * plan.highest_harmonic


def test_the_spectral_density_holds_the_mean_square_and_the_slope_of_the_profile():
    campaign = campaign_with(ratio="200")
    plan = field_plan(campaign)
    task = campaign.tasks()[-1]
    profile = make_problem(campaign, task).profile
    density = plan.spectral_density(profile.heights(plan.nodes))
    width = np.diff(plan.harmonic_edges) * profile.q0
    assert 2 * np.sum(density * width) == pytest.approx(profile.m0, rel=1e-12)
    present = (plan.wave_number > 10 * profile.q0) & (plan.wave_number < 150 * profile.q0)
    slope = np.polyfit(np.log(plan.wave_number[present]), np.log(density[present]), 1)[0]
    assert slope == pytest.approx(-(2 * task.hurst + 1), abs=0.02)


def test_penetrations_move_to_load_steps():
    plan = field_plan(campaign_with("field_penetrations = [0.29, -1.0, 0.31]\n"))
    np.testing.assert_allclose(plan.penetration, [-1.05, 0.3], atol=1e-12)
    assert field_plan(campaign_with()).penetration.size == 3


def test_reductions_agree_with_the_states_of_the_loop():
    campaign = campaign_with("field_nodes = 16\n", nodes_per_wave="64")
    plan, task = field_plan(campaign), campaign.tasks()[0]
    method = make_method("grid", make_problem(campaign, task), nodes_per_wave=64)
    wanted = {}

    def on_state(branch, state):
        for k, penetration in enumerate(plan.penetration):
            s = method.problem.separation(penetration)
            if abs(state.separation - s) < 1e-12 * s:
                wanted[int(branch == "unloading"), k] = state

    loop = run_loop(
        method,
        max_penetration=campaign.cycle.max_penetration,
        load_steps=campaign.cycle.load_steps,
        on_state=on_state,
    )
    assert len(wanted) == 6
    row = field_row(plan, method, loop, keep=True)
    profile = method.problem.profile
    assert np.sum(row["height_density"] * np.diff(HEIGHT_EDGES)) == pytest.approx(1, rel=1e-6)
    for place, state in wanted.items():
        fields = method.fields(state, plan.nodes)
        density = row["gap_density"][place].astype(float)
        assert np.sum(density * np.diff(GAP_EDGES)) == pytest.approx(
            1 - state.contact_fraction, rel=1e-6
        )
        middle = np.sqrt(GAP_EDGES[:-1] * GAP_EDGES[1:]) * profile.h_max
        mean_gap = np.sum(density * np.diff(GAP_EDGES) * middle)
        assert mean_gap == pytest.approx(fields.gap.mean(), rel=0.05)
        expected = np.abs(np.fft.rfft(fields.displacement) / plan.nodes) ** 2 * plan.period
        assert row["psd_displacement"][place][0] == pytest.approx(expected[1] / (2 * np.pi))
        kept = row["field_gap"][place]
        assert kept.shape == (16,)
        np.testing.assert_array_equal(kept, fields.gap[:: plan.stride].astype(np.float32))


def test_states_without_contact_are_not_a_number():
    campaign = campaign_with("field_penetrations = [-2.5, -0.15, 0.45]\n")
    result = Runner()(campaign, campaign.tasks()[0])
    missing = np.isnan(result["gap_density"]).all(axis=-1)
    assert missing[0].tolist() == [True, True, False]  # loading starts at zero
    assert missing[1, 2] == False  # noqa: E712
    assert missing[1, 0] == (result["pull_off_penetration"] > -2.55)


def test_only_first_realisations_keep_fields_through_reset_and_growth(tmp_path):
    path = tmp_path / "r.h5"
    campaign = campaign_with("field_realisations = 2\n", realisations="3")
    results = {task: fake_result(campaign, task) for task in campaign.tasks()}
    create(path, campaign)
    with Writer(path) as writer:
        for row, task in enumerate(campaign.tasks()):
            writer.write_result(row, results[task])
        writer.reset([1])
    larger = campaign_with(
        "field_realisations = 2\n", realisations="4", work_of_adhesion="[0.01, 0.02, 0.04]"
    )
    with Results(path) as old:
        create(path, larger, grown_from=old)
    with Results(path) as grown:
        tasks = [grown.tasks()[row] for row in grown.column(KEPT)]
        assert [task.realisation for task in tasks] == [0, 1] * 6
        for name in KEPT_COLUMNS:
            for task, values in zip(tasks, grown.column(name), strict=True):
                if task not in results or task == campaign.tasks()[1]:
                    assert np.isnan(values).all()
                else:
                    assert values.tobytes() == results[task][name].tobytes()


def test_a_campaign_can_keep_no_fields_at_all(tmp_path):
    path = tmp_path / "r.h5"
    campaign = campaign_with("field_penetrations = []\nfield_realisations = 0\n")
    create(path, campaign)
    result = Runner()(campaign, campaign.tasks()[0])
    with Writer(path) as writer:
        writer.write_result(0, result)
    with Results(path) as results:
        assert results.column("psd_displacement").shape[2] == 0
        assert results.column(KEPT).size == 0
        np.testing.assert_array_equal(results.column("psd_height")[0], result["psd_height"])
