"""Outputs of commands: refused before any work where they would destroy something, else whole."""

import json
import os
import resource
import tempfile
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.files import check_outputs, staged_folder, whole_file, write_json, write_new
from adhesis.ensemble.report.figures import style
from tests.support.campaign_support import adhesis_here
from tests.support.options import OF_WAVE, WAVE_HEIGHTS

LOOP = ("--heights", "wave.csv", *OF_WAVE, "--load-steps", 2, "--quiet")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, which holds wave.csv."""
    monkeypatch.chdir(tmp_path)
    Path("wave.csv").write_text("\n".join(map(repr, WAVE_HEIGHTS.tolist())))
    return tmp_path


def test_a_write_protected_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "o.json"
    path.write_text("old")
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write everything
    with pytest.raises(InputError, match=r"o\.json: the file is write-protected"):
        check_outputs({"--json": path}, {})


@pytest.mark.usefixtures("folder")
def test_a_full_disk_costs_one_output_and_neither_the_others_nor_the_loss() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    words = ("--json", "/dev/full", "--fields", "f.npz", "--figure", "f.svg")
    done = adhesis_here("loop", *LOOP, *words)
    assert done.returncode == 74
    assert done.stderr.splitlines()[-1] == (
        "adhesis loop: --json /dev/full could not be written (No space left on device)"
    )
    assert "\nloss  " in done.stdout
    assert [line for line in done.stdout.splitlines() if line.startswith("wrote")] == [
        "wrote       f.npz",
        "wrote       f.svg",
    ]
    assert np.load("f.npz")["stress"].shape[0] == 8
    assert "</svg>" in Path("f.svg").read_text()


def test_a_disk_that_is_full_before_the_work_is_no_bad_input(folder, monkeypatch):
    def full(**_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    for words in (["loop", *LOOP, "--json", "o.json"], ["bench", "--to", "b"]):
        done = adhesis_here(*words)
        assert done.returncode == 74
        assert "it cannot be written (No space left on device)" in done.stderr
    assert [path.name for path in folder.iterdir()] == ["wave.csv"]


def test_a_failure_in_the_middle_leaves_the_old_file(folder, monkeypatch):
    Path("o.json").write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    done = adhesis_here("loop", *LOOP, "--json", "o.json", "--figure", "f.png")
    assert done.returncode == 74
    (line,) = (line for line in done.stderr.splitlines() if "could not be written" in line)
    assert "--json o.json could not be written" in line
    assert "--figure f.png could not be written" in line
    assert "\nloss  " in done.stdout
    assert Path("o.json").read_text() == "old"
    assert sorted(path.name for path in folder.iterdir()) == ["o.json", "wave.csv"]


def test_a_figure_that_cannot_be_written_is_an_error_of_the_system(tmp_path: Path) -> None:
    """Nothing is left of it, whatever the writer of its format raises."""
    figure = Figure()
    figure.subplots().plot(range(1000))
    figure.savefig(os.devnull, format="pdf")  # loads modules, whose byte code would be cut off
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            style.write(figure, tmp_path / "a.pdf")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("folder")
def test_links_stay_and_what_they_point_to_is_replaced() -> None:
    Path("real.json").write_text("old")
    Path("link.json").symlink_to("real.json")
    assert adhesis_here("loop", *LOOP, "--json", "link.json").returncode == 0
    assert Path("link.json").is_symlink()
    assert json.loads(Path("real.json").read_text())["loss"] > 0


def test_standard_output_is_a_file_of_its_own(capfd: pytest.CaptureFixture[str]) -> None:
    devices = {"--json": Path("/dev/stdout"), "--fields": Path("/dev/fd/1")}
    with pytest.raises(InputError, match="--json and --fields are both"):
        check_outputs(devices, {})
    check_outputs({"--json": Path("/dev/null"), "--fields": Path("/dev/null")}, {})
    print("before")
    write_json(Path("/dev/stdout"), {"a": 1})
    print("behind")
    assert capfd.readouterr().out == 'before\n{\n "a": 1\n}\nbehind\n'
    assert Path("/dev/stdout").is_symlink()


def test_a_pipe_that_takes_the_place_of_an_output_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OSError, match="No such device"), whole_file(pipe):
        pass  # without a reader
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    with pytest.raises(OSError, match="neither a file nor a character device"), whole_file(pipe):
        pass
    os.close(reader)
    assert pipe.is_fifo()


def test_nothing_is_opened_while_the_content_of_a_new_file_is_made(tmp_path: Path) -> None:
    """A signal that comes while a module is loaded ends the process at once."""

    def content() -> bytes:
        assert list(tmp_path.iterdir()) == []
        return b"new"

    write_new("FILE", tmp_path / "a.txt", content)
    assert (tmp_path / "a.txt").read_bytes() == b"new"


def test_staged_files_are_moved_together_or_not_at_all(tmp_path: Path) -> None:
    """Older files of the writer's own names go once all is written; others stay always."""
    for name in ("a", "b", "notes"):
        (tmp_path / name).write_text("old")

    def fail() -> None:
        with staged_folder(tmp_path, ("a", "b", "c")) as folder:
            (folder / "a").write_text("new")
            raise OSError("full")

    with pytest.raises(OSError, match="full"):
        fail()
    kept = dict.fromkeys(("a", "b", "notes"), "old")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == kept
    with staged_folder(tmp_path, ("a", "b", "c")) as folder:
        (folder / "a").write_text("new")
        (folder / "c").write_text("more")
    written = {"a": "new", "c": "more", "notes": "old"}
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == written


def test_a_terminal_that_nobody_reads_is_refused() -> None:
    """A write to it would wait for ever."""
    try:
        os.close(os.open("/dev/ptmx", os.O_WRONLY | os.O_NOCTTY))
    except OSError as error:
        pytest.skip(f"/dev/ptmx cannot be opened here: {error}")
    with pytest.raises(OSError, match="which nobody reads"), whole_file(Path("/dev/ptmx")):
        pass
    with pytest.raises(InputError, match=r"^--csv is /dev/ptmx: .*which nobody reads"):
        check_outputs({"--csv": Path("/dev/ptmx")}, {})
