"""A task is a pure function: its row repeats to the bit and follows from the loop."""

from dataclasses import replace

import numpy as np
import pytest

from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.campaign.tasks import Part
from adhesis.ensemble.results.layout import Source, create
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DATASETS, DONE, PENDING
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.task.compute import Runner, make_problem
from adhesis.ensemble.task.dataset import KEPT, row_shape, sizes_of
from adhesis.ensemble.task.doubt import doubtful
from adhesis.ensemble.task.fields import GAP_EDGES, HEIGHT_EDGES, FieldPlan, field_row, field_scales
from adhesis.ensemble.task.row import RESULT_DATASETS, row_of, row_scales
from adhesis.solver.loading.loop import run_loop
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.zero_range import InteriorTension
from adhesis.solver.method import PathError
from adhesis.solver.model.jump import JUMP_KINDS, Jump
from adhesis.solver.registry import make_method
from tests.support.campaign_support import campaign_text
from tests.support.fake_run import fake_result


def loop_of(campaign) -> LoopResult:
    """The loop of the first task, with a loss and drops of whole numbers."""
    method = make_method("grid", make_problem(campaign, campaign.tasks()[0]), nodes_per_wave=16)
    cycle = campaign.cycle
    loop = run_loop(method, max_penetration=cycle.max_penetration, load_steps=cycle.load_steps)
    return replace(loop, loss=2.0, loss_from_drops=1.5, loss_error=0.02)


def with_jumps(loop: LoopResult, count: int, **more) -> LoopResult:
    """A loop with so many jumps in place of its own, each between two states of unloading."""
    first = int(np.argmax(loop.branch == "unloading"))
    s, contact = loop.separation, loop.contact_fraction
    jumps = tuple(
        Jump(
            *("unloading", s[k], float(i % 5), JUMP_KINDS[i % len(JUMP_KINDS)]),
            *(2, 1, contact[k], contact[k + 1], 1e-5),
        )
        for i, k in enumerate(range(first, first + count))
    )
    return replace(loop, jumps=jumps, **more)


def loop_row(campaign, loop):
    return row_of(loop, sizes_of(row_scales(campaign)))


def test_curves_end_in_zeros_after_detachment():
    campaign = parse_campaign(campaign_text())
    loop = loop_of(campaign)
    row = loop_row(campaign, loop)
    for branch, axis in (
        ("loading", campaign.penetration["loading"]),
        ("unloading", campaign.penetration["unloading"]),
    ):
        stress, reached = row[f"{branch}_mean_stress"], loop.states(branch, load_steps_only=True)
        assert stress.shape == axis.shape
        np.testing.assert_array_equal(stress[: len(reached)], loop.mean_stress[reached])
        assert not stress[len(reached) :].any()
    assert loop.patches[reached[:-1]].all()
    assert len(reached) < len(axis)
    assert row["audit_residual"] == 0.25
    assert (row["loss_error"], row["races"], row["energy_at_stake"]) == (0.02, 0, 0.0)


def test_the_range_of_adhesion_is_in_the_row():
    campaign = parse_campaign(campaign_text())
    loop = loop_of(campaign)
    names = ("valid_range", "largest_interior_tension", "interior_tension_position")
    row = loop_row(campaign, replace(loop, interior=None))
    np.testing.assert_array_equal([row[name] for name in names], [np.inf, 0.0, np.nan])
    found = InteriorTension(2e5, 3e-4, "unloading", -0.5)
    row = loop_row(campaign, replace(loop, interior=found, narrowest_length=1e-6))
    gamma = loop.problem.work_of_adhesion
    assert [row[name] for name in names] == [gamma / 2e5, 2e5, 3e-4]
    assert row["interior_tension_penetration"] == -0.5
    assert row["edge_range"] > 0
    assert (row["opening_strength"], row["openings"]) == (np.inf, 0)
    opened = with_jumps(loop, 2, problem=replace(loop.problem, strength=1e12))
    openings = tuple(replace(jump, kind="opening") for jump in opened.jumps)
    opened = replace(opened, jumps=openings, narrowest_length=1e-6)
    row = loop_row(campaign, opened)
    assert (row["opening_strength"], row["openings"]) == (1e12, 2)
    assert row["zone_error"] == opened.zone_error > 0


def test_curves_are_cut_where_the_axis_ends():
    campaign = parse_campaign(campaign_text(unloading_until="-0.1"))
    row = loop_row(campaign, loop_of(campaign))
    assert row["unloading_patches"].shape == campaign.penetration["unloading"].shape
    assert row["unloading_patches"].all()


