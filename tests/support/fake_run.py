"""``python fake_run.py BEHAVIOUR run …``: the command line with tasks that cost what a test wants.

BEHAVIOUR is a list of words, tasks given as H:γ:realisation with ``*`` for any:
``step=SECONDS`` time of a load step, ``fail=TASK`` raise, ``hang=TASK`` never reach the next load
step, ``deaf=TASK`` take 0.3 s without looking up, ``asked=TASK`` be asked to stop, by a signal, at
its end, once the ``log`` has another task, ``doubt=TASK`` a loss whose audit is 19 % off,
``hold=N`` after N tasks of a process stay in the next one, looking up, until stopped, or until
there is the file of ``free=FILE``,
``log=FILE`` write a line for each task begun, ``crash=TASK`` an error that is not a task's,
``serial=1`` as if HDF5 had no MPI, ``silence=SECONDS`` a rank that is silent for so long is out of
reach, ``full=BYTES`` no file may be written beyond so many bytes.
"""

import os
import re
import resource
import signal
import sys
import time
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import Task
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.run.session import Engine, Options, Summary, run_campaign
from adhesis.ensemble.task.dataset import KEPT, row_shape, sizes_of
from adhesis.ensemble.task.row import RESULT_DATASETS, Row, row_scales


def matches(pattern: str | None, task: Task) -> bool:
    if pattern is None:
        return False
    values = (task.hurst, task.work_of_adhesion, task.realisation)
    return all(p == "*" or float(p) == v for p, v in zip(pattern.split(":"), values, strict=True))


def fake_result(campaign: Campaign, task: Task) -> Row:
    """Numbers that depend on the task alone."""
    values = campaign.identity(task)
    mixed = [task.seed, *(round(1e9 * v) for v in values if v is not None)]
    rng = np.random.default_rng(mixed)
    sizes = sizes_of(row_scales(campaign))
    keep = task.realisation < campaign.output.field_realisations
    values = {}
    for dataset in RESULT_DATASETS:
        shape = row_shape(dataset, sizes)
        drawn = rng.random(shape) if dataset.dtype == "f8" else rng.integers(0, 2, shape)
        if keep or dataset.dims[0] != KEPT:
            values[dataset.name] = np.asarray(drawn, dataset.dtype)
    row = {k: v if v.ndim else v.item() for k, v in values.items()}
    errors = {"audit_residual": 1e-4 * row["audit_residual"], "loss_error": 1e-4 * row["loss"]}
    return row | errors  # no loss is doubtful by its own account


def write_results(path: Path, campaign: Campaign, rows: Iterable[int], **changes: float) -> None:
    """Write the results of rows of a campaign's file, some numbers replaced."""
    tasks = campaign.tasks()
    with Writer(path) as writer:
        for row in rows:
            writer.write_result(row, fake_result(campaign, tasks[row]) | changes)


class FakeTask:
    """Computes a task as a behaviour has it; another process may have a copy."""

    def __init__(self, behaviour: str) -> None:
        words = re.split(r"\s+(?=\w+=)", behaviour) if behaviour else []  # a path may have spaces
        self.settings = dict(word.split("=", 1) for word in words)
        self.broken = False
        self.begun = 0

    def __call__(self, campaign, task, progress=None):
        settings = self.settings
        self.begun += 1
        if "log" in settings:
            with open(settings["log"], "a") as log:
                log.write(f"{task.hurst}:{task.work_of_adhesion}:{task.realisation}\n")
        self.broken = self.broken or matches(settings.get("crash"), task)
        while matches(settings.get("hang"), task):
            time.sleep(0.01)
        if matches(settings.get("deaf"), task):
            signal.setitimer(signal.ITIMER_REAL, 0)  # which looks up for a task that does not
            time.sleep(0.3)
            return fake_result(campaign, task)
        free = Path(settings.get("free", "/dev/null/free"))
        while self.begun > int(settings.get("hold", self.begun)) and progress and not free.exists():
            time.sleep(0.01)
            progress("loading", 0.0, None)
        for _ in range(campaign.cycle.load_steps):
            time.sleep(float(settings.get("step", 0)))
            if progress is not None:
                progress("loading", 0.0, None)
        if matches(settings.get("fail"), task):
            raise FloatingPointError("the sum of γ diverged")
        if matches(settings.get("asked"), task):
            while len(Path(settings["log"]).read_text().splitlines()) < 2:
                time.sleep(0.01)
            os.kill(os.getpid(), signal.SIGUSR1)
        row = fake_result(campaign, task)
        return row | {"audit_residual": 0.19} if matches(settings.get("doubt"), task) else row


def fake_engine(behaviour: str) -> Engine:
    task = FakeTask(behaviour)
    settings = task.settings

    class FakeWriter(Writer):
        """A writer on a disk that fills, or with an error of its own."""

        def write_result(self, row, result, rank=0):
            if task.broken:
                raise TypeError("not a task's error")
            if "full" in settings:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                limits = (int(settings["full"]), resource.RLIM_INFINITY)
                resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            return super().write_result(row, result, rank)

    engine = Engine(task, lambda campaign, task: None, FakeWriter)
    if "silence" in settings:
        engine = replace(engine, silence=float(settings["silence"]))
    return replace(engine, all_write=False) if "serial" in settings else engine


def run_file(path: Path, out: Path, fake: str = "", **options: Any) -> Summary:
    """Run a campaign file in this process."""
    campaign, engine = load_campaign(path), fake_engine(fake)
    return run_campaign(campaign, out, options=Options(**options), engine=engine)


if __name__ == "__main__":
    from adhesis.ensemble import versions
    from adhesis.ensemble.command import run
    from adhesis.ensemble.command.main import main
    from tests.support import fake_run  # by its name, as other processes know it

    # Fake tasks transform nothing: to load FFTW for its version costs half as much as all else.
    versions._fftw = lambda: "not loaded"
    run.execute = partial(run.execute, engine=fake_run.fake_engine(sys.argv[1]))
    sys.exit(main(sys.argv[2:]))
