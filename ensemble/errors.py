"""Errors that are the user's to mend: one clear sentence, exit code 2."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator
from contextlib import contextmanager


class InputError(Exception):
    """A bad value, file or option. The text names the value and the rule in one sentence."""


class WriteError(Exception):
    """An output could not be written: the disk is full, say. What was written before is sound."""


@contextmanager
def refusals_of(options: Container[str], **names: str) -> Iterator[None]:
    """Raise what the solver's constructors refuse as the user's errors, with the option's name.

    Parameters
    ----------
    options : container of str
        Names of the command's options ("work_of_adhesion"); a sentence that begins with one
        ("work_of_adhesion is -1: …") then begins with the option (--work-of-adhesion).
    **names : str
        Option by the word that such a sentence begins with, where they differ.

    Raises
    ------
    InputError
        For a ValueError, a NotImplementedError, or an overflow.
    """
    try:
        yield
    except InputError:
        raise
    except (ValueError, NotImplementedError) as error:
        text = " ".join(str(error).split())
        found = re.match(r"(\w+)(?= (is|are|holds|has)\b)", text)
        name = names.get(found[1], found[1]) if found else ""
        if found and name in options:
            text = f"--{name.replace('_', '-')}{text[found.end() :]}"
        raise InputError(text) from None
    except OverflowError as error:
        raise InputError(
            f"the numbers leave the range of floating point ({error.args[-1]}): lengths are in m, "
            "stresses in Pa"
        ) from None