def test_the_catalogue_keeps_the_largest_drops_in_the_order_of_the_path():
    campaign = parse_campaign(campaign_text(load_steps="40"))
    loop = loop_of(campaign)
    few = loop_row(campaign, with_jumps(loop, 3))
    assert few["jump_count"] == 3
    np.testing.assert_array_equal(few["jump_kind"], [0, 1, 2, -1, -1, -1, -1, -1])
    assert np.isnan(few["jump_energy_drop"][3:]).all()
    several = with_jumps(loop, 20)
    many = loop_row(campaign, several)
    assert many["jump_count"] == 20
    drops = np.arange(20.0) % 5
    kept = np.sort(np.argsort(-drops, kind="stable")[:8])
    np.testing.assert_array_equal(many["jump_energy_drop"], drops[kept])
    places = [loop.problem.penetration(several.jumps[k].separation) for k in kept]
    np.testing.assert_array_equal(many["jump_penetration"], places)
    assert len(set(places)) == 8
    total = many["loss_small_scale"] + many["loss_large_scale"]
    assert total == drops.sum()


def test_a_task_on_further_axes_has_the_bits_of_a_campaign_of_its_values():
    axes = {"ratio": "[2, 4]", "poisson": "[0.3, 0.5]", "young": "[1e6, 2e6]"}
    several = parse_campaign(campaign_text(**axes))
    task = several.tasks()[-1]
    alone = parse_campaign(campaign_text(young="2e6"))
    one, two = Runner()(several, task), Runner()(alone, alone.tasks()[-1])
    for name in ("loss", "loss_from_drops", "loading_mean_stress", "jump_penetration", "h_max"):
        assert np.asarray(one[name]).tobytes() == np.asarray(two[name]).tobytes(), name
    coarse = several.tasks()[0]
    assert several.at(coarse).profile.ratio == 2
    small = Runner()(several, coarse)
    assert small["psd_height"].shape == one["psd_height"].shape


def sharp(turns: str):
    text = campaign_text(max_penetration=turns, load_steps="12", method='"sharp"')
    return parse_campaign(text.replace("nodes_per_wave = 16\n", ""))


TURNS = sharp("[0.3, 0.5, 0.6]")  # fields at thirds of 0.5 are between load steps of 0.6


def bits(row):
    return {
        k: np.asarray(v).tobytes() for k, v in row.items() if k not in ("wall_time", "cpu_time")
    }


def test_loops_that_share_a_loading_branch_do_not_depend_on_what_else_is_computed():
    """One alone, all in turn, some left out, out of order, after one that was given up."""
    campaign = TURNS
    tasks = campaign.sharing(campaign.tasks()[0])
    assert [campaign.at(task).cycle.max_penetration for task in tasks] == [0.3, 0.5, 0.6]
    alone = [bits(Runner()(campaign, task)) for task in tasks]
    together = Runner()
    assert [bits(together(campaign, task)) for task in tasks] == alone
    for order in ([0, 2], [2, 0, 1]):
        some = Runner()
        assert [bits(some(campaign, tasks[i])) for i in order] == [alone[i] for i in order]

    def give_up(branch, *_):
        if branch == "unloading":
            raise KeyboardInterrupt

    stopped = Runner()
    stopped(campaign, tasks[0])
    with pytest.raises(KeyboardInterrupt):
        stopped(campaign, tasks[1], give_up)
    assert bits(stopped(campaign, tasks[1])) == alone[1]
    other = campaign.sharing(campaign.tasks()[1])
    assert bits(stopped(campaign, other[2])) == bits(Runner()(campaign, other[2]))


def test_loops_that_share_a_loading_branch_are_those_of_campaigns_of_their_own():
    """Losses to the accuracy of jumps, curves and fields where the axes of a row have them."""
    campaign, runner = TURNS, Runner()
    for task in campaign.sharing(campaign.tasks()[0]):
        turn = campaign.at(task).cycle.max_penetration
        own = sharp(str(turn))
        one, two = runner(campaign, task), Runner()(own, own.tasks()[0])
        assert one["loss"] == pytest.approx(two["loss"], rel=1e-4)
        for name in ("loading_mean_stress", "unloading_mean_stress", "unloading_contact_fraction"):
            shared, separate = one[name], two[name]
            size = min(shared.size, separate.size)
            # between states of the shared branch a curve is a straight line
            np.testing.assert_allclose(
                shared[:size], separate[:size], atol=0.03 * np.abs(separate).max()
            )
        for name in ("psd_displacement", "gap_density"):
            kept, wanted = np.isfinite(one[name]), np.isfinite(two[name])
            np.testing.assert_array_equal(kept, wanted)
        assert one["field_gap"].shape == two["field_gap"].shape
        np.testing.assert_allclose(
            one["field_displacement"], two["field_displacement"], atol=2e-9, equal_nan=True
        )


