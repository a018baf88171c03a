"""What the tests of campaigns share: campaigns, fake tasks, commands under mpirun."""

import contextlib
import csv
import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import h5py
import numpy as np
import pytest

from adhesis.ensemble.campaign.tables import Campaign, growth
from adhesis.ensemble.command import run
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.run import launch
from tests.support.fake_run import fake_engine
from tests.support.launchers import MPIRUN
from tests.support.processes import ran

ROOT = Path(__file__).resolve().parent.parent.parent
TESTS = Path(__file__).resolve().parent

MOST_RANKS = 100  # more than cores anywhere: what a launcher needs to start them is set

# Time, place and version may differ between two runs of one campaign, and so the checksums of rows;
# nothing else may.
TIMING = {"wall_time", "cpu_time", "rank", "computed_by", "checksum"}

CAMPAIGN = """\
[profile]
period = 1e-3
n0 = 1
ratio = 4
h_rms = 1e-6

[material]
young = 1e6
poisson = 0.5

[sweep]
hurst = [0.7, 0.8]
work_of_adhesion = [0.01, 0.04]
realisations = 2
seed = 5

[cycle]
max_penetration = 0.6
load_steps = 4
unloading_until = -3

[solver]
method = "grid"
nodes_per_wave = 16

[output]
jumps = 8
"""


def campaign_text(**changes: str) -> str:
    lines = CAMPAIGN.splitlines()
    for key, value in changes.items():
        place = next(i for i, line in enumerate(lines) if line.startswith(f"{key} = "))
        lines[place] = f"{key} = {value}"
    return "\n".join(lines) + "\n"


def differing(old: Campaign, new: Campaign) -> list[str]:
    """Return a phrase for each key that makes the new campaign another one."""
    with pytest.raises(InputError, match=r"^f holds another campaign: .* there: f\)$") as refusal:
        growth("f", old, new)
    return str(refusal.value).partition(": ")[2].rpartition(" (here: ")[0].split("; ")


def write_campaign(folder: Path, name: str = "c.toml", **changes: str) -> Path:
    path = folder / name
    path.write_text(campaign_text(**changes))
    return path


def environment(**extra: str) -> dict[str, str]:
    """Return an environment in which mpirun works even from a process that has loaded MPI."""
    dirty = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "SLURM_", "MPI4PY_RC_")
    env = {k: v for k, v in os.environ.items() if not k.startswith(dirty)}
    with patch.dict(os.environ, env, clear=True):
        allowed = launch.launch_environment(MOST_RANKS)
    return allowed | {"PYTHONPATH": str(ROOT)} | extra


def command(words: Iterable[object], ranks: int = 0, fake: str | None = None) -> list[str]:
    """Return the command line of ``adhesis WORDS``, under mpirun if ranks are given."""
    entry = [str(TESTS / "fake_run.py"), fake] if fake is not None else ["-m", "adhesis"]
    start = [MPIRUN, "-n", str(ranks)] if ranks else []
    module = ["-m", "mpi4py"] if ranks else []
    return [*start, sys.executable, *module, *entry, *map(str, words)]


def adhesis(*words: object, **how: Any) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, started as by ``start``; TimeoutExpired if that does not come."""
    process = start(*words, **how)
    try:
        out, errors = process.communicate(timeout=150.0)
    except BaseException:  # Ctrl-C does not reach a process group of its own
        if process.pid not in hung_launchers():  # which are left to whoever looks for them
            kill_all(process)
        raise
    return subprocess.CompletedProcess(process.args, process.returncode, out, errors)


def adhesis_here(*words: object, fake: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command to its end in this process, which takes a tenth of the time of a new one."""
    execute = run.execute if fake is None else partial(run.execute, engine=fake_engine(fake))
    out, errors = io.StringIO(), io.StringIO()
    with (
        patch.object(run, "execute", execute),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(errors),
    ):
        code = main(list(map(str, words)))
    return subprocess.CompletedProcess(list(words), code, out.getvalue(), errors.getvalue())


def start(
    *words: object, ranks: int = 0, fake: str | None = None, cwd: Path | None = None
) -> subprocess.Popen[str]:
    """Start a command in a process group of its own."""
    return started(command(words, ranks, fake), cwd)


def started(line: Sequence[str | Path], cwd: Path | None = None) -> subprocess.Popen[str]:
    """Start a command line in a process group of its own."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(
        line, env=environment(), cwd=cwd, **pipes, text=True, start_new_session=True
    )


def run_python(*words: object, **extra: str) -> subprocess.CompletedProcess[str]:
    return ran(sys.executable, *words, env=environment(**extra))


def ranks_of(launcher: int) -> list[int]:
    """Return the process ids of the ranks that a launcher has started."""
    pids = (int(path.name) for path in Path("/proc").glob("[0-9]*"))
    return sorted(pid for pid in pids if stat_of(pid)[1:2] == [str(launcher)])


def stat_of(pid: int) -> list[str]:
    """Return the fields of /proc/PID/stat from the state on; none of a process that is gone."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def has_ended(pid: int) -> bool:
    return stat_of(pid)[:1] in ([], ["Z"])


def hung_launchers() -> list[int]:
    """Return the launchers among this process's children that have no ranks any more."""
    return [
        pid
        for pid in ranks_of(os.getpid())
        if not has_ended(pid)
        and Path(f"/proc/{pid}/comm").read_text().strip() in ("mpirun", "orterun", "prterun")
        and all(has_ended(rank) for rank in ranks_of(pid))
    ]


def wait_until(condition: Callable[[], bool], seconds: float = 150.0, every: float = 0.05) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(every)


def table_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a .csv, by the names of its columns."""
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def done_rows(path: Path) -> int:
    """Return the number of done rows of a results file that may not exist yet."""
    if not path.exists():
        return 0
    with h5py.File(path, "r", locking=False) as file:
        return int(np.sum(file["status"][:] == 1))


def kill_all(process: subprocess.Popen[str]) -> None:
    """Kill -9 a launcher and its ranks, as a machine that goes down does."""
    for pid in [*ranks_of(process.pid), process.pid]:
        os.kill(pid, signal.SIGKILL)
    process.wait()


def differences(one: Path, two: Path) -> list[str]:
    """Return the datasets, timing aside, that differ in a bit."""
    with h5py.File(one) as a, h5py.File(two) as b:
        assert set(a) == set(b)
        return [
            name
            for name in a
            if name not in TIMING and a[name][()].tobytes() != b[name][()].tobytes()
        ]
