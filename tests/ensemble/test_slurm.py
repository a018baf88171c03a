"""jobs/slurm.sh in a real Slurm: signalled at the time limit, requeued, finished.

A munged, a slurmctld and a slurmd of their own are started on free ports with everything they write
in a scratch folder, and stopped afterwards. No service of this machine is touched.
"""

from __future__ import annotations

import getpass
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DONE
from adhesis.ensemble.run import launch
from tests.support.campaign_support import CAMPAIGN
from tests.support.launchers import PATH

ROOT = Path(__file__).parent.parent.parent
pytestmark = pytest.mark.slurm


def wait_for(what: Callable[[], object], text: str, seconds: float) -> None:
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            raise TimeoutError(f"{text}: not within {seconds:.0f} s")
        time.sleep(0.2)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
    return port


@dataclass
class Cluster:
    """A Slurm of one node, and how to talk to it."""

    folder: Path
    env: dict[str, str]

    def call(self, *command: str | Path, cwd: Path | None = None) -> str:
        """Run a command of Slurm's; its output."""
        done = subprocess.run(
            command, env=self.env, cwd=cwd, capture_output=True, text=True, timeout=60, check=False
        )
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
        return done.stdout

    def job(self, number: str) -> dict[str, str]:
        """What scontrol tells of a job."""
        text = self.call("scontrol", "--oneliner", "show", "job", number)
        pairs = [word.partition("=") for word in text.split()]
        return {key: value for key, _, value in pairs}

    def logs(self) -> str:
        """How the daemons' logs end."""
        texts = []
        for path in sorted(self.folder.glob("*.log")):
            texts.append(f"--- {path.name}\n" + "\n".join(path.read_text().splitlines()[-15:]))
        return "\n".join(texts)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    # Not below pytest's folder: munge wants a path that everybody may pass through.
    folder = Path(tempfile.mkdtemp(prefix="adhesis-slurm-"))
    folder.chmod(0o755)
    for name in ("state", "spool"):
        (folder / name).mkdir()
    key = folder / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o400)
    node = socket.gethostname().split(".")[0]
    user = getpass.getuser()
    (folder / "slurm.conf").write_text(
        f"""
ClusterName=adhesis-test
SlurmctldHost={node}(127.0.0.1)
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
# A requeued job waits until its old credential has expired: two minutes by default.
AuthInfo=socket={folder}/munge.socket,cred_expire=10
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
ReturnToService=2
JobAcctGatherType=jobacct_gather/none
SchedulerParameters=sched_interval=2
NodeName={node} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=test Nodes={node} Default=YES MaxTime=INFINITE State=UP
"""
    )
    # Control groups are often missing where tests run. Later versions can do without, earlier ones
    # need none as long as they look for the old kind.
    version = subprocess.run(["slurmd", "-V"], env=os.environ | {"PATH": PATH}, capture_output=True)
    found = re.search(rb"(\d+)\.(\d+)", version.stdout)
    recent = found is not None and (int(found[1]), int(found[2])) >= (24, 5)
    plugin = "disabled" if recent else "cgroup/v1"
    (folder / "cgroup.conf").write_text(f"CgroupPlugin={plugin}\n")
    # As a user's shell: nothing of pytest's own batch job, if there is one.
    env = {k: v for k, v in launch.launch_environment(3).items() if not k.startswith("SLURM")}
    env |= {"PATH": PATH, "SLURM_CONF": str(folder / "slurm.conf")}
    cluster = Cluster(folder, env)
    daemons: list[subprocess.Popen[bytes]] = []

    def start(*command: str | Path) -> None:
        with (folder / f"{command[0]}-output.log").open("wb") as log:
            daemons.append(
                subprocess.Popen(
                    command, env=env, stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=folder
                )
            )

    def idle() -> bool:
        done = subprocess.run(
            ["sinfo", "--noheader", "--format=%T"], env=env, capture_output=True, text=True
        )
        return done.stdout.strip() == "idle"

    try:
        socket_path = folder / "munge.socket"
        files = [f"--{name}-file={folder}/munge.{name}" for name in ("key", "pid", "log", "seed")]
        start("munged", "--foreground", "--force", f"--socket={socket_path}", *files)
        wait_for(socket_path.exists, "munged", 20)
        start("slurmctld", "-D", "-f", folder / "slurm.conf")
        start("slurmd", "-D", "-f", folder / "slurm.conf")
        try:
            wait_for(idle, "an idle node", 60)
        except TimeoutError as error:
            reason = f"{error}\n{cluster.logs()}"
            if os.environ.get("CI"):
                pytest.fail(reason)
            pytest.skip(f"Slurm is installed, but does not start here: {reason}")
        yield cluster
    finally:
        for daemon in reversed(daemons):
            daemon.terminate()
        for daemon in reversed(daemons):
            try:
                daemon.wait(timeout=5)  # nothing that it could still save is needed
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def study(cluster: Cluster, tmp_path: Path) -> Path:
    """A folder to submit from: a campaign of 40 tasks, and a adhesis that takes 1 s for each.

    All is the real command but for the mechanics, so that the test is as long everywhere. After
    a restart the tasks take no time.
    """
    (tmp_path / "study.toml").write_text(
        CAMPAIGN.replace("realisations = 2", "realisations = 10").replace(
            "load_steps = 4", "load_steps = 10"
        )
    )
    adhesis = tmp_path / "adhesis"
    adhesis.write_text(
        f"""#!/bin/sh
step=0.1
if [ -n "$SLURM_RESTART_COUNT" ]; then step=0; fi
exec {sys.executable} {ROOT}/tests/support/fake_run.py "step=$step log={tmp_path}/begun" "$@"
"""
    )
    adhesis.chmod(0o755)
    launcher = launch.launcher()
    if launcher is None:
        pytest.skip("no mpirun here")
    cluster.env |= {"ADHESIS": str(adhesis), "LAUNCHER": f"{launcher} -n 2"}
    return tmp_path


