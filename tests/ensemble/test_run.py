"""A campaign in one process, by the command: resume, growth, stops, failures, bad input."""

import itertools
import json
import math
import os
import re
import signal
import time
from dataclasses import replace

import h5py
import numpy as np
import pytest
import xarray

from adhesis.ensemble.aggregate.average import aggregate
from adhesis.ensemble.aggregate.status import as_text, read_status
from adhesis.ensemble.campaign.file import load_campaign, parse_campaign
from adhesis.ensemble.campaign.precision import precision
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError, WriteError
from adhesis.ensemble.report import findings
from adhesis.ensemble.results.layout import create
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.run import session
from adhesis.ensemble.run.interrupt import StopSignals, deadline, parse_duration
from adhesis.ensemble.run.plan import Plan
from adhesis.ensemble.run.session import Engine, Options, run_campaign
from adhesis.ensemble.task.compute import check_task
from tests.support.campaign_support import (
    TIMING,
    adhesis,
    adhesis_here,
    campaign_text,
    differences,
    done_rows,
    environment,
    start,
    wait_until,
    write_campaign,
)
from tests.support.fake_run import fake_engine, fake_result, write_results


def run(folder, *words, fake="", **changes):
    path = write_campaign(folder, **changes)
    out = folder / "r.h5"
    return adhesis_here("run", path, "--out", out, *words, fake=fake), out


def test_a_run_from_nothing_to_done(tmp_path):
    out = tmp_path / "r.h5"
    process = adhesis("run", write_campaign(tmp_path), "--out", out, fake="")
    assert process.returncode == 0
    assert process.stdout == ""
    assert f"{out}: 8 tasks to do" in process.stderr
    assert f"{out}: 8 of 8 tasks done; 8 computed in" in process.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c.toml", "r.h5"]
    with h5py.File(out) as file:
        for name in ("adhesis_version", "commit", "mpi", "hdf5", "fftw", "numpy", "created"):
            assert file.attrs[name]
        assert file.attrs["campaign"] == (tmp_path / "c.toml").read_text()
        assert file.attrs["seed"] == 5


