"""One loop of a campaign: a pure function from its description to its row of the results file."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ensemble.campaign.tables import Campaign
from ensemble.campaign.tasks import Task
from ensemble.errors import InputError
from ensemble.task.fields import FieldRecorder, field_plan
from solver.jumps import JUMP_KINDS, Jump
from solver.loop import LoopResult, Progress, run_loop
from solver.material import HalfSpace
from solver.method import Method
from solver.problem import Problem
from solver.profile import Array, self_affine_profile
from solver.registry import make_method

BRANCHES = ("loading", "unloading")


@dataclass(frozen=True, eq=False)
class TaskResult:
    """One row of the results file; each attribute is the dataset of its name.

    Curves have the shape of the campaign's penetration axes, the catalogue of jumps that of
    ``output.jumps``, fields that of the campaign's field plan (ensemble.task.fields). ``field_…``
    are None for tasks that keep no fields.
    """

    wall_time: float
    cpu_time: float
    h_max: float
    h_rms: float
    m0: float
    m2: float
    m4: float
    loss: float
    loss_dimensionless: float
    loss_from_drops: float
    loss_small_scale: float
    loss_large_scale: float
    audit_residual: float
    pull_off_penetration: float
    pull_off_stress: float
    states: int
    loading_mean_stress: Array
    loading_contact_fraction: Array
    loading_patches: NDArray[np.int32]
    loading_energy: Array
    unloading_mean_stress: Array
    unloading_contact_fraction: Array
    unloading_patches: NDArray[np.int32]
    unloading_energy: Array
    jump_count: int
    jump_branch: NDArray[np.int8]
    jump_kind: NDArray[np.int8]
    jump_penetration: Array
    jump_energy_drop: Array
    jump_patch_length: Array
    jump_contact_before: Array
    jump_contact_after: Array
    jump_patches_before: NDArray[np.int32]
    jump_patches_after: NDArray[np.int32]
    psd_height: NDArray[np.float32]
    height_density: NDArray[np.float32]
    psd_displacement: NDArray[np.float32]
    gap_density: NDArray[np.float32]
    field_height: NDArray[np.float32] | None = None
    field_displacement: NDArray[np.float32] | None = None
    field_stress: NDArray[np.float32] | None = None
    field_gap: NDArray[np.float32] | None = None


def make_problem(campaign: Campaign, task: Task) -> Problem:
    """Build the profile, half-space and work of adhesion of a task.

    Raises
    ------
    ValueError
        If no such problem exists.
    """
    table = campaign.profile
    profile = self_affine_profile(
        task.hurst,
        period=table.period,
        n0=table.n0,
        ratio=table.ratio,
        seed=task.seed,
        amplitudes=table.amplitudes,
        **table.normalisation,
    )
    half_space = HalfSpace(campaign.material.young, campaign.material.poisson)
    return Problem(profile, half_space, task.work_of_adhesion)


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


def run_task(campaign: Campaign, task: Task, progress: Progress | None = None) -> TaskResult:
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
    plan = field_plan(campaign)
    recorder = FieldRecorder(plan, method, keep=task.realisation < plan.realisations)
    loop = run_loop(
        method,
        max_penetration=campaign.cycle.max_penetration,
        load_steps=campaign.cycle.load_steps,
        progress=progress,
        on_state=recorder.on_state,
    )
    row = row_of(campaign, loop) | recorder.row()
    return TaskResult(
        wall_time=time.perf_counter() - wall, cpu_time=time.process_time() - cpu, **row
    )


def row_of(campaign: Campaign, loop: LoopResult) -> dict[str, Any]:
    """Return the row of a loop, without its times: values by dataset."""
    profile = loop.problem.profile
    small = [j.energy_drop for j in loop.jumps if j.small_scale]
    large = [j.energy_drop for j in loop.jumps if not j.small_scale]
    return {
        "h_max": profile.h_max,
        "h_rms": profile.h_rms,
        "m0": profile.m0,
        "m2": profile.m2,
        "m4": profile.m4,
        "loss": loop.loss,
        "loss_dimensionless": loop.loss_dimensionless,
        "loss_from_drops": loop.loss_from_drops,
        "loss_small_scale": float(sum(small)),
        "loss_large_scale": float(sum(large)),
        "audit_residual": loop.audit_residual,
        "pull_off_penetration": loop.pull_off_penetration,
        "pull_off_stress": loop.pull_off_stress,
        "states": len(loop.branch),
        **_curves(loop, "loading", campaign.loading_penetration.size),
        **_curves(loop, "unloading", campaign.unloading_penetration.size),
        **_catalogue(loop, campaign.output.jumps),
    }


def _curves(loop: LoopResult, branch: Any, length: int) -> dict[str, Any]:
    """Return the curves of one branch on its axis; zero after detachment, cut at the axis' end."""
    chosen = loop.states(branch, load_steps_only=True)[:length]
    curves = {
        "mean_stress": (loop.mean_stress, np.float64),
        "contact_fraction": (loop.contact_fraction, np.float64),
        "patches": (loop.patches, np.int32),
        "energy": (loop.energy, np.float64),
    }
    out = {}
    for name, (values, dtype) in curves.items():
        row = np.zeros(length, dtype)
        row[: len(chosen)] = values[chosen]
        out[f"{branch}_{name}"] = row
    return out


def _catalogue(loop: LoopResult, capacity: int) -> dict[str, Any]:
    """Return the jumps with the largest drops, in the order of the path, padded to the capacity."""
    drops = np.array([j.energy_drop for j in loop.jumps])
    kept = [loop.jumps[i] for i in np.sort(np.argsort(-drops, kind="stable")[:capacity])]

    def column(value: Any, dtype: type, empty: float) -> NDArray[Any]:
        out: NDArray[Any] = np.full(capacity, empty, dtype)
        out[: len(kept)] = [value(j) for j in kept]
        return out

    def penetration(jump: Jump) -> float:
        return loop.problem.penetration(jump.separation)

    return {
        "jump_count": len(loop.jumps),
        "jump_branch": column(lambda j: BRANCHES.index(j.branch), np.int8, -1),
        "jump_kind": column(lambda j: JUMP_KINDS.index(j.kind), np.int8, -1),
        "jump_penetration": column(penetration, np.float64, np.nan),
        "jump_energy_drop": column(lambda j: j.energy_drop, np.float64, np.nan),
        "jump_patch_length": column(lambda j: j.patch_length, np.float64, np.nan),
        "jump_contact_before": column(lambda j: j.contact_before, np.float64, np.nan),
        "jump_contact_after": column(lambda j: j.contact_after, np.float64, np.nan),
        "jump_patches_before": column(lambda j: j.patches_before, np.int32, -1),
        "jump_patches_after": column(lambda j: j.patches_after, np.int32, -1),
    }
