"""No process that adhesis starts imports anything from the user's working directory."""

import json
import os
import signal
import subprocess
import sys
from multiprocessing import Pipe

import pytest

from adhesis.ensemble.doctor import examine
from adhesis.ensemble.run import launch
from adhesis.ensemble.trace.loops import Cycle, Loops, Run
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.profile import single_wave
from tests.support.campaign_support import ROOT, environment, has_ended, wait_until

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
    (probe,) = [examine._run_probe([], study)]
    assert probe.failure == ""
    assert len(probe.reports) == 1
    (answer,) = Loops([IMPOSSIBLE], 1).run().values()
    assert str(answer).startswith("ValueError")  # from the solver, so that was found


PARENT = """
import json, subprocess, sys, time
from adhesis.ensemble.run.launch import python, python_environment
worker = subprocess.Popen(
    python("-m", "adhesis.ensemble.run.processes", "1", sys.argv[1]),
    pass_fds=[int(sys.argv[1])],
    env=python_environment(),
)
print(json.dumps(worker.pid), flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the system ends children on Linux alone")
def test_a_worker_ends_with_its_parent_even_if_that_is_killed():
    """Its socket is held open by this process, so that the socket's end does not end it."""
    ours, theirs = Pipe()
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(theirs.fileno())],
        env=environment(),
        stdout=subprocess.PIPE,
        pass_fds=[theirs.fileno()],
    )
    try:
        worker = json.loads(parent.stdout.readline())
        ours.send((divmod, None, 10.0))
        ours.send((False, ("task", 0)))
        while (message := ours.recv())[0] == "alive":
            pass
        assert message[0] == "outcome"  # so it has come to its task
        parent.send_signal(signal.SIGKILL)
        parent.wait()
        wait_until(lambda: has_ended(worker))
    finally:
        ours.close()
        theirs.close()
        parent.kill()
        parent.wait()