def under_load(stress, **changes):
    text = campaign_text(work_of_adhesion="[0.002]", load_steps="8", **changes)
    text = text.replace("nodes_per_wave = 16\n", "").replace('"grid"', '"sharp"')
    return text.replace("max_penetration = 0.6", f'control = "load"\nmax_stress = {stress}')


def test_a_loop_under_a_load_is_that_of_the_library_on_axes_of_penetration():
    """A jump is a line at its load; nothing is reported beyond the turning point."""
    campaign = parse_campaign(under_load("300"))
    task = campaign.tasks()[0]
    row = Runner()(campaign, task)
    problem = make_problem(campaign, task)
    assert problem.control.is_load
    loop = run_loop(make_method("sharp", problem), max_stress=300.0, load_steps=8)
    assert row["loss"] == loop.loss
    sizes = sizes_of(row_scales(campaign))
    assert all(np.shape(row[d.name]) == row_shape(d, sizes) for d in RESULT_DATASETS)
    assert campaign.penetration["loading"][-1] == 1.0
    stress = row["loading_mean_stress"]
    beyond = campaign.penetration["loading"] > loop.max_penetration
    assert beyond.any()
    assert not beyond.all()
    np.testing.assert_array_equal(np.isnan(stress), beyond)
    assert (row["loading_patches"][beyond] == -1).all()
    assert np.nanmax(stress) <= 300.0
    assert np.all(np.diff(stress[~beyond]) >= -1e-6)  # the load does not fall on the way in
    assert np.nanmin(row["unloading_mean_stress"]) >= -loop.pull_off_stress
    assert not np.isnan(row["psd_displacement"][:, -1]).any()  # the state at max_stress is kept


def test_loads_share_a_loading_branch_and_what_runs_away_is_told():
    campaign = parse_campaign(under_load("[100, 300, 1e6]"))
    first, second, third = campaign.sharing(campaign.tasks()[0])
    runner = Runner()
    together = [bits(runner(campaign, task)) for task in (first, second)]
    assert together == [bits(Runner()(campaign, task)) for task in (first, second)]
    with pytest.raises(PathError, match=r"full contact before a mean stress of .* Pa"):
        runner(campaign, third)


def test_the_time_of_a_shared_loading_branch_counts_once(monkeypatch):
    clock = iter(range(1000))
    process_time = "adhesis.ensemble.task.compute.time.process_time"
    monkeypatch.setattr(process_time, lambda: float(next(clock)))
    campaign, runner = TURNS, Runner()
    rows = [runner(campaign, task) for task in campaign.sharing(campaign.tasks()[0])]
    assert [row["cpu_time"] for row in rows] == [1.0, 1.0, 1.0]
    assert next(clock) == 6


def test_a_part_has_whole_loading_branches():
    campaign = TURNS
    parts = [Part(k, 3) for k in (1, 2, 3)]
    rows = [campaign.rows(part).tolist() for part in parts]
    assert sorted(row for part in rows for row in part) == list(range(campaign.task_count))
    tasks = campaign.tasks()
    keys = [{campaign.branch_of(tasks[row]) for row in part} for part in rows]
    assert sum(map(len, keys)) == len(set().union(*keys))
    assert {len(part) for part in rows} <= {6, 9}
    assert list(campaign.tasks(parts[0])) == [tasks[row] for row in rows[0]]


def test_a_real_task_repeats_to_the_bit_and_has_the_shape_of_its_row():
    campaign = parse_campaign(campaign_text())
    task = campaign.tasks()[0]
    steps = []
    one = Runner()(campaign, task, lambda *step: steps.append(step[:2]))
    two = Runner()(campaign, task)
    sizes = sizes_of(row_scales(campaign))
    assert one.keys() == {d.name for d in RESULT_DATASETS}  # realisation 0 keeps its fields
    for dataset in RESULT_DATASETS:
        value = np.asarray(one[dataset.name], dataset.dtype)
        assert value.shape == row_shape(dataset, sizes)
        if dataset.name not in ("wall_time", "cpu_time"):
            again = np.asarray(two[dataset.name], dataset.dtype)
            assert value.tobytes() == again.tobytes(), dataset.name
    later = Runner()(campaign, campaign.tasks()[1])
    assert later.keys() == {d.name for d in RESULT_DATASETS if d.dims[0] != KEPT}
    assert len(steps) > campaign.cycle.load_steps
    assert one["loss"] > 0
    split = one["loss_small_scale"] + one["loss_large_scale"]
    assert split == pytest.approx(one["loss_from_drops"])


