"""One loop of a campaign: a pure function from its description to its row of the results file."""

from __future__ import annotations

import time
from collections.abc import Iterable

from ensemble.campaign.tables import Campaign
from ensemble.campaign.tasks import Task
from ensemble.errors import InputError
from ensemble.task.dataset import sizes_of
from ensemble.task.fields import FieldRecorder, field_plan
from ensemble.task.row import Row, row_of, row_scales
from solver.control import Control
from solver.loop import Progress, run_loop
from solver.material import HalfSpace
from solver.method import Method
from solver.problem import Problem
from solver.profile import self_affine_profile
from solver.registry import make_method


def make_problem(campaign: Campaign, task: Task) -> Problem:
    """Build the profile, half-space and work of adhesion of a task.

    Raises
    ------
    ValueError
        If no such problem exists.
    """
    campaign = campaign.at(task)
    table = campaign.profile
    profile = self_affine_profile(
        task.hurst,
        period=table.period,
        n0=table.n0,
        ratio=table.ratio,
        rolloff=table.rolloff,
        seed=task.seed,
        amplitudes=table.amplitudes,
        **table.normalisation,
    )
    half_space = HalfSpace(campaign.material.young, campaign.material.poisson)
    stiffness = campaign.cycle.stiffness
    control = Control() if stiffness is None else Control(stiffness)
    return Problem(profile, half_space, task.work_of_adhesion, control)


def check_task(campaign: Campaign, task: Task) -> None:
    """Refuse a campaign of which a task cannot be set up, before any work.

    Raises
    ------
    InputError
        With the solver's sentence.
    """
    try:
        _make_method(campaign, task)
    except (ValueError, NotImplementedError, ArithmeticError) as error:
        raise InputError(f"this campaign cannot be computed: {error}") from error


def _make_method(campaign: Campaign, task: Task) -> Method:
    return make_method(
        campaign.solver.method,
        make_problem(campaign, task),
        accuracy=campaign.solver.accuracy,
        nodes_per_wave=campaign.solver.nodes_per_wave,
    )


def methods_of(campaign: Campaign, tasks: Iterable[Task]) -> set[str]:
    """Return the names of the methods that compute these tasks."""
    of_adhesion = {task.work_of_adhesion: task for task in tasks}
    return {_make_method(campaign, task).name for task in of_adhesion.values()}


def run_task(campaign: Campaign, task: Task, progress: Progress | None = None) -> Row:
    """Compute one loop. No ranks, no files: the same in a notebook and on rank 317.

    Parameters
    ----------
    campaign : Campaign
    task : Task
    progress : callable, optional
        Called after each load step; it may raise to give the task up.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    method = _make_method(campaign, task)
    plan = field_plan(campaign, task)
    recorder = FieldRecorder(plan, method, keep=task.realisation < plan.realisations)
    loop = run_loop(
        method,
        max_penetration=campaign.at(task).cycle.max_penetration,
        load_steps=campaign.cycle.load_steps,
        progress=progress,
        on_state=recorder.on_state,
    )
    row = row_of(loop, sizes_of(row_scales(campaign))) | recorder.row()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return {"wall_time": wall, "cpu_time": cpu, **row}
