"""Under limits of the system a command ends in one sentence, and leaves nothing half-written."""

import errno
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from adhesis.ensemble.command import main as command_line
from adhesis.ensemble.command.main import main
from tests.support.campaign_support import (
    adhesis_here,
    command,
    environment,
    write_campaign,
)
from tests.support.processes import ran

ANOTHER_USER = 23456
MATERIAL = ("--work-of-adhesion", "0.01", "--young", "1e6", "--poisson", "0.5")
LOOP = ("--hurst", "0.8", "--n0", "1", "--ratio", "4", "--load-steps", "4", "--method", "grid")
WORDS: dict[str, tuple[object, ...]] = {
    "new": ("n.toml",),
    "run": ("{}/c.toml", "--out", "r.h5"),
    "status": ("{}/r.h5",),
    "loop": (*LOOP, *MATERIAL, "--accuracy", "0.1", "--quiet", "--json", "l.json"),
    "report": ("{}/r.h5", "--to", "report"),
    "bench": ("--quick", "--to", "bench"),
    "doctor": (),
}
# Values of ulimit: open files, of which Python itself needs 5, kB of memory and of files, and
# processes; with each the commands that meet it in a way of their own.
CASES = [
    (limit, value, name)
    for limit, value, names in (
        *(("n", 5, "run doctor"), ("n", 16, "status")),
        *(("v", 600_000, "loop"), ("f", 0, "new run loop"), ("f", 50, "run report")),
        *(("u", 1, "run bench doctor"), ("u", 8, "status")),
    )
    for name in names.split()
]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a campaign, and its results file, which is longer than the limits of files."""
    folder = tmp_path_factory.mktemp("finished")
    done = adhesis_here("run", write_campaign(folder), "--out", folder / "r.h5", fake="")
    assert done.returncode == 0, done.stderr
    assert (folder / "r.h5").stat().st_size > 50_000
    return folder


def limited(
    limit: str, words: list[object], folder: Path, fake: str | None = None, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run a command under an option of ulimit, one of processes as another user."""
    other: list[str] = []
    if limit.startswith("-u") and os.geteuid() == 0:  # root is not bound by it
        os.chown(folder, ANOTHER_USER, ANOTHER_USER)
        capability = "=-all,+dac_override"  # to read what root alone may
        other = ["setpriv", f"--reuid={ANOTHER_USER}", f"--regid={ANOTHER_USER}", "--clear-groups"]
        other += [f"--inh-caps{capability}", f"--ambient-caps{capability}"]
    line = ("bash", "-c", f'ulimit {limit}; exec "$@"', "bash", *command(words, fake=fake))
    return ran(*other, *line, cwd=folder, env=environment(PYTHONDONTWRITEBYTECODE="1") | variables)


def test_no_byte_code_is_cut_off_at_a_limit_of_file_sizes(tmp_path: Path) -> None:
    """It would be read by whoever comes next, and each later command would fail."""
    new = {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(tmp_path)}
    limited("-f 4", ["new", "n.toml"], tmp_path, **new)
    done = ran(*command(["new", "n.toml"]), cwd=tmp_path, env=environment(**new))
    assert (done.returncode, done.stderr) == (0, "")


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
    if done.returncode == 0:  # so few suffice
        assert (name, done.stderr) == ("status", "")
        assert "8 tasks, 8 done" in done.stdout
        return
    left = [path for path in tmp_path.rglob("*") if not path.is_dir()]
    assert [path for path in left if path.suffix != ".lock"] == []  # which is a result of no kind
    if name == "doctor" and done.returncode == 1:
        assert "FAIL" in done.stdout
        return
    allowed = {"f": {74}, "v": {71}}.get(limit, {71, 74})  # an output may need the file too many
    assert done.returncode in allowed, done.stderr
    # without the lines that tell every ten seconds how far it is
    (sentence,) = (line for line in done.stderr.splitlines() if not line.endswith(" s"))
    assert sentence.startswith(f"adhesis {name}: ")


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
def test_what_the_system_does_not_grant_is_one_sentence_and_71(error, words, monkeypatch, capsys):
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
