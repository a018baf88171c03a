"""Ranks that a run starts itself: launchers that fail or hang, threads, machines without MPI."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
import time
from pathlib import Path

import h5py
import pytest

import adhesis
from adhesis.ensemble.command import streams
from adhesis.ensemble.doctor import examine
from adhesis.ensemble.run import launch
from adhesis.ensemble.run.launch import RanksEnd
from tests.support.campaign_support import adhesis as run_adhesis
from tests.support.campaign_support import (
    adhesis_here,
    campaign_text,
    differences,
    done_rows,
    start_python,
    wait_until,
    write_campaign,
)
from tests.support.launchers import MPIRUN

HAND_OVER = f'printf "%s" "$END" > "${launch.STARTED}"'
WORDS = "------\nno slots are left\n------"


@pytest.fixture
def launcher(tmp_path, monkeypatch):
    """Return what makes a launcher of a few lines of shell, and starts "ranks" with it."""
    monkeypatch.setattr(launch, "_LOOK_EVERY", 0.02)

    def run(script: str, **env: str) -> tuple[RanksEnd, list[str]]:
        path, lines = tmp_path / "mpirun", []
        path.write_text(f"#!/bin/bash\n{script}\n")
        path.chmod(0o755)
        for name, value in env.items():
            monkeypatch.setenv(name, value)
        return launch.run_ranks(str(path), 2, [], output=lines.append), lines

    return run


# ------------------------------------------------------------------------ who says what


def test_lines_of_ranks_are_passed_on_and_those_of_the_launcher_kept_back(launcher):
    """Also where lines of several processes have mixed, and after a NUL byte."""
    script = r"""
