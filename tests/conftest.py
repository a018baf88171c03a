"""What all tests share: markers and what they need, figures that are not written.

Values and helpers that several tests use are in :mod:`tests.support`.
"""

import gc
import os
import signal
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from adhesis.ensemble.run.launch import ONE_THREAD
from tests.support.figures import few_figures
from tests.support.launcher_crash import pytest_runtest_protocol  # noqa: F401  # a hook
from tests.support.launchers import without_mpi, without_slurm
from tests.support.progress import Waiting
from tests.support.scheduling import rank_of, scheduler
from tools.interrupted import Interrupt

# Before numpy is loaded, in all processes of the tests: threads for small matrices wait for one
# another on a busy machine, and one module took 50 times as long.
for variable, count in ONE_THREAD.items():
    os.environ.setdefault(variable, count)

# Byte code is kept, or each process compiles all that it imports: seconds of the time of a command.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Nothing that is imported and collected is garbage: until all is, looking for some is in vain.
gc.disable()

# Tests send signals: what nohup or a shell's background ignores would be ignored by them, too.
HANDLERS = {signal.SIGHUP: signal.SIG_DFL, signal.SIGINT: signal.default_int_handler}
for number, handler in HANDLERS.items():
    if signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, handler)


@pytest.fixture
def alarm() -> Iterator[None]:
    """Let SIGALRM raise what may be taken for a failure of whatever it meets."""

    def handler(number: int, frame: object) -> None:
        raise Interrupt

    before = signal.signal(signal.SIGALRM, handler)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture
def quick_figures() -> Iterator[dict[str, Any]]:
    """Draw figures, here by name, and write pictures of one point."""
    with few_figures() as figures:
        yield figures


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write reports without figures, for tests that read their tables and pages."""
    for figures in ("FIELDS", "LOOPS", "LOSSES", "MECHANISMS"):
        monkeypatch.setattr(f"adhesis.ensemble.report.figures.catalogue.{figures}", ())


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="run what is marked slow, too")


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Name the tests under way when none ends for long."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        # The standard output of now: that of a test belongs to the test.
        terminal = os.fdopen(os.dup(1), "w", buffering=1)
        config.pluginmanager.register(Waiting(terminal), "waiting")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hand out tests of several processes by groups (tests/support/scheduling.py)."""
    return scheduler(config, log)


def pytest_collection_finish() -> None:
    """Spare the garbage collector all that was imported and collected, which stays to the end."""
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip, with the reason, what cannot run here, and what is slow."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(key=lambda item: rank_of(item.nodeid))
    reasons = {"mpi": without_mpi(), "slurm": without_slurm()}
    for item in items:
        for name, reason in reasons.items():
            if reason and item.get_closest_marker(name):
                item.add_marker(pytest.mark.skip(reason=reason))
        slow = item.get_closest_marker("slow")
        if slow is not None and not config.getoption("--slow"):
            item.add_marker(pytest.mark.skip(reason=f"slow ({slow.kwargs['reason']}): --slow"))
