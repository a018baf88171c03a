"""The shape of a results file: one table that lays it out, reads it and documents it.

``docs/results-file.md`` describes the same datasets for people; a test compares the two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ensemble.campaign.tables import Campaign
from ensemble.errors import InputError
from ensemble.task.fields import GAP_EDGES, HEIGHT_EDGES, field_plan
from solver.jumps import JUMP_KINDS

FILE_TYPE = "adhesis-results"
FILE_VERSION = (1, 0)

PENDING, DONE, FAILED = 0, 1, 2
ERROR_LENGTH = 512

_FLOAT, _COUNT, _FLAG = "f8", "i4", "i1"
_FIELD = "f4"  # fields are looked at and averaged; seven digits are plenty

# First dimension of the datasets that only the first realisations have rows of.
KEPT = "field_task"


@dataclass(frozen=True)
class Column:
    """One dataset.

    Attributes
    ----------
    name : str
    dims : tuple of str
        Names of the dimensions, ``task`` or ``field_task`` first.
    dtype : str
        numpy's name of the type.
    unit : str
        As UDUNITS reads it; "1" if there is none.
    meaning : str
        For the attribute ``long_name``.
    attributes : mapping
        Further attributes.
    """

    name: str
    dims: tuple[str, ...]
    dtype: str
    unit: str
    meaning: str
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def fill(self) -> Any:
        """Value of rows that hold no result: NaN, -1, 0 for the status, empty for texts."""
        kind = np.dtype(self.dtype).kind
        return {"f": np.nan, "i": -1, "u": 0, "S": b""}[kind]


def _flags(names: tuple[str, ...], dtype: str) -> dict[str, Any]:
    return {
        "flag_values": np.arange(len(names), dtype=dtype),
        "flag_meanings": " ".join(name.replace(" ", "_") for name in names),
    }


def _task(name: str, dtype: str, unit: str, meaning: str, **attributes: Any) -> Column:
    return Column(name, ("task",), dtype, unit, meaning, attributes)


def _branch(branch: str) -> tuple[Column, ...]:
    dims = ("task", f"{branch}_penetration")
    return (
        Column(f"{branch}_mean_stress", dims, _FLOAT, "Pa", "mean stress, compression positive"),
        Column(f"{branch}_contact_fraction", dims, _FLOAT, "1", "contact fraction A/A0"),
        Column(f"{branch}_patches", dims, _COUNT, "1", "number of contact patches"),
        Column(f"{branch}_energy", dims, _FLOAT, "J m-1", "energy of one period per unit depth"),
    )


def _jump(name: str, dtype: str, unit: str, meaning: str, **attributes: Any) -> Column:
    return Column(name, ("task", "jump"), dtype, unit, meaning, attributes)


_STATES = ("field_branch", "field_penetration")


def _reduced(name: str, dims: tuple[str, ...], unit: str, meaning: str) -> Column:
    return Column(name, ("task", *dims), _FIELD, unit, meaning)


def _kept(name: str, dims: tuple[str, ...], unit: str, meaning: str) -> Column:
    return Column(name, (KEPT, *dims, "field_position"), _FIELD, unit, meaning)


# What the task is, known before it runs.
TASK_COLUMNS: tuple[Column, ...] = (
    _task("hurst", _FLOAT, "1", "Hurst exponent H"),
    _task("work_of_adhesion", _FLOAT, "J m-2", "work of adhesion"),
    _task("realisation", _COUNT, "1", "realisation of the profile"),
    _task("seed", "i8", "1", "seed of the profile's phases"),
)
# How it went; the status is written last.
RUN_COLUMNS: tuple[Column, ...] = (
    _task("status", "u1", "1", "state of the task", **_flags(("pending", "done", "failed"), "u1")),
    _task("error", f"S{ERROR_LENGTH}", "1", "why the task failed (UTF-8)"),
    _task("rank", _COUNT, "1", "rank that computed the task"),
)
# What it gave: the attributes of TaskResult.
RESULT_COLUMNS: tuple[Column, ...] = (
    _task("wall_time", _FLOAT, "s", "wall time"),
    _task("cpu_time", _FLOAT, "s", "CPU time"),
    _task("h_max", _FLOAT, "m", "height of the highest point"),
    _task("h_rms", _FLOAT, "m", "root mean square height"),
    _task("m0", _FLOAT, "m2", "mean square height"),
    _task("m2", _FLOAT, "1", "mean square slope"),
    _task("m4", _FLOAT, "m-2", "mean square curvature"),
    _task("loss", _FLOAT, "J m-2", "loop integral of the mean stress per nominal area"),
    _task("loss_dimensionless", _FLOAT, "1", "loop integral of dimensionless stress"),
    _task("loss_from_drops", _FLOAT, "J m-2", "sum of the energy drops at the jumps"),
    _task("loss_small_scale", _FLOAT, "J m-2", "energy drops of edges running inside a patch"),
    _task("loss_large_scale", _FLOAT, "J m-2", "energy drops of patches that come and go"),
    _task("audit_residual", _FLOAT, "1", "(loss - loss_from_drops) / loss"),
    _task("pull_off_penetration", _FLOAT, "1", "penetration/h_max where the last contact is lost"),
    _task("pull_off_stress", _FLOAT, "Pa", "largest mean tension on unloading"),
    _task("states", _COUNT, "1", "states that the loop passed through"),
    *_branch("loading"),
    *_branch("unloading"),
    _task("jump_count", _COUNT, "1", "number of jumps, kept or not"),
    _jump("jump_branch", _FLAG, "1", "branch", **_flags(("loading", "unloading"), _FLAG)),
    _jump("jump_kind", _FLAG, "1", "kind of the jump", **_flags(JUMP_KINDS, _FLAG)),
    _jump("jump_penetration", _FLOAT, "1", "penetration/h_max of the jump"),
    _jump("jump_energy_drop", _FLOAT, "J m-2", "energy drop per nominal area"),
    _jump("jump_patch_length", _FLOAT, "m", "largest patch that the jump changed"),
    _jump("jump_contact_before", _FLOAT, "1", "contact fraction before the jump"),
    _jump("jump_contact_after", _FLOAT, "1", "contact fraction after the jump"),
    _jump("jump_patches_before", _COUNT, "1", "patches before the jump"),
    _jump("jump_patches_after", _COUNT, "1", "patches after the jump"),
    _reduced("psd_height", ("wave_number",), "m3", "two-sided spectral density of the profile"),
    _reduced("height_density", ("height_bin",), "1", "probability density of height/h_rms"),
    _reduced(
        "psd_displacement",
        (*_STATES, "wave_number"),
        "m3",
        "two-sided spectral density of the deformed surface",
    ),
    _reduced(
        "gap_density",
        (*_STATES, "gap_bin"),
        "1",
        "probability density of gap/h_max, nodes in contact left out",
    ),
    _kept("field_height", (), "m", "height of the rigid profile"),
    _kept("field_displacement", _STATES, "m", "displacement of the elastic surface"),
    _kept("field_stress", _STATES, "Pa", "stress, compression positive"),
    _kept("field_gap", _STATES, "m", "gap"),
)
COLUMNS: tuple[Column, ...] = TASK_COLUMNS + RUN_COLUMNS + RESULT_COLUMNS


@dataclass(frozen=True)
class Scale:
    """One dimension: its values, with unit and meaning."""

    name: str
    values: NDArray[Any]
    unit: str
    meaning: str


def kept_rows(campaign: Campaign) -> NDArray[np.int64]:
    """Return the rows of the tasks that keep their fields: the first realisations."""
    realisations = campaign.sweep.realisations
    rows = np.arange(campaign.task_count)
    return rows[rows % realisations < campaign.output.field_realisations]


def scales(campaign: Campaign) -> tuple[Scale, ...]:
    """Return the dimensions of a campaign's results file."""
    plan = field_plan(campaign)
    return (
        Scale("task", np.arange(campaign.task_count), "1", "row of the task"),
        Scale(
            "loading_penetration",
            campaign.loading_penetration,
            "1",
            "penetration/h_max on loading",
        ),
        Scale(
            "unloading_penetration",
            campaign.unloading_penetration,
            "1",
            "penetration/h_max on unloading",
        ),
        Scale("jump", np.arange(campaign.output.jumps), "1", "place in the catalogue of jumps"),
        Scale("wave_number", plan.wave_number, "rad m-1", "wave number, middle of its bin"),
        Scale(
            "gap_bin",
            np.sqrt(GAP_EDGES[:-1] * GAP_EDGES[1:]),
            "1",
            "gap/h_max, geometric middle of its bin",
        ),
        Scale(
            "height_bin",
            0.5 * (HEIGHT_EDGES[:-1] + HEIGHT_EDGES[1:]),
            "1",
            "height/h_rms, middle of its bin",
        ),
        Scale("field_branch", np.arange(2), "1", "branch of a field: 0 loading, 1 unloading"),
        Scale("field_penetration", plan.penetration, "1", "penetration/h_max of a field"),
        Scale("field_position", plan.position, "m", "position of a node of a kept field"),
        Scale(KEPT, kept_rows(campaign), "1", "row of a task that keeps its fields"),
    )