printf 'a transport warns\n\x1efirst\n'
printf '\0\x1esecond\n' >&2
printf 'half of a \x1ethird\x1efourth\n'
printf '\x1eno line end'
"""
    assert launcher(script) == (RanksEnd(0), ["first", "second", "third", "fourth", "no line end"])


def test_words_of_a_launcher_do_not_follow_those_of_its_ranks(launcher):
    script = f"echo before; {HAND_OVER}; printf '\\x1eof a rank\\n'; echo after; exit 1"
    end = RanksEnd(2, "adhesis run: a key is unknown")
    assert launcher(script, END="2\nadhesis run: a key is unknown") == (end, ["of a rank"])


def test_the_end_of_ranks_on_another_node_comes_with_their_lines(launcher):
    script = r"printf '\x1eof a rank\n\x1e\x1e74 adhesis run: the disk is full\n'; exit 1"
    end = RanksEnd(74, "adhesis run: the disk is full")
    assert launcher(script) == (end, ["of a rank"])


@pytest.mark.parametrize("here", [True, False], ids=["here", "on another node"])
def test_a_rank_hands_over_what_its_starter_reads(here, tmp_path, monkeypatch, capfd):
    end = tmp_path / "end"
    if here:
        end.touch()
    assert not launch.hand_over(2, "nobody has started this process")
    monkeypatch.setenv(launch.STARTED, str(end))
    assert launch.hand_over(2, "two\nlines")
    shown = capfd.readouterr().err
    assert (end.read_text(), shown) == ("2\ntwo\nlines", "") if here else True
    assert here or shown == "\x1e\x1e2 two lines\n"


def test_every_line_of_a_rank_is_marked_once(monkeypatch, capfd):
    monkeypatch.setenv(launch.STARTED, "/dev/null/no-file")
    raw = streams._Stderr(2, "w", closefd=False)
    assert [raw.write(data) for data in (b"one\ntw", b"o\n", b"th\rree\n\n")] == [6, 2, 8]
    assert capfd.readouterr().err == "\x1eone\n\x1etwo\n\x1eth\rree\n\x1e\n"
    monkeypatch.delenv(launch.STARTED)
    raw.write(b"four\n")
    assert capfd.readouterr().err == "four\n"


# ------------------------------------------------------------ launchers that fail or hang


@pytest.mark.parametrize("code", [1, 2, 75, 137, 243])
def test_a_launcher_that_starts_no_rank_is_bad_input_whatever_its_code(code, launcher, tmp_path):
    """Its words are shown; its code, which may be one of ours, is not taken for that of a rank."""
    folder = tmp_path / ".prte"
    folder.mkdir()
    (folder / "mca-params.conf").touch()
    given = {"OMPI_MCA_btl": "self\x1b", "HOME": str(tmp_path)}
    end, _ = launcher(f"echo '{WORDS}'; exit {code}", **given)
    assert (end.code, end.words) == (2, tuple(WORDS.splitlines()))
    sentence = (
        f"adhesis run: mpirun brought no ranks together and ended with {code}, for the reason"
    )
    assert end.sentence.startswith(sentence)
    assert "OMPI_MCA_btl=self\\x1b, " in end.sentence
    assert f"{folder}/mca-params.conf), or omit --ranks" in end.sentence


def test_a_launcher_that_says_nothing_leaves_a_hint(launcher, monkeypatch, tmp_path):
    for name in [name for name in os.environ if name.startswith(launch._SETTINGS)]:
        monkeypatch.delenv(name)
    end, _ = launcher("exit 1", HOME=str(tmp_path))
    assert end.sentence.endswith(
        "ended with 1, without a reason: adhesis doctor tests MPI, or omit --ranks"
    )


def test_ranks_that_had_met_and_end_without_a_code_were_killed(launcher):
    end, _ = launcher(rf"printf '\x1e\x1e\n'; echo '{WORDS}'; exit 1")
    assert (end.code, end.words) == (137, tuple(WORDS.splitlines()))
    assert "a rank was killed, or MPI failed (mpirun ended with 1); what was done" in end.sentence


@pytest.mark.parametrize("deaf", ["", "trap : TERM; "])
def test_a_launcher_whose_ranks_do_not_meet_in_time_is_ended(deaf, launcher, monkeypatch):
    monkeypatch.setattr(launch, "_MEETING", 0.3)
    monkeypatch.setattr(launch, "_TERMINATED", 0.3)
    end, _ = launcher(f"{deaf}echo no pipes are left; while :; do sleep 0.1; done")
    assert (end.code, end.words) == (2, ("no pipes are left",))
    assert "mpirun brought no ranks together within 0.3 s and was ended, for" in end.sentence


def test_a_launcher_that_hangs_after_its_ranks_have_ended_is_killed(launcher, monkeypatch, capfd):
    """The exit code and the message are those that the ranks have passed on."""
    monkeypatch.setattr(launch, "_LAUNCHER_ENDS", 0.1)
    monkeypatch.setattr(launch, "_LAUNCHER_KILLED", 0.1)
    end, _ = launcher(f"{HAND_OVER}; exec sleep 600", END="75\nstopped")
    assert end == RanksEnd(75, "stopped")
    text = "the run is over, but its launcher has not ended: it is ended in 0 s\n"
    assert capfd.readouterr().err == text


def test_a_process_that_holds_the_pipe_of_a_launcher_does_not_keep_the_run(launcher, tmp_path):
    """As a remote shell that a killed launcher leaves behind."""
    held = tmp_path / "held"
    os.mkfifo(held)
    began = time.monotonic()
    end, lines = launcher(rf"cat {held} & printf '\x1eof a rank\n'")
    assert (end, lines) == (RanksEnd(0), ["of a rank"])
    assert time.monotonic() - began < 60
    held.write_text("")  # which ends it


def test_a_launcher_that_cannot_be_started_is_one_sentence(tmp_path):
    path = tmp_path / "mpirun"
    path.write_bytes(b"\x7fELF")
    path.chmod(0o755)
    with pytest.raises(adhesis.InputError, match="mpirun cannot be started: Exec format error"):
        launch.run_ranks(str(path), 2, [])


@pytest.mark.parametrize(("numbers", "code"), [(["TERM"], 75), (["INT", "INT"], 130)])
def test_a_signal_before_the_ranks_have_met_ends_the_launcher(numbers, code, launcher, tmp_path):
    """Ranks that are still being loaded would die of the signal that stops them later."""
    script = f"trap 'echo $$ >> {tmp_path}/ended; (( ++n < {len(numbers)} )) || exit 1' TERM; "
    script += f"touch {tmp_path}/begun; while :; do sleep 0.05; done"

    ended = tmp_path / "ended"

    def send() -> None:
        wait_until((tmp_path / "begun").exists)
        for i, name in enumerate(numbers):
            os.kill(os.getpid(), getattr(signal, f"SIG{name}"))
            wait_until(lambda n=i: ended.exists() and len(ended.read_text().split()) > n)

    sender = threading.Thread(target=send)
    sender.start()
    end, _ = launcher(script)
    sender.join()
    assert end.code == code
    name = "stopped early: SIGTERM received" if code == 75 else "interrupted"
    assert end.sentence.startswith(f"adhesis run: {name}; what was done is kept")


# ------------------------------------------------------------------------ the real launcher

SITES = [
    {"OMPI_MCA_pml": "nosuch"},
    dict.fromkeys(
        ("OMPI_MCA_orte_default_hostfile", "PRTE_MCA_prte_default_hostfile"), "/dev/null/no-file"
    ),
    {"OMPI_MCA_btl": "self", "OMPI_MCA_pml": "ob1"},
]


@pytest.mark.mpi
@pytest.mark.parametrize("site", SITES, ids=lambda site: next(iter(site)))
def test_settings_of_a_site_that_start_no_rank_are_named(site, tmp_path, monkeypatch):
    """Those of Open MPI 4 and 5; the launcher's own words stand above."""
    for name, value in site.items():
        monkeypatch.setenv(name, value)
    out = tmp_path / "r.h5"
    process = adhesis_here("run", write_campaign(tmp_path), "--out", out, "--ranks", "3")
    assert process.returncode == 2, process.stderr
    *words, last = process.stderr.splitlines()
    assert words
    for name, value in site.items():
        assert f"{name}={value}" in last
    assert not out.exists()
    if site is SITES[0]:  # doctor takes the same list
        (check,) = [check for check in examine.examine().checks if check.name == "ranks"]
        assert not check.ok
        assert f"{name}={value}" in check.text


