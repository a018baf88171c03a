"""Worker of a hand-out in a process of its own, started by :mod:`adhesis.ensemble.run.processes`.

Messages arrive on stdin and leave on stdout, pickled; what the work prints goes to stderr.
"""

from __future__ import annotations

import os
import pickle
import queue
import sys
import threading
from collections.abc import Sequence
from typing import BinaryIO

from adhesis.ensemble.exit_codes import ended_by
from adhesis.ensemble.run.dispatch import MASTER, Limits, Message, Worker
from adhesis.ensemble.run.launch import end_with_parent


class Pipes:
    """Channel of such a worker."""

    def __init__(self, rank: int, incoming: BinaryIO, outgoing: BinaryIO) -> None:
        self.rank = rank
        self.workers: Sequence[int] = ()
        self._outgoing = outgoing
        self._boxes: dict[bool, queue.SimpleQueue[Message]] = {
            urgent: queue.SimpleQueue() for urgent in (False, True)
        }
        threading.Thread(target=self._listen, args=(incoming,), daemon=True).start()

    def send(self, to: int, message: Message, *, urgent: bool = False) -> None:
        """Send a message to the master."""
        self._outgoing.write(pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL))
        self._outgoing.flush()

    def poll(self, *, urgent: bool = False) -> tuple[int, Message] | None:
        """Return the next message, or None."""
        try:
            return MASTER, self._boxes[urgent].get_nowait()
        except queue.Empty:
            return None

    def _listen(self, incoming: BinaryIO) -> None:
        while True:
            try:
                urgent, message = pickle.load(incoming)
            except (EOFError, OSError, pickle.UnpicklingError, ValueError):
                os._exit(1)  # the parent has gone: nobody wants what is computed
            self._boxes[urgent].put(message)
            if message[0] == "dismissed":
                return


def main() -> None:
    """Work until dismissed."""
    end_with_parent()
    incoming = sys.stdin.buffer
    with os.fdopen(os.dup(1), "wb") as outgoing:
        os.dup2(2, 1)  # stdout carries messages alone
        try:
            compute, task_seconds, report_interval = pickle.load(incoming)
        except EOFError:
            return  # the parent has gone before it sent anything
        limits = Limits(task_seconds=task_seconds, report_interval=report_interval)
        channel = Pipes(int(sys.argv[1]), incoming, outgoing)
        Worker(channel, compute, lambda outcome: outcome, limits).run()


if __name__ == "__main__":
    try:
        main()
    except Exception as failure:
        code, sentence = ended_by(failure)
        if sentence:
            print(sentence, file=sys.stderr)
        sys.exit(code)
