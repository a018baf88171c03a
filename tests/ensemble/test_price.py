"""What a campaign costs, estimated before it starts."""

import shutil
import time

import numpy as np
import pytest

from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.campaign.tasks import Part, Task
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.results.layout import create
from adhesis.ensemble.results.schema import NOT_NEEDED
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.run.plan import prior
from adhesis.ensemble.run.price import price
from adhesis.ensemble.run.session import run_campaign
from adhesis.solver.method import PathError
from tests.support.campaign_support import adhesis_here, campaign_text, write_campaign
from tests.support.fake_run import fake_engine, write_results


def cost(task):
    return 100 * task.work_of_adhesion * (1 + 0.1 * task.realisation)


def compute(campaign, task):
    return {"cpu_time": cost(task)}


def test_pilots_tell_what_the_campaign_costs():
    campaign = parse_campaign(campaign_text(realisations="10"))
    true = sum(cost(task) for task in campaign.tasks())
    reported = price(campaign, compute=compute)
    assert reported.pilots == 40  # they take no time here
    assert reported.seconds == pytest.approx(true)
    assert reported.longest == pytest.approx(4.0 * 1.9)
    assert reported.makespan(2) == pytest.approx(true / 2)
    assert reported.makespan(1000) == reported.longest
    hurried = price(campaign, compute=compute, seconds=0.0)
    assert hurried.pilots == 0


@pytest.fixture
def made(monkeypatch):
    tasks = []

    class Counted(Task):
        def __post_init__(self):
            tasks.append(self.realisation)

    monkeypatch.setattr("adhesis.ensemble.campaign.tasks.Task", Counted)
    return tasks


def test_a_million_tasks_are_priced_by_those_that_are_tried_out(made):
    campaign = parse_campaign(campaign_text(realisations="250_000"))
    tried = []

    def stops(campaign, task):
        tried.append(task)
        if len(tried) == 8:
            time.sleep(0.2)
        return compute(campaign, task)

    reported = price(campaign, compute=stops, seconds=0.1)
    assert len(tried) < 1000
    assert {task.realisation for task in tried[:4]} == {0}  # one of each cell at first
    assert reported.tasks == reported.left == 1_000_000
    assert reported.seconds > 1e5
    assert len(made) < 3000
    assert price(campaign, part=Part(3, 7), compute=compute, seconds=0.0).left == len(
        range(2, 1_000_000, 7)
    )


def test_a_disk_that_is_too_small_is_met_before_tasks_are_made(made, tmp_path, monkeypatch):
    full = shutil.disk_usage(tmp_path)._replace(free=10**9)
    monkeypatch.setattr("adhesis.ensemble.results.layout.shutil.disk_usage", lambda path: full)
    campaign = parse_campaign(campaign_text(realisations="2_500_000"))
    with pytest.raises(InputError, match=r"needs .* and the disk has 1000 MB free"):
        run_campaign(campaign, tmp_path / "r.h5", engine=fake_engine(""))
    assert not made
    assert not list(tmp_path.iterdir())


def test_a_pilot_loop_without_a_path_costs_what_it_took():
    """As a loop that runs into full contact: the run records it as failed."""

    def fails_once(campaign, task):
        if task.hurst == 0.7 and task.work_of_adhesion == 0.01 and task.realisation == 0:
            raise PathError("full contact is reached")
        return compute(campaign, task)

    campaign = parse_campaign(campaign_text(realisations="10"))
    reported = price(campaign, compute=fails_once)
    assert reported.pilots == 40
    others = sum(cost(task) for task in list(campaign.tasks())[1:])
    assert reported.seconds == pytest.approx(others, rel=1e-3)  # it took no time


def test_pilot_loops_short_of_their_preload_are_reported():
    """Before hours are spent on loops that all turn at the latest turning point."""

    def falls_short(campaign, task):
        reached = float(task.work_of_adhesion == 0.01)
        stress = np.array([0.0, -3000.0, 1500.0 * task.hurst, np.nan])
        return compute(campaign, task) | {"preload_reached": reached, "loading_mean_stress": stress}

    text = campaign_text(realisations="1").replace("max_penetration = 0.6", "preload = 5000")
    campaign = parse_campaign(text)
    (warning,) = (s for s in str(price(campaign, compute=falls_short)).splitlines() if "WARN" in s)
    assert warning == (
        "WARNING: 2 of 4 pilot loops do not reach the preload, and turn at the latest turning "
        "point: at load steps the mean stress is at most 1.2 kPa. Rougher profiles or a stiffer "
        "material let loops reach it, or a smaller preload, unless all contact is in tension."
    )

    def pulls(campaign, task):
        return falls_short(campaign, task) | {"loading_mean_stress": np.array([0.0, -3000.0])}

    assert "at load steps the mean stress is a tension" in str(price(campaign, compute=pulls))
    assert "preload" not in str(price(campaign, compute=compute))


