"""No process that adhesis starts imports anything from the user's working directory."""

import os
import sys

import pytest

from adhesis.ensemble.doctor import examine
from adhesis.ensemble.run import launch
from adhesis.ensemble.trace.loops import Cycle, Loops, Run
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.profile import single_wave
from tests.support.campaign_support import ROOT, has_ended, started, wait_until

# A loop that the solver refuses: no loop turns below full penetration.
CYCLE = Cycle(HalfSpace(1.0, 0.5), (1.0,), (2.0,), 4, "grid")
IMPOSSIBLE = Run("only", single_wave(0.01, 1.0), CYCLE, 1.0, 2.0)
STRAY = ("numpy", "mpi4py", "solver", "ensemble", "h5py", "json", "pickle", "ctypes")


@pytest.fixture
def study(tmp_path, monkeypatch):
    """A working directory with modules that leave a file when they are executed."""
    for name in STRAY:
        executed = tmp_path / f"executed-{name}"
        (tmp_path / f"{name}.py").write_text(f"open({str(executed)!r}, 'w').close()\n")
    monkeypatch.chdir(tmp_path)
    # an empty entry is the working directory, too
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["", str(ROOT), ""]))
    yield tmp_path
    assert not sorted(path.name for path in tmp_path.glob("executed-*"))


def test_the_environment_of_a_process_names_this_package_and_no_working_directory(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["", "/a", "", "/b", ""]))
    assert launch.python_environment()["PYTHONPATH"].split(os.pathsep) == [str(ROOT), "/a", "/b"]
    monkeypatch.delenv("PYTHONPATH")
    assert launch.python_environment()["PYTHONPATH"] == str(ROOT)
    # where it is installed the interpreter finds it, and PYTHONPATH would shadow the library
    monkeypatch.setattr(launch.sysconfig, "get_path", lambda name: str(ROOT))
    assert launch.python_environment()["PYTHONPATH"] == ""


def test_doctor_and_workers_execute_nothing_of_the_working_directory(study):
    reports, failure = examine._run_probe([], study)
    assert failure == ""
    assert len(reports) == 1
    (answer,) = Loops([IMPOSSIBLE], 1).run().values()
    assert str(answer).startswith("ValueError")  # from the solver, so that was found


PARENT = """
import subprocess, time
from adhesis.ensemble.run.launch import end_with_parent
child = subprocess.Popen(["sleep", "600"], preexec_fn=end_with_parent)
print(child.pid, flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the system ends children on Linux alone")
def test_a_process_ends_with_its_parent_even_if_that_is_killed():
    """Workers of a run, which see that their sockets end: test_mpi.py."""
    parent = started([sys.executable, "-c", PARENT])
    child = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    wait_until(lambda: has_ended(child))
