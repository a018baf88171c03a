"""Store compiled code on disk between processes; independent of the compiler.

The code is in a folder named after all that it depends on (:func:`folder_name`), searched for

1.  in the installation, ``solver/__compiled__`` beside the sources: written by ``adhesis warm``,
    and read by every user and every node;
2.  in the user's cache: ``$ADHESIS_CACHE``, ``$XDG_CACHE_HOME/adhesis`` or ``~/.cache/adhesis``.

Each compiled function and signature has one file. A file is created atomically, by renaming:
processes that compile the same function at the same time both succeed, without locks, which are
unreliable on network disks.

Reading a file executes its content. A folder or file is therefore used only if its owner is trusted
(the user, root, and in the installation the owner of the sources, which are executed anyway) and
nobody else may write it; otherwise it is ignored with one warning (:class:`_Distrusted`). Whoever
owns a folder above could put another in its place: the same holds for all of them, but that a
sticky one, such as /tmp, may be written by all. They are opened one from the other, and the file
from the last, so that nothing can be exchanged after it was checked.
"""

from __future__ import annotations

import errno
import hashlib
import os
import pwd
import re
import secrets
import stat
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent.parent
_OTHERS = ("runtime/compiler.py", "runtime/jit.py", "sharp/tolerances.py")
"""Modules without compiled functions that compiled code depends on."""
_KERNEL = re.compile(r"^@compiled(_\w+)?\s*$", re.MULTILINE)


def kernel_modules(package: Path = _PACKAGE) -> list[Path]:
    """List the modules with the functions and constants of compiled code, in a fixed order."""
    return [
        path
        for path in sorted(package.rglob("*.py"))
        if path.relative_to(package).as_posix() in _OTHERS
        or _KERNEL.search(path.read_text("utf-8"))
    ]


def folder_name(settings: Mapping[str, str], processor: str, package: Path = _PACKAGE) -> str:
    """Return the folder name for these settings, this processor and the sources of the kernels.

    Parameters
    ----------
    settings : mapping of str to str
        Versions, settings of the compiler, features of the processor.
    processor : str
        Its name, which the folder's name begins with.
    package : path
        The folder of the sources.
    """
    digest = hashlib.sha256()
    for path in kernel_modules(package):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(package).as_posix()} {len(content)}\n".encode())
        digest.update(content)
    for name, value in sorted(settings.items()):
        digest.update(f"{name}={value}\n".encode())
    return f"{re.sub(r'[^A-Za-z0-9.-]', '-', processor)}-{digest.hexdigest()[:16]}"


def installed_folder() -> Path:
    """Return the folder of the installation's compiled code; it may be missing or read-only."""
    return _PACKAGE / "__compiled__"


def users_folder() -> Path | None:
    """Return the folder of the user's compiled code; None without a home folder."""
    if own := os.environ.get("ADHESIS_CACHE"):
        return Path(own)
    if base := os.environ.get("XDG_CACHE_HOME"):
        return Path(base) / "adhesis"
    try:
        return Path.home() / ".cache" / "adhesis"
    except RuntimeError:
        return None


# Descriptors to go on from, also of folders that can be passed and not listed.
_FOLDER = os.O_DIRECTORY | getattr(os, "O_PATH", os.O_RDONLY)
_LONGEST_WAY = 200  # folders and links: more are a circle of links


class _Distrusted(Exception):
    """Error for a folder or file that others could have written, with the remedy."""


