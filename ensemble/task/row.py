"""The row of a task: every number that a loop leaves behind, with how it is taken from the loop.

One table, from which the results file is laid out, written, read and documented
(:mod:`adhesis.ensemble.results.schema`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import chain
from operator import attrgetter, methodcaller
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.task.dataset import COUNT, FLAG, FLOAT, Dataset, flags, row_shape, scale
from adhesis.ensemble.task.fields import FIELD_DATASETS, FieldPlan, field_scales
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.model.jump import BRANCHES, JUMP_KINDS, Branch
from adhesis.solver.model.profile import Array

Row = dict[str, Any]
"""Values of one task by dataset; those of kept fields only where the task keeps them."""


def _value(
    name: str, unit: str, meaning: str, value: str | Callable[..., Any] = "", **options: Any
) -> Dataset:
    """Return a dataset; its value is taken by a function, or by the path of an attribute.

    Without either, the attribute has the name of the dataset. ``options`` are those of a dataset.
    """
    take = value if callable(value) else attrgetter(value or name)
    return Dataset(name, unit, meaning, value=take, **options)


def _count(name: str, meaning: str, value: str | Callable[..., Any] = "") -> Dataset:
    return _value(name, "1", meaning, value, dtype=COUNT)


def _curves(branch: Branch) -> tuple[Dataset, ...]:
    dims = ("task", f"{branch}_penetration")
    return tuple(
        _value(f"{branch}_{name}", unit, meaning, name, dtype=dtype, dims=dims)
        for name, dtype, unit, meaning in (
            ("mean_stress", FLOAT, "Pa", "mean stress, compression positive"),
            ("contact_fraction", FLOAT, "1", "contact fraction A/A0"),
            ("patches", COUNT, "1", "number of contact patches"),
            ("energy", FLOAT, "J m-1", "energy of one period per unit depth"),
        )
    )


def _jump(name: str, unit: str, meaning: str, value: Any = None, **options: Any) -> Dataset:
    """Return a dataset of the catalogue of jumps, whose value is taken from loop and jump."""
    take = value or (lambda loop, jump: getattr(jump, name))
    return _value(f"jump_{name}", unit, meaning, take, dims=("task", "jump"), **options)


def _flag(name: str, meaning: str, names: tuple[str, ...]) -> Dataset:
    """Return :func:`_jump` for an attribute that is one of some names."""
    options: Any = {"dtype": FLAG, "attributes": flags(names, FLAG)}
    return _jump(name, "1", meaning, lambda loop, jump: names.index(getattr(jump, name)), **options)


def _of_interior(name: str) -> Callable[[LoopResult], float]:
    return lambda loop: float(getattr(loop.interior, name, np.nan))


_SMALL, _LARGE = (methodcaller("drops", small_scale=small) for small in (True, False))
TIMES = (_value("wall_time", "s", "wall time"), _value("cpu_time", "s", "CPU time"))
NUMBERS = (
    _value("h_max", "m", "height of the highest point", "problem.profile.h_max"),
    _value("h_rms", "m", "root mean square height", "problem.profile.h_rms"),
    _value("m0", "m2", "mean square height", "problem.profile.m0"),
    _value("m2", "1", "mean square slope", "problem.profile.m2"),
    _value("m4", "m-2", "mean square curvature", "problem.profile.m4"),
    _value("loss", "J m-2", "loop integral of the mean stress per nominal area"),
    _value("loss_dimensionless", "1", "loop integral of dimensionless stress"),
    _value("loss_from_drops", "J m-2", "energy drops at jumps, and friction between them"),
    _value("loss_small_scale", "J m-2", "energy drops of edges running inside a patch", _SMALL),
    _value("loss_large_scale", "J m-2", "energy drops of patches that come and go", _LARGE),
    _value("friction", "J m-2", "part of the loss that edges dissipate as they recede"),
    _value("gamma_open", "J m-2", "work of adhesion at which edges recede", "problem.gamma_open"),
    _value("audit_residual", "1", "(loss - loss_from_drops) / loss"),
    _value("loss_error", "J m-2", "estimated numerical error of the loss"),
    _value("zone_error", "J m-2", "estimated change of the loss by zones at edges"),
    _count("races", "jumps that other speeds, order or a finer field might end elsewhere"),
    _value("energy_at_stake", "J m-2", "energy between the ends of those jumps"),
    # below the least of four ranges of adhesion the zero-range limit holds
    _value("valid_range", "m", "range of adhesion below which no patch opens from inside"),
    _value("edge_range", "m", "range whose cohesive zone is as long as what pins edges"),
    _value("touch_range", "m", "range that changes the loss by 0.01 by earlier touches"),
    _value("turn_range", "m", "way beyond the turn in which jumps take 0.01 of the loss"),
    _value("largest_interior_tension", "Pa", "largest tension inside patches"),
    _value("interior_tension_position", "m", "position of that tension", _of_interior("position")),
    _value(
        "interior_tension_penetration",
        "1",
        "penetration/h_max at that tension",
        _of_interior("penetration"),
    ),
    _value("opening_strength", "Pa", "largest tension of the interface", "problem.strength"),
    _value("openings", "1", "jumps that begin with a gap that opens inside a patch"),
    # where the loop turned
    _value("turning_penetration", "1", "penetration/h_max at the turning point", "max_penetration"),
    _value("turning_stress", "Pa", "mean stress at the turning point"),
    _value(
        *("preload_reached", "1", "1 if the mean stress reached the preload, 0 if not"),
        lambda loop: np.nan if loop.preload_reached is None else float(loop.preload_reached),
    ),
    _value("work_gained", "J m-2", "work gained on loading per nominal area"),
    _value("work_spent", "J m-2", "work spent on unloading per nominal area"),
    _value("largest_contact_fraction", "1", "largest contact fraction A/A0 of the loop"),
    _value(
        "full_contact_energy",
        "J m-2",
        "elastic energy of full contact",
        "problem.full_contact_energy",
    ),
    _value("pull_off_penetration", "1", "penetration/h_max of the first load step out of contact"),
    _value("pull_off_stress", "Pa", "largest mean tension on unloading"),
    _count("states", "states that the loop passed through", lambda loop: len(loop.branch)),
)
CURVES = {branch: _curves(branch) for branch in BRANCHES}
JUMP_COUNT = _count("jump_count", "number of jumps, kept or not", lambda loop: len(loop.jumps))
JUMPS = (
    _flag("branch", "branch", BRANCHES),
    _flag("kind", "kind of the jump", JUMP_KINDS),
    _jump(
        "penetration",
        "1",
        "penetration/h_max of the jump",
        lambda loop, jump: loop.problem.penetration(jump.separation),
    ),
    _jump("energy_drop", "J m-2", "energy drop per nominal area"),
    _jump("patch_length", "m", "largest patch, before or after the jump"),
    _jump("contact_before", "1", "contact fraction before the jump"),
    _jump("contact_after", "1", "contact fraction after the jump"),
    _jump("patches_before", "1", "patches before the jump", dtype=COUNT),
    _jump("patches_after", "1", "patches after the jump", dtype=COUNT),
)
_CURVES = tuple(chain(*CURVES.values()))
RESULT_DATASETS = (*TIMES, *NUMBERS, *_CURVES, JUMP_COUNT, *JUMPS, *FIELD_DATASETS)


def row_scales(campaign: Campaign) -> tuple[Dataset, ...]:
    """Return the dimensions of the rows of a campaign."""
    several = campaign.has_axis("max_penetration")
    depth = f"penetration/{'max_penetration' if several else 'h_max'}"
    curves = campaign.penetration.items()
    return (
        *(scale(f"{b}_penetration", axis, "1", f"{depth} on {b}") for b, axis in curves),
        scale("jump", np.arange(campaign.output.jumps), "1", "place in the catalogue of jumps"),
        *field_scales(FieldPlan(campaign)),
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
            on_axis = loop.on_axis(branch, values, length)[:length]
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
