"""Under limits of the system a command ends in one sentence, and leaves nothing half-written."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from adhesis.ensemble.command import main as command_line
from adhesis.ensemble.command.main import main
from tests.support.campaign_support import (
    ROOT,
    adhesis_here,
    command,
    environment,
    write_campaign,
)

FILE_SIZES = (0, 1, 50, 300, 1000)  # kB


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a campaign and its results file, of about 500 kB."""
    folder = tmp_path_factory.mktemp("finished")
    path = write_campaign(folder, realisations="40")
    done = adhesis_here("run", path, "--out", folder / "r.h5", fake="")
    assert done.returncode == 0, done.stderr
    return folder


def limited(
    limit: str, words: list[object], folder: Path, fake: str | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command under an option of ulimit."""
    return subprocess.run(
        ["bash", "-c", f'ulimit {limit}; exec "$@"', "bash", *command(words, fake=fake)],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize("size", FILE_SIZES)
@pytest.mark.parametrize("name", ["new", "sample", "run", "merge", "status", "verify"])
def test_a_limit_of_file_sizes_is_one_sentence_and_74(
    finished: Path, tmp_path: Path, name: str, size: int
) -> None:
    words: dict[str, list[object]] = {
        "new": ["n.toml"],
        "sample": ["s.csv"],
        "run": [finished / "c.toml", "--out", "r.h5"],
        "merge": [finished / "r.h5", "--out", "all.h5"],
        "status": [finished / "r.h5"],
        "verify": [finished / "r.h5"],
    }
    done = limited(f"-f {size}", [name, *words[name]], tmp_path, fake="")
    assert "Traceback" not in done.stderr
    if done.returncode == 0:
        assert len(os.listdir(tmp_path)) == (name not in ("status", "verify"))
    else:
        assert done.returncode == 74, done.stderr
        (line,) = done.stderr.splitlines()
        assert "written" in line
        assert "File too large" in line
        assert os.listdir(tmp_path) == []


def test_ranks_are_refused_where_they_cannot_share_memory(finished: Path, tmp_path: Path) -> None:
    """Open MPI hangs there, or its ranks crash."""
    words = ["run", finished / "c.toml", "--out", "r.h5", "--ranks", "2"]
    done = limited("-f 100", list(words), tmp_path, fake="")
    assert done.returncode == 74, done.stderr
    (line,) = done.stderr.splitlines()
    assert "the limit of file sizes (ulimit -f) is 0.1024 MB" in line
    assert os.listdir(tmp_path) == []


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
    done = subprocess.run(
        [sys.executable, "-c", code, copy], cwd=ROOT, capture_output=True, text=True, check=False
    )
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


def test_too_little_memory_to_load_a_library_is_one_sentence(tmp_path: Path) -> None:
    done = limited("-v 110000", ["new", "n.toml"], tmp_path)
    assert done.returncode in (0, 71), done.stderr
    assert len(done.stderr.splitlines()) == (done.returncode != 0)
    assert os.listdir(tmp_path) == ([] if done.returncode else ["n.toml"])
