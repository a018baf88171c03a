"""Processes of this machine as workers of a hand-out: messages through sockets, without MPI.

Each runs this module, with its rank and the number of its socket as arguments.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from typing import Self

from adhesis.ensemble.exit_codes import ended_by
from adhesis.ensemble.run.dispatch import MASTER, Compute, Limits, Message, Worker
from adhesis.ensemble.run.launch import ONE_THREAD, python, python_environment

_TO_END = 10.0  # s for a process to end once its socket is closed


class Processes:
    """Channel of a master to processes that it starts, as a context manager.

    They neither fork nor import the caller's script, so that this works from a notebook as well as
    from the command line. A process that ends, killed for want of memory say, takes its tasks with
    it, and another one is started in its place. ``compute`` is pickled; of the limits those of a
    task's time count.
    """

    def __init__(self, count: int, compute: Compute, limits: Limits) -> None:
        self.rank = MASTER
        self.workers: Sequence[int] = range(1, count + 1)
        self._work = (compute, limits.task_seconds, limits.report_interval)
        self._inbox: deque[tuple[int, Message]] = deque()
        self._processes: dict[int, subprocess.Popen[bytes]] = {}
        self._sockets: dict[int, Connection] = {}
        self._up: set[int] = set()  # ranks that have sent something
        self._dismissed: set[int] = set()

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
        for socket in self._sockets.values():
            socket.close()
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
                self._inbox.append((to, ("goodbye",)))
        with suppress(OSError):  # the process has ended, as its socket says
            self._sockets[to].send((urgent, message))

    def poll(self, *, urgent: bool = False) -> tuple[int, Message] | None:
        """Return the next message and who sent it, or None."""
        if not self._inbox:
            ready = wait(self._sockets.values(), timeout=0) if self._sockets else []
            for rank in [rank for rank, socket in self._sockets.items() if socket in ready]:
                self._inbox.append((rank, self._received(rank)))
        return self._inbox.popleft() if self._inbox else None

    def _received(self, rank: int) -> Message:
        try:
            message: Message = self._sockets[rank].recv()
        except (EOFError, OSError):
            self._sockets.pop(rank).close()
            why = f"its process ended with code {self._processes[rank].wait()}"
            self._up.discard(rank)
            if rank not in self._dismissed:
                self._start(rank)
            return ("ended", why)
        self._up.add(rank)
        return message

    def _start(self, rank: int) -> None:
        ours, theirs = Pipe()
        self._processes[rank] = subprocess.Popen(
            python("-m", "adhesis.ensemble.run.processes", str(rank), str(theirs.fileno())),
            stdin=subprocess.DEVNULL,
            stdout=2,
            env=python_environment() | ONE_THREAD,
            pass_fds=[theirs.fileno()],
            process_group=0,  # else Ctrl-C reaches it, too, before it is asked to stop
        )
        theirs.close()
        self._sockets[rank] = ours
        with suppress(OSError):
            ours.send(self._work)


class _Socket:
    """Channel of such a process to its master."""

    def __init__(self, rank: int, connection: Connection) -> None:
        self.rank = rank
        self.workers: Sequence[int] = ()
        self._connection = connection
        self._boxes: dict[bool, deque[Message]] = {False: deque(), True: deque()}

    def send(self, to: int, message: Message, *, urgent: bool = False) -> None:
        """Send a message to the master."""
        self._connection.send(message)

    def poll(self, *, urgent: bool = False) -> tuple[int, Message] | None:
        """Return the next message, or None."""
        try:
            while self._connection.poll():
                is_urgent, message = self._connection.recv()
                self._boxes[is_urgent].append(message)
        except (EOFError, OSError):
            os._exit(1)  # the parent has gone: nobody wants what is computed
        return (MASTER, self._boxes[urgent].popleft()) if self._boxes[urgent] else None


def _work(rank: int, connection: Connection) -> None:
    try:
        compute, task_seconds, report_interval = connection.recv()
    except EOFError:
        return  # the parent has gone before it sent anything
    limits = Limits(task_seconds=task_seconds, report_interval=report_interval)
    Worker(_Socket(rank, connection), compute, limits).run()


if __name__ == "__main__":
    try:
        _work(int(sys.argv[1]), Connection(int(sys.argv[2])))
    except Exception as failure:
        code, sentence = ended_by(failure)
        if sentence:
            print(sentence, file=sys.stderr)
        sys.exit(code)
