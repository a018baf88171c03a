"""A test in which mpirun itself crashes or hangs runs once more; no other test does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent

TESTS = """
import pytest

runs = []
crash = "PMIx_" + "server_finalize"  # not to be read in the source of the test

@pytest.fixture(scope="module")
def shared():
    runs.append("shared")
    return "shared"

@pytest.mark.parametrize("stack", [crash, "adhesis"])
@pytest.mark.parametrize("crashes", [1, 2])
def test_crash(stack, crashes, shared):
    runs.append((len(stack), crashes))
    assert runs.count((len(stack), crashes)) > crashes, stack

def test_count(shared):
    assert len(runs) == 1 + 2 * 2 + 2
"""


def lines_of(tests: str, folder: Path) -> list[str]:
    """Return what pytest prints about these tests."""
    path = folder / "test_it.py"
    path.write_text(tests)
    words = ("-q", "-rA", "-p", "tests.support.launcher_crash", "-c", "/dev/null", str(path))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words], cwd=ROOT, capture_output=True, text=True
    )
    return done.stdout.splitlines()


def test_a_test_runs_once_more_if_mpirun_crashes_in_it(tmp_path: Path) -> None:
    lines = lines_of(TESTS, tmp_path)
    passed = {line.split("::")[1] for line in lines if line.startswith("PASSED")}
    failed = {line.split("::")[1].split()[0] for line in lines if line.startswith("FAILED")}
    crash = "PMIx_" + "server_finalize"
    assert passed == {f"test_crash[1-{crash}]", "test_count"}
    assert failed == {"test_crash[1-adhesis]", f"test_crash[2-{crash}]", "test_crash[2-adhesis]"}
    assert any("mpirun itself crashed: this test runs once more" in line for line in lines)


HANGING = """
import os
import shutil
import subprocess

import pytest

from tests.support import campaign_support

runs = []

@pytest.mark.parametrize("ranks", [0, 1])
def test_hang(ranks, tmp_path):
    launcher = tmp_path / "mpirun"
    shutil.copy(shutil.which("bash"), launcher)
    runs.append(ranks)
    if runs.count(ranks) == 1:
        words = [launcher, "-c", "exec 3<&0; cat <&3 & echo; wait" if ranks else "echo; read"]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        process = subprocess.Popen(words, **pipes)
        process.stdout.readline()
        process.wait(timeout=0.1)

def test_hang_of_a_command(tmp_path, monkeypatch):
    launcher = tmp_path / "mpirun"
    os.mkfifo(tmp_path / "unwritten")
    launcher.write_text(f"#!/bin/bash\\nread < {tmp_path}/unwritten\\n")
    launcher.chmod(0o700)
    monkeypatch.setattr(campaign_support, "MPIRUN", str(launcher))
    runs.append("command")
    if runs.count("command") == 1:
        campaign_support.adhesis("status", ranks=1, timeout=0.1)
"""


def test_a_test_runs_once_more_if_mpirun_hangs_in_it_without_ranks(tmp_path: Path) -> None:
    lines = lines_of(HANGING, tmp_path)
    passed = [line.split("::")[1] for line in lines if line.startswith("PASSED")]
    assert passed == ["test_hang[0]", "test_hang_of_a_command"]
    failed = [line.split("::")[1].split()[0] for line in lines if line.startswith("FAILED")]
    assert failed == ["test_hang[1]"]
