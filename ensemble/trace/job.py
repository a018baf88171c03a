"""Compute one loop of a trace: a function of its job, returning its numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.values import ByValue

if TYPE_CHECKING:
    from adhesis.solver.registry import MethodName


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
    at_preload: bool = False
    latest: float | None = None
    work_of_adhesion_open: float | None = None


def run(job: Job, report: Callable[[tuple[str, float]], None] | None = None) -> dict[str, Any]:
    """Run one loop and return its numbers, and its states as lists.

    Parameters
    ----------
    job : Job
    report : callable, optional
        Called after each load step with the branch and the prescribed value that is reached.
    """
    from adhesis.solver.loading.loop import run_loop, turn_arguments
    from adhesis.solver.loading.loop_result import strain_warnings
    from adhesis.solver.loading.zero_range import opening_warnings, range_warnings
    from adhesis.solver.method import Branch, ContactState
    from adhesis.solver.model.control import Control
    from adhesis.solver.model.half_space import HalfSpace
    from adhesis.solver.model.problem import Problem
    from adhesis.solver.model.profile import Profile
    from adhesis.solver.registry import make_method

    def progress(branch: Branch, penetration: float, state: ContactState) -> None:
        if report is not None:
            report((branch, penetration))

    profile = Profile(job.period, job.coefficients)
    half_space, control = HalfSpace(job.young, job.poisson), Control(job.stiffness)
    problem = Problem(
        profile,
        half_space,
        job.work_of_adhesion,
        control,
        strength=job.strength,
        work_of_adhesion_open=job.work_of_adhesion_open,
    )
    method = make_method(job.method, problem, accuracy=job.accuracy)
    turn = turn_arguments(control, job.turning_point, job.at_preload, job.latest)
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
        "preload_warnings": loop.preload_warnings,
        "loss_note": loop.loss_note,
        "contact_fraction": loop.largest_contact_fraction,
        "patches": int(loop.patches.max()),
        "jumps": len(loop.jumps),
        "small_scale_share": small / loop.loss_from_drops if loop.loss_from_drops > 0 else 0.0,
        "waves": profile.highest_harmonic,
        "states": {name: values.tolist() for name, values in loop.columns().items()},
    }
