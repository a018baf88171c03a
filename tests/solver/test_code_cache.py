"""Compiled code is executed, so only what nobody else could have written is read."""

from __future__ import annotations

import os
import pickle
import re
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from adhesis.solver.runtime import disk_cache as code_cache
from adhesis.solver.runtime import jit as module
from adhesis.solver.runtime.disk_cache import CodeFiles

# Two accounts beside the one of the tests; they need no name.
MALLORY, ADMIN = 64_001, 64_002
root_only = pytest.mark.skipif(os.geteuid() != 0, reason="only root can act for other accounts")


@pytest.fixture
def places(monkeypatch):
    """The installation's and the user's folder, both empty, where other accounts may come, too."""
    # pytest's own folder is closed to others
    top = Path(tempfile.mkdtemp(prefix="adhesis-cache-"))
    top.chmod(0o755)
    monkeypatch.setattr(code_cache, "installed_folder", lambda: top / "installed")
    monkeypatch.setenv("ADHESIS_CACHE", str(top / "user"))
    yield top / "installed" / "key", top / "user" / "key"
    shutil.rmtree(top)


def write_as(user: int, path: Path, content: bytes = b"code") -> None:
    """Write a file, and its folder, as another account does, into a folder that lets it."""
    for folder in (path.parent.parent, path.parent):
        folder.mkdir(exist_ok=True)
        os.chown(folder, user, user)
    subprocess.run(
        ["/bin/sh", "-c", 'cat >"$1"', "sh", path],
        input=content, user=user, group=user, extra_groups=[], check=True,
    )  # fmt: skip
    assert path.stat().st_uid == user


def read(files: CodeFiles | None = None) -> tuple[bytes | None, str]:
    """Return what is read of the file ``code``, and the one warning or nothing."""
    files = files or CodeFiles("key")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        content = files.read("code")
        assert (files.find("code") is None) == (content is None)
    assert len(caught) <= 1
    return content, "".join(str(warning.message) for warning in caught)


def as_account(user: int, function: Callable[[], bytes]) -> bytes:
    """Return what a function returns in a process of another account.

    It is forked, as the interpreter may lie where other accounts cannot start it.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setgid(user)
            os.setuid(user)
            os.write(writing, function())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as stream:
        answer = stream.read()
    os.waitpid(child, 0)
    return answer


def double(x):
    return 2 * x


class Payload:
    """What an attacker keeps as compiled code: reading it makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


@root_only
def test_code_that_another_account_planted_is_not_executed(places, tmp_path, monkeypatch):
    def compile_double() -> int:
        files = CodeFiles("key")
        monkeypatch.setattr(module, "code_files", lambda to_installation=False: files)
        with module.watch_compilation() as seen:
            assert module.compiled(double)(21) == 42
        return seen.functions

    assert compile_double() == 1
    (name,) = (path.name for path in places[1].iterdir())
    shutil.rmtree(places[1].parent)
    executed = tmp_path / "executed"
    write_as(MALLORY, places[1] / name, pickle.dumps(Payload(executed)))
    with pytest.warns(RuntimeWarning, match=rf"user/key is not used.*uid {MALLORY}") as caught:
        assert compile_double() == 1
    assert len(caught) == 1
    assert not executed.exists()
    assert [path.stat().st_uid for path in places[1].iterdir()] == [MALLORY]


@root_only
@pytest.mark.parametrize(
    ("installed", "folders", "file", "mode", "words"),
    [
        # owner of the folder, of the file; who may write them
        (False, 0, 0, (0o700, 0o644), ""),
        (False, MALLORY, 0, (0o755, 0o644), f"user/key is not used.*uid {MALLORY}.*ADHESIS_CACHE"),
        (False, 0, MALLORY, (0o755, 0o644), f"user/key/code is not used.*uid {MALLORY}"),
        (False, 0, 0, (0o775, 0o644), r"user/key is not used.*mode 775.*chmod go-w .*user/key"),
        (False, 0, 0, (0o1777, 0o644), r"users other than its owner root \(uid 0\) may write"),
        (False, 0, 0, (0o700, 0o664), "user/key/code is not used.*mode 664"),
        (False, ADMIN, ADMIN, (0o755, 0o644), f"uid {ADMIN} and not to you or root; remove it"),
        # whoever owns the sources is trusted with what is compiled of them, and nobody else
        (True, ADMIN, ADMIN, (0o755, 0o644), ""),
        (True, ADMIN, 0, (0o755, 0o644), ""),
        (True, ADMIN, MALLORY, (0o755, 0o644), f"uid {MALLORY} and not to you, root or the owner"),
        (True, ADMIN, ADMIN, (0o775, 0o644), "installed/key is not used.*run adhesis warm"),
    ],
)
def test_only_what_nobody_else_could_have_written_is_read(
    places, tmp_path, monkeypatch, installed, folders, file, mode, words
):
    sources = tmp_path / "solver"
    sources.mkdir()
    os.chown(sources, ADMIN, ADMIN)
    monkeypatch.setattr(code_cache, "_PACKAGE", sources)
    place = places[not installed]
    write_as(file, place / "code")
    (place / "code").chmod(mode[1])
    for folder in (place, place.parent):
        os.chown(folder, folders, folders)
        folder.chmod(mode[0])
    content, reported = read()
    assert content == (None if words else b"code")
    assert re.search(words, reported) if words else reported == ""


