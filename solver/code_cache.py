"""Where compiled code is kept between processes: files alone, nothing of the compiler.

Code lies in a folder named after all that it depends on (:func:`folder_name`), which is looked for

1.  in the installation, ``solver/__compiled__`` beside the sources: made by ``adhesis warm``, and
    from then on only read, by every user and every node;
2.  in the user's cache: ``$ADHESIS_CACHE``, ``$XDG_CACHE_HOME/adhesis`` or ``~/.cache/adhesis``.

One file a compiled function and signature. A file appears whole, by renaming: processes that
compile the same at the same time both succeed, without locks, which network disks are bad at.
"""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent
_KERNEL = re.compile(r"^@compiled(_\w+)?\s*$", re.MULTILINE)


def kernel_modules(package: Path = _PACKAGE) -> list[Path]:
    """Modules that hold compiled functions, and the one that compiles them; in a fixed order.

    Whatever compiled code reads (functions, constants) stands in one of them.
    """
    return [
        path
        for path in sorted(package.rglob("*.py"))
        if path == package / "compiled.py" or _KERNEL.search(path.read_text("utf-8"))
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
        self._places = [installed_folder() / name]
        if users is not None:
            self._places.append(users / name)
        # where new files go, the preferred place first
        self._targets = self._places if to_installation else self._places[1:]
        self._to_installation = to_installation
        self._warned = False

    def read(self, file: str) -> bytes | None:
        """Content of a file, or None; what goes to the installation is copied there."""
        for place in self._places:
            try:
                content = (place / file).read_bytes()
            except OSError:
                continue
            if self._to_installation and place != self._places[0]:
                self.write(file, content)
            return content
        return None

    def find(self, file: str) -> Path | None:
        """Folder in which a file lies, or None."""
        return next((place for place in self._places if os.path.isfile(place / file)), None)

    def write(self, file: str, content: bytes) -> Path | None:
        """Keep a file; returns its folder, or None after a warning (once) if it cannot be kept."""
        reasons = []
        for place in self._targets:
            try:
                _write_whole(place, file, content)
            except OSError as error:
                reasons.append(f"{place.parent} ({error.strerror or error})")
            else:
                return place
        if not self._warned:
            self._warned = True
            warnings.warn(
                "compiled code cannot be kept, so that each process compiles it anew: "
                f"{_listed(reasons)}; ADHESIS_CACHE names another folder",
                RuntimeWarning,
                stacklevel=2,
            )
        return None


def _listed(reasons: Iterable[str]) -> str:
    return ", ".join(reasons) or "there is no home folder"


def _write_whole(folder: Path, file: str, content: bytes) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=f".{file[:40]}-")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.chmod(temporary, 0o644)  # others may read what one user's installation has compiled
        os.replace(temporary, folder / file)
    except BaseException:
        os.unlink(temporary)
        raise
