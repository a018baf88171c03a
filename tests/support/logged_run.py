"""``python logged_run.py LOG run …``: the command line, with a line in LOG for each compilation.

A line is the process and what it begins: the word ``compiles``, or ``computes`` for a task.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from ensemble.command import run
from ensemble.run.session import Engine
from ensemble.task.compute import run_task
from solver.warm import watch_compilation

if __name__ == "__main__":
    log = Path(sys.argv[1])

    def begin(what: str) -> None:
        with log.open("a") as stream:
            stream.write(f"{os.getpid()} {what}\n")

    def compute(campaign, task, progress=None):
        begin("computes")
        return run_task(campaign, task, progress)

    parser = argparse.ArgumentParser(prog="adhesis run")
    run.add_arguments(parser)
    with watch_compilation(lambda seen: begin("compiles")):
        code = run.execute(parser.parse_args(sys.argv[3:]), Engine(compute=compute))
    sys.exit(code)
