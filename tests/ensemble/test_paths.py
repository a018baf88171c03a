"""Crafted paths in the place of every file that a command or function reads or writes.

None holds it up, none is followed where it must not be, none is replaced, and the answer is one
sentence.
"""

import os
import signal
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import adhesis
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.run.lock import holder
from adhesis.ensemble.run.session import run_campaign
from tests.support.campaign_support import campaign_text
from tests.support.exact_wave import ExactWave
from tests.support.fake_run import fake_engine
from tests.support.options import WAVE_HEIGHTS, forbid_work
from tests.support.synthetic_results import campaign, write

ANOTHER_USER = 12345
LONGEST = 20  # s; nothing here takes one
PROBLEM = adhesis.Problem(adhesis.single_wave(1e-6, 1e-3), adhesis.HalfSpace(1e6, 0.5), 1e-4)
MATERIAL = ("--work-of-adhesion", "0.01", "--young", "1e6", "--poisson", "0.5")
LOOP = ("loop", "--heights", "wave.csv", "--period", "1e-3", *MATERIAL, "--load-steps", "2")


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(path.name)  # of the current folder: longer names are not possible


def _shared(path: Path, target: str) -> None:
    """Put a link of another user into the place of a path, in a folder in which all may write."""
    path.parent.chmod(0o1777)
    path.symlink_to(target)
    os.lchown(path, ANOTHER_USER, ANOTHER_USER)


def _chained(path: Path) -> None:
    Path("all").mkdir()
    _shared(Path("all/planted"), "../apart/precious")
    path.symlink_to("all/planted")


MADE: dict[str, Callable[[Path], None]] = {
    "pipe": os.mkfifo,
    "socket": _socket,
    "folder": Path.mkdir,
    "file": lambda path: path.write_text("mine") and None,
    "link to a pipe": lambda path: path.symlink_to("apart/pipe"),
    "link to a socket": lambda path: path.symlink_to("apart/socket"),
    "link to a folder": lambda path: path.symlink_to("apart"),
    "link to an endless device": lambda path: path.symlink_to("/dev/zero"),
    "link to a file": lambda path: path.symlink_to("apart/precious"),
    "link to nothing": lambda path: path.symlink_to("apart/new"),
    "link to itself": lambda path: path.symlink_to(path.name),
    "link of another user": lambda path: _shared(path, "apart/precious"),
    "link to that of another user": _chained,
    "second name": lambda path: path.hardlink_to("apart/precious"),
}
NAMED = {
    "a file for a folder": "apart/precious/x",
    "no folder": "none/x",
    "a name too long": 300 * "x",
    "a name of a folder too long": 300 * "x" + "/x",
    "a path too long": 2100 * "z/" + "x",
    "a device": "/dev/zero",
}


def all_but(*kinds: str) -> tuple[str, ...]:
    return tuple(kind for kind in (*MADE, *NAMED) if kind not in kinds)


ANOTHER = ("link of another user", "link to that of another user")
OF_READING = all_but("file", "link to a file", "second name", *ANOTHER)
OF_WRITING = all_but(
    *("file", "link to a file", "link to nothing", "second name"),
    *("link to an endless device", "a device"),
)
OF_FOLDERS = all_but("folder", "link to a folder", "no folder", "second name", ANOTHER[1])


def kept(folder: Path) -> dict[Path, Any]:
    """Return what lies in a folder: kinds, targets of links, and contents."""
    found = {}
    for path in folder.rglob("*"):
        content = path.read_bytes() if path.is_file() and not path.is_symlink() else None
        link = os.readlink(path) if path.is_symlink() else None
        found[path] = (stat.S_IFMT(path.lstat().st_mode), path.lstat().st_ino, link, content)
    return found


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., str]]:
    """Make a crafted path in the current folder, which ends with ``ending``; gives its name."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "apart").mkdir()
    (tmp_path / "apart" / "precious").write_text("mine")
    os.mkfifo(tmp_path / "apart" / "pipe")
    monkeypatch.chdir(tmp_path / "apart")
    _socket(Path("socket"))
    monkeypatch.chdir(tmp_path)
    Path("wave.csv").write_text("\n".join(map(str, WAVE_HEIGHTS)))
    x = np.arange(200)
    lines = [f"{a} {np.cos(a / 3) + 0.3 * np.sin(a):.4f}" for a in x]
    Path("trace.csv").write_text("\n".join(lines))
    Path("c.toml").write_text(campaign_text(hurst="[0.7]", realisations="1"))

    def make(kind: str, ending: str = "") -> str:
        if kind.endswith("of another user") and os.geteuid() != 0:
            pytest.skip("only root can give files to other users")
        if kind in NAMED:
            return NAMED[kind] if kind == "a device" else NAMED[kind] + ending
        path = Path(f"crafted{ending}")
        MADE[kind](path)
        return str(path)

    def too_late(*_: object) -> None:
        raise AssertionError(f"it waits for more than {LONGEST} s")

    before = signal.signal(signal.SIGALRM, too_late)
    signal.alarm(LONGEST)
    yield make
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> str:
    small = campaign(hurst=(0.8,), gamma=(0.01,), realisations=2)
    return str(write(tmp_path_factory.mktemp("results") / "sound.h5", small))


@pytest.fixture(scope="module")
def loop() -> adhesis.LoopResult:
    return adhesis.run_loop(ExactWave(PROBLEM), max_penetration=0.6, load_steps=4)


# {} is the crafted path and SOUND a sound results file; what follows -> is how the path ends.
COMMANDS = {
    OF_READING: """