@pytest.mark.mpi
def test_ranks_write_a_file_with_a_path_of_any_length(tmp_path):
    """Open MPI 4.1 has buffers of 256 bytes for a path and what it adds."""
    folder = tmp_path.joinpath("d" * 120, "e" * 200)
    folder.mkdir(parents=True)
    path, out, whole = write_campaign(tmp_path), folder / f"{'n' * 240}.h5", tmp_path / "whole.h5"
    assert adhesis_here("run", path, "--out", whole, fake="").returncode == 0
    process = run_adhesis("run", path, "--out", out, "--ranks", 3, fake="")
    assert process.returncode == 0, process.stderr
    assert differences(out, whole) == []
    assert [path.name for path in folder.iterdir()] == [out.name]


UNDER_LIMIT = """
import resource, sys
from adhesis.ensemble.command.main import main
from adhesis.ensemble.run import launch
resource.setrlimit(resource.RLIMIT_NOFILE, (32, 32))
launch._MEETING = 10.0
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.mpi
def test_too_few_descriptors_for_a_launcher_end_with_its_reason(tmp_path):
    """Open MPI 4 hangs then, without a rank."""
    words = ("run", write_campaign(tmp_path), "--out", tmp_path / "r.h5", "--ranks", 3)
    process = start_python("-c", UNDER_LIMIT, *words)
    _, errors = process.communicate(timeout=150)
    assert process.returncode == 2, errors
    *reason, last = errors.splitlines()
    assert reason
    assert "brought no ranks together" in last


# ------------------------------------------------------------------------ from Python, by threads


def small_campaign() -> adhesis.Campaign:
    return adhesis.Campaign(campaign_text(realisations="1", hurst="[0.7]"))


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.mpi)])
def test_a_campaign_runs_outside_the_main_thread(ranks, tmp_path):
    """As asyncio.to_thread and servers call it; two at once leave stderr as it was."""
    outs = [tmp_path / f"{i}.h5" for i in range(3 - ranks)]
    before = sys.stderr

    async def all_of_them() -> list[adhesis.CampaignResults]:
        runs = (asyncio.to_thread(small_campaign().run, out, ranks=ranks) for out in outs)
        return await asyncio.gather(*runs)

    results = asyncio.run(all_of_them())
    assert [done_rows(out) for out in outs] == [2] * len(outs)
    assert results[0].dataset.loss.identical(results[-1].dataset.loss)
    assert sys.stderr is before


def test_without_mpi4py_ranks_are_processes(tmp_path, monkeypatch):
    """Without an mpirun as well: tests/ensemble/test_run.py."""
    monkeypatch.setattr(launch, "launcher", lambda: MPIRUN)
    monkeypatch.setattr(launch, "find_spec", lambda name: None)
    results = small_campaign().run(Path(tmp_path, "2.h5"), ranks=2)
    assert repr(results).endswith("2 done, 0 failed, 0 pending>")
    with h5py.File(tmp_path / "2.h5") as file:
        assert set(file["rank"][:]) == {1}