def test_cells_that_take_more_than_in_proportion_are_followed(monkeypatch):
    """The prior's square: what was not reached is found, as the fit of the others has the power."""
    clock = iter(range(1000))
    monkeypatch.setattr("adhesis.ensemble.run.price.time.monotonic", lambda: float(next(clock)))
    campaign = parse_campaign(campaign_text(hurst="[0.6, 0.8]", work_of_adhesion="[0.01, 0.05]"))

    def compute(campaign, task):
        return {"cpu_time": 0.1 * prior(task) ** 2}

    reported = price(campaign, compute=compute, seconds=3.0)
    assert reported.pilots == 3
    assert "~ extrapolated from other cells" in str(reported)
    true = sum(0.1 * prior(task) ** 2 for task in campaign.tasks())
    assert reported.seconds == pytest.approx(true, rel=1e-9)


def test_what_was_measured_counts_and_is_not_computed_again(tmp_path):
    campaign, path = parse_campaign(campaign_text()), tmp_path / "r.h5"
    create(path, campaign)
    write_results(path, campaign, range(6), cpu_time=7.0)
    reported = price(campaign, path, compute=compute)
    assert (reported.done, reported.pilots) == (6, 2)
    assert reported.seconds == pytest.approx(cost(campaign.tasks()[6]) + cost(campaign.tasks()[7]))


def test_loops_on_one_loading_branch_are_tried_together(monkeypatch):
    """Time is up within the first three loops: they are gone through, and no others."""
    clock = iter(range(100))
    monkeypatch.setattr("adhesis.ensemble.run.price.time.monotonic", lambda: float(next(clock)))
    one = {"hurst": "[0.8]", "work_of_adhesion": "[0.04]", "max_penetration": "[0.3, 0.6, 0.9]"}
    campaign = parse_campaign(campaign_text(**one))
    took = {0.3: 2.0, 0.6: 3.0, 0.9: 4.0}

    def compute(campaign, task):
        return {"cpu_time": took[dict(task.others)["max_penetration"]]}

    reported = price(campaign, compute=compute, seconds=1.0)
    assert reported.pilots == 3
    assert reported.longest == pytest.approx(9.0)  # a rank gets all three
    assert [cell.seconds for cell in reported.cells] == [2.0, 3.0, 4.0]
    assert [cell.measured for cell in reported.cells] == [1, 1, 1]


def test_with_a_stop_the_spread_of_its_quantity_tells_how_many(tmp_path):
    """Without adhesion it is rounding, which has no spread: of W~ about 1e-12 it was 890 %."""
    stop = "[stop]\nrelative_error = 0.1\nmost = 200\n"
    text = campaign_text(realisations="8", work_of_adhesion="[0.0, 0.04]") + stop
    campaign, rng = parse_campaign(text), np.random.default_rng(1)

    def compute(campaign, task):
        mean, spread = (3.0, 0.4) if task.work_of_adhesion else (1e-12, 9.0)
        loss = mean * (1 + spread * rng.standard_normal())
        return {"cpu_time": 1.0, "loss_dimensionless": loss}

    reported = price(campaign, compute=compute)  # all 200 of each cell are tried: they take no time
    assert reported.left == 4 * 88  # of which the last three looks were batches of 8
    assert "loss_dimensionless of 400 loops scatters by 40 % so far; at least 56" in str(reported)
    blind = price(campaign, compute=compute, seconds=-1.0)
    assert "[stop]: 56 to 200 realisations a cell; the price is for 200" in str(blind)
    # What the rule has left out is not priced.
    path = tmp_path / "r.h5"
    create(path, campaign)
    write_results(path, campaign, range(72), cpu_time=7.0)
    with Writer(path) as writer:
        writer.mark(range(72, 200), NOT_NEEDED)
    reported = price(campaign, path, compute=compute, seconds=-1.0)
    assert reported.done == 72
    assert reported.cells[0].tasks == 0


def test_a_dry_run_writes_nothing(tmp_path, monkeypatch):
    path = write_campaign(tmp_path)
    monkeypatch.chdir(tmp_path)
    process = adhesis_here("run", path, "--dry-run", "--ranks", "3", fake="")
    assert process.returncode == 0, process.stderr
    assert "8 tasks to do in 4 cells, 0 done; nothing was written" in process.stdout
    assert "core hours" in process.stdout
    assert "MB of memory a rank" in process.stdout
    assert [p.name for p in tmp_path.iterdir()] == ["c.toml"]


@pytest.mark.parametrize(
    ("called", "options", "said"),
    [
        ("price.price", ["--dry-run"], "interrupted"),
        (
            "session.run_campaign",
            [],
            "interrupted; what the file holds is kept, run the same command again to resume",
        ),
        (
            "session.run_campaign",
            ["--redo", "all"],
            "interrupted; what the file holds is kept, run the command again without --redo to "
            "resume",
        ),
    ],
)
def test_an_interrupt_says_what_is_kept_and_what_resumes(
    tmp_path, monkeypatch, capsys, called, options, said
):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"adhesis.ensemble.run.{called}", interrupt)
    out = tmp_path / "r.h5"
    assert main(["run", str(write_campaign(tmp_path)), "--out", str(out), *options]) == 130
    assert capsys.readouterr().err == f"adhesis run: {said}\n"
