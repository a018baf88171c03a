"""Compiling before anything is timed, with words where it takes longer than a moment."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection

from adhesis.solver.precompile import Compilation, compiled_in, processor, warm

_MOMENT = 1.0  # s that pass without a word
_BETWEEN_LINES = 10.0  # s


def warm_up(
    methods: Collection[str], say: Callable[[str], None], *, to_installation: bool = False
) -> Compilation:
    """Compile what the methods need, or load it, and say so if that takes more than a moment.

    Parameters
    ----------
    methods : collection of str
        Names of methods.
    say : callable
        Gets a line before, now and then, and after; also why code cannot be kept.
    to_installation : bool
        Keep the code for all users of this installation, if it can be written.
    """
    next_line = _MOMENT

    def tell(seen: Compilation) -> None:
        nonlocal next_line
        passed = seen.seconds + seen.under_way
        if passed < next_line:
            return
        if next_line == _MOMENT:
            say(f"compiling {_listed(methods)} for {processor()} (once, in half a minute or so)")
        else:
            say(f"compiling: {seen.functions} functions in {passed:.0f} s")
        next_line = passed + _BETWEEN_LINES

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        seen = warm(methods, report=tell, to_installation=to_installation)
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        say(f"warning: {text}")
    if next_line > _MOMENT:
        kept = {str(place) for method in methods if (place := compiled_in(method)) is not None}
        where = f", kept in {' and '.join(sorted(kept))}" if kept else ""
        say(f"compiled {seen.functions} functions in {seen.seconds:.0f} s{where}")
    return seen


def warm_missing(methods: Collection[str], say: Callable[[str], None]) -> None:
    """Compile those methods whose code is not kept for this processor; see :func:`warm_up`."""
    missing = [method for method in methods if compiled_in(method) is None]
    if missing:
        warm_up(missing, say)


def _listed(methods: Collection[str]) -> str:
    words = sorted(methods, reverse=True)
    return f"the method{'s' if len(words) > 1 else ''} {' and '.join(words)}"