class _CodeFolder:
    """One folder of compiled code.

    Parameters
    ----------
    folder : path
    installed : bool
        True for the installation's folder, False for the user's.
    """

    def __init__(self, folder: Path, installed: bool) -> None:
        self.folder = folder
        self._installed = installed

    def read(self, file: str) -> bytes | None:
        """Return the content of a file, or None.

        Raises
        ------
        _Distrusted
        """
        try:
            with self._opened() as folder:
                # O_NONBLOCK: opening a pipe of that name would block
                flags = os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW
                with os.fdopen(os.open(file, flags, dir_fd=folder), "rb") as stream:
                    self._check(self.folder / file, os.fstat(stream.fileno()))
                    return stream.read()
        except OSError:
            return None

    def write(self, file: str, content: bytes) -> None:
        """Write a file, readable for all in the installation and for the user alone elsewhere.

        Raises
        ------
        OSError, _Distrusted
        """
        _make_folder(self.folder, 0o755 if self._installed else 0o700)
        with self._opened() as folder:
            temporary = f".{file[:40]}-{secrets.token_hex(8)}"
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
            handle = os.open(temporary, flags, 0o600, dir_fd=folder)
            try:
                with os.fdopen(handle, "wb") as stream:
                    stream.write(content)
                    os.fchmod(handle, 0o644)  # other users read the installation's code
                os.replace(temporary, file, src_dir_fd=folder, dst_dir_fd=folder)
            except BaseException:
                os.unlink(temporary, dir_fd=folder)
                raise

    @contextmanager
    def _opened(self) -> Iterator[int]:
        """Open the folder, after every folder above it, and every link on the way.

        In the installation those above hold the sources, which are executed anyway.

        Raises
        ------
        OSError, _Distrusted
        """
        path = Path(os.path.abspath(self.folder))
        path, parts = (path.parents[1], path.parts[-2:]) if self._installed else _split(path)
        names = [*reversed(parts)]
        passed: list[tuple[Path, os.stat_result]] = []
        here = os.open(path, _FOLDER)
        try:
            while names:
                name = names.pop()
                found = os.stat(name, dir_fd=here, follow_symlinks=False)
                passed.append((path / name, found))
                if len(passed) > _LONGEST_WAY:
                    raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
                if stat.S_ISLNK(found.st_mode):
                    names += reversed(Path(os.readlink(name, dir_fd=here)).parts)
                    continue
                path /= name
                there = os.open(name, _FOLDER | os.O_NOFOLLOW, dir_fd=here)
                os.close(here)
                here = there
                passed[-1] = path, os.fstat(here)
            for place, found in reversed(passed):
                self._check(place, found, above=place != path)
            yield here
        finally:
            os.close(here)

    def _check(self, path: Path, found: os.stat_result, above: bool = False) -> None:
        """Raise if an untrusted user could have written a folder or file, or a link above them."""
        trusted = {os.geteuid(), 0}
        who = "you or root"
        if self._installed:
            trusted.add(os.stat(_PACKAGE).st_uid)
            who = "you, root or the owner of the installation"
        if found.st_uid not in trusted:
            raise _Distrusted(
                f"{path} is not used, as compiled code is executed: it belongs to "
                f"{_name_of(found.st_uid)} and not to {who}; {self._remedy}"
            )
        if stat.S_ISLNK(found.st_mode) or (above and found.st_mode & stat.S_ISVTX):
            return  # links have no modes; in a sticky folder others can only add something
        if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            raise _Distrusted(
                f"{path} is not used, as compiled code is executed: users other than its "
                f"owner {_name_of(found.st_uid)} may write it (mode {found.st_mode & 0o777:o}); "
                f"chmod go-w {path}, or {self._remedy}"
            )

    @property
    def _remedy(self) -> str:
        if self._installed:
            return "let the owner of the installation remove it and run adhesis warm"
        return "remove it, or name another folder with ADHESIS_CACHE"


class CodeFiles:
    """Files of one folder name, in the installation and in the user's cache.

    Parameters
    ----------
    name : str
        Of :func:`folder_name`.
    to_installation : bool
        Whether new files go to the installation if it is writable; else to the user's cache.
    """

    def __init__(self, name: str, to_installation: bool = False) -> None:
        self.name = name
        users = users_folder()
        self._folders = [_CodeFolder(installed_folder() / name, installed=True)]
        if users is not None:
            self._folders.append(_CodeFolder(users / name, installed=False))
        # folders for new files, in order of preference
        self._targets = self._folders if to_installation else self._folders[1:]
        self._to_installation = to_installation
        self._warned = False

    def read(self, file: str) -> bytes | None:
        """Return the content of a file, or None.

        The user's file is copied to the installation if new files go there.
        """
        for each in self._folders:
            content = self._content(each, file)
            if content is None:
                continue
            if self._to_installation and each is not self._folders[0]:
                self.write(file, content)
            return content
        return None

    def find(self, file: str) -> Path | None:
        """Return the folder that contains a file, or None."""
        found = (each for each in self._folders if self._content(each, file) is not None)
        return next((each.folder for each in found), None)

    def write(self, file: str, content: bytes) -> Path | None:
        """Write a file; returns its folder, or None after a warning (once) if none is writable."""
        reasons = []
        for each in self._targets:
            try:
                each.write(file, content)
            except _Distrusted as error:
                self._warn(str(error))
            except OSError as error:
                reasons.append(f"{each.folder.parent} ({error.strerror or error})")
            else:
                return each.folder
        self._warn(
            "compiled code cannot be kept, so that each process compiles it anew: "
            f"{_listed(reasons)}; ADHESIS_CACHE names another folder"
        )
        return None

    def _content(self, folder: _CodeFolder, file: str) -> bytes | None:
        try:
            return folder.read(file)
        except _Distrusted as error:
            self._warn(str(error))
            return None

    def _warn(self, text: str) -> None:
        """Warn once, as further files fail for the same reason."""
        if not self._warned:
            self._warned = True
            warnings.warn(text, RuntimeWarning, stacklevel=4)


def _listed(reasons: Iterable[str]) -> str:
    return ", ".join(reasons) or "there is no home folder"


def _split(path: Path) -> tuple[Path, tuple[str, ...]]:
    """Return the root of a path, and the names below it."""
    return Path(path.anchor), path.parts[1:]


def _name_of(user: int) -> str:
    try:
        return f"{pwd.getpwuid(user).pw_name} (uid {user})"
    except KeyError:
        return f"uid {user}"


def _make_folder(folder: Path, mode: int) -> None:
    """Make a folder and its missing parents with this mode at most, whatever the umask."""
    if not folder.is_dir():
        _make_folder(folder.parent, mode)
        folder.mkdir(mode=mode, exist_ok=True)
