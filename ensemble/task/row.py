"""The row of a task: every number that a loop leaves behind, with how it is taken from the loop.

One table, from which the results file is laid out, written, read and documented
(:mod:`adhesis.ensemble.results.schema`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.task.dataset import COUNT, FLAG, FLOAT, Dataset, Scale, flags, row_shape
from adhesis.ensemble.task.fields import FIELD_DATASETS, field_plan, field_scales
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.method import Branch
from adhesis.solver.model.jump import BRANCHES, JUMP_KINDS, Jump
from adhesis.solver.model.profile import Array

Row = dict[str, Any]
"""Values of one task by dataset; those of kept fields only where the task keeps them."""


def _task(
    name: str,
    dtype: str,
    unit: str,
    meaning: str,
    value: Callable[[LoopResult], Any] | None = None,
) -> Dataset:
    return Dataset(name, ("task",), dtype, unit, meaning, {}, value)


def _curves(branch: Branch) -> tuple[Dataset, ...]:
    dims = ("task", f"{branch}_penetration")

    def curve(
        name: str, dtype: str, unit: str, meaning: str, value: Callable[[LoopResult], Any]
    ) -> Dataset:
        return Dataset(f"{branch}_{name}", dims, dtype, unit, meaning, {}, value)

    return (
        curve(
            *("mean_stress", FLOAT, "Pa", "mean stress, compression positive"),
            lambda loop: loop.mean_stress,
        ),
        curve(
            *("contact_fraction", FLOAT, "1", "contact fraction A/A0"),
            lambda loop: loop.contact_fraction,
        ),
        curve("patches", COUNT, "1", "number of contact patches", lambda loop: loop.patches),
        curve(
            *("energy", FLOAT, "J m-1", "energy of one period per unit depth"),
            lambda loop: loop.energy,
        ),
    )


def _jump(
    name: str,
    dtype: str,
    unit: str,
    meaning: str,
    value: Callable[[LoopResult, Jump], Any],
    **attributes: Any,
) -> Dataset:
    return Dataset(name, ("task", "jump"), dtype, unit, meaning, attributes, value)


def _drops(loop: LoopResult, *, small_scale: bool) -> float:
    return float(sum([j.energy_drop for j in loop.jumps if j.small_scale is small_scale]))


TIMES = (
    _task("wall_time", FLOAT, "s", "wall time"),
    _task("cpu_time", FLOAT, "s", "CPU time"),
)
# Below the least of three ranges of adhesion the zero-range limit holds.
_RANGES = (
    _task(
        *("valid_range", FLOAT, "m", "range of adhesion below which no patch opens from inside"),
        lambda loop: loop.valid_range,
    ),
    _task(
        *("edge_range", FLOAT, "m", "range whose cohesive zone is as long as what pins edges"),
        lambda loop: loop.edge_range,
    ),
    _task(
        *("touch_range", FLOAT, "m", "range that changes the loss by 0.01 by earlier touches"),
        lambda loop: loop.touch_range,
    ),
    _task(
        *("largest_interior_tension", FLOAT, "Pa", "largest tension inside patches"),
        lambda loop: loop.largest_interior_tension,
    ),
    _task(
        *("interior_tension_position", FLOAT, "m", "position of that tension"),
        lambda loop: np.nan if loop.interior is None else loop.interior.position,
    ),
    _task(
        *("interior_tension_penetration", FLOAT, "1", "penetration/h_max at that tension"),
        lambda loop: np.nan if loop.interior is None else loop.interior.penetration,
    ),
    _task(
        *("opening_strength", FLOAT, "Pa", "strength at which patches open from inside"),
        lambda loop: loop.problem.strength,
    ),
    _task(
        *("openings", FLOAT, "1", "jumps that begin with a gap that opens inside a patch"),
        lambda loop: loop.openings,
    ),
    _task(
        *("barrier", FLOAT, "J m-2", "energy up to the cracks that open patches"),
        lambda loop: loop.barrier,
    ),
)
# Where each loop turned.
_TURNS = (
    _task(
        *("turning_penetration", FLOAT, "1", "penetration/h_max at the turning point"),
        lambda loop: loop.max_penetration,
    ),
    _task(
        *("turning_stress", FLOAT, "Pa", "mean stress at the turning point"),
        lambda loop: loop.turning_stress,
    ),
    _task(
        *("preload_reached", FLOAT, "1", "1 if the mean stress reached the preload, 0 if not"),
        lambda loop: np.nan if loop.preload_reached is None else float(loop.preload_reached),
    ),
)
# Of each loop, one number.
NUMBERS = (
    _task(
        *("h_max", FLOAT, "m", "height of the highest point"),
        lambda loop: loop.problem.profile.h_max,
    ),
    _task(
        *("h_rms", FLOAT, "m", "root mean square height"),
        lambda loop: loop.problem.profile.h_rms,
    ),
    _task("m0", FLOAT, "m2", "mean square height", lambda loop: loop.problem.profile.m0),
    _task("m2", FLOAT, "1", "mean square slope", lambda loop: loop.problem.profile.m2),
    _task("m4", FLOAT, "m-2", "mean square curvature", lambda loop: loop.problem.profile.m4),
    _task(
        *("loss", FLOAT, "J m-2", "loop integral of the mean stress per nominal area"),
        lambda loop: loop.loss,
    ),
    _task(
        *("loss_dimensionless", FLOAT, "1", "loop integral of dimensionless stress"),
        lambda loop: loop.loss_dimensionless,
    ),
    _task(
        *("loss_from_drops", FLOAT, "J m-2", "energy drops at jumps, and friction between them"),
        lambda loop: loop.loss_from_drops,
    ),
    _task(
        *("loss_small_scale", FLOAT, "J m-2", "energy drops of edges running inside a patch"),
        lambda loop: _drops(loop, small_scale=True),
    ),
    _task(
        *("loss_large_scale", FLOAT, "J m-2", "energy drops of patches that come and go"),
        lambda loop: _drops(loop, small_scale=False),
    ),
    _task(
        *("friction", FLOAT, "J m-2", "part of the loss that edges dissipate as they recede"),
        lambda loop: loop.friction,
    ),
    _task(
        *("gamma_open", FLOAT, "J m-2", "work of adhesion at which edges recede"),
        lambda loop: loop.problem.gamma_open,
    ),
    _task(
        *("audit_residual", FLOAT, "1", "(loss - loss_from_drops) / loss"),
        lambda loop: loop.audit_residual,
    ),
    _task(
        *("loss_error", FLOAT, "J m-2", "estimated numerical error of the loss"),
        lambda loop: loop.loss_error,
    ),
    _task(
        *("races", COUNT, "1", "jumps that another rule of descent would have ended elsewhere"),
        lambda loop: loop.races,
    ),
    _task(
        *("energy_at_stake", FLOAT, "J m-2", "energy between the ends of those jumps"),
        lambda loop: loop.energy_at_stake,
    ),
    *_RANGES,
    *_TURNS,
    _task(
        *("work_gained", FLOAT, "J m-2", "work gained on loading per nominal area"),
        lambda loop: loop.work_gained,
    ),
    _task(
        *("work_spent", FLOAT, "J m-2", "work spent on unloading per nominal area"),
        lambda loop: loop.work_spent,
    ),
    _task(
        *("largest_contact_fraction", FLOAT, "1", "largest contact fraction A/A0 of the loop"),
        lambda loop: loop.largest_contact_fraction,
    ),
    _task(
        *("full_contact_energy", FLOAT, "J m-2", "elastic energy of full contact"),
        lambda loop: loop.problem.full_contact_energy,
    ),
    _task(
        *("pull_off_penetration", FLOAT, "1", "penetration/h_max where the last contact is lost"),
        lambda loop: loop.pull_off_penetration,
    ),
    _task(
        *("pull_off_stress", FLOAT, "Pa", "largest mean tension on unloading"),
        lambda loop: loop.pull_off_stress,
    ),
    _task(
        *("states", COUNT, "1", "states that the loop passed through"),
        lambda loop: len(loop.branch),
    ),
)
# Of each branch, values on its axis.
CURVES = {branch: _curves(branch) for branch in BRANCHES}
JUMP_COUNT = _task(
    "jump_count", COUNT, "1", "number of jumps, kept or not", lambda loop: len(loop.jumps)
)
# Of each jump that the catalogue holds, one number.
JUMPS = (
    _jump(
        *("jump_branch", FLAG, "1", "branch"),
        lambda loop, jump: BRANCHES.index(jump.branch),
        **flags(BRANCHES, FLAG),
    ),
    _jump(
        *("jump_kind", FLAG, "1", "kind of the jump"),
        lambda loop, jump: JUMP_KINDS.index(jump.kind),
        **flags(JUMP_KINDS, FLAG),
    ),
    _jump(
        *("jump_penetration", FLOAT, "1", "penetration/h_max of the jump"),
        lambda loop, jump: loop.problem.penetration(jump.separation),
    ),
    _jump(
        *("jump_energy_drop", FLOAT, "J m-2", "energy drop per nominal area"),
        lambda loop, jump: jump.energy_drop,
    ),
    _jump(
        *("jump_patch_length", FLOAT, "m", "largest patch that the jump changed"),
        lambda loop, jump: jump.patch_length,
    ),
    _jump(
        *("jump_contact_before", FLOAT, "1", "contact fraction before the jump"),
        lambda loop, jump: jump.contact_before,
    ),
    _jump(
        *("jump_contact_after", FLOAT, "1", "contact fraction after the jump"),
        lambda loop, jump: jump.contact_after,
    ),
    _jump(
        *("jump_patches_before", COUNT, "1", "patches before the jump"),
        lambda loop, jump: jump.patches_before,
    ),
    _jump(
        *("jump_patches_after", COUNT, "1", "patches after the jump"),
        lambda loop, jump: jump.patches_after,
    ),
)
RESULT_DATASETS: tuple[Dataset, ...] = (
    *TIMES,
    *NUMBERS,
    *(dataset for branch in BRANCHES for dataset in CURVES[branch]),
    JUMP_COUNT,
    *JUMPS,
    *FIELD_DATASETS,
)


def row_scales(campaign: Campaign) -> tuple[Scale, ...]:
    """Return the dimensions of the rows of a campaign."""
    depth = "max_penetration" if campaign.has_axis("max_penetration") else "h_max"
    return (
        Scale(
            "loading_penetration",
            campaign.loading_penetration,
            "1",
            f"penetration/{depth} on loading",
        ),
        Scale(
            "unloading_penetration",
            campaign.unloading_penetration,
            "1",
            f"penetration/{depth} on unloading",
        ),
        Scale("jump", np.arange(campaign.output.jumps), "1", "place in the catalogue of jumps"),
        *field_scales(field_plan(campaign), {axis.name for axis in campaign.axes[2:]}),
    )


def row_of(
    loop: LoopResult, sizes: Mapping[str, int], axes: Mapping[Branch, Array] | None = None
) -> Row:
    """Return the row of a loop, without its times and fields.

    Parameters
    ----------
    loop : LoopResult
    sizes : mapping of int
        Lengths of the dimensions of :func:`row_scales`. Curves are zero after detachment and cut
        where their axis ends; of more jumps than the catalogue holds those with the largest drops
        are kept, in the order of the path.
    axes : mapping of arrays, optional
        Penetrations (:meth:`adhesis.solver.loading.loop_result.LoopResult.at`) of the curves of
        each branch, where these are not the loop's load steps.
    """
    row: Row = {d.name: d.value(loop) for d in (*NUMBERS, JUMP_COUNT) if d.value is not None}
    for branch, curves in CURVES.items():
        for dataset in curves:
            (length,) = row_shape(dataset, sizes)
            assert dataset.value is not None
            values = dataset.value(loop)
            if axes is not None:
                found = loop.at(branch, axes[branch], values)
                row[dataset.name] = found if dataset.dtype == FLOAT else _rounded(found, dataset)
                continue
            curve = np.zeros(length, dataset.dtype)
            on_axis = loop.on_axis(branch, values)[:length]
            curve[: len(on_axis)] = on_axis
            row[dataset.name] = curve
    drops = np.array([j.energy_drop for j in loop.jumps])
    largest = np.sort(np.argsort(-drops, kind="stable")[: sizes["jump"]])
    for dataset in JUMPS:
        assert dataset.value is not None
        column = np.full(row_shape(dataset, sizes), dataset.fill, dataset.dtype)
        column[: len(largest)] = [dataset.value(loop, loop.jumps[i]) for i in largest]
        row[dataset.name] = column
    return row


def _rounded(values: Array, dataset: Dataset) -> NDArray[Any]:
    """Numbers between states as whole ones; the fill value where there are none."""
    known = np.isfinite(values)
    return np.where(known, np.rint(np.where(known, values, 0)), dataset.fill).astype(dataset.dtype)
