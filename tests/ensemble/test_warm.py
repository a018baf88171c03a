"""Compilation comes before the first task, once a node, with words, and never again."""

from __future__ import annotations

import argparse
import io
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from adhesis.ensemble import warm as ensemble_warm
from adhesis.ensemble.command import warm as command
from adhesis.solver import precompile as warm
from adhesis.solver.runtime import disk_cache as code_cache
from adhesis.solver.runtime import jit as door
from adhesis.solver.runtime.disk_cache import CodeFiles
from adhesis.solver.runtime.jit import Compilation
from tests.support.campaign_support import ROOT, campaign_text, environment, write_campaign
from tests.support.launchers import MPIRUN

# Another setting than any cache was made with: nothing is compiled yet, and it is quickly done.
COLD = {"NUMBA_OPT": "1"}


def logged_run(folder: Path, ranks: int, cache: Path) -> tuple[list[list[str]], str]:
    """Return what was begun, by process, in a small campaign, and what was said."""
    log = folder / "log"
    script = ROOT / "tests" / "support" / "logged_run.py"
    campaign = write_campaign(folder, hurst="[0.7]", realisations="1")
    words = [script, log, "run", campaign, "--out", folder / "r.h5"]
    done = subprocess.run(
        [MPIRUN, "-n", str(ranks), sys.executable, "-m", "mpi4py", *map(str, words)],
        env=environment(ADHESIS_CACHE=str(cache), **COLD),
        capture_output=True,
        text=True,
        timeout=150,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [line.split() for line in log.read_text().splitlines()], done.stderr


@pytest.mark.mpi
def test_three_ranks_with_an_empty_cache_compile_once_and_before_the_first_task(tmp_path):
    lines, said = logged_run(tmp_path, 3, tmp_path / "cache")
    compiling = [pid for pid, what in lines if what == "compiles"]
    assert len(set(compiling)) == 1
    assert "compiles" not in [what for _, what in lines[len(compiling) :]]
    assert [path.name for path in (tmp_path / "cache").glob("*/*.json")] == [warm._marker("grid")]
    assert said.count("compiling the method grid") <= 1


@pytest.mark.mpi
@pytest.mark.slow(reason="compiles on two ranks at once")
def test_without_a_folder_each_rank_compiles_before_the_first_task_and_one_line_warns(tmp_path):
    (tmp_path / "file").write_text("")
    lines, said = logged_run(tmp_path, 2, tmp_path / "file" / "beneath")
    compiling = [pid for pid, what in lines if what == "compiles"]
    assert len(set(compiling)) == 2
    for pid in set(compiling):
        own = [what for other, what in lines if other == pid]
        assert own == sorted(own)  # compiles, then computes
    assert said.count("cannot be kept") == 1


# Prints the number of functions that were compiled after warming up, and the kernels among them.
AFTER_WARMING = """
import os, sys
from pathlib import Path
import numpy as np
from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.task.compute import Runner
from adhesis.ensemble.trace.job import Cycle, Job, run
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.profile import self_affine_profile
from adhesis.solver.precompile import COMPILED_METHODS, compiled_in, warm, watch_compilation
def kept():
    return {path.name for path in Path(os.environ["ADHESIS_CACHE"]).glob("*/*")}
warm(method for method in COMPILED_METHODS if compiled_in(method) is None)
before = kept()
with watch_compilation() as seen:
    for text in sys.argv[1:]:
        campaign = parse_campaign(text, "a campaign")
        compute = Runner()
        for task in campaign.tasks():
            row = compute(campaign, task, None)
            assert np.isfinite(row["gap_density"]).any() and "field_gap" in row
    profile = self_affine_profile(0.7, period=1e-3, n0=1, ratio=4, seed=2, h_rms=1e-6)
    for method in ("sharp", "grid"):
        cycle = Cycle(HalfSpace(1e6, 0.5), (0.02,), (0.6,), 4, method, 0.05)
        run(Job("answer", profile, cycle, 0.02, 0.6))
print(seen.functions, *sorted(kept() - before))
"""


def test_after_warming_up_neither_campaigns_nor_traces_compile_anything(tmp_path):
    """In a new process with an empty folder of the user: all there is lies in the installation."""
    few = {"hurst": "[0.7]", "realisations": "1", "work_of_adhesion": "[0.04]"}
    sharp = campaign_text(**few, method='"sharp"').replace("nodes_per_wave = 16\n", "")
    several = sharp.replace("max_penetration = 0.6", "max_penetration = [0.3, 0.6]")
    texts = (several, campaign_text(**few))
    done = subprocess.run(
        [sys.executable, "-c", AFTER_WARMING, *texts],
        env=environment(ADHESIS_CACHE=str(tmp_path)),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.split() == ["0"], done.stdout + done.stderr


@pytest.fixture
def places(tmp_path, monkeypatch):
    """The installation's and the user's folder, both empty."""
    monkeypatch.setattr(code_cache, "installed_folder", lambda: tmp_path / "installed")
    monkeypatch.setattr(warm, "installed_folder", lambda: tmp_path / "installed")
    monkeypatch.setenv("ADHESIS_CACHE", str(tmp_path / "user"))
    files = CodeFiles("key"), CodeFiles("key", to_installation=True)

    def code_files(to_installation=False):
        return files[to_installation]

    for module in (door, warm):
        monkeypatch.setattr(module, "code_files", code_files)
    return tmp_path / "installed", tmp_path / "user"


@pytest.mark.parametrize("own", [False, True])
def test_the_command_keeps_code_for_all_or_for_the_user(places, own, capsys, monkeypatch):
    monkeypatch.setattr(warm, "_small_loops", lambda *_: None)
    assert command.execute(argparse.Namespace(own=own)) == 0
    for method in warm.COMPILED_METHODS:
        assert (places[own] / "key" / warm._marker(method)).is_file()
    assert not places[not own].exists()
    capsys.readouterr()
    monkeypatch.setattr(warm, "_small_loops", lambda *_: pytest.fail("compiled again"))
    assert command.execute(argparse.Namespace(own=own)) == 0
    assert "compiled before" in capsys.readouterr().out


def test_the_command_puts_the_users_code_into_the_installation(places, monkeypatch):
    monkeypatch.setattr(warm, "_small_loops", lambda *_: door._files().read("code"))
    CodeFiles("key").write("code", b"machine code")
    assert command.execute(argparse.Namespace(own=False)) == 0
    assert (places[0] / "key" / "code").read_bytes() == b"machine code"


def test_code_that_cannot_be_kept_is_told(places, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(warm, "_small_loops", lambda *_: None)
    (tmp_path / "installed").write_text("")
    (tmp_path / "user").write_text("")
    assert command.execute(argparse.Namespace(own=False)) == 1
    assert "cannot be kept" in capsys.readouterr().out


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def compile_for(places, monkeypatch):
    """A function that runs ``compile`` while a compilation of so many seconds is simulated."""
    watches = []
    original = door.watch_compilation

    def watch(report):
        watches.append(report)
        return original(report)

    def run(seconds: float, start: Callable[[], object]) -> None:
        def small_loops(*_: object) -> None:
            seen = Compilation(watches[-1])
            for i in range(40):
                seen.functions, seen.seconds = i, seconds * i / 40
                seen._report(seen)

        monkeypatch.setattr(warm, "watch_compilation", watch)
        monkeypatch.setattr(warm, "_small_loops", small_loops)
        start()

    return run


def test_compiling_that_takes_a_while_is_reported_and_a_moment_is_not(places, compile_for):
    lines: list[str] = []
    total = warm.functions_of(["sharp", "grid"])
    compile_for(32.0, lambda: ensemble_warm.warm_up(["sharp", "grid"], lines.append))
    assert lines[0].startswith("compiling the methods sharp and grid for ")
    assert lines[0].endswith(f"about {total} functions, once")
    assert [line.startswith("compiling: ") for line in lines[1:-1]] == [True] * 2
    assert f" of about {total} functions in " in lines[1]
    assert lines[-1].startswith("compiled ")
    assert f"kept in {places[1] / 'key'}" in lines[-1]
    lines.clear()
    compile_for(0.5, lambda: ensemble_warm.warm_up(["sharp", "grid"], lines.append))
    assert lines == []


@pytest.mark.parametrize("quiet", [False, True])
def test_on_a_terminal_a_bar_shows_how_far_compiling_is(compile_for, quiet, monkeypatch):
    terminal = _Terminal()
    total = warm.functions_of(["sharp"], many_gaps=False)
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("TERM", "xterm")
    compile_for(90.0, lambda: ensemble_warm.warm_missing(["sharp"], quiet=quiet, many_gaps=False))
    shown = terminal.getvalue()
    if quiet:
        assert shown == ""
        return
    assert f"about {total} functions" in shown
    assert "compiling, 39 functions" in shown  # the last that is begun
    assert " s left" in shown
    assert "compiling: " not in shown  # no lines beside the bar


def test_code_for_few_gaps_is_enough_for_a_loop_and_not_for_a_campaign(places, compile_for):
    compile_for(2.0, lambda: ensemble_warm.warm_missing(["sharp"], quiet=True, many_gaps=False))
    assert warm.compiled_in("sharp", many_gaps=False) is not None
    assert warm.compiled_in("sharp") is None
    assert 0 < warm.functions_of(["sharp"]) < warm.functions_of(["sharp", "grid"]) < 200
    compile_for(2.0, lambda: ensemble_warm.warm_missing(["sharp", "grid"], quiet=True))
    assert None not in [warm.compiled_in(method) for method in warm.COMPILED_METHODS]
