"""The scripts of jobs/ in a real Slurm: jobs that are signalled, killed, cancelled, and in parts.

A munged, a slurmctld and a slurmd of their own are started on free ports with everything they write
in a scratch folder, and stopped afterwards. No service of this machine is touched. All jobs are
submitted at once, since each mostly waits for Slurm; the tests then watch one each.
"""

from __future__ import annotations

import contextlib
import getpass
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from adhesis.ensemble.run import launch
from tests.support.campaign_support import ROOT, campaign_text, done_rows, wait_until
from tests.support.launchers import PATH
from tests.support.processes import executable, ran

SCRIPT = ROOT / "jobs" / "slurm.sh"
pytestmark = pytest.mark.slurm


def processes_in(folder: Path, word: str) -> list[int]:
    """Return the processes with a word in their command line that work in a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().split(b"\0")
            if (process / "cwd").resolve() == folder and any(word.encode() in w for w in words):
                found.append(int(process.name))
        except OSError:
            continue
    return found


def free_ports(count: int) -> list[int]:
    """Return ports that are not of those which the system gives to ranks, and to any who ask."""
    found: list[int] = []
    for port in random.sample(range(20_000, 32_000), 1000):
        with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port)):
            found.append(port)
        if len(found) == count:
            break
    return found


@dataclass
class Cluster:
    """A Slurm of one node, and how to talk to it."""

    folder: Path
    env: dict[str, str]

    def call(self, *command: str) -> str:
        done = ran(*command, env=self.env, timeout=None)
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
        return done.stdout

    def job(self, number: str) -> dict[str, str]:
        text = self.call("scontrol", "--oneliner", "show", "job", number)
        pairs = [word.partition("=") for word in text.split()]
        return {key: value for key, _, value in pairs}

    def logs(self) -> str:
        texts = []
        for path in sorted(self.folder.glob("*.log")):
            texts.append(f"--- {path.name}\n" + "\n".join(path.read_text().splitlines()[-15:]))
        return "\n".join(texts)


# Ends daemons, steps and ranks, all of which name the folder in their environment, once its input
# ends: also where the tests are interrupted or killed, which the steps of Slurm outlive.
GUARD = """
import os, pathlib, shutil, signal, sys
sys.stdin.read()
name, folder = f"SLURM_CONF={sys.argv[1]}/slurm.conf".encode(), sys.argv[1]
found = True
while found:
    found = False
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            if name in (process / "environ").read_bytes().split(b"\\0"):
                os.kill(int(process.name), signal.SIGKILL)
                found = True
        except OSError:
            pass
shutil.rmtree(folder, ignore_errors=True)
"""


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    # Not below pytest's folder: munge wants a path that everybody may pass through.
    folder = Path(tempfile.mkdtemp(prefix="adhesis-slurm-"))
    folder.chmod(0o755)
    for name in ("state", "spool", "tmp"):
        (folder / name).mkdir()
    key = folder / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o400)
    node = socket.gethostname().split(".")[0]
    user, ports = getpass.getuser(), free_ports(2)
    (folder / "slurm.conf").write_text(
        f"""
