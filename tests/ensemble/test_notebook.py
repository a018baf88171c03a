"""Results as a notebook's user handles them: shown, as tables, saved, copied, with a bar."""

import asyncio
import copy
import html
import io
import json
import multiprocessing
import pickle
import re
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from functools import reduce
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import adhesis
from adhesis import (
    Control,
    HalfSpace,
    InputError,
    LoopResult,
    PathResult,
    Problem,
    run_loop,
    run_loops,
    run_path,
    self_affine_profile,
    single_wave,
)
from adhesis.ensemble.aggregate.status import as_text, read_status
from adhesis.ensemble.quantities import with_error
from adhesis.ensemble.report import findings
from adhesis.ensemble.results.schema import DONE
from adhesis.ensemble.task.compute import Runner
from adhesis.ensemble.trace.prepare import prepare_trace
from adhesis.ensemble.trace.reading.measured_trace import Trace
from adhesis.solver import checks
from tests.support.campaign_support import campaign_text
from tests.support.exact_wave import ExactWave
from tests.support.wrong_values import FloatWithUnit, WithUnit

WAVE = single_wave(1e-6, 1e-3)


def wave_method(control: Control | None = None) -> ExactWave:
    problem = Problem(WAVE, HalfSpace(1e6, 0.5), 1e-3, control or Control())
    return ExactWave(problem, states_per_step=4)


HALF: dict[str, Any] = {"max_penetration": 0.5, "load_steps": 4}
LOOPS: dict[str, Callable[[], LoopResult | PathResult]] = {
    "loop": lambda: run_loop(wave_method(), **HALF),
    "under a stiffness": lambda: run_loop(wave_method(Control(1e9)), **HALF),
    "under a load": lambda: run_loop(wave_method(Control(0.0)), max_stress=400.0, load_steps=4),
    "without adhesion": lambda: run_loop(
        ExactWave(replace(wave_method().problem, work_of_adhesion=0.0)), **HALF
    ),
    "to a preload": lambda: run_loop(wave_method(), preload=500.0, load_steps=4),
    "flat": lambda: run_loop(ExactWave(replace(wave_method().problem, measure="flat")), **HALF),
    "path": lambda: run_path(wave_method(), [0.5, 0.2, 0.6], load_steps=4),
    "path under a load": lambda: run_path(wave_method(Control(0.0)), [400, 150, 300], load_steps=4),
}


@pytest.fixture(scope="module", params=LOOPS)
def result(request: pytest.FixtureRequest) -> LoopResult | PathResult:
    return LOOPS[request.param]()


def check_short_repr(*objects: Any) -> None:
    shapes = (LoopResult, PathResult, adhesis.Profile, Problem, adhesis.Fields, adhesis.Opening)
    for thing in objects:
        assert len(repr(thing)) < 800, type(thing)
        assert " at 0x" not in repr(thing)
        if type(thing).__module__.startswith("adhesis"):
            page = thing._repr_html_()
            assert page.startswith(("<table><tr><th>", "<iframe")), type(thing)
            assert ("data:image/png;base64," in page) == isinstance(thing, shapes), type(thing)


@pytest.mark.parametrize("result", ["loop", "path"], indirect=True)
def test_every_object_of_a_result_has_a_short_repr(result):
    method = wave_method()
    state = result.contact_states[3]
    check_short_repr(
        *(result, result.jumps, state, method.fields(state, 64), *method.openings(state)),
        *(*result.jumps[:1], *getattr(result, "minor_loops", ()), result.film(frames=2)),
    )
    assert len(repr(result.method)) < 800
    assert " at 0x" not in repr(result.method)


def test_every_object_without_a_result_has_a_short_repr():
    method = wave_method()
    check_short_repr(
        *(method, method.recipe, WAVE, method.problem, method.problem.half_space, Control()),
        method.follow(method.detached(1e-6), 0.9e-6),
    )


@pytest.mark.parametrize("result", ["to a preload", "under a load", "path"], indirect=True)
def test_a_notebook_shows_the_main_numbers_and_the_figure(result):
    page = result._repr_html_()
    value = result.work if isinstance(result, PathResult) else result.loss
    assert f"{value:.6g}" in html.unescape(page)
    assert "data:image/png;base64," in page
    assert len(page) < 200_000
    figure = result.plot()
    assert isinstance(figure, Figure)
    assert [axes.get_xlabel() for axes in figure.axes] == [r"penetration $\Delta/h_{\max}$"] * 2


