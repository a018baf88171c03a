"""The row of a task: every number that a loop leaves behind, with how it is taken from the loop.

One table, from which the results file is laid out, written, read and documented
(:mod:`adhesis.ensemble.results.schema`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import attrgetter, methodcaller
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.task.dataset import COUNT, FLAG, FLOAT, Dataset, Scale, flags, row_shape
from adhesis.ensemble.task.fields import FIELD_DATASETS, field_plan, field_scales
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.method import Branch
from adhesis.solver.model.jump import BRANCHES, JUMP_KINDS
from adhesis.solver.model.profile import Array

Row = dict[str, Any]
"""Values of one task by dataset; those of kept fields only where the task keeps them."""


def _dataset(
    name: str,
    dtype: str,
    unit: str,
    meaning: str,
    value: str | Callable[..., Any] = "",
    dims: tuple[str, ...] = ("task",),
    **attributes: Any,
) -> Dataset:
    """Return a dataset; its value is taken by a function, or by the name of an attribute.

    Without either, the attribute has the name of the dataset.
    """
    take = value if callable(value) else attrgetter(value or name)
    return Dataset(name, dims, dtype, unit, meaning, attributes, take)


def _curves(branch: Branch) -> tuple[Dataset, ...]:
    dims = ("task", f"{branch}_penetration")
    return tuple(
        _dataset(f"{branch}_{name}", dtype, unit, meaning, name, dims)
        for name, dtype, unit, meaning in (
            ("mean_stress", FLOAT, "Pa", "mean stress, compression positive"),
            ("contact_fraction", FLOAT, "1", "contact fraction A/A0"),
            ("patches", COUNT, "1", "number of contact patches"),
            ("energy", FLOAT, "J m-1", "energy of one period per unit depth"),
        )
    )


def _jump(name: str, dtype: str, unit: str, meaning: str, *value: Any, **flags_: Any) -> Dataset:
    """Return a dataset of the catalogue of jumps, whose value is taken from loop and jump."""
    take = value[0] if value else lambda loop, jump: getattr(jump, name)
    dims = ("task", "jump")
    return _dataset(f"jump_{name}", dtype, unit, meaning, take, dims, **flags_)


def _of_interior(name: str) -> Callable[[LoopResult], float]:
    return lambda loop: float(getattr(loop.interior, name, np.nan))


TIMES = (
    _dataset("wall_time", FLOAT, "s", "wall time"),
    _dataset("cpu_time", FLOAT, "s", "CPU time"),
)
# Of each loop, one number.
NUMBERS = (
    _dataset("h_max", FLOAT, "m", "height of the highest point", "problem.profile.h_max"),
    _dataset("h_rms", FLOAT, "m", "root mean square height", "problem.profile.h_rms"),
    _dataset("m0", FLOAT, "m2", "mean square height", "problem.profile.m0"),
    _dataset("m2", FLOAT, "1", "mean square slope", "problem.profile.m2"),
    _dataset("m4", FLOAT, "m-2", "mean square curvature", "problem.profile.m4"),
    _dataset("loss", FLOAT, "J m-2", "loop integral of the mean stress per nominal area"),
    _dataset("loss_dimensionless", FLOAT, "1", "loop integral of dimensionless stress"),
    _dataset("loss_from_drops", FLOAT, "J m-2", "energy drops at jumps, and friction between them"),
    _dataset(
        *("loss_small_scale", FLOAT, "J m-2", "energy drops of edges running inside a patch"),
        methodcaller("drops", small_scale=True),
    ),
    _dataset(
        *("loss_large_scale", FLOAT, "J m-2", "energy drops of patches that come and go"),
        methodcaller("drops", small_scale=False),
    ),
    _dataset("friction", FLOAT, "J m-2", "part of the loss that edges dissipate as they recede"),
    _dataset(
        *("gamma_open", FLOAT, "J m-2", "work of adhesion at which edges recede"),
        "problem.gamma_open",
    ),
    _dataset("audit_residual", FLOAT, "1", "(loss - loss_from_drops) / loss"),
    _dataset("loss_error", FLOAT, "J m-2", "estimated numerical error of the loss"),
    _dataset("zone_error", FLOAT, "J m-2", "estimated change of the loss by zones at edges"),
    _dataset("races", COUNT, "1", "jumps that another rule of descent would have ended elsewhere"),
    _dataset("energy_at_stake", FLOAT, "J m-2", "energy between the ends of those jumps"),
    # below the least of four ranges of adhesion the zero-range limit holds
    _dataset("valid_range", FLOAT, "m", "range of adhesion below which no patch opens from inside"),
    _dataset("edge_range", FLOAT, "m", "range whose cohesive zone is as long as what pins edges"),
    _dataset("touch_range", FLOAT, "m", "range that changes the loss by 0.01 by earlier touches"),
    _dataset("turn_range", FLOAT, "m", "way beyond the turn in which jumps take 0.01 of the loss"),
    _dataset("largest_interior_tension", FLOAT, "Pa", "largest tension inside patches"),
    _dataset(
        *("interior_tension_position", FLOAT, "m", "position of that tension"),
        _of_interior("position"),
    ),
    _dataset(
        *("interior_tension_penetration", FLOAT, "1", "penetration/h_max at that tension"),
        _of_interior("penetration"),
    ),
    _dataset(
        *("opening_strength", FLOAT, "Pa", "strength at which patches open from inside"),
        "problem.strength",
    ),
    _dataset("openings", FLOAT, "1", "jumps that begin with a gap that opens inside a patch"),
    _dataset("barrier", FLOAT, "J m-2", "energy up to the cracks that open patches"),
    # where the loop turned
    _dataset(
        *("turning_penetration", FLOAT, "1", "penetration/h_max at the turning point"),
        "max_penetration",
    ),
    _dataset("turning_stress", FLOAT, "Pa", "mean stress at the turning point"),
    _dataset(
        *("preload_reached", FLOAT, "1", "1 if the mean stress reached the preload, 0 if not"),
        lambda loop: np.nan if loop.preload_reached is None else float(loop.preload_reached),
    ),
    _dataset("work_gained", FLOAT, "J m-2", "work gained on loading per nominal area"),
    _dataset("work_spent", FLOAT, "J m-2", "work spent on unloading per nominal area"),
    _dataset("largest_contact_fraction", FLOAT, "1", "largest contact fraction A/A0 of the loop"),
    _dataset(
        *("full_contact_energy", FLOAT, "J m-2", "elastic energy of full contact"),
        "problem.full_contact_energy",
    ),
    _dataset(
        "pull_off_penetration", FLOAT, "1", "penetration/h_max where the last contact is lost"
    ),
    _dataset("pull_off_stress", FLOAT, "Pa", "largest mean tension on unloading"),
    _dataset(
        *("states", COUNT, "1", "states that the loop passed through"),
        lambda loop: len(loop.branch),
    ),
)
# Of each branch, values on its axis.
CURVES = {branch: _curves(branch) for branch in BRANCHES}
JUMP_COUNT = _dataset(
    "jump_count", COUNT, "1", "number of jumps, kept or not", lambda loop: len(loop.jumps)
)
# Of each jump that the catalogue holds, one number.
JUMPS = (
    _jump(
        *("branch", FLAG, "1", "branch"),
        lambda loop, jump: BRANCHES.index(jump.branch),
        **flags(BRANCHES, FLAG),
    ),
    _jump(
        *("kind", FLAG, "1", "kind of the jump"),
        lambda loop, jump: JUMP_KINDS.index(jump.kind),
        **flags(JUMP_KINDS, FLAG),
    ),
    _jump(
        *("penetration", FLOAT, "1", "penetration/h_max of the jump"),
        lambda loop, jump: loop.problem.penetration(jump.separation),
    ),
    _jump("energy_drop", FLOAT, "J m-2", "energy drop per nominal area"),
    _jump("patch_length", FLOAT, "m", "largest patch, before or after the jump"),
    _jump("contact_before", FLOAT, "1", "contact fraction before the jump"),
    _jump("contact_after", FLOAT, "1", "contact fraction after the jump"),
    _jump("patches_before", COUNT, "1", "patches before the jump"),
    _jump("patches_after", COUNT, "1", "patches after the jump"),
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
    several = campaign.has_axis("max_penetration")
    depth = f"penetration/{'max_penetration' if several else 'h_max'}"
    return (
        Scale("loading_penetration", campaign.loading_penetration, "1", f"{depth} on loading"),
        Scale(
            "unloading_penetration", campaign.unloading_penetration, "1", f"{depth} on unloading"
        ),
        Scale("jump", np.arange(campaign.output.jumps), "1", "place in the catalogue of jumps"),
        *field_scales(field_plan(campaign), {axis.name for axis in campaign.axes[2:]}),
    )


def row_of(
    loop: LoopResult, sizes: Mapping[str, int], axes: Mapping[Branch, Array] | None = None
) -> Row:
    """Return the row of a loop, without its times and fields.

    Curves are zero after detachment and cut where their axis ends; of more jumps than the catalogue
    holds those with the largest drops are kept, in the order of the path. ``axes`` are the
    penetrations of the curves of each branch, where these are not the loop's load steps.
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