@root_only
def test_a_users_folder_is_read_by_that_user_and_roots_by_all(places, monkeypatch):
    write_as(0, places[0] / "code", b"of root")
    write_as(ADMIN, places[1] / "code", b"of the user")
    monkeypatch.setattr(code_cache, "_PACKAGE", places[0])

    def both() -> bytes:
        first, _ = read()
        return repr((first, read_users())).encode()

    def read_users() -> bytes | None:
        monkeypatch.setattr(code_cache, "installed_folder", lambda: places[0] / "none")
        return read()[0]

    assert as_account(ADMIN, both) == b"(b'of root', b'of the user')"
    assert as_account(MALLORY, both) == b"(b'of root', None)"


@pytest.mark.parametrize("mask", [0o002, 0o000, 0o077])
def test_new_folders_are_closed_to_others_whatever_the_umask(places, mask):
    installed, user = places
    before = os.umask(mask)
    try:
        assert CodeFiles("key").write("code", b"code") == user
        assert CodeFiles("key", to_installation=True).write("code", b"code") == installed
    finally:
        os.umask(before)
    for folder in (user, user.parent):
        assert folder.stat().st_mode & 0o777 == 0o700
    for folder in (installed, installed.parent):
        assert folder.stat().st_mode & 0o777 == 0o755 & ~mask
    assert read() == (b"code", "")


def test_a_folder_that_is_not_trusted_is_not_written_either(places):
    user = places[1]
    user.mkdir(parents=True)
    user.chmod(0o777)
    files = CodeFiles("key")
    with pytest.warns(RuntimeWarning, match=r"user/key is not used.*mode 777"):
        assert files.write("code", b"code") is None
    assert read(files) == (None, "")  # one warning is enough
    assert not list(user.iterdir())


def test_a_file_that_others_may_write_is_compiled_and_kept_anew(places):
    files = CodeFiles("key")
    assert files.write("code", b"mine") == places[1]
    (places[1] / "code").write_bytes(b"whose?")
    (places[1] / "code").chmod(0o666)
    with pytest.warns(RuntimeWarning, match="user/key/code is not used"):
        assert files.read("code") is None
    assert files.write("code", b"mine") == places[1]
    assert files.read("code") == b"mine"


@root_only
@pytest.mark.parametrize(
    ("owner", "mode", "words"),
    [
        (0, 0o755, ""),
        (0, 0o1777, ""),  # sticky, as /tmp is
        (0, 0o777, "above is not used.*mode 777.*chmod go-w .*above"),
        (0, 0o770, "above is not used.*mode 770"),
        (MALLORY, 0o755, f"above is not used.*uid {MALLORY}.*ADHESIS_CACHE"),
        (MALLORY, 0o1777, f"above is not used.*uid {MALLORY}"),
    ],
)
def test_who_owns_a_folder_above_could_exchange_the_code(places, monkeypatch, owner, mode, words):
    above = places[1].parent.parent / "above"
    monkeypatch.setenv("ADHESIS_CACHE", str(above / "of" / "mine"))
    assert CodeFiles("key").write("code", b"code") == above / "of" / "mine" / "key"
    os.chown(above, owner, owner)
    above.chmod(mode)
    content, reported = read()
    assert content == (None if words else b"code")
    assert re.search(words, reported) if words else reported == ""


@root_only
def test_a_link_is_followed_if_nobody_else_could_have_made_it(places, monkeypatch):
    """A home folder is often a link; in /tmp anybody may make one to a folder that is trusted."""
    top = places[1].parent.parent
    (top / "tmp").mkdir()
    (top / "tmp").chmod(0o1777)
    CodeFiles("key").write("code", b"code")
    link = top / "tmp" / "link"
    for target in (top / "user", Path("../user")):
        link.symlink_to(target)
        for words in ("", f"link is not used.*uid {MALLORY}"):
            monkeypatch.setenv("ADHESIS_CACHE", str(link))
            content, reported = read()
            assert content == (None if words else b"code")
            assert re.search(words, reported) if words else reported == ""
            os.chown(link, MALLORY, MALLORY, follow_symlinks=False)
        link.unlink()
    link.symlink_to(link)
    assert read() == (None, "")


def test_the_file_itself_is_no_link(places):
    files = CodeFiles("key")
    files.write("other", b"code")
    (places[1] / "code").symlink_to("other")
    assert read(files) == (None, "")
    assert files.write("code", b"mine") == places[1]
    assert (read(files), files.read("other")) == ((b"mine", ""), b"code")
