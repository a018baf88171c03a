"""Tests run once more in which mpirun itself crashed, or hung once its ranks had ended.

Open MPI 4.1.4 now and then ends with a segmentation fault after its ranks have ended, on a busy
machine: with "Data unpack would read past end of buffer in file show_help.c" and a stack of its own
libraries. Or two of its threads wait for each other at the same place, for ever. Nothing in a rank
can prevent that. A rank that crashes has another stack, and one that hangs is still there.
"""

import os
import signal

import pytest
from _pytest.runner import runtestprotocol

_OF_MPIRUN = "PMIx_server_finalize"  # in the stack of its crash
_TIMEOUT = "TimeoutExpired"  # of whoever waits for it


def is_mpiruns(report: pytest.TestReport) -> bool:
    """Whether a test failed by mpirun itself; launchers that hang are ended."""
    if not report.failed:
        return False
    from tests.support.campaign_support import hung_launchers  # loads h5py

    if _OF_MPIRUN in report.longreprtext:
        return True
    hung = hung_launchers() if _TIMEOUT in report.longreprtext else []
    for pid in hung:
        os.kill(pid, signal.SIGKILL)
    return bool(hung)


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test, and once more if mpirun crashed or hung in it."""
    place = {"nodeid": item.nodeid, "location": item.location}
    item.ihook.pytest_runtest_logstart(**place)
    reports = runtestprotocol(item, nextitem=nextitem, log=False)
    if any(is_mpiruns(report) for report in reports):
        item.warn(pytest.PytestWarning("mpirun itself crashed: this test runs once more"))
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(**place)
    return True