def test_the_results_file_is_named_after_the_campaign_by_default(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_campaign(tmp_path, "mine.toml")
    assert adhesis_here("run", "mine.toml", fake="").returncode == 0
    assert (tmp_path / "mine.h5").exists()


def test_a_finished_campaign_computes_nothing_again_unasked(tmp_path):
    _, out = run(tmp_path)
    before = out.read_bytes()
    log = tmp_path / "log"
    process, _ = run(tmp_path, fake=f"log={log}", hurst="[0.80, 0.70]")
    assert process.returncode == 0
    assert not log.exists()
    assert out.read_bytes() == before
    other = out.replace(tmp_path / "old.dat")  # an existing file may have any name
    assert adhesis_here("run", tmp_path / "c.toml", "--out", other, fake="").returncode == 0
    assert other.replace(out).read_bytes() == before
    words = ("--redo", "all", "--hurst", "0.8", "--realisation", "0")
    run(tmp_path, *words, fake=f"log={log}")
    assert sorted(log.read_text().split()) == ["0.8:0.01:0", "0.8:0.04:0"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return run(tmp_path_factory.mktemp("whole"))[1]


@pytest.mark.parametrize(
    ("number", "name"), [(signal.SIGINT, "Ctrl-C (SIGINT)"), (signal.SIGKILL, "")]
)
def test_a_stopped_run_says_so_and_resumes_with_the_same_bits(tmp_path, whole, number, name):
    path, out = write_campaign(tmp_path), tmp_path / "r.h5"
    process = start("run", path, "--out", out, fake="hold=2")
    wait_until(lambda: done_rows(out) >= 2)
    process.send_signal(number)
    _, errors = process.communicate(timeout=150)  # the task would go on for ever
    assert process.returncode == (75 if name else -signal.SIGKILL)
    assert not name or f"stopped early: {name} received" in errors
    kept = done_rows(out)
    log = tmp_path / "log"
    process, _ = run(tmp_path, fake=f"log={log}")
    assert process.returncode == 0
    assert len(log.read_text().splitlines()) == 8 - kept
    assert differences(out, whole) == []


def test_walltime_ends_the_run_in_time(tmp_path):
    path, out = write_campaign(tmp_path), tmp_path / "r.h5"
    words = ("run", path, "--out", out, "--walltime", "1s")
    process = adhesis_here(*words, fake="step=0.02 hang=0.8:0.04:1")  # that task would never end
    assert process.returncode == 75
    assert "stopped early: " in process.stderr


def test_growing_computes_exactly_what_is_new(tmp_path):
    _, out = run(tmp_path, realisations="1", hurst="[0.8]")
    with Results(out) as results:
        created = results.attributes["created"]
        before = [results.column(name).tolist() for name in TIMING]
    log = tmp_path / "log"
    process, _ = run(tmp_path, fake=f"log={log}", realisations="3")
    assert process.returncode == 0
    assert "12 of 12 tasks done; 10 computed" in process.stderr
    new = {f"{h}:{g}:{r}" for h in (0.7, 0.8) for g in (0.01, 0.04) for r in range(3)}
    assert set(log.read_text().split()) == new - {"0.8:0.01:0", "0.8:0.04:0"}
    with Results(out) as results:
        assert [results.column(name)[[6, 9]].tolist() for name in TIMING] == before
        assert results.attributes["created"] == created
    (tmp_path / "whole").mkdir()
    log.unlink()
    _, whole = run(tmp_path / "whole", fake=f"log={log}", realisations="3")
    assert differences(out, whole) == []
    # wherever it is interrupted every cell has been computed about as often
    order = [int(line.rsplit(":", 1)[1]) for line in log.read_text().split()]
    assert order == [0] * 4 + [1] * 4 + [2] * 4


def test_a_campaign_on_further_axes(tmp_path):
    axes = {"ratio": "[4, 2]", "max_penetration": "[0.6, 0.3]", "realisations": "1"}
    process, out = run(tmp_path, hurst="[0.7]", **axes)
    assert "8 of 8 tasks done" in process.stderr
    with xarray.open_dataset(out, engine="h5netcdf") as data:
        assert data["ratio"].values.tolist() == [2, 2, 4, 4] * 2
        assert data["ratio"].attrs["long_name"].startswith("highest over lowest")
        assert data["max_penetration"].values.tolist() == [0.3, 0.6] * 4
        assert data["loading_penetration"].values.tolist() == [0, 0.25, 0.5, 0.75, 1]
    status = json.loads(adhesis_here("status", out, "--json").stdout)
    assert status["axes"] == ["hurst", "work_of_adhesion", "ratio", "max_penetration"]
    assert [g["max_penetration"] for g in status["groups"][:3]] == [0.3, 0.6, 0.3]
    assert "ratio  max_penetration" in adhesis_here("status", out).stdout
    log = tmp_path / "log"
    process, _ = run(tmp_path, young="[1e6, 2e6]", hurst="[0.7]", fake=f"log={log}", **axes)
    assert process.returncode == 0, process.stderr
    assert len(log.read_text().split()) == 16 - 8
    (tmp_path / "whole").mkdir()
    _, whole = run(tmp_path / "whole", young="[2e6, 1e6]", hurst="[0.7]", **axes)
    assert differences(out, whole) == []
    axes["ratio"] = "[2, 4, 8]"
    process, _ = run(tmp_path, young="[1e6, 2e6]", hurst="[0.7]", **axes)
    assert process.returncode == 2
    assert "cannot grow by profile.ratio: the bins of its spectra would change" in process.stderr
    axes |= {"ratio": "[2, 4]", "period": "[1e-3, 2e-3]"}
    process, _ = run(tmp_path, young="[1e6, 2e6]", hurst="[0.7]", **axes)
    assert process.returncode == 2
    assert "would change (they follow the highest n0 · ratio of the campaign, and" in process.stderr


def test_failed_tasks_are_recorded_and_computed_again_when_asked(tmp_path, whole):
    process, out = run(tmp_path, fake="fail=0.7:*:1")
    assert process.returncode == 1
    assert "failed: H = 0.7, γ = 0.01 J/m², realisation 1: FloatingPointError" in process.stderr
    assert "6 of 8 tasks done, 2 failed; 6 computed" in process.stderr
    text = adhesis_here("status", out).stdout
    assert "8 tasks, 6 done, 0 pending, 2 failed" in text
    assert "failed 2×: FloatingPointError: the sum of γ diverged" in text
    assert "H = 0.7, γ = 0.04 J/m², realisation 1" in text
    status = json.loads(adhesis_here("status", out, "--json").stdout)
    assert [g["done"] for g in status["groups"]] == [1, 1, 2, 2]
    # Failures are results: they are not tried again unasked.
    process, _ = run(tmp_path)
    assert process.returncode == 1
    assert "0 to do, 2 failed before" in process.stderr
    log = tmp_path / "log"
    words = ("--redo", "failed", "--work-of-adhesion", "40mJ/m2")
    process, _ = run(tmp_path, *words, fake=f"log={log}")
    assert process.returncode == 1
    assert log.read_text() == "0.7:0.04:1\n"
    process, _ = run(tmp_path, "--redo", "failed")
    assert process.returncode == 0
    assert differences(out, whole) == []


def test_a_doubtful_loss_is_said(tmp_path):
    process, out = run(tmp_path, fake="doubt=0.7:*:1")
    assert process.returncode == 0
    reported = "doubtful loss: H = 0.7, γ = 0.01 J/m², realisation 1: audit residual 19 %"
    assert reported in process.stderr
    assert "2 losses are doubtful: by their own account they may be off by more than 0.1 %" in (
        process.stderr
    )
    text = adhesis_here("status", out).stdout
    assert "2 losses are doubtful: by their own account less accurate than asked for" in text
    assert "realisation 1" in text
    status = json.loads(adhesis_here("status", out, "--json").stdout)
    assert [d["row"] for d in status["doubtful"]] == [1, 3]
    again, _ = run(tmp_path)  # of a file that is finished, too
    assert "2 losses are doubtful: by their own account they may be off" in again.stderr


def test_what_there_is_one_of_is_said_in_the_singular_and_rounding_is_no_loss(
    tmp_path, monkeypatch
):
    one = {"hurst": "[0.7]", "work_of_adhesion": "[0.01]", "realisations": "1"}
    process, out = run(tmp_path, fake="doubt=*:*:*", **one)
    assert "r.h5: 1 task to do\n" in process.stderr
    assert "r.h5: 1 of 1 task done; 1 computed in" in process.stderr
    assert "1 loss is doubtful: by its own account it may be off by more" in process.stderr
    shown = as_text(read_status(out))
    assert "r.h5: 1 task, 1 done" in shown
    assert "1 loss is doubtful: by its own account less accurate" in shown
    said = [*findings.quality(aggregate(out)), *findings.missing(aggregate(out))]
    assert any("WARNING: 1 of 1 loss is doubtful, as its audit" in text for text in said)
    known = precision([1.0, 1.1, 0.9], 0.5, "loss")
    monkeypatch.setattr(findings, "precisions", lambda cells: [("H = 0.7", known)])
    (sentence,) = findings.precision(aggregate(out))
    assert "([stop]): 0 of 1 cell met that; the others: H = 0.7: loss" in sentence
    without = {"loss": -5e-12, "loss_standard_error": 1e-11, "work_of_adhesion": 0.0}
    status = read_status(out)
    status["groups"][0] |= without
    (line,) = (line for line in as_text(status).splitlines() if line.startswith("  0.7 "))
    assert line.split()[-1] == "0"


def test_too_many_failures_stop_the_run(tmp_path):
    process, out = run(tmp_path, "--max-failures", "3", fake="fail=*:*:*")
    assert process.returncode == 1
    assert "stopped early: 3 tasks failed (the limit is --max-failures 3)" in process.stderr
    status = json.loads(adhesis_here("status", out, "--json").stdout)
    assert (status["failed"], status["pending"]) == (3, 5)


def test_a_task_that_hangs_meets_the_time_limit_and_the_limit_may_change(tmp_path):
    process, out = run(tmp_path, fake="hang=0.7:0.01:0", method='"grid"\ntime_limit = 0.6')
    assert process.returncode == 1
    failure = json.loads(adhesis_here("status", out, "--json").stdout)["failures"][0]
    assert failure["error"] == "longer than the time limit of 0.6 s"
    again = f"adhesis run CAMPAIGN.toml --out {out} --redo failed"
    shown = adhesis_here("status", out).stdout
    assert f"again, with a longer time_limit in [solver]: {again}\n" in shown
    assert failure["seconds"] > 0.5
    process, _ = run(tmp_path, "--redo", "failed", method='"grid"\ntime_limit = 60')
    assert process.returncode == 0


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"work_of_adhesion": '[0.01, "1e25 J/m2"]'}, "work_of_adhesion is 1e+25 J/m²"),
        ({"work_of_adhesion": "[1e-25, 0.01]"}, "work_of_adhesion is 1e-25 J/m²"),
        ({"young": "[1e6, 1e15]"}, "work_of_adhesion is 0.01 J/m²"),
        (
            {"poisson": "0.5\nstrength = [1e9, 2e3]", "method": '"sharp"'},
            "adhesion_range is 5e-06 m, strength 2000 Pa",
        ),
    ],
)
def test_every_cell_is_tried_before_anything_is_written(tmp_path, changes, sentence):
    """A value far down a list is refused at once, and not when its turn has come."""
    campaign = parse_campaign(campaign_text(**changes).replace("nodes_per_wave = 16\n", ""))
    out = tmp_path / "r.h5"
    refusal = re.escape(f"this campaign cannot be computed: {sentence}")
    with pytest.raises(InputError, match=refusal):
        run_campaign(campaign, out, engine=replace(fake_engine(""), check=check_task))
    assert list(tmp_path.iterdir()) == []