def test_tables_dataset_and_numbers_hold_every_state_and_jump_with_units(result):
    states, jumps, data = result.to_dataframe(), result.to_dataframe("jumps"), result.to_xarray()
    numbers, columns, rows = result.numbers(), result.columns(), result.jump_rows()
    length = len(result.separation)
    assert {len(states), data.sizes["state"], *map(len, columns.values())} == {length}
    for name in ("mean_stress", "energy"):
        assert states[name].to_numpy() == pytest.approx(getattr(result, name), abs=0)
    drops = [jump.energy_drop for jump in result.jumps]
    assert jumps.energy_drop.tolist() == [row["energy_drop"] for row in rows] == drops
    assert sum(drops) == pytest.approx(result.loss_from_drops)
    assert [row["penetration"] for row in rows] == [
        pytest.approx(1 - jump.separation / WAVE.h_max, abs=1e-12) for jump in result.jumps
    ]
    for table in (states, jumps):
        assert set(table.attrs["units"]) == set(table.columns)
    units = {**states.attrs["units"], **jumps.attrs["units"]}
    assert (units["mean_stress"], units["separation"], units["energy_drop"]) == ("Pa", "m", "J/m²")
    assert all("units" in data[name].attrs for name in data.data_vars)
    assert (data.mean_stress.units, data.jump_energy_drop.units) == ("Pa", "J/m²")
    for name in ("loss", "loss_error", "loss_from_drops"):
        assert numbers[name] == getattr(result, name)
    assert data.attrs["loss_from_drops"] == result.loss_from_drops
    assert (numbers["young"], data.attrs["young"], numbers["races"]) == (1e6, 1e6, 0)
    stiffness = result.problem.control.stiffness
    if isinstance(result, PathResult):
        assert data.minor_start.units == data.minor_turn.units == ("1" if stiffness else "Pa")
    assert numbers["stiffness"] == (stiffness if np.isfinite(stiffness) else None)
    assert json.loads(json.dumps(numbers, allow_nan=False)) == numbers


def test_what_was_saved_is_loaded_as_it_was(result, tmp_path):
    file = tmp_path / "result.nc"
    result.save(file)
    found = adhesis.load(file)
    assert found == result
    assert hash(found) == hash(result)
    assert repr(found) == repr(result)
    assert found.audit_residual == result.audit_residual
    assert found.method.states_per_step == result.method.states_per_step
    assert found.seconds == result.seconds
    assert found.plot().axes
    assert found == pickle.loads(pickle.dumps(found))
    with pytest.raises(ValueError, match="read from a file"):
        found.film()


def same(thing: Any) -> Any:
    return thing


def test_results_are_sent_to_spawned_processes():
    results = [make() for make in LOOPS.values()]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        trace = Trace(WAVE.heights(64), 1e-5)
        things = [*results, trace, WAVE, wave_method().problem, results[0].contact_states[3]]
        assert pool.map(same, things) == things
        method = wave_method()
        loop = pool.apply(run_loop, (method,), HALF)
    assert loop == results[0]


@pytest.mark.parametrize(
    "run",
    [
        lambda **more: run_loop(wave_method(), **HALF, **more),
        lambda **more: run_loops(wave_method(), max_penetration=[0.3, 0.5], load_steps=4, **more),
        lambda **more: run_path(wave_method(), [0.5, 0.2, 0.6], load_steps=4, **more),
    ],
    ids=["run_loop", "run_loops", "run_path"],
)
def test_a_bar_on_stderr_follows_the_path_and_changes_nothing(run, capsys):
    silent = run()
    assert run(progress=False) == silent
    assert capsys.readouterr() == ("", "")
    assert run(progress=True) == silent
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "unloading" in shown.err
    assert "0 patches" in shown.err


def test_a_bar_under_a_weight_has_a_unit(capsys):
    run_loop(wave_method(Control(0.0)), max_stress=800.0, load_steps=4, progress=True)
    assert re.search(r"unloading +p̄ -?[\d.]+ k?Pa of 800 Pa", capsys.readouterr().err)


@pytest.mark.parametrize("thing", [HalfSpace(1e6, 0.5), wave_method()], ids=["solid", "method"])
def test_numbers_are_shown_with_their_units(thing):
    shown = html.unescape(thing._repr_html_())
    expected = {"young": "1e+06 Pa", "modulus": "1.33333e+06 Pa", "name": "exact wave"}
    for name, value in expected.items():
        if hasattr(thing, name):
            assert f"<th>{name}</th><td>{value}</td>" in shown


