"""``python logged_run.py LOG run …``: the command line, with a line in LOG for each compilation.

A line is the process and what it begins: the word ``compiles``, or ``computes`` for a task.
"""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path

from adhesis.ensemble.command.campaigns import run
from adhesis.ensemble.command.main import main
from adhesis.ensemble.run.session import Engine
from adhesis.ensemble.task.compute import Runner
from adhesis.solver.precompile import watch_compilation

if __name__ == "__main__":
    log = Path(sys.argv[1])

    def begin(what: str) -> None:
        with log.open("a") as stream:
            stream.write(f"{os.getpid()} {what}\n")

    def compute(campaign, task, progress=None):
        begin("computes")
        return Runner()(campaign, task, progress)

    run.execute = partial(run.execute, engine=Engine(compute=compute))
    with watch_compilation(lambda seen: begin("compiles")):
        code = main(sys.argv[2:])
    sys.exit(code)
