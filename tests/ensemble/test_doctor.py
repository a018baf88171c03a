"""`adhesis doctor`: what it says is what was tried."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from adhesis.ensemble.command.main import main
from adhesis.ensemble.doctor import examine as doctor
from tests.support.campaign_support import run_python, wait_until
from tests.support.processes import executable


@pytest.fixture(scope="module")
def findings() -> dict[str, Any]:
    """Of a process that a launcher could have started: it must not take itself for a rank."""
    of_a_rank = {"OMPI_COMM_WORLD_SIZE": "4", "OMPI_MCA_ess": "pmi", "PMIX_RANK": "0"}
    done = run_python("-m", "adhesis", "doctor", "--json", **of_a_rank, PMI_RANK="0")
    found: dict[str, Any] = json.loads(done.stdout)
    assert done.returncode == (0 if found["usable"] else 1), done.stderr
    return found


def test_this_installation_is_usable(findings: dict[str, Any]) -> None:
    failed = [check for check in findings["checks"] if check["needed"] and not check["ok"]]
    assert findings["usable"], failed


def test_parallel_hdf5_means_that_ranks_wrote_a_file(findings: dict[str, Any]) -> None:
    written = [c["ok"] for c in findings["checks"] if c["name"] == "mpio writing available"]
    if "parallel" not in findings["versions"]["hdf5"]:
        assert written == []
        assert findings["writer"] == "rank 0"
    else:
        assert written == [True]
        assert findings["writer"] == "mpio"


def test_text_names_the_writer_and_every_library(findings, monkeypatch, capsys):
    found = {name: value for name, value in findings.items() if name != "usable"}
    checks = [doctor.Check(**check) for check in findings["checks"]]
    diagnosis = doctor.Diagnosis(**{**found, "checks": checks})
    monkeypatch.setattr("adhesis.ensemble.command.doctor.examine", lambda directory: diagnosis)
    assert main(["doctor"]) == (0 if findings["usable"] else 1)
    text = capsys.readouterr().out
    for word in ("MPI ", "mpirun ", "HDF5 ", "FFTW ", "kernels ", "cores ", "writer "):
        assert f"\n{word}" in text


@pytest.mark.mpi
def test_a_launcher_of_another_mpi_is_told_from_the_right_one(tmp_path, monkeypatch, capsys):
    # As the other MPI's mpirun does to these ranks: two processes, each alone in its world.
    wrong = executable(tmp_path / "mpirun", '#!/bin/sh\nshift 2\n"$@" & "$@"\nwait\n')
    monkeypatch.setenv("MPIRUN", str(wrong))
    assert main(["doctor", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    (check,) = [check for check in found["checks"] if check["name"] == "ranks"]
    assert not check["ok"]
    assert "another MPI" in check["text"]
    assert found["writer"] == "rank 0"


def test_a_launcher_that_hangs_is_given_up_and_may_end_its_ranks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has its time limit as soon as it hangs, and all else the one of the product."""
    begun, ended = tmp_path / "begun", tmp_path / "ended"
    hanging = executable(
        tmp_path / "mpirun",
        '#!/bin/sh\n[ "$1" = --version ] && exit\n'
        f'trap \'echo > "{ended}"; kill $!; exit 1\' TERM\nsleep 600 & echo > "{begun}"; wait\n',
    )
    communicate = subprocess.Popen.communicate

    def at_once(process, input=None, timeout=None):
        words = list(map(str, process.args))
        if str(hanging) in words and "--version" not in words and timeout == doctor._TIME_LIMIT:
            wait_until(begun.exists)
            timeout = 0.01
        return communicate(process, input, timeout)

    monkeypatch.setattr(subprocess.Popen, "communicate", at_once)
    monkeypatch.setenv("MPIRUN", str(hanging))
    diagnosis = doctor.examine()
    assert not diagnosis.usable
    assert any("did not end within" in check.text for check in diagnosis.checks)
    assert ended.exists()