def test_a_film_shows_a_bar_and_is_the_same(capsys):
    loop = LOOPS["loop"]()
    assert loop.film(frames=3, progress=True).page == loop.film(frames=3, progress=False).page
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "frames" in shown.err


@pytest.mark.usefixtures("quick_figures")
def test_a_trace_shows_its_progress_and_its_answer_is_shown_by_a_notebook(capsys, tmp_path):
    step = 1e-3 / 400
    x = step * np.arange(400)
    profile = self_affine_profile(0.8, period=1e-3, n0=2, ratio=4, seed=2, h_rms=1e-6)
    prepared = prepare_trace(Trace(profile.at(x), step, "t.txt"))
    seen = []
    answer = adhesis.loss_of_trace(
        *(prepared,),
        half_space=HalfSpace(1e6, 0.5),
        work_of_adhesion=0.02,
        load_steps=3,
        quick=True,
        processes=0,
        progress=True,
        watch=lambda pool: seen.append(len(pool.done)),
    )
    runs = len(answer.plan.runs)
    assert seen[-1] == runs
    assert f"{runs} of {runs} loops" in capsys.readouterr().err
    page = answer._repr_html_()
    assert "<th>loss</th>" in page
    assert "data:image/png;base64," in page
    assert pickle.loads(pickle.dumps(answer)) == answer
    assert copy.deepcopy(answer) == answer
    for thing in (answer, prepared, prepared.trace):
        assert len(repr(thing)) < 200
        assert "data:image/png;base64," in thing._repr_html_()
    known = with_error(1e3 * answer.loss.value, 1e3 * answer.loss.uncertainty)
    assert str(answer).startswith(f"loss        {known} mJ/m²")
    table = answer.to_dataframe()
    assert table.loss[0] == answer.loss.value
    assert len(table) == runs
    assert table.description[0] == "the loop"
    assert not [name for name in table.columns if "warnings" in name or name == "failed"]
    assert table.attrs["units"]["loss"] == "J/m²"
    path = answer.page(tmp_path / "new" / "folder")
    assert path == tmp_path / "new" / "folder" / "trace.html"
    made = {file.name for file in path.parent.iterdir()}
    assert made >= {"trace.html", "trace.md", "trace.json", "trace.png", "loop.png"}
    assert json.loads((path.parent / "trace.json").read_text())["loss"]["value"] == table.loss[0]
    with pytest.raises(TypeError, match="folder is 3"):
        answer.page(3)


TABLES: dict[str, Any] = {
    "profile": {"period": 2e-3, "n0": 2, "ratio": 4, "h_rms": 1e-6},
    "material": {"young": 1e6, "poisson": 0.5},
    "sweep": {"hurst": [0.7, np.float64(0.9)], "work_of_adhesion": [0.02], "realisations": 1},
    "cycle": {"max_penetration": np.array([0.4, 0.6]), "load_steps": np.int64(4)},
}


@pytest.fixture(scope="module")
def campaign() -> adhesis.Campaign:
    return adhesis.Campaign(TABLES)


def test_a_campaign_is_the_same_from_a_dictionary_a_text_and_a_file(campaign, tmp_path):
    file = tmp_path / "my.toml"
    file.write_text(campaign.text)
    for other in (adhesis.Campaign(file), adhesis.Campaign(str(file))):
        assert other == campaign
    assert adhesis.Campaign(campaign.text) == campaign
    assert pickle.loads(pickle.dumps(campaign)) == campaign
    assert repr(campaign) == "<Campaign: 4 cells, 4 tasks>"
    assert "young = 1000000.0" in campaign._repr_html_()


def test_units_are_asked_for_in_a_dictionary_too():
    """40 J/m² can hardly be meant. Texts and files: test_campaign.py."""
    with pytest.raises(InputError, match=r"\[sweep\] work_of_adhesion is .*40"):
        adhesis.Campaign({**TABLES, "sweep": {**TABLES["sweep"], "work_of_adhesion": [40]}})
    with_unit = {**TABLES, "sweep": {**TABLES["sweep"], "work_of_adhesion": ["40 mJ/m2"]}}
    assert adhesis.Campaign(with_unit).tables.sweep.work_of_adhesion == (0.04,)


INSIDE_ITSELF: list[Any] = [0.7]
INSIDE_ITSELF.append(INSIDE_ITSELF)


def _nested(depth):
    return reduce(lambda values, _: [values], range(depth), 0.7)


