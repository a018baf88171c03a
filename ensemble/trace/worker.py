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
    """Return class and message of an error."""
    return f"{type(error).__name__}: {error}"


@dataclass(frozen=True, eq=False, repr=False)
class Job(ByValue):
    """Arguments of one loop, in SI units."""

    name: str
    period: float
    coefficients: NDArray[np.complex128]
    young: float
    poisson: float
    work_of_adhesion: float
    max_penetration: float
    load_steps: int
    method: MethodName
    accuracy: float
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
    from adhesis.solver.loading.zero_range import opening_warnings, range_warnings
    from adhesis.solver.method import Branch, ContactState
    from adhesis.solver.model.half_space import HalfSpace
    from adhesis.solver.model.problem import Problem
    from adhesis.solver.model.profile import Profile
    from adhesis.solver.registry import make_method
    from adhesis.solver.values import finite

    last = time.monotonic()

    def progress(branch: Branch, penetration: float, state: ContactState) -> None:
        nonlocal last
        if report is not None and time.monotonic() - last > _SECONDS_BETWEEN_REPORTS:
            last = time.monotonic()
            report(branch, penetration)

    profile = Profile(job.period, job.coefficients)
    half_space = HalfSpace(job.young, job.poisson)
    problem = Problem(profile, half_space, job.work_of_adhesion, strength=job.strength)
    method = make_method(job.method, problem, accuracy=job.accuracy)
    loop = run_loop(
        method,
        max_penetration=job.max_penetration,
        load_steps=job.load_steps,
        progress=progress,
    )
    small = sum(jump.energy_drop for jump in loop.jumps if jump.small_scale)
    return {
        "loss": loop.loss,
        "loss_dimensionless": loop.loss_dimensionless,
        "loss_from_drops": loop.loss_from_drops,
        "audit_residual": loop.audit_residual,
        "loss_error": _number(loop, "loss_error"),
        "races": _number(loop, "races"),
        "valid_range": finite(loop.valid_range),
        "edge_range": finite(loop.edge_range),
        "largest_interior_tension": loop.largest_interior_tension,
        "range_warnings": range_warnings(
            problem, loop.valid_range, loop.loss, loop.contact_fraction
        )
        + opening_warnings(loop.jumps, loop.loss),
        "openings": loop.openings,
        "barrier": loop.barrier,
        "energy_at_stake": _number(loop, "energy_at_stake"),
        "pull_off_stress": loop.pull_off_stress,
        "pull_off_penetration": loop.pull_off_penetration,
        "contact_fraction": float(loop.contact_fraction.max()),
        "patches": int(loop.patches.max()),
        "jumps": len(loop.jumps),
        "small_scale_share": small / loop.loss_from_drops if loop.loss_from_drops > 0 else 0.0,
        "h_max": profile.h_max,
        "h_rms": profile.h_rms,
        "m2": profile.m2,
        "waves": profile.highest_harmonic,
        "period": profile.period,
        "seconds": loop.seconds,
        "states": {
            "branch": loop.branch.tolist(),
            "penetration": loop.penetration.tolist(),
            "mean_stress": loop.mean_stress.tolist(),
            "contact_fraction": loop.contact_fraction.tolist(),
            "patches": loop.patches.tolist(),
        },
    }


def _number(loop: Any, name: str) -> float | None:
    """Return an estimate of error of a loop, None if its method has none."""
    value = getattr(loop, name, None)
    return None if value is None else float(value)


if __name__ == "__main__":
    end_with_parent()
    main()
