"""What a campaign costs, told before it starts: a few pilot loops, or the times measured so far."""

from __future__ import annotations

import math
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ensemble.campaign.tables import Campaign
from ensemble.campaign.tasks import WHOLE, Part, Task
from ensemble.results.read import Results
from ensemble.results.schema import DONE, file_size
from ensemble.run.plan import group_of, prior
from ensemble.run.progress import duration
from ensemble.task.compute import Runner
from ensemble.task.row import Row

# Loops are tried out for so long (s), one realisation of every cell after the other.
PILOT_SECONDS = 60.0
_MOST_CELLS_SHOWN = 60
# Ranks are worth having as long as they are busy for this share of the time.
_BUSY = 0.8


@dataclass(frozen=True)
class CellPrice:
    """What the tasks of one cell cost.

    Attributes
    ----------
    task : Task
        One of them.
    tasks : int
        Number still to do.
    seconds : float
        Mean CPU time of one, in s.
    measured : int
        Loops that the mean is over; 0 where it is scaled from other cells.
    """

    task: Task
    tasks: int
    seconds: float
    measured: int


@dataclass(frozen=True)
class Price:
    """What a campaign costs.

    Attributes
    ----------
    tasks, done : int
        Tasks of the campaign or part, and those of them that are done.
    cells : tuple of CellPrice
    longest : float
        Estimated CPU time of the longest task, in s.
    file_bytes, rank_bytes : int
        Of the results file; of one rank's memory, as this process has had it.
    pilots : int
        Loops that were computed to find out.
    pilot_seconds : float
        Their CPU time.
    """

    tasks: int
    done: int
    cells: tuple[CellPrice, ...]
    longest: float
    file_bytes: int
    rank_bytes: int
    pilots: int
    pilot_seconds: float

    @property
    def seconds(self) -> float:
        """CPU time of all tasks still to do."""
        return sum(cell.tasks * cell.seconds for cell in self.cells)

    def makespan(self, workers: int) -> float:
        """Estimated wall time of the rest on so many workers: no shorter than its longest task."""
        return max(self.seconds / workers, self.longest)

    @property
    def most_workers(self) -> int:
        """Workers that are still busy for most of the time."""
        left = sum(cell.tasks for cell in self.cells)
        if not self.longest:
            return max(1, left)
        return max(1, min(left, math.floor(self.seconds / (_BUSY * self.longest))))


def price(
    campaign: Campaign,
    path: Path | None = None,
    part: Part = WHOLE,
    *,
    seconds: float = PILOT_SECONDS,
    compute: Callable[[Campaign, Task], Row] | None = None,
    on_pilot: Callable[[Task, float], None] = lambda task, seconds: None,
) -> Price:
    """Estimate what a campaign costs; writes nothing.

    Cells of which loops are done in the results file cost what those did. Of the others loops are
    tried out, the first realisation of each, then the second …, until the time is up; what was not
    reached is scaled by how the tasks of such cells usually compare.

    Parameters
    ----------
    campaign : Campaign
    path : path, optional
        Its results file, if there is one.
    part : Part, optional
    seconds : float
        How long loops are tried out.
    compute : callable, optional
        Computes a task.
    on_pilot : callable
        Called after each loop that was tried out, with its CPU time in s.
    """
    compute = compute or Runner()
    tasks = campaign.tasks(part)
    times: dict[tuple[float, ...], list[float]] = {task.cell: [] for task in tasks}
    done: set[Task] = set()
    if path is not None and path.exists():
        with Results(path) as results:
            known = zip(
                *(results.tasks(), results.status(), results.column("cpu_time")), strict=True
            )
            for task, status, took in known:
                if status == DONE and task.cell in times:
                    times[task.cell].append(float(took))
                    done.add(task)
    left = [task for task in tasks if task not in done]
    unknown = {task.cell for task in left if not times[task.cell]}
    pilots, spent, end = 0, 0.0, time.monotonic() + seconds
    # The cheapest first, so that as many cells as possible are met; realisation by realisation.
    order = sorted(
        (t for t in left if t.cell in unknown),
        key=lambda t: (t.realisation, prior(t), group_of(campaign, t)),
    )
    for task in order:
        if time.monotonic() > end:
            break
        took = float(compute(campaign, task)["cpu_time"])
        times[task.cell].append(took)
        pilots, spent = pilots + 1, spent + took
        on_pilot(task, took)
    return _sum_up(campaign, part, tasks, left, times, pilots, spent)


def _sum_up(
    campaign: Campaign,
    part: Part,
    tasks: list[Task],
    left: list[Task],
    times: dict[tuple[float, ...], list[float]],
    pilots: int,
    spent: float,
) -> Price:
    first = {task.cell: task for task in reversed(tasks)}
    measured = {cell: float(np.mean(seconds)) for cell, seconds in times.items() if seconds}
    scale = (
        np.mean([seconds / prior(first[cell]) for cell, seconds in measured.items()])
        if measured
        else 0.0
    )
    count = dict.fromkeys(first, 0)
    for task in left:
        count[task.cell] += 1
    cells = tuple(
        CellPrice(
            task,
            count[cell],
            measured.get(cell, float(scale * prior(task))),
            len(times[cell]),
        )
        for cell, task in first.items()
    )
    slowest = max([t for seconds in times.values() for t in seconds], default=0.0)
    waiting = [cell.seconds for cell in cells if cell.tasks]
    kibibytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return Price(
        tasks=len(tasks),
        done=len(tasks) - len(left),
        cells=cells,
        longest=max(slowest, *waiting) if waiting else 0.0,
        file_bytes=file_size(campaign, part),
        rank_bytes=kibibytes if sys.platform == "darwin" else 1024 * kibibytes,
        pilots=pilots,
        pilot_seconds=spent,
    )


def as_text(price: Price) -> str:
    """Return a price as lines for people."""
    left = price.tasks - price.done
    tried = (
        f"{price.pilots} pilot loops of {duration(price.pilot_seconds)} in all"
        if price.pilots
        else "the loops that are done"
    )
    lines = [
        f"{left} tasks to do in {len(price.cells)} cells, {price.done} done; nothing was written",
        f"{price.seconds / 3600:.3g} core hours, by {tried}; "
        f"the longest task takes about {duration(price.longest)}",
        f"results file {price.file_bytes / 1e6:.3g} MB, "
        f"about {price.rank_bytes / 1e6:.0f} MB of memory a rank",
    ]
    if left:
        lines.append(f"one process takes {duration(price.makespan(1))}")
        for workers in sorted({2, 8, 32, 128, price.most_workers}):
            if 1 < workers <= price.most_workers:
                lines.append(f"{workers + 1} ranks take {duration(price.makespan(workers))}")
        lines.append("of more ranks some would wait for the longest task")
    if len(price.cells) <= _MOST_CELLS_SHOWN:
        lines += ["", "s a loop  tasks  core hours  cell"]
        for cell in price.cells:
            mark = " " if cell.measured else "~"
            hours = cell.tasks * cell.seconds / 3600
            name = str(cell.task).rpartition(", realisation")[0]
            lines.append(f"{mark}{cell.seconds:7.3g} {cell.tasks:6d} {hours:11.3g}  {name}")
        if not all(cell.measured for cell in price.cells):
            lines.append("~ scaled from other cells")
    return "\n".join(lines)
