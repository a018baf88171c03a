"""Tests run once more in which mpirun itself crashed.

Open MPI 4.1.4 now and then ends with a segmentation fault after its ranks have ended, on a busy
machine: with "Data unpack would read past end of buffer in file show_help.c" and a stack of its own
libraries. Nothing in a rank can prevent that. A rank that crashes has another stack.
"""

from __future__ import annotations

import pytest
from _pytest.runner import runtestprotocol

_OF_MPIRUN = "PMIx_server_finalize"  # in the stack of its crash


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test, and once more if mpirun crashed in it."""
    place = {"nodeid": item.nodeid, "location": item.location}
    item.ihook.pytest_runtest_logstart(**place)
    reports = runtestprotocol(item, nextitem=nextitem, log=False)
    if any(report.failed and _OF_MPIRUN in report.longreprtext for report in reports):
        item.warn(pytest.PytestWarning("mpirun itself crashed: this test runs once more"))
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(**place)
    return True