ClusterName=adhesis-test
SlurmctldHost={node}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
# A requeued job waits until its old credential has expired: two minutes by default.
AuthInfo=socket={folder}/munge.socket,cred_expire=10
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
TmpFS={folder}/tmp
# PMIx and MPI name what ranks share by the numbers of user and job, which a second Slurm of this
# machine must not meet: its ranks would crash.
FirstJobId={100 * (os.getpid() % 500_000) + 1}
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
KillWait=5
SlurmdParameters=config_overrides
JobAcctGatherType=jobacct_gather/none
SchedulerParameters=sched_interval=2
# A finished job is looked at when its test comes, however late.
MinJobAge=86400
NodeName={node} NodeAddr=127.0.0.1 CPUs=32 State=UNKNOWN
PartitionName=test Nodes={node} Default=YES MaxTime=INFINITE State=UP
"""
    )
    # Control groups are often missing where tests run. Later versions can do without, earlier ones
    # need none as long as they look for the old kind.
    version = ran("slurmd", "-V", env=os.environ | {"PATH": PATH})
    found = re.search(r"(\d+)\.(\d+)", version.stdout)
    recent = found is not None and (int(found[1]), int(found[2])) >= (24, 5)
    plugin = "disabled" if recent else "cgroup/v1"
    (folder / "cgroup.conf").write_text(f"CgroupPlugin={plugin}\n")
    # As a user's shell: nothing of pytest's own batch job, if there is one.
    env = {k: v for k, v in launch.launch_environment(3).items() if not k.startswith("SLURM")}
    env |= {"PATH": PATH, "SLURM_CONF": str(folder / "slurm.conf")}
    cluster = Cluster(folder, env)
    guard = subprocess.Popen(
        [sys.executable, "-c", GUARD, folder], stdin=subprocess.PIPE, start_new_session=True
    )

    daemons: list[subprocess.Popen[bytes]] = []

    def start(*command: str | Path) -> None:
        with (folder / f"{command[0]}-output.log").open("wb") as log:
            daemons.append(
                subprocess.Popen(
                    command, env=env, stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=folder
                )
            )

    def idle() -> bool:
        return ran("sinfo", "--noheader", "--format=%T", env=env).stdout.strip() == "idle"

    try:
        socket_path = folder / "munge.socket"
        files = [f"--{name}-file={folder}/munge.{name}" for name in ("key", "pid", "log", "seed")]
        start("munged", "--foreground", "--force", f"--socket={socket_path}", *files)
        wait_until(socket_path.exists, 20)
        start("slurmctld", "-D", "-f", folder / "slurm.conf")
        start("slurmd", "-D", "-f", folder / "slurm.conf")
        try:
            wait_until(idle, 60, 0.2)
        except AssertionError:
            reason = f"no idle node within 60 s\n{cluster.logs()}"
            if os.environ.get("CI"):
                pytest.fail(reason)
            pytest.skip(f"Slurm is installed, but does not start here: {reason}")
        yield cluster
    finally:
        guard.communicate()  # which ends its input
        for daemon in daemons:
            daemon.wait()


@dataclass
class Job:
    """A job that was submitted from a folder of its own."""

    cluster: Cluster
    folder: Path
    number: str
    env: dict[str, str]

    def again(self, *words: str) -> Job:
        words = ("sbatch", "--parsable", "--ntasks=2", str(SCRIPT), "study.toml", *words)
        done = ran(*words, env=self.env, cwd=self.folder, timeout=None)
        assert done.returncode == 0, done.stderr
        return Job(self.cluster, self.folder, done.stdout.strip(), self.env)

    @property
    def values(self) -> dict[str, str]:
        return self.cluster.job(self.number)

    @property
    def log(self) -> str:
        path = self.folder / f"adhesis-{self.number}.log"
        return path.read_text() if path.exists() else ""

    def done_tasks(self) -> int:
        return done_rows(self.folder / "study.h5")

    def staged_tasks(self) -> int:
        return done_rows(next(self.folder.glob("disk/*/study.h5"), self.folder / "none"))

    def wait(self, what: Callable[[], object], text: str, seconds: float = 90) -> None:
        """Wait for a condition; the job and all logs in the message."""
        try:
            wait_until(what, seconds, 0.2)
        except AssertionError as error:
            about = f"{text}: not within {seconds:.0f} s\n{self.values}\n{self.log}\n"
            raise AssertionError(about + self.cluster.logs()) from error


@pytest.fixture(scope="module")
def submit(cluster: Cluster, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Job]:
    """Return what submits a campaign of 4 times so many tasks, from a folder with a comma.

    All is the real command but for the mechanics and the report. A rank of a first start computes
    two tasks and stays in the third one until it is stopped; after a restart, and in parts, tasks
    take no time.
    """
    mpirun = launch.launcher()
    if mpirun is None:
        pytest.skip("no mpirun here")

    def submit(*words, realisations=3, launcher="", staging="") -> Job:
        folder = tmp_path_factory.mktemp("a study, ")
        text = campaign_text(realisations=str(realisations))
        (folder / "study.toml").write_text(text)
        adhesis = executable(
            folder / "bin" / "adhesis",
            f"""#!/bin/sh