run {} -> .toml
run c.toml --out {} -> .h5
run c.toml --dry-run --out {} -> .h5
status {} -> .h5
verify {} -> .h5
report {} --to new -> .h5
report SOUND --to new --beside {} -> .h5
merge {} --out all.h5 -> .h5
merge SOUND {} --out all.h5 -> .h5
merge SOUND --out {} -> .h5
loop --heights {} --period 1e-3 MATERIAL -> .csv
loop --trace {} --unit um MATERIAL -> .csv
trace {} --unit um MATERIAL --to new -> .csv
trace {} --unit um MATERIAL --to new -> .npy
trace {} --unit um MATERIAL --to new -> .sdf
""",
    OF_WRITING: """
LOOP --json {} -> .json
LOOP --csv {} -> .csv
LOOP --figure {} -> .png
LOOP --film {} -> .html
LOOP --fields {} -> .npz
sample {} -> .csv
new {} -> .toml
""",
    OF_FOLDERS: """
trace trace.csv --unit um MATERIAL --to {} ->
report SOUND --to {} ->
bench --quick --to {} ->
doctor --in {} ->
""",
}
Call = Callable[[str, str, adhesis.LoopResult], object]
FUNCTIONS: dict[tuple[str, ...], dict[str, tuple[Call, str]]] = {
    OF_READING: {
        "open": (lambda path, _, __: adhesis.open(path), ".h5"),
        "open, beside": (lambda path, sound, _: adhesis.open(sound, beside=[path]), ".h5"),
        "load": (lambda path, _, __: adhesis.load(path), ".nc"),
        "read_trace": (lambda path, _, __: adhesis.read_trace(path), ".csv"),
        "Campaign": (lambda path, _, __: adhesis.Campaign(path), ".toml"),
        "Campaign.price": (lambda path, _, __: adhesis.Campaign("c.toml").price(path), ".h5"),
        "Campaign.run": (lambda path, _, __: adhesis.Campaign("c.toml").run(path), ".h5"),
    },
    OF_WRITING: {
        "save": (lambda path, _, loop: loop.save(path), ".nc"),
        "film": (lambda path, _, loop: loop.film(frames=2).save(path), ".html"),
    },
}
# A new results file is made through a link, and one that is missing where it is looked at.
MAKES = ("run c.toml", "merge SOUND --out", "Campaign.price", "Campaign.run")
# Each reader, writer and maker of folders meets all kinds; whoever calls one of them, some.
EACH = (
    *("run {}", "run c.toml --out", "status", "loop --heights", "trace", "LOOP --json"),
    *("doctor", "load", "save"),
)
SOME = ("pipe", "link to itself", "a name too long")
CASES = [
    (name, kind)
    for named in (COMMANDS, FUNCTIONS)
    for kinds, names in named.items()
    for name in (names.strip().splitlines() if isinstance(names, str) else names)
    for kind in kinds
    if name.startswith(EACH) or kind in SOME
    if not (kind == "link to nothing" and name.startswith(MAKES))
]


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_a_crafted_path_is_refused_in_one_sentence_before_anything_is_done(
    name, kind, place, results, loop, capsys, monkeypatch
):
    forbid_work(monkeypatch)
    # a slow machine is no reason for a line of progress
    monkeypatch.setattr("adhesis.ensemble.reporter.interval", lambda elapsed: 1e3)
    monkeypatch.setattr("adhesis.ensemble.run.session.run_campaign", None)
    if "->" in name:
        text, _, ending = (word.strip() for word in name.partition("->"))
        text = text.replace("LOOP", " ".join(LOOP)).replace("MATERIAL", " ".join(MATERIAL))
        words = {"{}": place(kind, ending), "SOUND": results}
        refused_by(lambda: commanded([words.get(word, word) for word in text.split()], capsys))
    else:
        call, ending = next(names[name] for names in FUNCTIONS.values() if name in names)
        path = place(kind, ending)
        refused_by(lambda: call(path, results, loop))


def commanded(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    code = main(words)
    out, error = capsys.readouterr()
    assert (code, out) == (2, ""), (code, out, error)
    (line,) = error.splitlines()
    raise InputError(line)


def refused_by(call: Callable[[], object]) -> None:
    folder = Path.cwd()
    before = kept(folder)
    with pytest.raises(InputError) as error:
        call()
    assert "\n" not in str(error.value)
    assert kept(folder) == before


@pytest.mark.parametrize("kind", [kind for kind in MADE if kind != "file"])
def test_what_stands_in_the_place_of_the_lock_is_refused(kind, place, capsys):
    place(kind, ".h5.lock")
    run = adhesis.Campaign("c.toml").tables
    refused_by(lambda: run_campaign(run, "crafted.h5", engine=fake_engine("")))
    assert holder("crafted.h5") is None
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "kind",
    [
        *("pipe", "folder", "second name", "link to a file", "link to a folder"),
        "link of another user",
    ],
)
def test_what_stands_in_the_place_of_the_unfinished_file_is_removed_and_not_followed(kind, place):
    place(kind, ".h5.part")
    run = adhesis.Campaign("c.toml").tables
    if kind == "folder":
        refused_by(lambda: run_campaign(run, "crafted.h5", engine=fake_engine("")))
        return
    before = kept(Path("apart"))
    run_campaign(run, "crafted.h5", engine=fake_engine(""))
    assert kept(Path("apart")) == before
    assert sorted(path.name for path in Path().glob("crafted*")) == ["crafted.h5"]
