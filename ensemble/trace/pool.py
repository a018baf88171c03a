"""Run loops side by side in processes of their own, without MPI."""

from __future__ import annotations

import contextlib
import pickle
import queue
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from adhesis.ensemble.run.interrupt import raised_by_handler
from adhesis.ensemble.run.launch import ONE_THREAD, python, python_environment
from adhesis.ensemble.trace.worker import FAILURES, Job, failure, run

Result = dict[str, Any]
Watch = Callable[["Pool"], None]


class Pool:
    """Pool of processes; the first job runs alone, so that one process compiles for all.

    Parameters
    ----------
    jobs : sequence of Job
    processes : int
        Number of processes; 0 runs the jobs one after the other in this process.

    Attributes
    ----------
    done : dict
        Result by job name; the error text of a failed loop.
    running : dict
        By job name: start (monotonic seconds), and the branch and penetration reached.
    took : dict
        Wall seconds by name of the finished jobs.
    """

    def __init__(self, jobs: Sequence[Job], processes: int) -> None:
        self.waiting = list(jobs)
        self.processes = min(processes, len(self.waiting))
        self.done: dict[str, Result | str] = {}
        self.running: dict[str, tuple[float, str, float]] = {}
        self.took: dict[str, float] = {}
        self._inbox: queue.Queue[tuple[int, str, Any]] = queue.Queue()
        self._workers: list[subprocess.Popen[bytes]] = []
        self._job_of: dict[int, Job] = {}

    @property
    def pids(self) -> list[int]:
        """Ids of the processes, in the order in which they were started."""
        return [process.pid for process in self._workers]

    def run(self, watch: Watch | None = None, every: float = 1.0) -> dict[str, Result | str]:
        """Run all jobs; ``watch`` is called at this interval (s), and when a loop is done."""
        if self.processes == 0:
            return self._run_here(watch)
        try:
            self._start()
            last = time.monotonic()
            while len(self._job_of) > 0:
                try:
                    worker, kind, content = self._inbox.get(timeout=every)
                except queue.Empty:
                    pass
                else:
                    self._take(worker, kind, content)
                    if kind == "progress" and time.monotonic() - last < every:
                        continue
                last = time.monotonic()
                if watch is not None:
                    watch(self)
        finally:
            self._stop()
        return self.done

    def _run_here(self, watch: Watch | None) -> dict[str, Result | str]:
        while self.waiting:
            job, started = self.waiting.pop(0), time.monotonic()
            try:
                self.done[job.name] = run(job)
            except FAILURES as error:
                if raised_by_handler(error):
                    raise
                self.done[job.name] = failure(error)
            self.took[job.name] = time.monotonic() - started
            if watch is not None:
                watch(self)
        return self.done

    def _start(self) -> None:
        worker = len(self._workers)
        process = subprocess.Popen(
            python("-m", "adhesis.ensemble.trace.worker"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=python_environment() | ONE_THREAD,
        )
        self._workers.append(process)
        threading.Thread(target=self._listen, args=(worker, process), daemon=True).start()
        self._hand_out(worker)

    def _listen(self, worker: int, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        while True:
            try:
                kind, content = pickle.load(process.stdout)
            except (EOFError, pickle.UnpicklingError, OSError, ValueError):
                self._inbox.put((worker, "gone", process.wait()))
                return
            self._inbox.put((worker, kind, content))

    def _hand_out(self, worker: int) -> None:
        if not self.waiting:
            self._job_of.pop(worker, None)
            return
        job = self.waiting.pop(0)
        self._job_of[worker] = job
        self.running[job.name] = (time.monotonic(), "loading", 0.0)
        stdin = self._workers[worker].stdin
        assert stdin is not None
        try:
            pickle.dump(job, stdin)
            stdin.flush()
        except BrokenPipeError:
            pass  # the process has ended: _listen reports it

    def _take(self, worker: int, kind: str, content: Any) -> None:
        job = self._job_of.get(worker)
        if job is None:
            return
        if kind == "progress":
            self.running[job.name] = (self.running[job.name][0], *content)
            return
        self.took[job.name] = time.monotonic() - self.running.pop(job.name)[0]
        if kind == "gone":
            self.done[job.name] = f"its process ended with code {content}"
            del self._job_of[worker]
            if self.waiting and not self._job_of:
                self._start()
            return
        self.done[job.name] = content
        self._hand_out(worker)
        while self.waiting and len(self._job_of) < self.processes:
            self._start()

    def _stop(self) -> None:
        if self._job_of:
            for process in self._workers:
                process.terminate()
        for process in self._workers:
            if process.stdin is not None:
                with contextlib.suppress(BrokenPipeError):
                    process.stdin.close()
        for process in self._workers:
            try:
                process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                process.kill()
