"""Lines that name the tests under way while none ends, so that a long wait is never silent."""

import threading
import time
from typing import TextIO

_EVERY = 10.0  # s; the longest time without a line


class Waiting:
    """Write which tests are under way, whenever none has ended for some seconds.

    Of several processes, the one that hands the tests out is notified when each begins and ends.
    ``terminal`` is a stream of its own, which no test captures.
    """

    def __init__(self, terminal: TextIO) -> None:
        self._terminal = terminal
        self._begun: dict[str, float] = {}
        self._last = time.monotonic()
        self._ended = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._begun[nodeid] = time.monotonic()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """Note the end of a test, of which pytest itself writes."""
        self._begun.pop(nodeid, None)
        self._last = time.monotonic()

    def pytest_sessionfinish(self) -> None:
        self._ended.set()

    def _watch(self) -> None:
        while not self._ended.wait(1.0):
            now = time.monotonic()
            if now - self._last < _EVERY:
                continue
            self._last = now
            under_way = [f"{name} ({now - begun:.0f} s)" for name, begun in self._begun.items()]
            waited = ", ".join(under_way) or "the tests to be collected"
            print(f"\nwaiting for {waited}", file=self._terminal)
