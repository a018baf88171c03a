"""Gradient flow through the model of the openings, compiled: a long step with one field.

The flow ṅ = C_c² - C² is integrated by linearly implicit Euler steps, (1/Δτ + H) Δn = force, each
at most a longest step long; with equal speeds, for comparison, the time Δτ is each edge's own.
Fields are not solved on the way: the step-size control decides how far the model is used
(``step_size``), which compares its openings with those of the field at the end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.edge_forces import norm
from adhesis.solver.sharp.descent.edge_model import (
    EdgeModel,
    advance,
    evaluate,
    model_forces,
    model_hessian,
)
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.pinning import stop_at_band
from adhesis.solver.sharp.field.cholesky import factor_rows, padded, solve_column
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.tolerances import (
    FORCES_FELL,
    MODEL_STEP,
    MODEL_STEPS,
    NEAR_BALANCE,
    RATE_GROWTH,
    RUNNING_ENDS,
    SLOWEST,
    TIME_TRIES,
)


class ModelFlow(NamedTuple):
    """Flow through the model.

    Attributes
    ----------
    motion : array, shape (2L,)
        Outward motion of the contact at every edge.
    opening : array, shape (2L,)
        C of the model at the end.
    points : array, shape (n, 2L)
        Edges after each step.
    lengths : array, shape (n,)
        Largest motion up to each step.
    residuals : array, shape (n, 2L)
        C - C_c of the model after each step.
    interaction : array, shape (2L, 2L)
        Force, as C², that the motion of each edge (columns) took from every edge (rows).
    is_at_limit : bool
        Whether an edge came to its limit.
    """

    motion: Array
    opening: Array
    points: Array
    lengths: Array
    residuals: Array
    interaction: Array
    is_at_limit: bool


@compiled
def no_flow() -> ModelFlow:
    """Make a flow without points."""
    none, nothing = np.empty((0, 0)), np.empty(0)
    return ModelFlow(nothing, nothing, none, nothing, none, none, False)


@compiled
def flow_through(
    model: EdgeModel, limit: Array, equal_speeds: bool, strongest: float, law: EdgeLaw,
    panels: Panels,
) -> ModelFlow:  # fmt: skip
    """Follow the flow until an edge is at its limit, or near balance.

    ``model`` goes along with the edges. ``strongest`` is the largest norm of the forces on the way
    so far.
    """
    edges = model.opening.shape[0]
    points, residuals = np.empty((MODEL_STEPS, edges)), np.empty((MODEL_STEPS, edges))
    lengths = np.empty(MODEL_STEPS)
    interaction, matrix = np.zeros((edges, edges)), np.empty((edges, edges))
    force, step = np.empty(edges), np.empty(edges)
    factor = np.empty((edges, padded(edges)))
    longest = MODEL_STEP * law.longest_step
    count, length, share = 0, 0.0, 1.0
    while count < MODEL_STEPS and share == 1:
        model_forces(model, force)
        total = norm(force)
        strongest = max(strongest, total)
        if near_balance(total, strongest, law):
            break
        model_hessian(model, matrix)
        size = implicit_step(matrix, force, longest, equal_speeds, factor, step)
        if not size > RUNNING_ENDS * law.longest_step:
            break
        if law.pinning > 0:
            stop_at_band(model.theta, step, law)
        share = share_within(model.motion, step, limit)
        if share < 1:
            step *= share
        add_forces(matrix, step, interaction)
        advance(model, step)
        evaluate(model, law, panels)
        points[count] = model.theta
        residuals[count] = model.opening - model.critical
        length = max(length, largest(model.motion))
        lengths[count] = length
        count += 1
    return ModelFlow(
        model.motion, model.opening, points[:count], lengths[:count], residuals[:count],
        interaction, share < 1,
    )  # fmt: skip


@compiled
def near_balance(force: float, strongest: float, law: EdgeLaw) -> bool:
    """Whether forces that were as large as ``strongest`` have come near a minimum or saddle."""
    small = NEAR_BALANCE * law.critical * law.critical
    return force < small and FORCES_FELL * force < strongest


@compiled
def implicit_step(
    matrix: Array, force: Array, longest: float, equal_speeds: bool, factor: Array, step: Array
) -> float:
    """Take a linearly implicit step, (1/Δτ + H) Δn = force; returns the largest motion.

    No edge moves further than ``longest``. The time Δτ is that in which the largest force alone
    would move its edge so far; with equal speeds every edge has its own time, in which its own
    force would. It is less where 1/Δτ + H is not positive definite: the step would not be downhill.
    ``factor`` and ``step`` are changed in place.
    """
    edges = force.shape[0]
    strongest = largest(force)
    growth = 1 / longest
    size = 0.0
    for _ in range(TIME_TRIES):
        for e in range(edges):
            for f in range(e + 1):
                factor[e, f] = matrix[e, f]
            own = max(abs(force[e]), SLOWEST * strongest) if equal_speeds else strongest
            factor[e, e] += growth * own
        if not factor_rows(factor, 0.0):
            growth *= RATE_GROWTH
            continue
        step[:] = force
        solve_column(factor, step)
        size = largest(step)
        if size <= longest:
            break
        step *= longest / size
        growth *= min(RATE_GROWTH, 1.1 * size / longest)
        size = longest
    return size


@compiled
def largest(values: Array) -> float:
    """Find the largest of the absolute values."""
    size = 0.0
    for e in range(values.shape[0]):
        size = max(size, abs(values[e]))
    return size


@compiled
def share_within(motion: Array, step: Array, limit: Array) -> float:
    """Find the share of a step that keeps every motion within its limit."""
    share = 1.0
    for e in range(step.shape[0]):
        left = limit[e] - np.sign(step[e]) * motion[e]
        if abs(step[e]) > left:
            share = min(share, left / abs(step[e]))
    return share


@compiled
def add_forces(matrix: Array, step: Array, interaction: Array) -> None:
    """Add the force that each edge's step (columns) takes from every edge (rows)."""
    for e in range(step.shape[0]):
        for f in range(step.shape[0]):
            interaction[e, f] += matrix[e, f] * step[f]