def test_a_loss_is_doubtful_where_it_misses_the_accuracy_asked_for():
    """The estimated error is calibrated (docs/methods.md), so it is held against it as it is."""
    values = {
        "loss": [-1, -1, -1, -1, np.nan, -1, -1, -1],
        "audit_residual": [0, 0, 2e-3, -2e-3, 0, np.nan, 0, 0],
        "loss_error": [9e-4, 1.1e-3, 0, 0, 0, 0, np.nan, np.inf],
    }
    flags = doubtful(values | {"work_of_adhesion": 0.01}, 1e-3)
    assert flags.tolist() == [False, *7 * [True]]
    without = doubtful(values | {"work_of_adhesion": 0.0}, 1e-3)  # nothing is lost
    assert without.tolist() == [bool(np.isnan(loss)) for loss in values["loss"]]


KEPT_COLUMNS = [column.name for column in DATASETS if column.dims[0] == KEPT]


def campaign_with(output: str = "", **changes: str):
    return parse_campaign(campaign_text(**changes) + output)


def test_every_harmonic_below_the_last_node_lies_in_one_bin():
    plan = FieldPlan(campaign_with(ratio="100"))
    edges = plan.harmonic_edges
    assert edges[0] == 1
    assert edges[-1] == plan.nodes // 2
    assert (np.diff(edges) >= 1).all()
    q0 = 2 * np.pi / plan.period
    inside = (edges[:-1] * q0 <= plan.wave_number) & (plan.wave_number <= (edges[1:] - 1) * q0)
    np.testing.assert_array_equal(inside | np.isclose(plan.wave_number, edges[:-1] * q0), True)
    assert plan.nodes >= 8 * 100


def test_the_spectral_density_holds_the_mean_square_and_the_slope_of_the_profile():
    campaign = campaign_with(ratio="200")
    plan = FieldPlan(campaign)
    task = campaign.tasks()[-1]
    profile = make_problem(campaign, task).profile
    density = plan.spectral_density(profile.heights(plan.nodes))
    width = np.diff(plan.harmonic_edges) * profile.q0
    assert 2 * np.sum(density * width) == pytest.approx(profile.m0, rel=1e-12)
    present = (plan.wave_number > 10 * profile.q0) & (plan.wave_number < 150 * profile.q0)
    slope = np.polyfit(np.log(plan.wave_number[present]), np.log(density[present]), 1)[0]
    assert slope == pytest.approx(-(2 * task.hurst + 1), abs=0.02)


def test_positions_have_units_of_a_period_that_has_several_values_and_bins_are_of_the_task():
    for period, units in (("1e-3", {"rad m-1", "m"}), ("[1e-3, 2e-3]", {"1"})):
        scales = field_scales(FieldPlan(campaign_with(period=period)))
        assert {s.unit for s in scales if s.name in ("wave_number", "field_position")} == units
    campaign = campaign_with(ratio="[4, 40]")
    low, high = (FieldPlan(campaign, task) for task in list(campaign.tasks().of_cells())[:2])
    assert np.sum(low.filled) < np.sum(high.filled)
    np.testing.assert_array_equal(low.harmonic_edges, high.harmonic_edges)


def test_penetrations_move_to_load_steps():
    plan = FieldPlan(campaign_with("field_penetrations = [0.29, -1.0, 0.31]\n"))
    np.testing.assert_allclose(plan.penetration, [-1.05, 0.3], atol=1e-12)
    assert FieldPlan(campaign_with()).penetration.size == 3


def test_reductions_agree_with_the_states_of_the_loop():
    campaign = campaign_with("field_nodes = 16\n", nodes_per_wave="64")
    plan, task = FieldPlan(campaign), campaign.tasks()[0]
    method = make_method("grid", make_problem(campaign, task), nodes_per_wave=64)
    cycle = campaign.cycle
    loop = run_loop(method, max_penetration=cycle.max_penetration, load_steps=cycle.load_steps)
    wanted = {}
    for branch, state in zip(loop.branch, loop.contact_states, strict=True):
        for k, s in enumerate(map(method.problem.separation, plan.penetration)):
            if abs(state.separation - s) < 1e-12 * s:
                wanted[int(branch == "unloading"), k] = state
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


def test_only_first_realisations_keep_fields_through_redo_and_growth(tmp_path):
    path = tmp_path / "r.h5"
    campaign = campaign_with("field_realisations = 2\n", realisations="3")
    results = {task: fake_result(campaign, task) for task in campaign.tasks()}
    create(path, campaign)
    with Writer(path) as writer:
        for row, task in enumerate(campaign.tasks()):
            writer.write_result(row, results[task])
        writer.mark([1], PENDING)
    larger = campaign_with(
        "field_realisations = 2\n", realisations="4", work_of_adhesion="[0.01, 0.02, 0.04]"
    )
    with Results(path) as old:
        create(path, larger, sources=[Source(old, larger, old.status() == DONE)])
    with Results(path) as grown:
        tasks = [grown.tasks[row] for row in grown.column(KEPT)]
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
