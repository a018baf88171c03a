"""What endurance costs: hand-out, results file and master, measured through the real mpirun.

    python benchmarks/endurance.py empty                     # tasks that do nothing
    python benchmarks/endurance.py campaign jobs/paper.toml  # real tasks

``empty`` lets tasks return at once, with a row of the paper's campaign (``--campaign`` for
another): what remains is hand-out and file. Then tasks that only wait tell what an idle master
costs. ``campaign`` computes a whole campaign into a new results file and compares its makespan,
from reading the campaign to the closed file without the start of the processes, with the ideal:
the sum of the task times in the file over the number of workers, or the longest task where that
is more. Wall times mean little on a busy machine: its load is stated first. CPU times grow there,
too, by a factor of two or so, and by the looks that a rank takes around while it waits.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import Task
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DONE, FAILED, file_size
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.run.dispatch import Master, Worker
from adhesis.ensemble.run.launch import ONE_THREAD, launch_environment, launcher
from adhesis.ensemble.run.ranks import world
from adhesis.ensemble.run.session import Engine, run_campaign
from adhesis.ensemble.task.compute import Runner, check_task
from adhesis.ensemble.task.dataset import KEPT, row_shape, sizes_of
from adhesis.ensemble.task.row import RESULT_DATASETS, Row, row_scales

ROOT = Path(__file__).resolve().parent.parent


@dataclass
class Times:
    """What one rank measured of itself, in s.

    Attributes
    ----------
    run : float
        From the campaign's file to the closed results file.
    loop, cpu : float
        Wall and CPU time of the loop that hands out (rank 0) or works (the others).
    writing, writing_cpu : float
        Wall and CPU time in the calls that write rows.
    rows : int
        Rows written.
    """

    run: float = 0.0
    loop: float = 0.0
    cpu: float = 0.0
    writing: float = 0.0
    writing_cpu: float = 0.0
    rows: int = 0


def measured(times: Times, pretend: float | None) -> Engine:
    """Return an engine with clocks around the loops of the ranks and the writing of rows.

    ``pretend``: seconds of tasks that do nothing, instead of loops.
    """

    def timed(loop: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def run(of: Any) -> Any:
            wall, cpu = time.perf_counter(), time.process_time()
            ended = loop(of)
            times.loop, times.cpu = time.perf_counter() - wall, time.process_time() - cpu
            return ended

        return run

    class TimedWriter(Writer):
        def write_result(self, row: int, result: Row, rank: int = 0) -> int:
            started, cpu = time.perf_counter(), time.process_time()
            written = super().write_result(row, result, rank)
            times.writing += time.perf_counter() - started
            times.writing_cpu += time.process_time() - cpu
            times.rows += 1
            return written

    compute = Runner() if pretend is None else do_nothing(pretend)
    check = check_task if pretend is None else lambda *_: None
    for loop in (Master, Worker):
        loop.run = timed(loop.run)
    return Engine(compute=compute, check=check, writer=TimedWriter)


def do_nothing(seconds: float) -> Callable[..., Row]:
    """Return a task that takes ``seconds`` without work and has a row of zeros."""
    rows: dict[bool, Row] = {}  # of one campaign, by whether the task keeps its fields

    def row(campaign: Campaign, keep: bool) -> Row:
        sizes = sizes_of(row_scales(campaign))
        values: Row = {}
        for dataset in RESULT_DATASETS:
            zeros = np.zeros(row_shape(dataset, sizes), dataset.dtype)
            if keep or dataset.dims[0] != KEPT:
                values[dataset.name] = zeros if zeros.ndim else zeros.item()
        return values | {"wall_time": seconds}

    def compute(campaign: Campaign, task: Task, progress: Any = None) -> Row:
        if seconds:
            time.sleep(seconds)
        keep = task.realisation < campaign.output.field_realisations
        if keep not in rows:
            rows[keep] = row(campaign, keep)
        return rows[keep]

    return compute


def rank(options: argparse.Namespace) -> None:
    """Be one rank of a measured run; leaves its times beside the results file."""
    started = time.perf_counter()
    times = Times()
    comm = world()
    engine = measured(times, options.pretend)
    run_campaign(load_campaign(options.campaign), options.out, comm, engine=engine)
    times.run = time.perf_counter() - started
    place = comm.rank
    Path(f"{options.out}.{place}.json").write_text(json.dumps(vars(times)))


def launch(
    campaign: Path, out: Path, workers: int, pretend: float | None = None
) -> tuple[Times, list[Times]]:
    """Run a campaign under mpirun; returns the times of the master and of the workers.

    ``pretend``: seconds of the tasks that do nothing, instead of real ones.
    """
    ranks, mpirun = workers + 1, launcher()
    if mpirun is None:
        sys.exit("there is no mpirun here")
    words = [sys.executable, "-m", "mpi4py", __file__, "rank", str(campaign), "--out", str(out)]
    if pretend is not None:
        words += ["--pretend", str(pretend)]
    process = subprocess.run(
        [mpirun, "-n", str(ranks), *words],
        env={**launch_environment(ranks), **ONE_THREAD, "PYTHONPATH": str(ROOT)},
        stderr=None if pretend is None else subprocess.PIPE,
        text=True,
    )
    if process.returncode != 0:
        sys.exit(f"mpirun ended with {process.returncode}: {process.stderr or 'see above'}")
    with Results(out) as results:
        if failed := results.errors(np.flatnonzero(results.status() == FAILED)):
            sys.exit(f"{len(failed)} tasks failed, as: {failed[0]}")
    cards = []
    for place in range(workers + 1):
        card = Path(f"{out}.{place}.json")
        cards.append(Times(**json.loads(card.read_text())))
        card.unlink()
    return cards[0], cards[1:]


def show(rows: list[tuple[str, str, str]]) -> None:
    """Print a table: what, how much, how much is wanted."""
    width = [max(len(row[i]) for row in rows) for i in range(2)]
    for what, value, wanted in rows:
        print(f"  {what:{width[0]}}  {value:>{width[1]}}  {wanted}".rstrip())


def shrunk(campaign: Path, tasks: int, folder: Path) -> Path:
    """Write a campaign file with so many realisations that there are about ``tasks`` tasks."""
    sweep = load_campaign(campaign).sweep
    number = max(1, round(tasks / (len(sweep.hurst) * len(sweep.work_of_adhesion))))
    lines = [
        f"realisations = {number}" if line.split("=")[0].strip() == "realisations" else line
        for line in campaign.read_text().splitlines()
    ]
    path = folder / f"{number}.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def empty(options: argparse.Namespace) -> None:
    """Measure tasks that do nothing, and a master that has nothing to do."""
    n = options.workers
    with tempfile.TemporaryDirectory(dir=options.dir) as folder:
        path = shrunk(options.campaign, 10, Path(folder))
        idle, _ = launch(path, Path(folder) / "idle.h5", n, options.seconds)
        waiting = idle.cpu / idle.loop
        print(f"{load_campaign(path).task_count} tasks that wait {options.seconds:g} s:")
        show([("master, of a core", f"{100 * waiting:.2f} %", "under 2 %")])
        path = shrunk(options.campaign, options.tasks, Path(folder))
        campaign = load_campaign(path)
        count = campaign.task_count
        row = file_size(campaign) / count / 1e3
        master, workers = launch(path, Path(folder) / "empty.h5", n, 0.0)
        writing = sum(w.writing for w in workers) / count
        cpu = sum(w.cpu for w in workers) / count
        writing_cpu = sum(w.writing_cpu for w in workers) / count
        master_cpu = (master.cpu - waiting * master.loop) / count
        print(f"{count} empty tasks, {n} workers, {row:.0f} kB a row:")
        show(
            [
                ("tasks a second", f"{count / master.loop:.0f}", "at least 1000"),
                ("wall time of a worker a task", f"{1e6 * n * master.loop / count:.0f} µs", ""),
                ("  of that, writing the row", f"{1e6 * writing:.0f} µs", ""),
                ("CPU time of a worker a task", f"{1e6 * cpu:.0f} µs", ""),
                ("  of that, writing the row", f"{1e6 * writing_cpu:.0f} µs", ""),
                ("CPU time of the master a task", f"{1e6 * master.cpu / count:.0f} µs", ""),
                ("  beyond its waiting", f"{1e6 * master_cpu:.0f} µs", ""),
                ("laying out, opening, closing", f"{master.run - master.loop:.1f} s", ""),
            ]
        )


def real(options: argparse.Namespace) -> None:
    """Compute a campaign into a new results file and compare its time with the ideal."""
    out = Path(options.out or f"{options.campaign.stem}.h5")
    if out.exists():
        sys.exit(f"{out} exists: what is measured is a whole campaign, in a new results file")
    n = options.workers
    master, workers = launch(options.campaign, out, n)
    with Results(out) as results:
        done = results.status() == DONE
        seconds, by = results.column("wall_time")[done], results.column("rank")[done]
    total, longest = float(seconds.sum()), float(seconds.max(initial=0.0))
    ideal = max(total / n, longest)
    writing = sum(w.writing for w in workers) / (n * master.run)
    print(f"{out}: {done.sum()} of {done.size} tasks done by {n} workers")
    show(
        [
            ("makespan", f"{master.run:.1f} s", ""),
            ("  of that, handing out", f"{master.loop:.1f} s", ""),
            ("sum of the task times", f"{total:.1f} s", ""),
            ("longest task", f"{longest:.1f} s", ""),
            ("makespan / ideal", f"{master.run / ideal:.3f}", "at most 1.05"),
            ("master, of a core", f"{100 * master.cpu / master.loop:.2f} %", "under 2 %"),
            ("writing, of the run", f"{100 * writing:.3f} %", "under 1 %"),
            *(
                (f"tasks of rank {i}", f"{(by == i).sum()} in {seconds[by == i].sum():.1f} s", "")
                for i in range(1, n + 1)
            ),
        ]
    )


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("empty", help="tasks that do nothing", allow_abbrev=False)
    one.add_argument("--campaign", type=Path, default=ROOT / "jobs" / "paper.toml")
    one.add_argument("--tasks", type=int, default=10_000)
    one.add_argument("--workers", type=int, default=2)
    one.add_argument("--seconds", type=float, default=2.0, help="of a task for the idle master")
    one.add_argument("--dir", type=Path, help="folder for the results files")
    one.set_defaults(do=empty)
    two = commands.add_parser("campaign", help="real tasks", allow_abbrev=False)
    two.add_argument("campaign", type=Path)
    two.add_argument("--workers", type=int, default=2)
    two.add_argument("--out", type=Path)
    two.set_defaults(do=real)
    one_rank = commands.add_parser("rank", allow_abbrev=False)  # what mpirun starts
    one_rank.add_argument("campaign", type=Path)
    one_rank.add_argument("--out", type=Path, required=True)
    one_rank.add_argument("--pretend", type=float)
    one_rank.set_defaults(do=rank)
    options = parser.parse_args()
    if options.command != "rank":
        load = " ".join(f"{value:.1f}" for value in os.getloadavg())
        print(f"load of the machine before: {load}; cores: {os.cpu_count()}", flush=True)
    options.do(options)


if __name__ == "__main__":
    main()