def test_a_cell_that_is_new_is_tried_before_the_file_grows(tmp_path):
    """Tasks that are done are not: that would load the solver for nothing."""
    engine, out = fake_engine(""), tmp_path / "r.h5"
    run_campaign(load_campaign(write_campaign(tmp_path)), out, engine=engine)
    before = out.read_bytes()
    tried = []

    def check(campaign, task):
        tried.append(task.work_of_adhesion)
        check_task(campaign, task)

    run_campaign(load_campaign(write_campaign(tmp_path)), out, engine=replace(engine, check=check))
    assert tried == []
    grown = load_campaign(write_campaign(tmp_path, work_of_adhesion='[0.01, 0.04, "1e25 J/m2"]'))
    with pytest.raises(InputError, match=r"cannot be computed: work_of_adhesion is 1e\+25 J/m²"):
        run_campaign(grown, out, engine=replace(engine, check=check))
    assert 1e25 in tried
    assert out.read_bytes() == before


def test_a_results_file_of_another_campaign(tmp_path):
    _, out = run(tmp_path)
    before = out.read_bytes()
    for changes, sentences in (
        ({"load_steps": "5", "young": "2e6"}, ("young is 2000000.0 here", "load_steps is 5 here")),
        ({"hurst": "[0.7]"}, ("sweep.hurst",)),
    ):
        process, _ = run(tmp_path, **changes)
        assert (process.returncode, process.stdout) == (2, "")
        (line,) = process.stderr.splitlines()
        assert line.startswith("adhesis run: ")
        assert all(sentence in line for sentence in sentences)
        assert out.read_bytes() == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder(tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    path = write_campaign(tmp_path)
    process = adhesis_here("run", path, "--out", folder / "r.h5")
    assert process.returncode == 2
    assert "is read-only" in process.stderr


def test_two_runs_on_one_file(tmp_path):
    path, out = write_campaign(tmp_path), tmp_path / "r.h5"
    started = time.time()
    first = start("run", path, "--out", out, fake="hold=1")
    wait_until(lambda: done_rows(out) >= 1)
    second = adhesis_here("run", path, "--out", out, "--patience", "0.1")
    assert second.returncode == 2
    assert len(second.stderr.splitlines()) == 1
    assert f"is being written by another run (host {os.uname().nodename}" in second.stderr
    status = json.loads(adhesis_here("status", out, "--json").stdout)
    assert (status["done"], status["pending"]) == (1, 7)
    assert status["run"]["pid"] == first.pid
    assert started <= status["last_row"] <= time.time()
    assert f"a run is writing (host {os.uname().nodename}" in adhesis_here("status", out).stdout
    first.send_signal(signal.SIGTERM)
    first.communicate(timeout=150)
    assert first.returncode == 75
    ended = adhesis_here("status", out).stdout
    assert "no run is writing; last written " in ended
    assert json.loads(adhesis_here("status", out, "--json").stdout)["run"] is None


CHANGED = r"holds \d of \d finished tasks: another program has"
COPIED_OVER = {
    "zeros": (3, lambda empty, other: bytes(len(empty)), InputError, "is damaged"),
    "rows of before lost": (0, lambda empty, other: empty, WriteError, CHANGED),
    "rows of another run": (3, lambda empty, other: other, WriteError, CHANGED),
}


@pytest.mark.parametrize(
    ("how", "stops"), [*((how, False) for how in COPIED_OVER), ("rows of another run", True)]
)
def test_a_file_that_is_copied_over_meanwhile_is_no_finished_run(tmp_path, how, stops):
    """The run would have ended with 0, and rows that it counted be lost."""
    place, content, error, sentence = COPIED_OVER[how]
    campaign, out = load_campaign(write_campaign(tmp_path)), tmp_path / "r.h5"
    create(out, campaign)
    empty = out.read_bytes()
    write_results(out, campaign, range(8), loss=1.0)
    other = out.read_bytes()
    out.write_bytes(empty)
    write_results(out, campaign, range(2))
    begun = itertools.count()

    def compute(campaign, task, progress=None):
        number = next(begun)
        if number == place:
            with out.open("r+b") as file:
                file.write(content(empty, other))
        if number == 4 and stops:
            signal.raise_signal(signal.SIGTERM)
        return fake_result(campaign, task)

    with pytest.raises(error, match=sentence):
        run_campaign(campaign, out, engine=Engine(compute, lambda campaign, task: None))
    if error is WriteError:
        assert run_campaign(campaign, out, engine=fake_engine("")).done == 8


def test_processes_of_another_mpi_are_reported_by_rank_0(tmp_path, monkeypatch):
    for place, words in (("0", 1), ("1", 0)):
        monkeypatch.setattr(
            "tests.support.campaign_support.environment",
            lambda place=place: {**environment(), "PMI_SIZE": "2", "PMI_RANK": place},
        )
        process = adhesis("run", write_campaign(tmp_path), cwd=tmp_path)
        assert process.returncode == 2 * words
        assert len(process.stderr.splitlines()) == words
        assert words == 0 or "the launcher belongs to another MPI than mpi4py" in process.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["c.toml"]


def test_a_disk_that_fills_while_running(tmp_path):
    """A limit on the size of a file stands for the full disk; the rows before it are kept."""
    _, out = run(tmp_path, fake="")
    words = ("run", tmp_path / "c.toml", "--out", out, "--redo", "all", "--realisation", "1")
    process = adhesis(*words, fake="full=20000")
    assert process.returncode == 74
    assert "could not be written: File too large; what the file holds is kept" in process.stderr
    assert "Traceback" not in process.stderr
    assert done_rows(out) == 4


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("90", 90),
        ("90s", 90),
        ("1.5", 1.5),
        ("45:00", 2700),
        ("12:00:00", 43200),
        ("2-00:00:00", 172800),
        ("1h30m", 5400),
        ("1d", 86400),
    ],
)
def test_durations(text, seconds):
    assert parse_duration(text) == seconds


