"""Split options that are lists of numbers, and refuse those that may hold decimal commas."""

from __future__ import annotations

import re
from itertools import pairwise

from adhesis.ensemble.errors import InputError, quoted

_WHOLE = re.compile(r"[+\-]?\d+")
_DIGITS = re.compile(r"\d+(?![\d.])")


def words_of(text: str) -> list[str]:
    """Return the words of a list such as "0.3,0.6".

    A whole number, a comma and digits can be one number with a decimal comma. A list of whole
    numbers has decimals ("1.0,5.0") or blanks ("1, 5").

    Raises
    ------
    InputError
        If two words can be one number; the sentence begins with "is".
    """
    words = text.split(",")
    for whole, rest in pairwise(words):
        digits = _DIGITS.match(rest)
        if _WHOLE.fullmatch(whole.strip()) and digits is not None:
            raise InputError(
                f"is {quoted(text)}: numbers have a decimal point, as in {whole}.{digits[0]}; if "
                f"two are meant, write {float(whole):.1f},{float(digits[0]):.1f}"
            )
    return [word.strip() for word in words]