class _Printed(float):
    def __repr__(self):
        return "1\n[output]\njumps = 1\n#"


@pytest.mark.parametrize(
    "values", [INSIDE_ITSELF, _nested(20), _nested(100_000), ["\ud800"], "\0", [b"a"], {"a": 1}]
)
def test_a_value_that_no_key_has_is_refused_in_one_sentence(values):
    with pytest.raises(InputError) as error:
        adhesis.Campaign({**TABLES, "sweep": {**TABLES["sweep"], "hurst": values}})
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400


@pytest.mark.parametrize(
    "value", [None, 1j, Fraction(10**400), {0.5}, np.array(0.5).view(WithUnit), FloatWithUnit(0.5)]
)
def test_a_value_that_no_file_has_is_quoted_as_what_it_is(value):
    with pytest.raises(InputError, match="poisson is ") as error:
        adhesis.Campaign({**TABLES, "material": {"young": 1e6, "poisson": value}})
    assert f"poisson is {checks.shown(value)}: it must be a number, " in str(error.value)


@pytest.mark.parametrize("poisson", [_Printed(0.5), Decimal("0.5"), Fraction(1, 2)])
def test_a_number_of_another_class_is_a_number(poisson):
    half_space = {"young": 1e6, "poisson": poisson}
    assert adhesis.Campaign({**TABLES, "material": half_space}).tables.material.poisson == 0.5


@pytest.mark.parametrize("name", ["a\0.h5", "a\ud800.h5", ""])
@pytest.mark.parametrize("result", ["loop"], indirect=True)
def test_what_no_file_can_be_called_is_refused(name, campaign, result):
    path = result.save, adhesis.load, adhesis.open, adhesis.read_trace, campaign.run, campaign.price
    for function in (*path, adhesis.Campaign, lambda name: adhesis.open("x.h5", beside=[name])):
        with pytest.raises(ValueError, match="it must be the name of a file"):
            function(name)


@pytest.fixture(scope="module")
def computed(campaign, tmp_path_factory):
    """The results file of the campaign, and its rows, computed here without a word."""
    file, shown = tmp_path_factory.mktemp("computed") / "my.h5", io.StringIO()
    with redirect_stdout(shown), redirect_stderr(shown):
        results = campaign.run(file)
    assert shown.getvalue() == ""
    return file, results.dataset.load()


def test_a_campaign_is_priced_run_resumed_and_opened(campaign, computed, capsys):
    file, rows = computed
    price = campaign.price(seconds=0.1)
    assert price.tasks == price.left == 4
    assert "4 tasks to do in 4 cells" in str(price)
    assert repr(price).startswith("<Price: 4 of 4 tasks to do, ")
    assert str(price).splitlines()[0] in html.unescape(price._repr_html_())
    with campaign.run(file) as results:
        assert results.dataset.loss.identical(rows.loss)
        assert results.losses.shape[0] == 4
        assert bool((results.dataset.loss > 0).all())
        drops = results.jumps.energy_drop.sum()
        assert drops == pytest.approx(float(results.dataset.loss_from_drops.sum()))
        assert results.jumps.attrs["units"]["energy_drop"] == "J/m²"
        units = results.losses.attrs["units"]
        assert units["loss_mean [J/m^2]"] == units["work_of_adhesion"] == "J/m²"
        assert units["m2_mean"] == ""
        again = pickle.loads(pickle.dumps(results))
        assert again.losses.equals(results.losses)
        assert again.plot.pull_off()
        page = results._repr_html_()
        assert "<th>done</th><td>4</td>" in page
        assert "data:image/png;base64," in page
        assert " at 0x" not in repr(results.plot)
    assert capsys.readouterr() == ("", "")
    assert "4 done" in repr(campaign.run(file, progress=True))  # nothing is left to do
    assert "4" in capsys.readouterr().err
    assert campaign.price(file).left == 0
    other = adhesis.Campaign(campaign.text.replace("young = 1000000.0", "young = 2e6"))
    with pytest.raises(InputError, match="young"):
        other.run(file)
    with pytest.raises(ValueError, match="ranks is 0"):
        campaign.run(file, ranks=0)
    with pytest.raises(ValueError, match="seconds is -1"):
        campaign.price(seconds=-1)


