"""Compute one loop of a campaign: a pure function of its task, returning its row of results."""

from __future__ import annotations

import math
import time
from typing import Any

from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import Task
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.task.dataset import sizes_of
from adhesis.ensemble.task.fields import FieldPlan, field_row
from adhesis.ensemble.task.row import Row, row_of, row_scales
from adhesis.solver.loading.loop import LoadingBranch
from adhesis.solver.loading.path_record import Progress
from adhesis.solver.method import Branch, Method
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.pattern import stripes_of
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array, self_affine_profile
from adhesis.solver.registry import make_method


def make_problem(campaign: Campaign, task: Task) -> Problem:
    """Build the profile, half-space and work of adhesion of a task (ValueError)."""
    campaign = campaign.at(task)
    table = campaign.profile
    names = ("period", "n0", "ratio", "rolloff", "amplitudes")
    shape: dict[str, Any] = {name: getattr(table, name) for name in names} | table.normalisation
    profile = self_affine_profile(task.hurst, seed=task.seed, **shape)
    half_space = HalfSpace(campaign.material.young, campaign.material.poisson)
    stiffness = 0.0 if campaign.cycle.under_load else campaign.cycle.stiffness
    control = Control() if stiffness is None else Control(stiffness)
    material = campaign.material
    return Problem(
        *(profile, half_space, task.work_of_adhesion, control),
        strength=math.inf if material.strength is None else material.strength,
        adhesion_range=material.adhesion_range,
        work_of_adhesion_open=material.work_of_adhesion_open,
        measure=material.measure,
        pattern=stripes_of(material.stripes, material.stripe_amplitude, material.stripe_phase),
    )


def check_task(campaign: Campaign, task: Task) -> None:
    """Raise InputError, with the solver's message, if a task cannot be set up."""
    try:
        _make_method(campaign, task)
    except (ValueError, NotImplementedError, ArithmeticError) as error:
        raise InputError(f"this campaign cannot be computed: {error}") from error


def _make_method(campaign: Campaign, task: Task) -> Method:
    problem, solver = make_problem(campaign, task), campaign.solver
    nodes = solver.nodes_per_wave
    return make_method(solver.method, problem, accuracy=solver.accuracy, nodes_per_wave=nodes)


class Runner:
    """Runner of tasks one after the other, each with the bits that it has alone.

    The tasks of a campaign with several turning points share a loading branch
    (:meth:`adhesis.ensemble.campaign.tables.Campaign.branch_of`): it is kept from one task to the
    next, as long as the turning points ascend.
    """

    def __init__(self) -> None:
        # Of the last task: campaign, key, turning point and the branch, which the next may continue
        self._last: tuple[Campaign, Task, float, LoadingBranch] | None = None

    def __call__(self, campaign: Campaign, task: Task, progress: Progress | None = None) -> Row:
        """Compute one loop, independently of ranks and files.

        ``progress`` is called after each load step; it may raise an exception to give the task up.
        The times in the row are those of this call: the time of a shared loading branch counts
        once, in the first loop that needs it.
        """
        wall, cpu = time.perf_counter(), time.process_time()
        here, plan = campaign.at(task), FieldPlan(campaign, task)
        turn, key = here.cycle.turning_point, campaign.branch_of(task)
        last, self._last = self._last, None  # an interrupted branch is not continued
        if last is not None and last[0] is campaign and last[1] == key and last[2] < turn:
            branch = last[3]
        else:
            branch = _branch(campaign, task)
        this = (campaign, key, turn, branch) if key != task else None
        try:
            loop = branch.loop(turn, marks=_marks(plan), progress=progress)
        except Exception:
            self._last = this
            raise
        self._last = this
        axes: dict[Branch, Array] | None = None
        if key != task or here.cycle.turns_at_stress:  # its load steps are not the curves' axes
            axes = campaign.curve_axes(task)
        row = row_of(loop, sizes_of(row_scales(campaign)), axes)
        keep = task.realisation < campaign.output.field_realisations
        row |= field_row(plan, branch.method, loop, keep=keep)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        return {"wall_time": wall, "cpu_time": cpu, **row}


def _branch(campaign: Campaign, task: Task) -> LoadingBranch:
    """Return the loading branch of a task, with all tasks that share it."""
    others = campaign.sharing(task)
    return LoadingBranch(
        _make_method(campaign, task),
        [campaign.at(other).cycle.turning_point for other in others],
        load_steps=campaign.cycle.load_steps,
        latest=None if campaign.cycle.preload is None else campaign.cycle.deepest,
        marks=[mark for o in others for mark in _marks(FieldPlan(campaign, o))],
    )


def _marks(plan: FieldPlan) -> list[float]:
    """Return the prescribed values of the states whose fields are kept, if these are prescribed."""
    cycle = plan.campaign.cycle
    if cycle.preload is not None:
        return []
    marks: list[float] = (plan.penetration * (cycle.max_stress or 1.0)).tolist()
    return marks
