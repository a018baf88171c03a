"""No silence while something takes long: a line every so often, and none of what is over."""

from __future__ import annotations

import io
import sys
import time

from adhesis.ensemble.reporter import bar
from adhesis.ensemble.run.progress import ProgressLine, Summary


def test_what_takes_long_is_told_and_what_is_over_is_not(capsys) -> None:
    said: list[str] = []
    with bar("claims", every=0.05, last=False) as show:
        end = time.monotonic() + 20
        while not any(line.startswith("one claim  [############............]  ") for line in said):
            said += capsys.readouterr().err.splitlines()
            if said:
                show(1, 2, "one claim")
            assert time.monotonic() < end
            time.sleep(0.005)
    assert said[0].startswith("claims  ")
    capsys.readouterr()
    with bar("no sooner than it is due", every=60.0, last=False):
        pass
    assert not capsys.readouterr().err
    with bar("loading", every=60.0):
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


def test_the_first_ten_minutes_of_a_run_know_no_silence_above_fifteen_seconds(monkeypatch) -> None:
    class Log:
        lines: tuple[float, ...] = ()

        def write(self, text: str) -> None:
            self.lines += (now[0],) if text.strip() else ()

        def flush(self) -> None: ...

        def isatty(self) -> bool:
            return False

    now, log = [0.0], Log()
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    progress = ProgressLine(Summary(total=10), lambda: None, log)
    while now[0] < 36000.0:
        progress.tick()
        now[0] += 0.5
    gaps = [(a, b - a) for a, b in zip(log.lines, log.lines[1:], strict=False)]
    assert max(gap for at, gap in gaps if at < 600.0) <= 15.5
    assert max(gap for _, gap in gaps) <= 60.5
    assert len(log.lines) < 800  # ten hours: a log that can be read


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_run_on_a_terminal_has_one_line_and_failures_above_it(monkeypatch) -> None:
    now, stream = [0.0], _Terminal()
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    counts = Summary(total=3, done=1)
    progress = ProgressLine(counts, lambda: None, stream)
    progress.tick()
    progress.tick()  # too early
    progress.failure("H = 0.8", "diverged")
    counts.done = 2
    counts.computed = counts.failed = counts.failed_now = 1
    now[0] = 2.0
    progress.tick()
    progress.end()
    progress.end()
    first, last = "1 of 3 tasks done", "2 of 3 tasks done, 1 failed, 2.0 s so far"
    shown = stream.getvalue().replace("\r\x1b[K", "|")
    assert shown == f"|{first}|failed: H = 0.8: diverged\n|{last}|{last}\n"