def submit(cluster: Cluster, study: Path, *options: str) -> str:
    script = ROOT / "jobs" / "slurm.sh"
    return cluster.call("sbatch", "--parsable", *options, script, "study.toml", cwd=study).strip()


def done_tasks(study: Path) -> int:
    file = study / "study.h5"
    if not file.exists():
        return 0
    return int((Results(file).status() == DONE).sum())


def states(cluster: Cluster, number: str, study: Path) -> str:
    """Where the job is, and its log: for messages."""
    log = study / f"adhesis-{number}.log"
    text = log.read_text() if log.exists() else "no log"
    return f"{cluster.job(number)}\n{text}\n{cluster.logs()}"


def test_a_cancelled_job_ends_and_stays_away(cluster: Cluster, study: Path) -> None:
    number = submit(cluster, study)
    wait_for(lambda: done_tasks(study) > 0, "a first task", 60)
    cluster.call("scancel", number)
    wait_for(lambda: cluster.job(number)["JobState"] == "CANCELLED", "cancelled", 60)
    wait_for(lambda: number not in cluster.call("squeue", "--noheader", "--format=%i"), "gone", 60)
    job = cluster.job(number)
    assert (job["JobState"], job["Restarts"]) == ("CANCELLED", "0")
    assert 0 < done_tasks(study) < 40  # and the file is readable


def test_a_job_at_its_time_limit_is_requeued_and_finishes(cluster: Cluster, study: Path) -> None:
    # Slurm looks at its clocks twice a minute and signals up to a minute early: soon, that is.
    number = submit(cluster, study, "--time=2", "--signal=B:USR1@85")
    log = study / f"adhesis-{number}.log"
    try:
        wait_for(lambda: cluster.job(number)["Restarts"] == "1", "requeued", 90)
        before = done_tasks(study)
        assert 0 < before < 40
        assert "USR1 received" in log.read_text()
        assert "adhesis run ended with 75" in log.read_text()
        # Time enough for the rest, which would be signalled as soon otherwise.
        cluster.call("scontrol", "update", f"JobId={number}", "TimeLimit=60")
        wait_for(lambda: cluster.job(number)["JobState"] == "COMPLETED", "finished", 180)
    except (AssertionError, TimeoutError) as error:
        raise AssertionError(f"{error}\n{states(cluster, number, study)}") from error
    assert cluster.job(number)["Restarts"] == "1"
    assert "adhesis run ended with 0" in log.read_text()
    assert done_tasks(study) == 40
    assert (study / "study" / "losses.csv").exists()
    # What was done was not computed again: only the task that the signal met was begun twice.
    begun = (study / "begun").read_text().split()
    assert len(set(begun)) == 40
    assert len(begun) <= 41


def test_srun_passes_the_signal_on_too(cluster: Cluster, study: Path) -> None:
    if "pmix" not in cluster.call("srun", "--mpi=list"):
        pytest.skip("this Slurm has no PMIx")
    cluster.env["LAUNCHER"] = "srun --mpi=pmix"
    number = submit(cluster, study)
    log = study / f"adhesis-{number}.log"
    try:
        wait_for(lambda: done_tasks(study) > 0, "a first task", 60)
        # What Slurm does at the time limit (B: of --signal), without waiting for it.
        cluster.call("scancel", "--batch", "--signal=USR1", number)
        wait_for(lambda: cluster.job(number)["Restarts"] == "1", "requeued", 60)
        assert "adhesis run ended with 75" in log.read_text()
    except (AssertionError, TimeoutError) as error:
        raise AssertionError(f"{error}\n{states(cluster, number, study)}") from error
    finally:
        cluster.call("scancel", number)
