"""Compile both methods now, and keep the code for this processor: no loop need wait for it.

The code is kept in the installation, for all who use it, or, where that cannot be written, in the
user's own folder ($ADHESIS_CACHE, or adhesis in $XDG_CACHE_HOME or ~/.cache). Exit code 1 if it
cannot be kept at all.
"""

from __future__ import annotations

import argparse

EXAMPLES = (
    "adhesis warm",
    "adhesis warm --own",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--own",
        action="store_true",
        help="keep the code in the user's own folder even if the installation can be written",
    )


def execute(args: argparse.Namespace) -> int:
    """Compile what is not compiled yet; 0 if the code is kept."""
    from adhesis.ensemble.warm import warm_up
    from adhesis.solver.precompile import COMPILED_METHODS, compiled_in, in_installation, processor

    def say(text: str) -> None:
        print(text, flush=True)

    ready = [place for method in COMPILED_METHODS if (place := compiled_in(method)) is not None]
    if len(ready) == len(COMPILED_METHODS) and (args.own or all(map(in_installation, ready))):
        say(f"compiled before, for {processor()}: {ready[0]}")
        return 0
    seen = warm_up(COMPILED_METHODS, say, to_installation=not args.own, show_bar=True)
    places = [compiled_in(method) for method in COMPILED_METHODS]
    if None in places:
        say("the code cannot be kept: each process compiles it anew")
        return 1
    if not seen.functions:
        say(f"compiled before, for {processor()}; kept in {places[0]}")
    return 0
