"""Run loops for a parent process: jobs on stdin, messages on stdout, pickled.

Started as ``python -m adhesis.ensemble.trace.worker``. It neither forks nor imports the caller's
script, so it works from a notebook as well as from the command line.
"""

from __future__ import annotations

import math
import os
import pickle
import signal
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.run.launch import end_with_parent
from adhesis.solver.values import ByValue

if TYPE_CHECKING:
    from adhesis.solver.registry import MethodName

_SECONDS_BETWEEN_REPORTS = 1.0

# Errors with which a loop may fail; any other is a fault of the program and ends the process.
FAILURES = (RuntimeError, ValueError, ArithmeticError, MemoryError)


def failure(error: Exception) -> str:
    """Return the message of an error; where it is not written for users, with its class."""
    from adhesis.solver.method import PathError

    return str(error) if isinstance(error, PathError) else f"{type(error).__name__}: {error}"


@dataclass(frozen=True, eq=False, repr=False)
class Job(ByValue):
    """Arguments of one loop, in SI units."""

    name: str
    period: float
    coefficients: NDArray[np.complex128]
    young: float
    poisson: float
    work_of_adhesion: float
    turning_point: float
    load_steps: int
    method: MethodName
    accuracy: float
    stiffness: float = math.inf
    strength: float = math.inf


def main() -> None:
    """Run jobs until the parent closes the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # at Ctrl-C the parent ends its workers
    jobs, messages = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # prints go to stderr: stdout carries messages alone

    def send(kind: str, content: Any) -> None:
        pickle.dump((kind, content), messages)
        messages.flush()

    while True:
        try:
            job: Job = pickle.load(jobs)
        except EOFError:
            return
        try:
            send("done", run(job, lambda branch, where: send("progress", (branch, where))))
        except FAILURES as error:
            send("failed", failure(error))


def run(job: Job, report: Any = None) -> dict[str, Any]:
    """Run one loop and return its numbers, and its states as lists."""
    from adhesis.solver.loading.loop import run_loop
    from adhesis.solver.loading.loop_result import strain_warnings
    from adhesis.solver.loading.zero_range import opening_warnings, range_warnings
    from adhesis.solver.method import Branch, ContactState
    from adhesis.solver.model.control import Control
    from adhesis.solver.model.half_space import HalfSpace
    from adhesis.solver.model.problem import Problem
    from adhesis.solver.model.profile import Profile
    from adhesis.solver.registry import make_method

    last = time.monotonic()

    def progress(branch: Branch, penetration: float, state: ContactState) -> None:
        nonlocal last
        if report is not None and time.monotonic() - last > _SECONDS_BETWEEN_REPORTS:
            last = time.monotonic()
            report(branch, penetration)

    profile = Profile(job.period, job.coefficients)
    half_space, control = HalfSpace(job.young, job.poisson), Control(job.stiffness)
    problem = Problem(profile, half_space, job.work_of_adhesion, control, strength=job.strength)
    method = make_method(job.method, problem, accuracy=job.accuracy)
    name = "max_stress" if control.is_load else "max_penetration"
    turn: Any = {name: job.turning_point}
    loop = run_loop(method, load_steps=job.load_steps, progress=progress, **turn)
    small = sum(jump.energy_drop for jump in loop.jumps if jump.small_scale)
    return loop.numbers() | {
        "range_warnings": range_warnings(
            *(problem, loop.valid_range, loop.loss, loop.contact_fraction),
            *(loop.edge_range, loop.touch_range),
        )
        + opening_warnings(loop.jumps, loop.loss),
        "strain_warnings": strain_warnings(
            problem, loop.mean_stress, loop.separation, loop.patches
        ),
        "contact_fraction": loop.largest_contact_fraction,
        "patches": int(loop.patches.max()),
        "jumps": len(loop.jumps),
        "small_scale_share": small / loop.loss_from_drops if loop.loss_from_drops > 0 else 0.0,
        "waves": profile.highest_harmonic,
        "states": {name: values.tolist() for name, values in loop.columns().items()},
    }


if __name__ == "__main__":
    end_with_parent()
    main()
