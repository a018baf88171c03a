"""Compile before anything is timed, and report it if it takes longer than a moment."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Collection
from contextlib import ExitStack

from adhesis.ensemble.reporter import bar, log
from adhesis.solver.checks import counted
from adhesis.solver.precompile import (
    COMPILED_METHODS,
    Compilation,
    compiled_in,
    functions_of,
    processor,
    warm,
)

_MOMENT = 1.0  # s of compilation before the first report
_BETWEEN_LINES = 10.0  # s


def warm_up(
    methods: Collection[str],
    write: Callable[[str], None],
    *,
    to_installation: bool = False,
    many_gaps: bool = True,
    show_bar: bool = False,
) -> Compilation:
    """Compile what the methods need, or load it, and report that if it takes more than a moment.

    Parameters
    ----------
    methods : collection of str
        Names of methods.
    write : callable
        Takes a line before, now and then, and after; also why code cannot be kept.
    to_installation : bool
        Keep the code for all users of this installation, if it can be written.
    many_gaps : bool
        Whether ``sharp`` is compiled for many gaps, too.
    show_bar : bool
        Show a bar instead of the lines between the first and the last, if stderr is a terminal.
    """
    total = functions_of(methods, many_gaps=many_gaps)  # 0 for code of an earlier source
    show_bar = show_bar and sys.stderr.isatty()
    next_report = _MOMENT

    with ExitStack() as stack:
        show = None

        def report(seen: Compilation) -> None:
            nonlocal next_report, show
            passed = seen.seconds + seen.under_way
            if passed < next_report:
                return
            if next_report == _MOMENT:
                about = f"about {counted(total, 'function')}, " if total else ""
                write(f"compiling {_listed(methods)} for {processor()}: {about}once")
                if show_bar:
                    show = stack.enter_context(bar("compiling", remaining=True))
            elif show is None:
                done = f"{seen.functions} of about {total} functions"
                if seen.functions > total:
                    done = f"{counted(seen.functions, 'function')} so far"
                write(f"compiling: {done} in {passed:.0f} s")
            if show is not None:
                known = total if seen.functions <= total else None
                show(seen.functions, known, f"compiling, {counted(seen.functions, 'function')}")
            next_report = passed if show is not None else passed + _BETWEEN_LINES

        caught = stack.enter_context(warnings.catch_warnings(record=True))
        warnings.simplefilter("always")
        seen = warm(methods, report=report, to_installation=to_installation, many_gaps=many_gaps)
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        write(f"warning: {text}")
    if next_report > _MOMENT:
        places = (compiled_in(method, many_gaps=many_gaps) for method in methods)
        kept = sorted({str(place) for place in places if place is not None})
        where = f", kept in {' and '.join(kept)}" if kept else ""
        write(f"compiled {counted(seen.functions, 'function')} in {seen.seconds:.0f} s{where}")
    return seen


def warm_missing(methods: Collection[str], *, quiet: bool = False, many_gaps: bool = True) -> None:
    """Compile those methods whose code is not kept for this processor, reported on stderr."""
    compiled = [name for name in methods if name in COMPILED_METHODS]
    missing = [name for name in compiled if compiled_in(name, many_gaps=many_gaps) is None]
    if missing:
        write = (lambda text: None) if quiet else log
        warm_up(missing, write, many_gaps=many_gaps, show_bar=not quiet)


def _listed(methods: Collection[str]) -> str:
    words = sorted(methods, reverse=True)
    return f"the method{'s' if len(words) > 1 else ''} {' and '.join(words)}"
