"""Reduce the fields of chosen states of a loop to a bounded size.

At the chosen penetrations, on both branches, every task keeps the power spectral density of the
deformed surface and the density of the gap. Their bins depend on the campaign alone, so that they
can be averaged over realisations. The first realisations of each (H, γ) keep the fields themselves,
thinned to a bounded number of nodes.

Conventions: the spectral density C of a field v is two-sided, ∫ C(q) dq over all q = mean(v²); on
harmonics C(m q0) = |v_m|²/q0, and a bin holds the mean over its harmonics. Densities of gap (in
units of h_max) and height (in units of h_rms) have unit integral over the period; contact has no
gap, so that the density of the gap integrates to the fraction out of contact.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.campaign.tasks import Task
from adhesis.ensemble.task.dataset import FIELD, KEPT, Dataset, row_shape, scale, sizes_of
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.method import BRANCHES, ContactState, Method
from adhesis.solver.model.profile import Array
from adhesis.solver.observables import gap_shares, spectral_density

# Nodes per shortest wave: spectra then reach four times the highest wave number of the profile.
NODES_PER_WAVE = 8
_BINS_PER_DECADE = 12

# Gap in units of h_max: from far below the roughness to far above any gap before detachment.
GAP_EDGES: Array = np.logspace(-4, 2, 6 * 16 + 1)
HEIGHT_EDGES: Array = np.linspace(-5, 5, 81)
# Middles of their bins
GAP_BINS: Array = np.sqrt(GAP_EDGES[:-1] * GAP_EDGES[1:])
HEIGHT_BINS: Array = 0.5 * (HEIGHT_EDGES[:-1] + HEIGHT_EDGES[1:])


@dataclass(eq=False)
class FieldPlan:
    """States of which a campaign keeps fields, and bins of their statistics.

    It is the plan of a task, or of the file, with lengths in units of what tasks differ in. All
    tasks have the spectral bins of the finest profile of the campaign.
    """

    campaign: Campaign  # its tables hold the values of the task, if the plan is that of one
    task: Task | None = None

    def __post_init__(self) -> None:
        campaign, task = self.campaign, self.task
        self.campaign = campaign if task is None else campaign.at(task)
        cycle, output = self.campaign.cycle, self.campaign.output
        shared = task is None and campaign.has_axis("period")
        self.period = 2 * np.pi if shared else self.campaign.profile.period  # λ in m
        # Δ/h_max; under a load and at a preload 1, and then all penetrations here are mean stresses
        # over max_stress or preload
        shared = task is None and campaign.has_axis("max_penetration")
        top = 1.0 if cycle.turns_at_stress or shared else cycle.turning_point
        self.max_penetration = top
        # Of the states, ascending: the wanted ones moved to the nearest load step
        step, wanted = top / cycle.load_steps, output.field_penetrations
        wanted = (top / 3, 2 * top / 3, top) if wanted is None else wanted
        steps = sorted({round(value / step) for value in wanted})
        self.penetration: Array = np.array([step * k for k in steps])
        # Nodes on which fields are computed, a power of two
        self.nodes = int(1 << (NODES_PER_WAVE * campaign.finest_harmonic - 1).bit_length())
        # Nodes of a stored field, a power of two; their distance in computed ones
        stored = min(self.nodes, 1 << (output.field_nodes.bit_length() - 1))
        self.stride = self.nodes // stored
        # First harmonic of each bin of the spectra, and one past the last; no bin is empty
        decades = np.log10(self.nodes // 2)
        count = max(2, int(np.ceil(decades * _BINS_PER_DECADE)) + 1)
        edges = np.unique(np.rint(np.logspace(0, decades, count)).astype(np.int64))
        self.harmonic_edges: NDArray[np.int64] = edges
        # Wave number of each bin in rad/m: geometric mean of its first and last harmonic
        middle = np.sqrt(edges[:-1] * (edges[1:] - 1.0)).astype(np.float64)
        self.wave_number: Array = np.asarray(middle * (2 * np.pi / self.period))
        # Bins in which the profile has every harmonic, shape (bins,)
        n0, ratio = self.campaign.profile.n0, self.campaign.profile.ratio
        filled = (edges[:-1] >= n0) & (edges[1:] - 1 <= n0 * ratio)
        self.filled: NDArray[np.bool_] = np.asarray(filled)

    @property
    def position(self) -> Array:
        """Positions x of the stored nodes, in m."""
        return np.linspace(0, self.period, self.nodes // self.stride, endpoint=False)

    def spectral_density(self, values: Array) -> Array:
        """Return the spectral density in the bins, in u² m, of values on the nodes with unit u."""
        power = spectral_density(values, self.period)
        edges = self.harmonic_edges
        total = np.add.reduceat(power[: edges[-1]], edges[:-1])
        return np.asarray(total / np.diff(edges))


def field_scales(plan: FieldPlan) -> tuple[Dataset, ...]:
    """Return the dimensions of the datasets of fields, lengths in units of keys with a list."""
    campaign = plan.campaign
    if campaign.has_axis("period"):
        waves = scale("wave_number", plan.wave_number, "1", "wave number/q0, middle of its bin")
        positions = scale("field_position", plan.position, "1", "q0 times the position of a node")
    else:
        waves = scale("wave_number", plan.wave_number, "rad m-1", "wave number, middle of its bin")
        meaning = "position of a node of a kept field"
        positions = scale("field_position", plan.position, "m", meaning)
    depth = f"penetration/{'max_penetration' if campaign.has_axis('max_penetration') else 'h_max'}"
    if campaign.cycle.turns_at_stress:
        depth = f"mean stress/{'max_stress' if campaign.cycle.under_load else 'preload'}"
    return (
        waves,
        scale("gap_bin", GAP_BINS, "1", "gap/h_max, geometric middle of its bin"),
        scale("height_bin", HEIGHT_BINS, "1", "height/h_rms, middle of its bin"),
        scale("field_branch", np.arange(2), "1", "branch of a field: 0 loading, 1 unloading"),
        scale("field_penetration", plan.penetration, "1", f"{depth} of a field"),
        positions,
    )


def _field(name: str, unit: str, meaning: str, *dims: str) -> Dataset:
    return Dataset(name, unit, meaning, FIELD, dims)


_SPECTRUM = "two-sided spectral density of the"
_BINNED = ("task", "field_branch", "field_penetration")
_SHAPE = (KEPT, "field_branch", "field_penetration", "field_position")
FIELD_DATASETS = (
    _field("psd_height", "m3", f"{_SPECTRUM} profile", "task", "wave_number"),
    _field("height_density", "1", "probability density of height/h_rms", "task", "height_bin"),
    _field("psd_displacement", "m3", f"{_SPECTRUM} deformed surface", *_BINNED, "wave_number"),
    _field(
        "gap_density", "1", "probability density of gap/h_max out of contact", *_BINNED, "gap_bin"
    ),
    _field("field_height", "m", "height of the rigid profile", KEPT, "field_position"),
    _field("field_displacement", "m", "displacement of the elastic surface", *_SHAPE),
    _field("field_stress", "Pa", "stress, compression positive", *_SHAPE),
    _field("field_gap", "m", "gap", *_SHAPE),
)


def field_row(
    plan: FieldPlan, method: Method, loop: LoopResult, *, keep: bool
) -> dict[str, NDArray[np.float32]]:
    """Return the values of a loop by dataset; NaN where a state had no contact.

    ``keep`` is whether they include the fields themselves.
    """
    sizes, profile = sizes_of(field_scales(plan)), method.problem.profile
    row = {
        dataset.name: np.full(row_shape(dataset, sizes), np.nan, np.float32)
        for dataset in FIELD_DATASETS
        if keep or dataset.dims[0] != KEPT
    }
    height, pick = profile.heights(plan.nodes), slice(None, None, plan.stride)
    row["psd_height"][:] = plan.spectral_density(height)
    count, _ = np.histogram(height / profile.h_rms, HEIGHT_EDGES)
    row["height_density"][:] = count / (np.diff(HEIGHT_EDGES) * height.size)
    if keep:
        row["field_height"][:] = height[pick]
    at_preload = plan.campaign.cycle.preload is not None
    found = _at_stresses(plan, loop) if at_preload else _at_penetrations(plan, loop)
    for place, state in found.items():
        fields = method.fields(state, plan.nodes)
        row["psd_displacement"][place] = plan.spectral_density(fields.displacement)
        shares = gap_shares(method.openings(state), profile.period, GAP_EDGES * profile.h_max)
        row["gap_density"][place] = shares / np.diff(GAP_EDGES)
        if keep:
            row["field_displacement"][place] = fields.displacement[pick]
            row["field_stress"][place] = fields.stress[pick]
            row["field_gap"][place] = fields.gap[pick]
    return row


_Found = dict[tuple[int, int], ContactState]
"""States by the number of their branch and of their penetration."""


def _at_penetrations(plan: FieldPlan, loop: LoopResult) -> _Found:
    """Find the states in contact at the chosen penetrations, or parts of a load."""
    found: _Found = {}
    problem = loop.problem
    for branch, state in zip(loop.branch.tolist(), loop.contact_states, strict=True):
        if not state.patches or not plan.penetration.size:
            continue
        # with a stiffness, the penetration of the far side
        penetration = problem.penetration(problem.prescribed_in(state))
        if plan.campaign.cycle.under_load:
            penetration = state.mean_stress / plan.campaign.cycle.turning_point
        distance = np.abs(plan.penetration - penetration)
        nearest = int(np.argmin(distance))
        # States between load steps differ from the axis by far more than rounding.
        if distance[nearest] <= 1e-9:
            found[BRANCHES.index(branch), nearest] = state
    return found


def _at_stresses(plan: FieldPlan, loop: LoopResult) -> _Found:
    """Find the states at the parts of the preload; none that the loop lacks."""
    found: _Found = {}
    for number, part in enumerate(plan.penetration.tolist()):
        for branch in BRANCHES:
            with suppress(ValueError):  # the preload was not reached
                state = loop.at_stress(part * plan.campaign.cycle.turning_point, branch).state
                found[BRANCHES.index(branch), number] = state
    return found
