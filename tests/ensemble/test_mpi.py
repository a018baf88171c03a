"""Campaigns under mpirun: the same bits for any number of ranks, and what happens when some die."""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import time

import pytest

from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.campaign.tasks import Part
from adhesis.ensemble.results.layout import create, merge
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DONE, PENDING
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.run.session import Options, run_campaign
from tests.support.campaign_support import (
    adhesis,
    campaign_text,
    differences,
    done_rows,
    has_ended,
    kill_all,
    ranks_of,
    start,
    stat_of,
    wait_until,
    write_campaign,
)
from tests.support.fake_run import run_file

pytestmark = pytest.mark.mpi


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The fake campaign, undisturbed, by one process."""
    folder = tmp_path_factory.mktemp("whole")
    assert run_file(write_campaign(folder), folder / "whole.h5").done == 8
    return folder / "whole.h5"


def test_loops_have_the_same_bits_on_ranks_resumed_and_in_parts(tmp_path):
    """Also where some loops that share a loading branch are there already, and others not.

    Ranks write to a path of any length: Open MPI 4.1 has buffers of 256 bytes for it.
    """
    some = {"hurst": "[0.8]", "work_of_adhesion": "[0.04]", "load_steps": "8"}
    text = campaign_text(max_penetration="[0.3, 0.6]", method='"sharp"', **some)
    path, whole = tmp_path / "c.toml", tmp_path / "whole.h5"
    path.write_text(text.replace("nodes_per_wave = 16\n", ""))
    campaign = load_campaign(path)
    assert run_campaign(campaign, whole).done == 4
    folder = tmp_path.joinpath("d" * 120, "e" * 200)
    folder.mkdir(parents=True)
    out = folder / f"{'n' * 240}.h5"
    process = adhesis("run", path, "--out", out, ranks=3)
    assert process.returncode == 0, process.stderr
    assert differences(out, whole) == []
    with Results(out) as results:
        assert set(results.column("rank").tolist()) <= {1, 2}  # rank 0 only handed out
    assert [path.name for path in folder.iterdir()] == [out.name]
    resumed = tmp_path / "resumed.h5"
    shutil.copy(whole, resumed)
    with Writer(resumed) as writer:
        writer.mark([1, 2], PENDING)
    assert run_campaign(campaign, resumed).computed == 2
    assert differences(resumed, whole) == []
    parts = [tmp_path / "1.h5", tmp_path / "2.h5"]
    for k, part in enumerate(parts, start=1):
        assert run_campaign(campaign, part, options=Options(part=Part(k, 2))).done == 2
    merge(parts, tmp_path / "merged.h5")
    assert differences(tmp_path / "merged.h5", whole) == []


MPI, OWN = ((), 3), (("--ranks", 3), 0)
ENDLESS = "step=0.1 hang=0.8:0.04:1"  # one of the tasks never ends
LAUNCHER, FIRST, LAST = "the launcher", "the first rank", "the last rank"
BY_SIGNAL = ("stopped early: SIGUSR1 received",)
BY_CTRL_C = (
    "stopped early: Ctrl-C (SIGINT) received",
    "Ctrl-C (SIGINT) received: tasks in progress have up to 30 s to stop",
)
SILENT = "rank 2 has not answered for 2 s; what the file holds is kept, run the same command again"


@pytest.mark.parametrize(
    ("started", "fake", "hit", "number", "code", "said"),
    [
        (MPI, "hold=2", LAST, signal.SIGKILL, None, ()),
        (MPI, "hold=2", FIRST, signal.SIGKILL, None, ()),
        (MPI, ENDLESS, LAUNCHER, signal.SIGUSR1, 75, BY_SIGNAL),
        (MPI, ENDLESS, LAST, signal.SIGUSR1, 75, BY_SIGNAL),
        (OWN, "hold=1", LAUNCHER, signal.SIGINT, 75, BY_CTRL_C),
        (OWN, "hold=1", LAUNCHER, signal.SIGKILL, -signal.SIGKILL, ()),
        # as if its node hung; it never comes back (a stall of the whole machine counts as 1 s)
        (OWN, "hold=1 silence=2", LAST, signal.SIGSTOP, 75, (SILENT,)),
    ],
)
def test_ranks_end_with_their_run_and_the_next_one_goes_on(
    tmp_path, whole, started, fake, hit, number, code, said
):
    """A kill of all ranks: test_precision.py, and with the other writer below; see test_run.py."""
    path, out, free = write_campaign(tmp_path), tmp_path / "r.h5", tmp_path / "free"
    words, launched = started
    process = start("run", path, "--out", out, *words, ranks=launched, fake=f"{fake} free={free}")
    wait_until(lambda: done_rows(out) >= 2)
    ranks = ranks_of(process.pid)
    assert len(ranks) == (launched or 2)
    os.kill({LAUNCHER: process.pid, FIRST: ranks[0], LAST: ranks[-1]}[hit], number)
    if number == signal.SIGSTOP:
        free.touch()
    _, errors = process.communicate(timeout=150)
    assert process.returncode == code or (code is None and process.returncode not in (0, 1, 2, 75))
    assert all(phrase in errors for phrase in said), errors
    wait_until(lambda: all(map(has_ended, ranks)))
    kept, log = done_rows(out), tmp_path / "rest.log"
    again = run_file(path, out, f"log={log}")
    assert (again.done, again.computed) == (8, 8 - kept)
    assert kept >= 2
    assert len(log.read_text().splitlines()) == 8 - kept  # none is begun twice
    assert differences(out, whole) == []


@pytest.mark.parametrize(
    ("started", "done_to_it", "code", "said"),
    [
        (OWN, "moved", 74, "r.h5 was moved, replaced or removed while a run wrote to it"),
        (MPI, "zeros", 2, "or it is damaged"),
        (MPI, "an older copy", 74, "of 8 finished tasks: another program"),
    ],
)
def test_ranks_whose_file_is_taken_away_end_with_one_sentence(
    tmp_path, started, done_to_it, code, said
):
    """Rows that nobody finds were reported as done; no rank goes to the end of MPI with it open."""
    path, out, free = write_campaign(tmp_path), tmp_path / "r.h5", tmp_path / "free"
    words, launched = started
    create(out, load_campaign(path))  # a copy of what ranks make may hold their first rows, too
    copy = out.read_bytes() if code == 74 else bytes(out.stat().st_size)
    process = start("run", path, "--out", out, *words, ranks=launched, fake=f"hold=1 free={free}")
    wait_until(lambda: done_rows(out) >= 2)
    if done_to_it == "moved":
        out.rename(tmp_path / "old.h5")
    else:
        out.write_bytes(copy)
    free.touch()
    _, errors = process.communicate(timeout=60)
    assert process.returncode == code, errors
    (line,) = (line for line in errors.splitlines() if line.startswith("adhesis run: "))
    assert said in line
    assert "Traceback" not in errors
    if done_to_it == "moved":
        assert run_file(path, (tmp_path / "old.h5").rename(out)).done == 8


def test_a_run_that_is_told_to_stop_but_ends_complete_says_nothing_of_stopping(tmp_path):
    """One worker is asked to stop, while the last task, on another, does not look up.

    A third worker gets no task: there are more ranks than tasks.
    """
    path = write_campaign(tmp_path, realisations="1", hurst="[0.7]")
    log = tmp_path / "log"
    fake = f"asked=0.7:0.01:0 deaf=0.7:0.04:0 log={log}"
    process = adhesis("run", path, "--out", tmp_path / "r.h5", ranks=4, fake=fake)
    assert process.returncode == 0, process.stderr
    assert "2 of 2 tasks done; 2 computed" in process.stderr
    assert "stopped early" not in process.stderr


KILLS = 20  # of each victim


@pytest.mark.slow(reason="sixty kills")
@pytest.mark.parametrize("victim", ["worker", "master", "all"])
def test_kills_at_random_moments(tmp_path, victim):
    random.seed(victim)
    path, out, whole = write_campaign(tmp_path, realisations="4"), tmp_path / "r.h5", tmp_path / "w"
    assert run_file(path, whole).done == 16
    killed = 0
    while killed < KILLS:
        done = set[str]()  # tasks as the fake task's log has them
        if out.exists():
            with Results(out) as results:
                rows = zip(results.tasks, results.status(), strict=True)
                found = (task for task, status in rows if status == DONE)
                done = {f"{t.hurst}:{t.work_of_adhesion}:{t.realisation}" for t in found}
        log = tmp_path / f"log{killed}"
        log.touch()
        process = start("run", path, "--out", out, ranks=3, fake=f"step=0.06 log={log}")
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=random.uniform(0.3, 4.0))
        ranks = ranks_of(process.pid)
        if process.poll() is None and len(ranks) == 3:
            killed += 1
            if victim == "all":
                kill_all(process)
            else:
                os.kill(ranks[-1] if victim == "worker" else ranks[0], signal.SIGKILL)
        process.communicate(timeout=150)
        assert not done & set(log.read_text().split())
        if process.returncode == 0:
            assert differences(out, whole) == []
            out.unlink()
    assert adhesis("run", path, "--out", out, ranks=3, fake="").returncode == 0
    assert differences(out, whole) == []


def test_an_error_that_is_not_a_tasks_ends_the_job(tmp_path):
    path, out = write_campaign(tmp_path), tmp_path / "r.h5"
    process = adhesis("run", path, "--out", out, ranks=3, fake="crash=0.8:0.01:0")
    assert process.returncode == 70
    assert "TypeError" in process.stderr


def test_the_rank_0_writer_writes_the_same_file(tmp_path, whole):
    """As where HDF5 has no MPI; half of the file before a kill, and half after it."""
    path, out = write_campaign(tmp_path), tmp_path / "r.h5"
    process = start("run", path, "--out", out, ranks=3, fake="serial=1 hold=2")
    wait_until(lambda: done_rows(out) == 4)
    kill_all(process)
    process.communicate()
    resumed = adhesis("run", path, "--out", out, ranks=3, fake="serial=1")
    assert resumed.returncode == 0, resumed.stderr
    assert "4 computed" in resumed.stderr
    assert differences(out, whole) == []


def test_an_error_under_mpirun_is_one_sentence(tmp_path):
    """Also if the other rank has ended long before rank 0 reports it."""
    write_campaign(tmp_path, hurst="[1.5]")
    process = adhesis("run", "c.toml", "--out", "r.h5", ranks=2, cwd=tmp_path)
    assert process.returncode == 2, process.stderr
    (line,) = (line for line in process.stderr.splitlines() if "adhesis" in line)
    assert "hurst is [1.5]: it must be a list" in line
    assert [path.name for path in tmp_path.iterdir()] == ["c.toml"]


def test_a_run_that_starts_its_ranks_ends_with_one_sentence(tmp_path):
    bad = write_campaign(tmp_path, "bad.toml", hurst="[1.5]")
    process = adhesis("run", bad, "--out", tmp_path / "r.h5", "--ranks", "2")
    assert process.returncode == 2
    assert len(process.stderr.splitlines()) == 1, process.stderr
    assert process.stderr.startswith("adhesis run: ")
    path = write_campaign(tmp_path, realisations="1", hurst="[0.7]")
    words = ("run", path, "--out", tmp_path / "r.h5", "--ranks", "2")
    process = adhesis(*words, fake="fail=0.7:0.01:0")
    assert process.returncode == 1
    assert "1 of 2 tasks done, 1 failed" in process.stderr
    process = adhesis(*words, "--redo", "all", fake="full=20000")
    assert process.returncode == 74
    last = process.stderr.splitlines()[-1]
    assert "could not be written" in last
    assert last.endswith("; what the file holds is kept")


def test_waiting_costs_the_master_next_to_nothing(tmp_path):
    """It looks 200 times a second, 1 to 2 % of a core here; a blocking receive takes all of one."""
    path, out, log = write_campaign(tmp_path), tmp_path / "r.h5", tmp_path / "log"
    process = start("run", path, "--out", out, ranks=3, fake=f"step=0.6 log={log}")

    def begun() -> int:
        return len(log.read_text().splitlines()) if log.exists() else 0

    wait_until(lambda: begun() == 2)
    master = ranks_of(process.pid)[0]

    def cpu() -> float:
        return sum(map(int, stat_of(master)[11:13])) / os.sysconf("SC_CLK_TCK")

    before, since = cpu(), time.monotonic()
    wait_until(lambda: begun() == 4)  # the master has waited for two tasks of four load steps
    share = (cpu() - before) / (time.monotonic() - since)
    process.send_signal(signal.SIGUSR1)
    process.communicate(timeout=150)
    assert share < 0.1
