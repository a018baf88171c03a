"""Files of a command: read without waiting, checked before any work, written whole or not at all.

Of what is read, a pipe, socket or device in the place of a file is refused: a pipe that nobody
writes to would hold a program up until it is killed, and a device that has no end would fill its
memory.

A command lists its outputs, each with the option that names it, and has them checked before it
computes. A regular file is written beside its place and renamed. A stream of the process
(/dev/stdout) and a character device (/dev/null) are written in place; a pipe is refused, as it
would wait for a reader. A failure while writing does not keep the other outputs from being written.
"""

from __future__ import annotations

import errno
import json
import os
import re
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import IO, Any

from adhesis.ensemble.errors import InputError, WriteError, quoted, reason, refusal

# Other names of an open descriptor of this process; to rename a file over them would destroy them.
_DESCRIPTOR = re.compile(r"/dev/(?:(stdin|stdout|stderr)|fd/(\d+))|/proc/self/fd/(\d+)")
_MOST_LINKS = 40  # of a chain, as of Linux
_NEW_TERMINAL = os.makedev(5, 2)  # /dev/ptmx: opening it makes a terminal
# Folders that are being written to, for a signal that ends the process at once.
_unfinished: set[Path] = set()
_STANDARD = {"stdin": 0, "stdout": 1, "stderr": 2}