def test_the_deadline_of_the_batch_system():
    for walltime, environ, end in (
        (1000.0, {}, 1005.0),
        (70.0, {}, 75.0),
        (20.0, {}, 25.0),
        (0.5, {}, 5.5),
        (None, {"SLURM_JOB_END_TIME": "10005"}, 10005.0),
        (None, {"PBS_WALLTIME": "100"}, 105.0),
    ):
        at, grace = deadline(walltime, 5.0, environ)
        assert at == end - min(30.0, 0.1 * (end - 5.0))
        # half of what is kept in reserve is left when workers that did not answer are ended
        assert at + grace == pytest.approx(0.5 * (at + end))
    assert deadline(None, 5.0, {}) == (math.inf, 30.0)


def test_workers_have_as_long_to_answer_as_the_walltime_leaves_by_any_clock(tmp_path, monkeypatch):
    campaign = load_campaign(write_campaign(tmp_path))
    plan = Plan(campaign.tasks(), [0], 0, 0, np.full(8, -1), np.full(8, np.nan))

    def session_of(options):
        return session._Session(campaign, plan, None, options, StopSignals(), Engine())

    for options, grace in ((Options(), 30.0), (Options(deadline=deadline(70.0, 0.0, {})), 3.5)):
        assert session_of(options)._limits.grace == pytest.approx(grace)
    found = session_of(Options(deadline=deadline(1000.0, time.time(), {})))
    monkeypatch.setattr(time, "time", lambda: 0.0)  # the clock is set back
    assert found._time_left() <= 970.0


