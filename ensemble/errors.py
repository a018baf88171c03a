"""Errors that are the user's to mend: one clear sentence, exit code 2."""

from __future__ import annotations

import errno
import os
import re
import resource
from collections.abc import Container, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from adhesis.ensemble.escape import printable


class _Printable(Exception):
    """An error whose text may hold texts from files, without their control characters."""

    def __str__(self) -> str:
        return printable(super().__str__())


def quoted(text: str, longest: int = 80) -> str:
    """Return the repr of a text, of which a message shows so many characters."""
    return repr(text if len(text) <= longest else f"{text[:longest]}…")


def reason(error: Exception) -> str:
    """Return in one line what the system or a library says of an error; of HDF5's the gist."""
    if found := re.search(r"error message = '([^']*)'", str(error)):
        return found[1]
    return getattr(error, "strerror", None) or " ".join(str(error).split()) or type(error).__name__


class InputError(_Printable, ValueError):
    """A bad value, file or option. The text names the value and the rule in one sentence.

    References
    ----------
    docs/python.md, "Bad input"
    """


class UnitError(InputError):
    """A number has no unit of its quantity, or one is to be given; the text begins with "is"."""


class RankError(InputError):
    """A bad input that one rank alone may have, such as a library that is missing on its node."""


class WriteError(_Printable):
    """An output or stdout could not be written: what was written before is sound."""


# The disk or a limit is at fault, and not the name or its permissions.
_OF_THE_SYSTEM = {*(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO), errno.EMFILE, errno.ENFILE}


def refusal(error: Exception) -> type[InputError | WriteError]:
    """Return the kind of error by which a file that cannot be written is reported."""
    return WriteError if getattr(error, "errno", None) in _OF_THE_SYSTEM else InputError


class Terminated(KeyboardInterrupt):
    """SIGTERM was received, or SIGHUP of a terminal that closes."""


_LACKS = (errno.ENOMEM, errno.EMFILE, errno.ENFILE, errno.EAGAIN)
# How libraries put it: Python's threads, and the loader of shared libraries.
_WORDS = ("can't start new thread", "failed to map segment", *(map(os.strerror, _LACKS)))


def lack(error: BaseException) -> str:
    """Return a sentence on what the system did not grant, if an error is of that kind; or nothing.

    Memory, threads, processes and open files are limited by ``ulimit``, a batch system or a
    container.
    """
    seen: list[BaseException] = []
    cause: BaseException | None = error
    while cause is not None and cause not in seen:
        seen.append(cause)
        text = str(cause)
        numbered = isinstance(cause, OSError) and cause.errno in _LACKS
        worded = isinstance(cause, (OSError, RuntimeError, ImportError))
        found = [words for words in _WORDS if words in text]
        if isinstance(cause, MemoryError) or numbered or (worded and found):
            what = found[0] if found else text or "Cannot allocate memory"
            return (
                f"the system gave too few resources ({what}): raise the limit of memory, processes "
                "or open files (ulimit -a lists them)"
            )
        cause = cause.__cause__ or cause.__context__
    return ""


# Below a limit of about 700 MB, the libraries of a loop hang, end the process, or take the lack for
# a damaged file. They map far more than they use.
_LEAST_MEMORY = 1e9  # bytes


def check_memory() -> None:
    """Raise MemoryError under a limit of memory that numerical libraries cannot live with."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < _LEAST_MEMORY:
        raise MemoryError(f"ulimit -v is {limit / 1e6:.0f} MB, not {_LEAST_MEMORY / 1e9:g} GB")


_of_a_command: ContextVar[bool] = ContextVar("of_a_command", default=False)


@contextmanager
def naming_options() -> Iterator[None]:
    """Let messages name the options of a command instead of the parameters of functions."""
    before = _of_a_command.set(True)
    try:
        yield
    finally:
        _of_a_command.reset(before)


def parameter(name: str, command: str = "") -> str:
    """Return the name by which a caller gave a parameter: longest_gap, or --longest-gap.

    Of an option that callers from Python do not have, they get the ``command``, too.
    """
    option = f"--{name.replace('_', '-')}"
    outside = f"{command} {option}" if command else name
    return option if _of_a_command.get() else outside


@contextmanager
def refused_as_input(options: Container[str] = (), **names: str) -> Iterator[None]:
    """Raise what the solver refuses, or an overflow, as an InputError; other errors pass.

    A sentence that begins with one of the ``options`` of a command ("work_of_adhesion is -1: …")
    then begins with the option itself; ``names`` are options by the word of the sentence, where
    they differ.
    """
    try:
        yield
    except InputError:
        raise
    except (ValueError, NotImplementedError) as error:
        text = " ".join(str(error).split())
        found = re.match(r"(\w+)(?=(\[\d+\])? (is|are|holds|has)\b)", text)
        name = names.get(found[1], found[1]) if found else ""
        if found and name in options:
            text = f"{parameter(name)}{text[found.end() :]}"
        raise InputError(text) from None
    except OverflowError as error:
        raise InputError(
            f"the numbers leave the range of floating point ({error.args[-1]}): lengths are in m, "
            "stresses in Pa"
        ) from None