# A pipe that takes the place of the file after it was looked at is opened without waiting, too.
_WITHOUT_WAITING = os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
_KINDS = (
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def irregular(mode: int) -> str | None:
    """Return what a file with this mode is ("a pipe"); None for a regular file."""
    if stat.S_ISREG(mode):
        return None
    return next((kind for holds, kind in _KINDS if holds(mode)), "no ordinary file")


def open_regular(path: Path | str) -> BufferedReader:
    """Open a file to read (OSError), if it is a regular one (InputError)."""
    try:
        mode = os.stat(path).st_mode
    except ValueError:  # a NUL, or characters that no name has
        raise InputError(f"{quoted(str(path))} is not the name of a file") from None
    _refuse(path, mode)  # before it is opened, which some devices take for a command
    descriptor = os.open(path, os.O_RDONLY | _WITHOUT_WAITING)
    try:
        _refuse(path, os.fstat(descriptor).st_mode)
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def _refuse(path: Path | str, mode: int) -> None:
    kind = irregular(mode)
    if kind is not None:
        raise InputError(
            f"{path} is {kind}, not a file"
            + (": write its content to a file first" if kind != "a directory" else "")
        )


# ---------------------------------------------------------------------- outputs


def target_of(path: Path | str) -> Path:
    """Return the file that a path leads to: that of a symbolic link, or the path itself.

    Other paths stay as they were given, for messages. InputError for a link that leads in a circle,
    or that another user has put into a folder in which all may write: it could lead to any file of
    this user.
    """
    path = Path(path)
    link = path
    for _ in range(_MOST_LINKS):
        try:
            target = os.readlink(link)
        except OSError:  # no link, or none at all
            break
        _check_link(path, link)
        link = link.parent / target
    else:
        raise InputError(f"{path} is a link that leads in a circle: give another path")
    return Path(os.path.realpath(path)) if link != path else path


def _check_link(path: Path, link: Path) -> None:
    """Refuse to follow a link as Linux does (protected_symlinks), which renaming would evade."""
    folder, owner = os.stat(link.parent), os.lstat(link).st_uid
    shared = folder.st_mode & stat.S_ISVTX and folder.st_mode & stat.S_IWOTH
    if shared and owner not in (os.geteuid(), folder.st_uid):
        raise InputError(
            f"{path} is a link that another user has put into {link.parent}, where all may write: "
            "it is not followed, so give another path"
        )


def check_outputs(outputs: Mapping[str, Path], inputs: Mapping[str, Path]) -> None:
    """Refuse outputs, by option, that cannot be written or overwrite a file (InputError)."""
    seen: dict[str, Path] = {}
    for option, path in outputs.items():
        with _refusing(option, path):
            _check_file(option, path)
            for name, other in inputs.items():
                if _same_file(path, other):
                    raise InputError(
                        f"{option} is {path}, the file that {name} reads: it would be "
                        "overwritten, so give another file"
                    )
            for name, other in seen.items():
                if _same_file(path, other) and os.path.realpath(path) != os.devnull:
                    rule = "each output needs a file of its own"
                    raise InputError(f"{name} and {option} are both {path}: {rule}")
        seen[option] = path


def check_ending(option: str, path: Path, *endings: str) -> None:
    """Refuse the name of a file with another ending, in small letters or capitals (InputError)."""
    if path.suffix.lower() not in endings:
        names = " or ".join(", ".join(endings).rsplit(", ", 1))
        raise InputError(f"{option} is {path}: the name must end in {names}")


def check_output_folder(
    option: str, folder: Path, names: Iterable[str], inputs: Mapping[str, Path]
) -> None:
    """Refuse a folder that cannot be made or written, or in which an input would be overwritten.

    Nothing is made yet. ``names`` are those of the files that are to be written there; InputError.
    """
    with _refusing(option, folder):
        target_of(folder)  # not through a link of another user
        place = Path(os.path.abspath(folder))
        while not os.path.lexists(place) and place.parent != place:
            _check_name(place)
            place = place.parent
        if not place.is_dir():
            raise InputError(f"{option} is {folder}: {place} is not a directory")
        tempfile.TemporaryFile(dir=place).close()
        for name in names:
            if (folder / name).is_dir():
                raise InputError(
                    f"{option} is {folder}: a file {name} is to be written there, "
                    "and there is a directory of that name"
                )
            for source, path in inputs.items():
                if _same_file(folder / name, path):
                    raise InputError(
                        f"{option} is {folder}: {name} would be written there over {path}, the "
                        f"file that {source} reads, so give another directory"
                    )


@contextmanager
def _refusing(option: str, path: Path) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        why = reason(error)
        raise refusal(error)(f"{option} is {path}: it cannot be written ({why})") from None


def _check_file(option: str, path: Path) -> None:
    if _descriptor(path) is not None:
        return
    target = target_of(path)
    if target.is_dir():
        raise InputError(f"{option} is {path}: it is a directory, not a file to write")
    if target.exists() and not (target.is_file() or target.is_char_device()):
        kind = irregular(target.stat().st_mode)
        raise InputError(f"{option} is {path}: it is {kind}, not a file to write")
    if not target.parent.is_dir():
        raise InputError(f"{option} is {path}: there is no directory {target.parent}")
    if _in_place(target):
        _open_device(target).close()
        return
    if target.exists() and not os.access(target, os.W_OK):
        raise InputError(f"{option} is {path}: the file is write-protected")
    _check_name(target)
    tempfile.TemporaryFile(dir=target.parent).close()


def _check_name(path: Path) -> None:
    with suppress(FileNotFoundError, NotADirectoryError):
        path.lstat()  # the system refuses a name that is too long (OSError)


def _same_file(one: Path, other: Path) -> bool:
    """Whether two paths are one file, through links of either kind, or would be."""
    first, second = _descriptor(one), _descriptor(other)
    if first is not None or second is not None:
        return first == second
    with suppress(OSError):  # one of them is still to be made
        if os.path.samefile(one, other):
            return True
    return os.path.realpath(one) == os.path.realpath(other)


class Writing:
    """Outputs that are written one after the other, and a clause for each that failed."""

    def __init__(self) -> None:
        self.written: list[Path] = []
        self.failures: list[str] = []

    @contextmanager
    def output(self, option: str, path: Path) -> Iterator[None]:
        """Record whether the output that is written inside succeeds; an OSError ends here."""
        try:
            yield
        except OSError as error:
            self.failures.append(f"{option} {path} could not be written ({reason(error)})")
        else:
            self.written.append(path)

    def finish(self) -> None:
        """Raise a WriteError that names every output that is missing, if there are any."""
        if self.failures:
            raise WriteError("; ".join(self.failures))


@contextmanager
def whole_file(path: Path) -> Iterator[IO[bytes]]:
    """Open a file to write that appears whole or not at all; streams and devices in place.

    A link is followed: the file that it points to is replaced (OSError).
    """
    descriptor = _descriptor(path)
    if descriptor is not None:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()  # what was printed before comes first
        with os.fdopen(os.dup(descriptor), "wb") as file:
            yield file
        return
    target = target_of(path)
    if _in_place(target):
        with _open_device(target) as file:
            yield file
        return
    with _staging(target.parent) as folder, (folder / target.name).open("wb") as file:
        yield file


def write_new(option: str, path: Path, content: Callable[[], bytes]) -> None:
    """Write a file that does not exist yet (InputError, WriteError)."""
    check_outputs({option: path}, {})
    if os.path.isfile(path):
        raise InputError(f"{option} is {path}, which exists: give another name")
    data = content()  # first: a signal while it loads modules leaves no part of a file
    writing = Writing()
    with writing.output(option, path), whole_file(path) as stream:
        stream.write(data)
    writing.finish()
    print(f"wrote       {path}")


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a document whole or not at all (OSError)."""
    with whole_file(path) as stream:
        stream.write((json.dumps(document, indent=1, allow_nan=False) + "\n").encode())


@contextmanager
def staged_folder(folder: Path, names: Iterable[str] = ()) -> Iterator[Path]:
    """Make a folder and one inside it to write files into, which are then moved to their place.

    If the writing fails, none of the files is moved, and older ones of the same names stay
    (OSError). An older file of ``names`` that is not written now is removed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with _staging(folder) as staging:
        yield staging
        older = set(names) - {path.name for path in staging.iterdir()}
    for name in older:
        (folder / name).unlink(missing_ok=True)


@contextmanager
def _staging(folder: Path) -> Iterator[Path]:
    """Make a folder inside another one; at the end its files are moved there, all or none."""
    staging = Path(tempfile.mkdtemp(dir=folder, prefix=".writing-"))
    _unfinished.add(staging)
    spare = os.open(staging, os.O_RDONLY)  # to empty it by, where no more files may be opened
    try:
        yield staging
        for path in sorted(staging.iterdir()):
            os.replace(path, folder / path.name)
    finally:
        os.close(spare)
        with suppress(OSError):  # shutil.rmtree opens several files
            _remove_folder(staging)
        _unfinished.discard(staging)


def _remove_folder(folder: Path) -> None:
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()


def remove_unfinished() -> None:
    """Remove what is being written, before a signal ends the process."""
    for folder in sorted(_unfinished, reverse=True):  # one in another one comes first
        with suppress(OSError):
            _remove_folder(folder)


def _in_place(target: Path) -> bool:
    """Whether a path is no file, which is written in place, if at all, and not renamed over."""
    return target.exists() and not target.is_file()


def _open_device(target: Path) -> IO[bytes]:
    """Open a character device to write (OSError, also for whatever else has taken its place)."""
    descriptor = os.open(target, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        found = os.fstat(descriptor)
        if not stat.S_ISCHR(found.st_mode):
            raise OSError(errno.EINVAL, "it is neither a file nor a character device")
        if found.st_rdev == _NEW_TERMINAL:  # nobody reads it: a write would wait for ever
            raise OSError(errno.EINVAL, "it opens a terminal of its own, which nobody reads")
        os.set_blocking(descriptor, True)
        return os.fdopen(descriptor, "wb")
    except BaseException:
        os.close(descriptor)
        raise


def _descriptor(path: Path) -> int | None:
    """The descriptor of this process that a path such as /dev/stdout names, or None."""
    found = _DESCRIPTOR.fullmatch(os.path.abspath(path))
    if found is None:
        return None
    return _STANDARD[found[1]] if found[1] else int(found[2] or found[3])