def test_a_hangup_stops_a_run_unless_it_is_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        with StopSignals() as signals:
            signal.raise_signal(signal.SIGHUP)
        assert signals.received == "SIGHUP"
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
        with StopSignals() as signals:
            signal.raise_signal(signal.SIGHUP)
        assert signals.received is None
    finally:
        signal.signal(signal.SIGHUP, before)


def test_watching_a_run_until_it_is_done(tmp_path, monkeypatch, capsys):
    """A run that writes two rows between two looks; status of a real one: above."""
    campaign, out = load_campaign(write_campaign(tmp_path)), tmp_path / "r.h5"
    create(out, campaign)
    rows, waited = iter(range(8)), []

    def written_meanwhile(seconds):
        waited.append(seconds)
        write_results(out, campaign, itertools.islice(rows, 2))

    monkeypatch.setattr("adhesis.ensemble.command.status.time.sleep", written_meanwhile)
    assert main(["status", str(out), "--watch", "--interval", "200"]) == 0
    assert waited == [200.0] * 4
    lines = capsys.readouterr().out.splitlines()
    shown = [line for line in lines if " tasks, " in line]
    for done, line in zip((0, 2, 4, 6, 8), shown, strict=True):
        assert line.startswith(f"{out}: 8 tasks, {done} done, {8 - done} pending, 0 failed")
        assert ("an hour, about" in line) == (0 < done < 8)
    assert any(" ± " in line for line in lines[lines.index(shown[-1]) :])  # the table of losses
    assert main(["status", str(out), "--watch", "--interval", "x"]) == 2


def test_the_losses_that_status_shows(whole):
    status = json.loads(adhesis_here("status", whole, "--json").stdout)
    with h5py.File(whole) as file:
        loss = file["loss"][(file["hurst"][:] == 0.7) & (file["work_of_adhesion"][:] == 0.04)]
    group = next(g for g in status["groups"] if (g["hurst"], g["work_of_adhesion"]) == (0.7, 0.04))
    assert group["loss"] == pytest.approx(loss.mean())
    assert group["loss_standard_error"] == pytest.approx(loss.std(ddof=1) / np.sqrt(2))