def test_failed_tasks_are_loud(tmp_path):
    """A weight that draws the surface into full contact fails every loop of a cell, always."""
    campaign = adhesis.Campaign(
        {
            "profile": {"period": 1e-3, "n0": 2, "ratio": 2, "h_rms": 1e-7},
            "material": {"young": 1e6, "poisson": 0.5},
            "sweep": {"hurst": [0.8], "work_of_adhesion": [1e-4, 1.0], "realisations": 2},
            "cycle": {"control": "load", "max_stress": 100.0, "load_steps": 5},
        }
    )
    with pytest.warns(UserWarning, match=r"2 of 4 tasks failed.*first reason: PathError: under a"):
        results = campaign.run(tmp_path / "r.h5")
    assert repr(results).endswith("2 done, 2 failed, 0 pending>")
    assert "they fail again if they are computed again" in as_text(read_status(tmp_path / "r.h5"))
    text = " ".join(findings.missing(results.averages))
    assert "WARNING: all tasks failed for H = 0.8, γ = 1 J/m²" in text
    assert "yet" not in text
    below = results.plot.contact_against_stress().get_supxlabel()
    assert below == r"missing, as all tasks failed: H = 0.8, $\gamma$ = 1 J/m²"


def test_a_run_ends_in_the_folder_where_it_began(tmp_path, monkeypatch):
    """The working directory is that of all threads: one may change it meanwhile."""
    one_task = {"realisations": "1", "hurst": "[0.7]", "work_of_adhesion": "[0.04]"}
    compute = Runner.__call__

    def from_elsewhere(*arguments):
        monkeypatch.chdir("/")
        return compute(*arguments)

    monkeypatch.setattr(Runner, "__call__", from_elsewhere)
    monkeypatch.chdir(tmp_path)
    results = adhesis.Campaign(campaign_text(**one_task)).run("r.h5")
    assert results.path == tmp_path / "r.h5"
    assert (results.dataset.status == DONE).all()
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]


def test_campaigns_run_outside_the_main_thread(tmp_path):
    """As asyncio.to_thread and servers call them; two at once leave stderr as it was."""
    one_task = {"realisations": "1", "hurst": "[0.7]", "work_of_adhesion": "[0.04]"}
    small = adhesis.Campaign(campaign_text(**one_task))
    before = sys.stderr

    async def both() -> list[Any]:
        runs = (asyncio.to_thread(small.run, tmp_path / f"{i}.h5") for i in range(2))
        return await asyncio.gather(*runs)

    one, two = asyncio.run(both())
    assert (one.dataset.status == DONE).all()
    assert one.dataset.loss.identical(two.dataset.loss)
    assert sys.stderr is before


@pytest.mark.mpi
def test_ranks_compute_the_same_rows(campaign, computed, tmp_path, capfd, monkeypatch):
    """Started from another thread, as a server does."""
    _, rows = computed
    ranks = asyncio.run(asyncio.to_thread(campaign.run, tmp_path / "2.h5", ranks=2))
    assert not any("tasks" in text for text in capfd.readouterr())
    shown = io.StringIO()  # what a notebook has as stderr is not the process's own
    monkeypatch.setattr("sys.stderr", shown)
    campaign.run(tmp_path / "2.h5", ranks=2, progress=True)
    assert "4 of 4 tasks done" in shown.getvalue()
    assert rows.loss.identical(ranks.dataset.loss)
    other = adhesis.Campaign(campaign.text.replace("young = 1000000.0", "young = 2e6"))
    with pytest.raises(InputError, match="young"):
        other.run(tmp_path / "2.h5", ranks=2)


def test_a_loop_is_drawn_into_axes_that_are_given():
    problem = Problem(single_wave(1e-9, 1e-3), HalfSpace(1e6, 0.5), 1e-9)
    loop = run_loop(ExactWave(problem), **HALF)
    figure = Figure()
    stress, contact = figure.subplots(1, 2)
    assert loop.plot(ax=(stress, contact)) is figure
    assert stress.get_lines()[0].get_ydata() == pytest.approx(
        1e-3 * loop.mean_stress[loop.branch == "unloading"]
    )
    assert contact.get_ylabel() == "contact fraction $A/A_0$"
    alone = Figure().subplots()
    assert loop.plot(ax=alone) is alone.figure
    low, high = alone.get_ylim()  # without room for a legend, which stands where it hides least
    assert high - 1e-3 * loop.mean_stress.max() < 0.1 * (high - low)
    assert len(alone.get_lines()) == 3  # two branches, and a line at 0
    for bad in ("ax", [alone, 1], []):
        with pytest.raises(TypeError, match="must be one Axes of matplotlib, or several of them"):
            loop.plot(ax=bad)
