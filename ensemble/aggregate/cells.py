"""Read the cells of a campaign, one point on its axes each, and compare those of two campaigns.

The seed of a realisation's phases is the same in all cells of a campaign, and of campaigns that
share their seed, so the difference of two losses is taken profile by profile: with another
resolution, path or spectrum.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.precision import Estimate, Precision, estimates, precision
from adhesis.ensemble.campaign.rules import shown
from adhesis.ensemble.campaign.tables import Axis, Campaign, differing
from adhesis.ensemble.campaign.tasks import name_at
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DONE, FAILED, NOT_NEEDED, PENDING
from adhesis.ensemble.task.doubt import beyond_zero_range, doubtful
from adhesis.ensemble.task.fields import FieldPlan
from adhesis.ensemble.task.row import JUMP_COUNT, NUMBERS, TIMES
from adhesis.solver.loading.zero_range import RANGES, least_range
from adhesis.solver.model import problem
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.jump import Branch
from adhesis.solver.model.profile import Array

Rows = NDArray[np.intp]

_PER_TASK = tuple(dataset.name for dataset in (*TIMES, *NUMBERS, JUMP_COUNT))
# Of these the least or the largest of a cell counts, as a range or a strength may be infinite; or
# they belong to the place of one tension.
_NOT_AVERAGED = (
    *(*RANGES, "opening_strength", "largest_interior_tension"),
    *("interior_tension_position", "interior_tension_penetration"),
)
# Numbers of tasks by their state, under the names of :class:`Cell`.
COUNTS = {"done": DONE, "pending": PENDING, "failed": FAILED, "not_needed": NOT_NEEDED}
Kind = Literal["resolution", "load steps", "other"]
# Keys that choose tasks and outputs, and do not change a loop.
_IGNORED = ("sweep.", "stop.", "output.", "solver.time_limit")
# Energies that are also given per largest contact area, in J/m² of contact.
_PER_CONTACT = {
    "loss_per_contact": "loss",
    "effective_work_of_approach": "work_gained",
    "effective_work_of_separation": "work_spent",
}


@dataclass(frozen=True, eq=False)
class Cell:
    """All tasks of one (H, γ) and one value on every further axis of the campaign."""

    # hurst, work_of_adhesion: H; γ in J/m²
    hurst: float
    work_of_adhesion: float
    others: tuple[tuple[str, float], ...]  # names of the further axes, and the values there
    campaign: Campaign  # its tables hold the values of the cell
    penetration: dict[Branch, Array]  # Δ/h_max of the curves of each branch
    plan: FieldPlan  # states with stored fields: their Δ/h_max, wave numbers, positions
    # done, failed, pending, not_needed: numbers of tasks
    done: int
    failed: int
    pending: int
    not_needed: int
    rows: Rows  # shape (done,); rows of the done tasks in the file, by realisation
    seed: NDArray[np.int64]  # shape (done,)
    # Each of shape (done,); per-task numbers under the names of the results file, and
    # ``small_scale_share`` (of the drops of both scales); ``instability`` (loss without friction);
    # ``loss_error_dimensionless``, ``energy_at_stake_dimensionless`` (in W~);
    # ``pull_off_stress_dimensionless`` (in σ~); ``loss_per_contact``,
    # ``effective_work_of_approach``, ``effective_work_of_separation`` (loss, work gained and work
    # spent per largest contact area, in J/m²)
    values: dict[str, Array]

    @property
    def at(self) -> dict[str, float]:
        """Values on the axes of the campaign by name: H, γ, and those of further axes."""
        gamma = self.work_of_adhesion
        return {"hurst": self.hurst, "work_of_adhesion": gamma, **dict(self.others)}

    @property
    def name(self) -> str:
        """Values on these axes: "H = 0.8, γ = 0.04 J/m²"."""
        return name_at(self.hurst, self.work_of_adhesion, self.others)

    @cached_property
    def estimates(self) -> dict[str, Estimate]:
        """Means of the values, but of ranges, the largest interior tension and its place."""
        names = [name for name in self.values if name not in _NOT_AVERAGED]
        means = estimates(np.array([self.values[name] for name in names]))
        found = dict(zip(names, means, strict=True))
        if not self.work_of_adhesion:  # nothing is lost: the values are rounding
            (nothing,) = estimates(np.zeros(self.done), with_interval=False)
            found |= dict.fromkeys(("loss", "loss_dimensionless", "loss_per_contact"), nothing)
        for name in ("small_scale_share", "largest_contact_fraction"):
            share = found[name]
            low, high = np.clip([share.low, share.high], 0, 1)  # Student's interval may leave it
            found[name] = replace(share, low=float(low), high=float(high))
        return found

    @property
    def least_range(self) -> Array:
        """Least of the four ranges of adhesion of each done task, in m, shape (done,)."""
        return least_range(*(self.values[name] for name in RANGES))

    @property
    def doubtful(self) -> NDArray[np.bool_]:
        """Which done tasks have a doubtful loss by their own account, shape (done,)."""
        judged = {**self.values, "work_of_adhesion": self.work_of_adhesion}
        return doubtful(judged, self.campaign.solver.accuracy)

    @property
    def doubt(self) -> Array:
        """Share of the loss of each done task by which it may be off by its own account."""
        loss, error = np.abs(self.values["loss"]), self.values["loss_error"]
        share = np.divide(error, loss, out=np.full_like(loss, np.inf), where=loss > 0)
        return np.maximum(np.abs(self.values["audit_residual"]), share)

    @property
    def beyond_zero_range(self) -> NDArray[np.bool_]:
        """Which done tasks have a loss that a finite range may not have, shape (done,)."""
        values = {**self.values, "work_of_adhesion": self.work_of_adhesion}
        return beyond_zero_range(values, self.campaign.cycle.stiffness)

    @property
    def short_of_preload(self) -> int:
        """Number of loops that turned before their preload was reached."""
        return int(np.sum(self.values["preload_reached"] == 0))

    @property
    def precision(self) -> Precision | None:
        """Precision of the mean of the quantity of ``[stop]``; None without ``[stop]``."""
        stop = self.campaign.stop
        if stop.relative_error is None:
            return None
        # Without adhesion nothing is lost: the values are rounding.
        values = self.values[stop.quantity] if self.work_of_adhesion > 0 else np.zeros(self.done)
        return precision(values, stop.relative_error, stop.quantity, finished=not self.pending)


SomeCell = TypeVar("SomeCell", bound=Cell)


def precisions(cells: Iterable[Cell]) -> list[tuple[str, Precision]]:
    """Return name and precision of every cell; none without ``[stop]``."""
    known = ((cell.name, cell.precision) for cell in cells)
    return [(name, precision) for name, precision in known if precision is not None]


def doubtful_loops(cells: Iterable[Cell]) -> list[tuple[Cell, int]]:
    """Return the loops with a doubtful loss, as cell and place in it, the worst first."""
    return _sorted((-cell.doubt, cell.doubtful, cell) for cell in cells)


def loops_beyond_zero_range(cells: Iterable[Cell]) -> list[tuple[Cell, int]]:
    """Return the loops beyond zero range, as cell and place in it, the least range first."""
    return _sorted((cell.least_range, cell.beyond_zero_range, cell) for cell in cells)


def _sorted(loops: Iterable[tuple[Array, NDArray[np.bool_], Cell]]) -> list[tuple[Cell, int]]:
    found = [(by[k], cell, int(k)) for by, chosen, cell in loops for k in np.flatnonzero(chosen)]
    return [(cell, k) for _, cell, k in sorted(found, key=itemgetter(0))]


def alike(
    cells: Iterable[SomeCell], but: Collection[str]
) -> dict[tuple[float, ...], list[SomeCell]]:
    """Group cells that differ on these axes alone, by their values on the others."""
    groups: dict[tuple[float, ...], list[SomeCell]] = {}
    for cell in cells:
        fixed = tuple(value for name, value in cell.at.items() if name not in but)
        groups.setdefault(fixed, []).append(cell)
    return groups


def finished_cells(results: Results) -> list[Cell]:
    """Read every cell as :func:`read_cells`; InputError if no task is finished."""
    cells, damaged = read_cells(results), results.damaged().size
    if not any(cell.done for cell in cells):
        raise InputError(
            f"{results.path} holds no finished task yet ({sum(c.failed for c in cells)} failed"
            + (f" and {damaged} damaged" if damaged else "")
            + f", of {len(results)}): there is nothing to report"
        )
    return cells


def read_cells(results: Results) -> list[Cell]:
    """Read every cell by H, γ, further axes, ascending."""
    campaign, tasks, status = results.campaign, results.tasks, results.status()
    seed = tasks.column("seed")
    done = np.flatnonzero(status == DONE)
    columns = {name: results.column(name)[done].astype(float) for name in _PER_TASK}
    cells = []
    for task, rows_of_cell in tasks.by_cell():
        of_cell = campaign.at(task)
        of_rows = status[rows_of_cell]
        rows = rows_of_cell[of_rows == DONE]
        mine = np.searchsorted(done, rows)
        values = {name: column[mine] for name, column in columns.items()}
        drops = values["loss_small_scale"] + values["loss_large_scale"]
        values["small_scale_share"] = np.divide(
            values["loss_small_scale"], drops, out=np.zeros_like(drops), where=drops > 0
        )
        contact = values["largest_contact_fraction"]
        for name, energy in _PER_CONTACT.items():
            values[name] = np.divide(
                values[energy], contact, out=np.full_like(contact, np.nan), where=contact > 0
            )
        values["instability"] = values["loss"] - values["friction"]
        scale = stress_scale(of_cell, values["h_max"])
        values["pull_off_stress_dimensionless"] = values["pull_off_stress"] / scale
        for name in ("loss_error", "energy_at_stake"):
            values[f"{name}_dimensionless"] = values[name] / (scale * values["h_max"])
        cells.append(
            Cell(
                hurst=task.hurst,
                work_of_adhesion=task.work_of_adhesion,
                others=task.others,
                campaign=of_cell,
                penetration=campaign.curve_axes(task),
                plan=FieldPlan(campaign, task),
                **{name: int(np.sum(of_rows == code)) for name, code in COUNTS.items()},
                rows=rows,
                seed=seed[rows],
                values=values,
            )
        )
    return cells


def stress_scale(campaign: Campaign, h_max: Array) -> Array:
    """Return the mean stress in Pa at σ~ = 1, for each h_max in m."""
    half_space = HalfSpace(campaign.material.young, campaign.material.poisson)
    return np.asarray(problem.stress_scale(half_space, campaign.profile.period, h_max))


@dataclass(frozen=True, eq=False)
class Companion:
    """Campaign that is compared with the reported one."""

    path: Path
    campaign: Campaign
    cells: tuple[Cell, ...]
    # "key = value" of the keys that differ, with the values of this campaign
    differs: tuple[str, ...]
    # Subject of the difference: "resolution" (the solver), "load steps", "other"
    kind: Kind
    further: tuple[Axis, ...] = ()  # axes beside H and γ of the reported campaign
    doubts: tuple[str, ...] = ()  # sentences on damage of the file

    def like(self, cell: Cell) -> Cell | None:
        """Return the cell of the same H, γ and values on the further axes of either campaign.

        None if this campaign lacks it.
        """
        keys = {axis.key for axis in (*self.campaign.axes[2:], *self.further)}

        def point(of: Cell) -> tuple[Any, ...]:
            return (of.hurst, of.work_of_adhesion, *(of.campaign.value(key) for key in keys))

        return next((other for other in self.cells if point(other) == point(cell)), None)


@dataclass(frozen=True)
class LossDifference:
    """A loss of two cells, over the realisations of the same phases that both have finished."""

    here: Estimate
    there: Estimate
    difference: Estimate  # there less here


def read_companion(path: Path | str, campaign: Campaign) -> Companion:
    """Read another results file and the keys in which its campaign differs (InputError)."""
    with Results(path) as results:
        other, cells = results.campaign, finished_cells(results)
        doubts = results.doubts()
    values, keys = other.values(), differing_keys(campaign, other)
    return Companion(
        path=Path(path),
        campaign=other,
        cells=tuple(cells),
        differs=tuple(f"{key} = {shown(values[key])}" for key in keys),
        kind=kind_of(keys),
        further=campaign.axes[2:],
        doubts=doubts,
    )


def differing_keys(here: Campaign, there: Campaign) -> list[str]:
    """Return the keys ("cycle.load_steps") in which the loops of two campaigns differ."""
    return [key for key in differing(here, there) if not key.startswith(_IGNORED)]


def kind_of(keys: Sequence[str]) -> Kind:
    """Classify a difference in these keys; see :class:`Companion`."""
    if keys and all(key.startswith("solver.") for key in keys):
        return "resolution"
    if list(keys) == ["cycle.load_steps"]:
        return "load steps"
    return "other"


def difference(
    here: Cell, there: Cell | None, name: str = "loss_dimensionless"
) -> LossDifference | None:
    """Compare a loss profile by profile; None without a realisation that both have finished."""
    if there is None:
        return None
    _, mine, theirs = np.intersect1d(here.seed, there.seed, assume_unique=True, return_indices=True)
    if not mine.size:
        return None
    own, other = here.values[name][mine], there.values[name][theirs]
    return LossDifference(*estimates(np.array([own, other, other - own])))