def shape_of(column: Column, sizes: Mapping[str, int]) -> tuple[int, ...]:
    """Return the shape of a dataset, from the sizes of the dimensions."""
    return tuple(sizes[dim] for dim in column.dims)


def file_size(campaign: Campaign) -> int:
    """Bytes of a campaign's results file, without headers."""
    sizes = {scale.name: scale.values.size for scale in scales(campaign)}
    return sum(
        int(np.prod(shape_of(column, sizes), dtype=object)) * np.dtype(column.dtype).itemsize
        for column in COLUMNS
    )


def encode_error(text: str) -> bytes:
    """Return an error text as it is stored: UTF-8, whole characters, at most ERROR_LENGTH bytes."""
    return text.encode("utf-8", "replace")[:ERROR_LENGTH].decode("utf-8", "ignore").encode("utf-8")


def check_version(path: object, file_type: object, version: object) -> None:
    """Refuse a file of another type or of a version that this code does not know.

    Raises
    ------
    InputError
    """
    if file_type != FILE_TYPE:
        raise InputError(f"{path} is not a results file of adhesis")
    numbers = np.ravel(np.asarray(version))
    if numbers.size != 2 or int(numbers[0]) != FILE_VERSION[0]:
        shown = ".".join(str(n) for n in numbers[:4])
        raise InputError(
            f"{path} has file version {shown}: this adhesis reads version {FILE_VERSION[0]}"
        )
