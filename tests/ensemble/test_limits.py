"""Under limits of the system a command ends in one sentence, and leaves nothing half-written."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from adhesis.ensemble.command import main as command_line
from adhesis.ensemble.command.main import _WITHOUT_NUMERICS, main
from tests.support.campaign_support import (
    adhesis_here,
    command,
    environment,
    run_python,
    write_campaign,
)

ANOTHER_USER = 23456
# Values of ulimit: open files, of which Python itself needs 5, and kB of memory and of files.
LIMITS = {
    "n": (5, 8, 16, 32, 64),
    "v": (150_000, 300_000, 600_000, 1_000_000, 2_000_000),
    "f": (0, 8, 50, 150, 1000),
    "u": (1, 4, 8, 16, 32),
}
MATERIAL = ("--work-of-adhesion", "0.01", "--young", "1e6", "--poisson", "0.5")
LOOP = ("--hurst", "0.8", "--n0", "1", "--ratio", "4", "--load-steps", "4", "--method", "grid")
WORDS: dict[str, tuple[object, ...]] = {
    "new": ("n.toml",),
    "run": ("{}/c.toml", "--out", "r.h5"),
    "status": ("{}/r.h5",),
    "verify": ("{}/r.h5",),
    "merge": ("{}/r.h5", "--out", "all.h5"),
    "report": ("{}/r.h5", "--to", "report"),
    "loop": (*LOOP, *MATERIAL, "--accuracy", "0.1", "--quiet", "--json", "l.json"),
    "trace": ("{}/s.csv", "--unit", "um", *MATERIAL, "--plan"),
    "sample": ("s.csv",),
    "validate": ("--method", "grid"),
    "bench": ("--quick", "--to", "bench"),
    "doctor": (),
    "completion": ("bash",),
}
# The value of each limit that is hardest to bear, and the commands that meet it each in a way of
# their own: with few modules or many, files, threads, processes. --slow: all commands and values.
HARDEST = {
    "n": (5, ("new", "run", "loop", "doctor")),
    "v": (600_000, ("run", "loop")),
    "f": (0, ("new", "run", "loop", "doctor")),
    "u": (1, ("run", "loop", "bench", "doctor")),
}
RANGES = {"n": ("status",), "v": ("status",), "f": ("run",), "u": ("status",)}
AS_OTHERS = pytest.mark.slow(reason="a start of Python each, refused where other commands are")


def case(limit: str, value: int, name: str) -> Any:
    """Return the case, marked as slow if others are like it."""
    hardest, names = HARDEST[limit]
    alone = (value == hardest and name in names) or (
        name in RANGES[limit] and value == LIMITS[limit][2]
    )
    return pytest.param(limit, value, name, marks=() if alone else AS_OTHERS)


CASES = [
    case(limit, value, name)
    for limit, values in LIMITS.items()
    for name in WORDS
    for value in (values if name in (*RANGES[limit], "merge") else (HARDEST[limit][0],))
    if (limit, name) not in (("f", "bench"), ("f", "report"))  # see test_outputs.py: both write so
]
# It goes on for long where files are limited; its first line shows that it has begun.
LONG = {"validate"}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a campaign, its results file of about 500 kB, and a trace."""
    folder = tmp_path_factory.mktemp("finished")
    path = write_campaign(folder, realisations="40")
    done = adhesis_here("run", path, "--out", folder / "r.h5", fake="")
    assert done.returncode == 0, done.stderr
    assert adhesis_here("sample", folder / "s.csv").returncode == 0
    return folder


def limited(
    limit: str, words: list[object], folder: Path, fake: str | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command under an option of ulimit, one of processes as another user."""
    other: list[str] = []
    if limit.startswith("-u") and os.geteuid() == 0:  # root is not bound by it
        os.chown(folder, ANOTHER_USER, ANOTHER_USER)
        capability = "=-all,+dac_override"  # to read what root alone may
        other = ["setpriv", f"--reuid={ANOTHER_USER}", f"--regid={ANOTHER_USER}", "--clear-groups"]
        other += [f"--inh-caps{capability}", f"--ambient-caps{capability}"]
    script = f'ulimit {limit}; exec "$@"'
    process = subprocess.Popen(
        [*other, "bash", "-c", script, "bash", *command(words, fake=fake)],
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    first = process.stdout.readline() if words[0] in LONG else ""
    if first:
        process.terminate()
    out, errors = process.communicate(timeout=120)
    return subprocess.CompletedProcess(words, process.returncode, first + out, errors)


@pytest.mark.parametrize(("limit", "value", "name"), CASES)
def test_a_command_under_a_limit_ends_in_one_sentence_and_leaves_nothing_half_written(
    finished: Path, tmp_path: Path, limit: str, value: int, name: str
) -> None:
    if limit == "u" and os.geteuid() == 0 and shutil.which("setpriv") is None:
        pytest.skip("root is not bound by a limit of processes, and setpriv is missing")
    words = [name, *(str(word).format(finished) for word in WORDS[name])]
    # tasks that cost nothing, where the run gets so far; they load modules outside of the command
    fake = "" if limit == "f" else None
    done = limited(f"-{limit} {value}", words, tmp_path, fake=fake)
    assert "Traceback" not in done.stdout + done.stderr
    if done.returncode == 0:
        assert limit != "v" or value >= 1_000_000 or name in _WITHOUT_NUMERICS
        return
    left = [path for path in tmp_path.rglob("*") if not path.is_dir()]
    assert [path for path in left if path.suffix != ".lock"] == []  # which is a result of no kind
    if name == "doctor" and done.returncode == 1:
        assert "FAIL" in done.stdout
        return
    began = name in LONG and done.returncode == 143 and done.stdout != ""
    allowed = {"f": {74}, "v": {71}}.get(limit, {71, 74})  # an output may need the file too many
    assert began or done.returncode in allowed, done.stderr
    # without the lines that tell every ten seconds how far it is
    sentences = [line for line in done.stderr.splitlines() if not line.endswith(" s)")]
    assert began or (len(sentences) == 1 and sentences[0].startswith(f"adhesis {name}: "))


def test_a_python_process_survives_a_row_that_the_disk_did_not_take(finished: Path) -> None:
    """HDF5 would end it with a segmentation fault when the process ends."""
    code = (
        "import resource, sys\n"
        "from adhesis.ensemble.errors import WriteError\n"
        "from adhesis.ensemble.results.write import Writer\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "try:\n"
        "    with Writer(sys.argv[1]) as writer:\n"
        "        writer.write_failure(3, 'no result', 1.0)\n"
        "except WriteError as error:\n"
        "    print(error)\n"
    )
    copy = finished / "copy.h5"
    copy.write_bytes((finished / "r.h5").read_bytes())
    done = run_python("-c", code, copy)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"row 3 of {copy} could not be written: File too large\n"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError(), "Cannot allocate memory"),
        (OSError(errno.EMFILE, os.strerror(errno.EMFILE)), "Too many open files"),
        (BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN)), "temporarily unavailable"),
        (RuntimeError("can't start new thread"), "can't start new thread"),
        (ImportError("libx.so: failed to map segment from shared object"), "failed to map segment"),
    ],
)
def test_what_the_system_does_not_grant_is_one_sentence_and_71(
    error: Exception,
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(*_: object) -> int:
        try:
            raise error
        except Exception as cause:  # libraries wrap such errors in their own
            raise LookupError("no function") from cause

    monkeypatch.setattr(command_line, "_execute", fail)
    assert main(["status", "r.h5"]) == 71
    (line,) = capsys.readouterr().err.splitlines()
    assert "the system gave too few resources" in line
    assert words in line
