"""Where compiled code is kept between processes: files alone, nothing of the compiler.

Code lies in a folder named after all that it depends on (:func:`folder_name`), which is looked for

1.  in the installation, ``solver/__compiled__`` beside the sources: made by ``adhesis warm``, and
    from then on only read, by every user and every node;
2.  in the user's cache: ``$ADHESIS_CACHE``, ``$XDG_CACHE_HOME/adhesis`` or ``~/.cache/adhesis``.

One file a compiled function and signature. A file appears whole, by renaming: processes that
compile the same at the same time both succeed, without locks, which network disks are bad at.

Reading a file executes what is in it. So a folder or file counts only if its owner is trusted (the
user, root, and in the installation the owner of the sources, which are executed anyway) and nobody
else may write it; anything else is ignored with one warning (:class:`_Distrusted`).
"""

from __future__ import annotations

import hashlib
import os
import pwd
import re
import stat
import tempfile
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent.parent
_OTHERS = ("runtime/jit.py", "sharp/tolerances.py")
"""Modules without compiled functions that compiled code depends on."""
_KERNEL = re.compile(r"^@compiled(_\w+)?\s*$", re.MULTILINE)


def kernel_modules(package: Path = _PACKAGE) -> list[Path]:
    """List the modules that compiled code depends on, in a fixed order.

    Whatever compiled code reads (functions, constants) stands in one of them.
    """
    return [
        path
        for path in sorted(package.rglob("*.py"))
        if path.relative_to(package).as_posix() in _OTHERS
        or _KERNEL.search(path.read_text("utf-8"))
    ]


def folder_name(settings: Mapping[str, str], processor: str, package: Path = _PACKAGE) -> str:
    """Name of the folder for these settings and this processor and the kernels' sources.

    Parameters
    ----------
    settings : mapping of str to str
        What else the machine code depends on: versions, the compiler's settings, the processor's
        features.
    processor : str
        Its name, which the folder bears for the reader.
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
    """Folder of the installation's compiled code; may be missing or read-only."""
    return _PACKAGE / "__compiled__"


def users_folder() -> Path | None:
    """Folder of the user's compiled code; None without a home to put it in."""
    if own := os.environ.get("ADHESIS_CACHE"):
        return Path(own)
    if base := os.environ.get("XDG_CACHE_HOME"):
        return Path(base) / "adhesis"
    try:
        return Path.home() / ".cache" / "adhesis"
    except RuntimeError:
        return None


class _Distrusted(Exception):
    """A folder or file that others could have written; the text says why and what to do."""


class _Place:
    """One folder of compiled code.

    Parameters
    ----------
    folder : path
    installed : bool
        Whether it belongs to the installation, not to the user.
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
            self._check(self.folder, os.stat(self.folder))
            # O_NONBLOCK: a pipe of that name would be waited for
            descriptor = os.open(self.folder / file, os.O_RDONLY | os.O_NONBLOCK)
        except OSError:
            return None
        with os.fdopen(descriptor, "rb") as stream:
            self._check(self.folder / file, os.fstat(descriptor))
            try:
                return stream.read()
            except OSError:
                return None

    def write(self, file: str, content: bytes) -> None:
        """Keep a file, readable for all in the installation and for the user alone elsewhere.

        Raises
        ------
        OSError, _Distrusted
        """
        _make_folder(self.folder, 0o755 if self._installed else 0o700)
        self._check(self.folder, os.stat(self.folder))
        handle, temporary = tempfile.mkstemp(dir=self.folder, prefix=f".{file[:40]}-")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
            os.chmod(temporary, 0o644)  # others may read what one user's installation has compiled
            os.replace(temporary, self.folder / file)
        except BaseException:
            os.unlink(temporary)
            raise

    def _check(self, path: Path, found: os.stat_result) -> None:
        """Raise if another user could have written a folder or file."""
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
    """The files of one folder name, wherever they are kept.

    Parameters
    ----------
    name : str
        Of :func:`folder_name`.
    to_installation : bool
        Whether new files go to the installation, if it can be written, and not to the user's cache.
    """

    def __init__(self, name: str, to_installation: bool = False) -> None:
        users = users_folder()
        self._places = [_Place(installed_folder() / name, installed=True)]
        if users is not None:
            self._places.append(_Place(users / name, installed=False))
        # where new files go, the preferred place first
        self._targets = self._places if to_installation else self._places[1:]
        self._to_installation = to_installation
        self._warned = False

    def read(self, file: str) -> bytes | None:
        """Return the content of a file, or None; one of the user's is copied to the installation.

        The latter only where new files go to the installation.
        """
        for place in self._places:
            content = self._content(place, file)
            if content is None:
                continue
            if self._to_installation and place is not self._places[0]:
                self.write(file, content)
            return content
        return None

    def find(self, file: str) -> Path | None:
        """Return the folder in which a file lies, or None."""
        found = (place for place in self._places if self._content(place, file) is not None)
        return next((place.folder for place in found), None)

    def write(self, file: str, content: bytes) -> Path | None:
        """Keep a file; returns its folder, or None after a warning (once) if it cannot be kept."""
        reasons = []
        for place in self._targets:
            try:
                place.write(file, content)
            except _Distrusted as error:
                self._warn(str(error))
            except OSError as error:
                reasons.append(f"{place.folder.parent} ({error.strerror or error})")
            else:
                return place.folder
        self._warn(
            "compiled code cannot be kept, so that each process compiles it anew: "
            f"{_listed(reasons)}; ADHESIS_CACHE names another folder"
        )
        return None

    def _content(self, place: _Place, file: str) -> bytes | None:
        try:
            return place.read(file)
        except _Distrusted as error:
            self._warn(str(error))
            return None

    def _warn(self, text: str) -> None:
        """Warn once: the first reason is that of all further ones."""
        if not self._warned:
            self._warned = True
            warnings.warn(text, RuntimeWarning, stacklevel=4)


def _listed(reasons: Iterable[str]) -> str:
    return ", ".join(reasons) or "there is no home folder"


def _name_of(user: int) -> str:
    try:
        return f"{pwd.getpwuid(user).pw_name} (uid {user})"
    except KeyError:
        return f"uid {user}"


def _make_folder(folder: Path, mode: int) -> None:
    """Make a folder and those above it, with a mode that a lax umask does not widen."""
    if not folder.is_dir():
        _make_folder(folder.parent, mode)
        folder.mkdir(mode=mode, exist_ok=True)
