"""A bar that shows how many loops of a trace are done."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from adhesis.ensemble.trace.pool import Pool, Watch


@contextmanager
def bar_of(loops: int, watch: Watch | None) -> Iterator[Watch]:
    """Show the bar on stderr, or in the notebook; yields what a pool calls.

    Parameters
    ----------
    loops : int
        Number of loops in all.
    watch : callable, optional
        What is to be called besides.
    """
    columns = TextColumn("loops"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("loops", total=loops)

        def shown(pool: Pool) -> None:
            bar.update(task, completed=len(pool.done))
            if watch is not None:
                watch(pool)

        yield shown
