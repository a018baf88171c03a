"""No silence while something takes long: a line every so often, and none of what is over."""

import io
import sys
import time

from adhesis.ensemble.reporter import bar, interval
from adhesis.ensemble.run.session import ProgressLine, Summary
from tests.support.campaign_support import wait_until


def test_what_takes_long_is_told_and_what_is_over_is_not(capsys, monkeypatch) -> None:
    said: list[str] = []
    monkeypatch.setattr("adhesis.ensemble.reporter.interval", lambda elapsed: 0.05)
    with bar("claims", last=False) as show:
        end = time.monotonic() + 20
        while not any(line.startswith("one claim  [############............]  ") for line in said):
            said += capsys.readouterr().err.splitlines()
            if said:
                show(1, 2, "one claim")
            assert time.monotonic() < end
            time.sleep(0.005)
    assert said[0].startswith("claims  ")
    capsys.readouterr()
    monkeypatch.setattr("adhesis.ensemble.reporter.interval", lambda elapsed: 60.0)
    with bar("no sooner than it is due", last=False):
        pass
    assert not capsys.readouterr().err
    with bar("loading"):
        pass
    assert capsys.readouterr().err.startswith("loading  ")


def test_what_is_printed_beside_a_bar_goes_to_stdout(capsys, monkeypatch) -> None:
    terminal = _Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with bar("claims") as show:
        show(1, 2, "the first claim")
        print("the first claim holds")
    assert capsys.readouterr().out == "the first claim holds\n"
    assert "the first claim" in terminal.getvalue()


def test_no_silence_is_above_fifteen_seconds() -> None:
    at, lines = 0.0, 0
    while at < 36000.0:
        assert interval(at) <= 15.0
        at, lines = at + interval(at), lines + 1
    assert lines < 2500  # ten hours


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_run_on_a_terminal_has_one_line_and_failures_above_it(monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")  # a line is cut where a terminal ends
    stream, counts = _Terminal(), Summary(total=3, done=1)
    with ProgressLine(counts, lambda: None, stream) as progress:
        wait_until(lambda: "1 of 3 tasks done" in stream.getvalue())
        counts.failed = counts.failed_now = 1
        progress.failure("H = 0.8", "diverged")
        counts.done, counts.computed = 2, 1
    shown = stream.getvalue().split("\r\x1b[K")
    assert shown[1] == "1 of 3 tasks done"
    assert "failed: H = 0.8: diverged\n" in shown
    assert shown[-1].startswith("2 of 3 tasks done, 1 failed, ")
    assert shown[-1].endswith("s so far\n")
    assert sum(line.endswith("\n") for line in shown) == 2
