"""Processes of this machine as workers of a hand-out: messages through pipes, without MPI."""

from __future__ import annotations

import contextlib
import pickle
import queue
import subprocess
import threading
from collections.abc import Sequence
from typing import Any, Self

from adhesis.ensemble.run.attempt import Compute
from adhesis.ensemble.run.dispatch import REPORT_INTERVAL, Message
from adhesis.ensemble.run.launch import ONE_THREAD, python, python_environment

_TO_END = 10.0  # s for a process to end once its pipe is closed


class Processes:
    """Channel of a master to processes that it starts, as a context manager.

    They neither fork nor import the caller's script, so that this works from a notebook as well as
    from the command line. A process that ends, killed for want of memory say, takes its tasks with
    it, and another one is started in its place. ``compute`` is pickled; both times are in s.
    """

    def __init__(
        self,
        count: int,
        compute: Compute,
        task_seconds: float | None = None,
        report_interval: float = REPORT_INTERVAL,
    ) -> None:
        self.rank = 0
        self.workers: Sequence[int] = range(1, count + 1)
        self._work = (compute, task_seconds, report_interval)
        self._inbox: queue.SimpleQueue[tuple[int, Message]] = queue.SimpleQueue()
        self._processes: dict[int, subprocess.Popen[bytes]] = {}
        self._up: set[int] = set()  # ranks that have sent something
        self._dismissed: set[int] = set()

    @property
    def pids(self) -> list[int]:
        """Ids of the processes, by rank."""
        return [self._processes[rank].pid for rank in self.workers]

    def __enter__(self) -> Self:
        try:
            for rank in self.workers:
                self._start(rank)
        except BaseException:  # too few processes, or an interrupt: those that run are ended
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for rank, process in self._processes.items():
            if rank not in self._dismissed:
                process.kill()  # it holds no file, and may be stopped
            assert process.stdin is not None
            with contextlib.suppress(OSError):
                process.stdin.close()
        for process in self._processes.values():
            try:
                process.wait(timeout=_TO_END)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def send(self, to: int, message: Message, *, urgent: bool = False) -> None:
        """Send a message to a process."""
        if message[0] == "dismissed":
            self._dismissed.add(to)
            if to not in self._up:  # it still starts, and nothing of it is waited for
                self._inbox.put((to, ("goodbye",)))
        self._write(to, (urgent, message))

    def poll(self, *, urgent: bool = False) -> tuple[int, Message] | None:
        """Return the next message and who sent it, or None."""
        try:
            rank, message = self._inbox.get_nowait()
        except queue.Empty:
            return None
        self._up.add(rank)
        if message[0] == "ended" and rank not in self._dismissed:
            self._up.discard(rank)
            self._start(rank)
        return rank, message

    def _start(self, rank: int) -> None:
        process = subprocess.Popen(
            python("-m", "adhesis.ensemble.run.process_worker", str(rank)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=python_environment() | ONE_THREAD,
            process_group=0,  # else Ctrl-C reaches it, too, before it is asked to stop
        )
        self._processes[rank] = process
        threading.Thread(target=self._listen, args=(rank, process), daemon=True).start()
        self._write(rank, self._work)

    def _write(self, rank: int, content: Any) -> None:
        stdin = self._processes[rank].stdin
        assert stdin is not None
        with contextlib.suppress(OSError):  # the process has ended: _listen reports it
            stdin.write(pickle.dumps(content, protocol=pickle.HIGHEST_PROTOCOL))
            stdin.flush()

    def _listen(self, rank: int, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        with process.stdout as stream:
            while True:
                try:
                    self._inbox.put((rank, pickle.load(stream)))
                except (EOFError, pickle.UnpicklingError, OSError, ValueError):
                    break
        why = f"its process ended with code {process.wait()}"
        self._inbox.put((rank, ("ended", why)))