behaviour="log=begun hold=2"
if [ "$1" = report ]; then exec mkdir "$4"; fi
if [ -n "$SLURM_RESTART_COUNT$SLURM_ARRAY_TASK_ID" ]; then behaviour=log=begun; fi
exec "{sys.executable}" "{ROOT}/tests/support/fake_run.py" "$behaviour" "$@"
""",
        )
        (folder / "mpirun").write_text(f"{mpirun}\n")  # as set-up records it
        env = cluster.env | {"ADHESIS": str(adhesis), "LAUNCHER": launcher, "REPORT": "no"}
        env |= {"STAGING": staging and str(folder / staging)}
        if not words[0].startswith("/"):
            words = ("sbatch", "--parsable", *words, str(SCRIPT), "study.toml")
        done = ran(*words, env=env, cwd=folder, timeout=None)
        assert done.returncode == 0, done.stderr
        numbers = re.findall(r"\d+", done.stdout)
        return Job(cluster, folder, numbers[-1], env)

    return submit


@pytest.fixture(scope="module")
def jobs(cluster: Cluster, submit: Callable[..., Job]) -> dict[str, Job]:
    # Slurm looks at its clocks twice a minute and signals up to a minute early: soon, that is.
    limited = ("--ntasks=2", "--time=2", "--signal=B:USR1@85")
    jobs = {"limited": submit(*limited, realisations=10)}
    jobs["staged"] = submit("--ntasks=2", realisations=10, staging="disk")
    jobs["parts"] = submit(str(ROOT / "jobs" / "parts.sh"), "2", "--mem=1", "study.toml")
    jobs["killed"] = submit("--nodes=1", "--ntasks-per-node=3", realisations=10)
    jobs["cancelled"] = submit("--ntasks=2", realisations=10)
    if "pmix" in cluster.call("srun", "--mpi=list"):
        # Without SLURM_EXPORT_ENV ranks would lack PYTHONPATH.
        settings = "--export=ADHESIS,LAUNCHER,REPORT,PATH,SLURM_CONF,PYTHONPATH"
        jobs["srun"] = submit("--ntasks=2", settings, realisations=10, launcher="srun --mpi=pmix")
    return jobs


def test_a_cancelled_job_ends_and_starts_no_report(cluster: Cluster, jobs: dict[str, Job]) -> None:
    job = jobs["cancelled"]
    job.wait(lambda: job.done_tasks() > 0, "a first task")
    cluster.call("scancel", job.number)
    queue = ("squeue", "--noheader", "--format=%i")
    job.wait(lambda: job.number not in cluster.call(*queue), "gone")
    assert (job.values["JobState"], job.values["Restarts"]) == ("CANCELLED", "0")
    assert "it is not requeued" in job.log
    assert 0 < job.done_tasks() <= 2  # and the file is readable
    assert not (job.folder / "study").exists()


def test_a_job_with_a_rank_that_dies_comes_back_and_finishes(jobs):
    job = jobs["killed"]
    job.wait(lambda: job.done_tasks() > 0, "a first task")
    assert "3 ranks" in job.log  # by --ntasks-per-node
    ranks = processes_in(job.folder, "fake_run.py")
    assert len(ranks) == 3
    os.kill(max(ranks), signal.SIGKILL)
    job.wait(lambda: job.values["Restarts"] == "1", "requeued")
    assert "adhesis run ended with 137" in job.log
    job.wait(lambda: job.values["JobState"] == "COMPLETED", "finished")
    assert job.done_tasks() == 40


def test_two_jobs_of_one_campaign_with_staging_lose_no_row(cluster, jobs):
    """The second one comes while the first runs, which then comes back and finishes."""
    first = jobs["staged"]
    first.wait(lambda: first.staged_tasks() > 0, "a first task")
    second = first.again("--patience", "0")
    second.wait(lambda: second.values["JobState"] == "FAILED", "refused")
    assert "study.h5 is held by another job" in second.log
    assert first.staged_tasks() > 0
    assert not (first.folder / "study.h5").exists()
    cluster.call("scontrol", "requeue", first.number)
    first.wait(lambda: first.values["Restarts"] == "1", "requeued")
    first.wait(lambda: first.values["JobState"] == "COMPLETED", "finished")
    assert first.done_tasks() == 40
    assert list((first.folder / "disk").iterdir()) == []
    begun = (first.folder / "begun").read_text().split()
    assert len(set(begun)) == 40
    assert len(begun) <= 41  # only the task that the signal met was begun twice


def test_srun_passes_the_signal_on_too(cluster: Cluster, jobs: dict[str, Job]) -> None:
    if "srun" not in jobs:
        pytest.skip("this Slurm has no PMIx")
    job = jobs["srun"]
    job.wait(lambda: job.done_tasks() > 0, "a first task")
    # What Slurm does at the time limit (B: of --signal), without waiting for it.
    cluster.call("scancel", "--batch", "--signal=USR1", job.number)
    job.wait(lambda: job.values["Restarts"] == "1", "requeued")
    assert "adhesis run ended with 75" in job.log
    cluster.call("scancel", job.number)


def test_parts_run_as_an_array_and_are_joined(jobs: dict[str, Job]) -> None:
    merge = jobs["parts"]
    merge.wait(lambda: merge.values["JobState"] == "COMPLETED", "joined", 180)
    assert merge.done_tasks() == 12
    for part in ("study.1-of-2.h5", "study.2-of-2.h5"):
        assert done_rows(merge.folder / part) == 6
    assert (merge.folder / "study").is_dir()  # reported


def test_a_job_at_its_time_limit_is_requeued_and_finishes(cluster, jobs):
    job = jobs["limited"]
    job.wait(lambda: "USR1 received" in job.log, "signalled")
    job.wait(lambda: job.values["Restarts"] != "0", "requeued")
    assert "adhesis run ended with 75" in job.log
    assert "stopped early: SIGUSR1 received; 38 tasks are left" in job.log
    # A busy machine may take so long for the rest that it is signalled once more.
    job.wait(lambda: job.values["JobState"] == "COMPLETED", "finished", 300)
    starts = int(job.values["Restarts"]) + 1
    assert job.log.count("adhesis run ended with 75") == starts - 1
    assert job.log.count("adhesis run ended with 0") == 1
    assert job.done_tasks() == 40
    # What was done was not computed again: only a task that a signal met was begun twice.
    begun = (job.folder / "begun").read_text().split()
    assert len(set(begun)) == 40
    assert len(begun) <= 40 + starts - 1
