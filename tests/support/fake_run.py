"""``python fake_run.py BEHAVIOUR run …``: the command line with tasks that cost what a test wants.

BEHAVIOUR is a list of words, tasks given as H:γ:realisation with ``*`` for any:
``step=SECONDS`` time of a load step, ``fail=TASK`` raise, ``hang=TASK`` never reach the next load
step, ``log=FILE`` write a line for each task begun, ``crash=TASK`` an error that is not a task's,
``serial=1`` as if HDF5 had no MPI, ``full=BYTES`` no file may be written beyond so many bytes.
"""

from __future__ import annotations

import resource
import signal
import sys
import time
from types import SimpleNamespace

import numpy as np

import ensemble.run.session
from ensemble.campaign.tables import Campaign
from ensemble.campaign.tasks import Task
from ensemble.results.schema import RESULT_COLUMNS, scales, shape_of
from ensemble.task.compute import TaskResult


def matches(pattern: str | None, task: Task) -> bool:
    if pattern is None:
        return False
    values = (task.hurst, task.work_of_adhesion, task.realisation)
    return all(p == "*" or float(p) == v for p, v in zip(pattern.split(":"), values, strict=True))


def fake_result(campaign: Campaign, task: Task) -> TaskResult:
    """Numbers that depend on the task alone."""
    mixed = [task.seed, round(1e6 * task.hurst), round(1e6 * task.work_of_adhesion)]
    rng = np.random.default_rng(mixed)
    sizes = {s.name: s.values.size for s in scales(campaign)}
    values = {}
    for column in RESULT_COLUMNS:
        shape = shape_of(column, sizes)[1:]
        drawn = rng.random(shape) if column.dtype == "f8" else rng.integers(0, 2, shape)
        values[column.name] = np.asarray(drawn, column.dtype)
    return TaskResult(**{k: v if v.ndim else v.item() for k, v in values.items()})


def fill_the_disk(size: int) -> None:
    """Let every write beyond ``size`` fail once rows are written."""
    write = ensemble.run.session._Session._write

    def limited(session, outcome):
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
        return write(session, outcome)

    ensemble.run.session._Session._write = limited


def install(behaviour: str) -> None:
    settings = dict(word.split("=", 1) for word in behaviour.split())

    def run_task(campaign, task, progress=None):
        if "log" in settings:
            with open(settings["log"], "a") as log:
                log.write(f"{task.hurst}:{task.work_of_adhesion}:{task.realisation}\n")
        if matches(settings.get("crash"), task):
            ensemble.run.session.Writer.write_result = None
        while matches(settings.get("hang"), task):
            time.sleep(0.01)
        for _ in range(campaign.cycle.load_steps):
            time.sleep(float(settings.get("step", 0)))
            if progress is not None:
                progress("loading", 0.0, None)
        if matches(settings.get("fail"), task):
            raise FloatingPointError("the sum of γ diverged")
        return fake_result(campaign, task)

    if "serial" in settings:
        ensemble.run.session.h5py.get_config = lambda: SimpleNamespace(mpi=False)
    if "full" in settings:
        fill_the_disk(int(settings["full"]))
    ensemble.run.session.run_task = run_task
    ensemble.run.session.check_task = lambda campaign, task: None


if __name__ == "__main__":
    from ensemble.command.main import main

    install(sys.argv[1])
    sys.exit(main(sys.argv[2:]))
