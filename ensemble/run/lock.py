"""One run a results file: a lock beside it, ``FILE.h5.lock``.

HDF5 keeps no second writer out (under MPI it takes no lock at all). The lock is the operating
system's, on a file beside the results: it ends with the process that holds it, however that ends,
and a lock file left over by a killed run locks nothing. Ranks may outlive a killed launcher by
seconds; each rank that writes therefore holds its share, and a new run waits for the last of them.

The lock belongs to the file itself: a symbolic link to a results file has no lock of its own. Where
others can write to the folder, a link in place of the lock is refused, not followed.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import socket
import stat
import sys
import time
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, Self

from adhesis.ensemble.errors import InputError, WriteError
from adhesis.ensemble.escape import one_line
from adhesis.ensemble.outputs import target_of

# Two bytes far beyond the text: the run as a whole, and the ranks that write.
_RUN, _WRITERS = 1 << 30, (1 << 30) + 1
_UNSUPPORTED = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL}
_FULL = {errno.ENOSPC, errno.EDQUOT}
# O_NONBLOCK: a pipe in place of the lock would be waited for.
_SAFELY = os.O_NOFOLLOW | os.O_NONBLOCK
_LONGEST_CARD = 4096  # bytes
_PAUSE = 0.1


class RunLock:
    """Held while a run writes to a results file.

    Parameters
    ----------
    results : path
        The results file; it need not exist.
    """

    def __init__(self, results: Path | str) -> None:
        self._results = Path(results)
        self.path = _lock_of(self._results)
        self._descriptor: int | None = None
        self._owner = False

    def acquire(self, ranks: int, patience: float) -> None:
        """Take the lock for a run, by its rank 0.

        Parameters
        ----------
        ranks : int
            Told to whoever is refused.
        patience : float
            How long to wait for a run that holds it, in s: one that was just killed needs a moment.

        Raises
        ------
        InputError
            If another run holds it, or the folder cannot be written.
        WriteError
            If the disk is full.
        """
        deadline = time.monotonic() + patience
        told = False
        while not self._try(_RUN):
            if time.monotonic() >= deadline:
                raise InputError(f"{self._results} is being written by another run{self._holder()}")
            if not told and patience > 1:
                print(
                    f"{self._results} is held by another run{self._holder()}; "
                    f"waiting up to {patience:g} s for it to end",
                    file=sys.stderr,
                    flush=True,
                )
                told = True
            time.sleep(_PAUSE)
        self._owner = True
        while not self._lock(_WRITERS, fcntl.LOCK_EX):
            if time.monotonic() >= deadline:
                self.release()
                raise InputError(
                    f"{self._results} is still being written by ranks of an earlier run: "
                    "end them, or wait until they have ended"
                )
            time.sleep(_PAUSE)
        self._lock(_WRITERS, fcntl.LOCK_SH)
        self._sign(ranks)

    def join(self) -> None:
        """Hold a share of the lock, by any other rank that writes, after rank 0 has acquired it."""
        self._open()
        self._lock(_WRITERS, fcntl.LOCK_SH)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # After a failure other ranks may still write, and a new run must meet their shares here.
        self.release(keep_file=kind is not None and not issubclass(kind, InputError))

    def release(self, *, keep_file: bool = False) -> None:
        """Let go; does nothing if nothing is held."""
        if self._descriptor is None:
            return
        if self._owner and not keep_file:
            self.path.unlink(missing_ok=True)
        os.close(self._descriptor)
        self._descriptor, self._owner = None, False

    def _try(self, byte: int) -> bool:
        """Lock the file that is at the path now: its last holder may just have removed it."""
        self._open()
        assert self._descriptor is not None
        if self._lock(byte, fcntl.LOCK_EX):
            mine = os.fstat(self._descriptor)
            try:
                there = os.stat(self.path)
            except FileNotFoundError:
                there = None
            if there is not None and (there.st_ino, there.st_dev) == (mine.st_ino, mine.st_dev):
                return True
        os.close(self._descriptor)
        self._descriptor = None
        return False

    def _open(self) -> None:
        if self._descriptor is None:
            try:
                descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | _SAFELY, 0o666)
            except OSError as error:
                if error.errno == errno.ELOOP:
                    raise self._no_lock() from None
                kind = WriteError if error.errno in _FULL else InputError
                raise kind(f"{self._results} cannot be written: {error.strerror}") from error
            found = os.fstat(descriptor)
            # Another name of it would be that of a file which the lock's text would replace.
            if not stat.S_ISREG(found.st_mode) or found.st_nlink > 1:
                os.close(descriptor)
                raise self._no_lock()
            self._descriptor = descriptor

    def _no_lock(self) -> InputError:
        return InputError(
            f"{self.path} is a link or no ordinary file, and not the lock of a run: remove it"
        )

    def _lock(self, byte: int, kind: int) -> bool:
        assert self._descriptor is not None
        try:
            fcntl.lockf(self._descriptor, kind | fcntl.LOCK_NB, 1, byte)
        except OSError as error:
            if error.errno in _UNSUPPORTED:
                if byte == _RUN:
                    print(
                        f"warning: the file system of {self.path} has no locks; "
                        "make sure that no other run writes there",
                        file=sys.stderr,
                    )
                return True
            return False
        return True

    def _sign(self, ranks: int) -> None:
        assert self._descriptor is not None
        card = {
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "ranks": ranks,
            "since": datetime.now().astimezone().isoformat(timespec="seconds"),
        }
        try:
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, json.dumps(card).encode(), 0)
        except OSError as error:
            self.release()
            raise WriteError(f"{self.path} cannot be written: {error.strerror}") from error

    def _holder(self) -> str:
        try:
            descriptor = os.open(self.path, os.O_RDONLY | _SAFELY)
        except OSError:
            return ""
        try:
            card = _card(descriptor)
        finally:
            os.close(descriptor)
        return f" ({described(card)})" if card else ""


def _lock_of(results: Path) -> Path:
    results = target_of(results)
    return results.with_name(f"{results.name}.lock")


def holder(results: Path | str) -> dict[str, Any] | None:
    """Tell which run writes to a results file now: host, pid, ranks, since; None if none does.

    Takes nothing that a run would wait for longer than a moment. Where the file system has no locks
    nothing is known, and None is returned.
    """
    try:
        descriptor = os.open(_lock_of(Path(results)), os.O_RDONLY | _SAFELY)
    except OSError:
        return None
    try:
        fcntl.lockf(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB, 1, _RUN)
    except OSError as error:
        return None if error.errno in _UNSUPPORTED else _card(descriptor) or {}
    finally:
        os.close(descriptor)
    return None


def described(card: Mapping[str, Any]) -> str:
    """Return in words which run holds a lock."""
    if not card:
        return "of which nothing more is known"
    return one_line(
        f"host {card['host']}, process {card['pid']}, {card['ranks']} ranks, since {card['since']}"
    )


def _card(descriptor: int) -> dict[str, Any] | None:
    """Read what the holder of a lock has written into it."""
    try:
        card = json.loads(os.pread(descriptor, _LONGEST_CARD, 0))
        return {name: card[name] for name in ("host", "pid", "ranks", "since")}
    except (OSError, ValueError, KeyError, TypeError):
        return None
