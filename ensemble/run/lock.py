"""Keep a second run out of a results file, by a lock beside it: ``FILE.h5.lock``.

HDF5 keeps no second writer out (under MPI it takes no lock at all). The lock is the operating
system's (flock), on a file beside the results: it ends with the process that holds it, however that
ends, so the lock file of a killed run is not locked. It keeps out a second run of the same process,
too. Ranks may outlive a killed launcher by seconds; each rank that writes therefore holds a share,
and a new run, which takes the whole lock before its share, waits for the last of them.

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
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from adhesis.ensemble.errors import InputError, WriteError, refusal
from adhesis.ensemble.escape import one_line
from adhesis.ensemble.files import target_of
from adhesis.ensemble.reporter import log
from adhesis.solver.checks import counted

_UNSUPPORTED = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL, errno.EBADF}
# Without O_NONBLOCK, opening a pipe in place of the lock file would block.
_SAFELY = os.O_NOFOLLOW | os.O_NONBLOCK
_MAX_RECORD = 4096  # bytes
_RETRY_INTERVAL = 0.1  # s


class RunLock(AbstractContextManager["RunLock"]):
    """Lock that a run holds while it writes to a results file, which need not exist."""

    def __init__(self, results: Path | str) -> None:
        self._results = Path(results)
        self.path = _lock_of(self._results)
        self._descriptor: int | None = None
        self._owner = False

    def acquire(self, ranks: int, patience: float) -> None:
        """Take the lock for a run, by its rank 0 (InputError; WriteError for a full disk).

        ``ranks`` is for the message to a run that is refused, ``patience`` how long to wait for a
        run that holds it, in s: one that was just killed needs a moment.
        """
        deadline = time.monotonic() + patience
        announced = False
        while not self._try():
            if time.monotonic() >= deadline:
                raise InputError(
                    f"{self._results} is being written by another run{self._holder()}, or by ranks "
                    "that have outlived it: wait until they have ended"
                )
            if not announced and patience > 1:
                held = f"{self._results} is held by another run{self._holder()}"
                log(f"{held}; waiting up to {patience:g} s for it to end")
                announced = True
            time.sleep(_RETRY_INTERVAL)
        self._owner = True
        self._write_record(ranks)

    def join(self) -> None:
        """Hold a share of the lock, by any other rank that writes, after rank 0 has acquired it."""
        with suppress(OSError):  # rank 0 has warned
            fcntl.flock(self._open(), fcntl.LOCK_SH)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # After a failure other ranks may still write: a new run finds their locks on this file.
        self.release(keep_file=kind is not None and not issubclass(kind, InputError))

    def release(self, *, keep_file: bool = False) -> None:
        """Release the lock, if it is held."""
        if self._descriptor is None:
            return
        if self._owner and not keep_file:
            self.path.unlink(missing_ok=True)
        with suppress(OSError):  # a process that was forked meanwhile has the open file, too
            fcntl.flock(self._descriptor, fcntl.LOCK_UN)
        os.close(self._descriptor)
        self._descriptor, self._owner = None, False

    def _try(self) -> bool:
        """Lock the file that is at the path now: its last holder may just have removed it."""
        descriptor = self._open()
        try:
            # Between both another run may take it: the second fails then.
            for kind in (fcntl.LOCK_EX, fcntl.LOCK_SH):
                fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.stat(self.path), os.fstat(descriptor)):
                    return True
        except OSError as error:
            if error.errno in _UNSUPPORTED:
                none = f"the file system of {self.path} has no locks"
                log(f"warning: {none}; make sure that no other run writes there")
                return True
        os.close(descriptor)
        self._descriptor = None
        return False

    def _open(self) -> int:
        if self._descriptor is None:
            try:
                descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | _SAFELY, 0o666)
            except OSError as error:
                if error.errno in (errno.ELOOP, errno.ENXIO, errno.EISDIR):
                    raise self._no_lock() from None
                raise refusal(error)(f"{self.path} cannot be written: {error.strerror}") from error
            found = os.fstat(descriptor)
            # With a second name (hard link) it may be a file of the user's: the record would
            # overwrite it.
            if not stat.S_ISREG(found.st_mode) or found.st_nlink > 1:
                os.close(descriptor)
                raise self._no_lock()
            self._descriptor = descriptor
        return self._descriptor

    def _no_lock(self) -> InputError:
        kind = "a link or no ordinary file, and not the lock of a run"
        return InputError(f"{self.path} is {kind}: remove it")

    def _write_record(self, ranks: int) -> None:
        assert self._descriptor is not None
        record = {
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "ranks": ranks,
            "since": datetime.now().astimezone().isoformat(timespec="seconds"),
        }
        try:
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, json.dumps(record).encode(), 0)
        except OSError as error:
            self.release()
            raise WriteError(f"{self.path} cannot be written: {error.strerror}") from error

    def _holder(self) -> str:
        record = holder(self._results)
        return f" ({described(record)})" if record else ""


def _lock_of(results: Path) -> Path:
    results = target_of(results)
    return results.with_name(f"{results.name}.lock")


def holder(results: Path | str) -> dict[str, Any] | None:
    """Return which run writes to a results file now: host, pid, ranks, since; None if none does.

    The lock is held for a moment only. On a file system without locks None is returned.
    """
    for mode in (os.O_RDWR, os.O_RDONLY):  # some file systems lock alone what may be written
        with suppress(OSError):
            descriptor = os.open(_lock_of(Path(results)), mode | _SAFELY)
            break
    else:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return None if error.errno in _UNSUPPORTED else _read_record(descriptor) or {}
    finally:
        os.close(descriptor)
    return None


def described(record: Mapping[str, Any]) -> str:
    """Describe the run that holds a lock."""
    if not record:
        return "of which nothing more is known"
    return one_line(
        f"host {record['host']}, process {record['pid']}, {counted(record['ranks'], 'rank')}, "
        f"since {record['since']}"
    )


def _read_record(descriptor: int) -> dict[str, Any] | None:
    """Read the record that the holder of a lock has written into it."""
    try:
        record = json.loads(os.pread(descriptor, _MAX_RECORD, 0))
        return {name: record[name] for name in ("host", "pid", "ranks", "since")}
    except (OSError, ValueError, KeyError, TypeError):
        return None
