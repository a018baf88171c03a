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
from adhesis.solver.sharp.descent.edge_model import (
    EdgeModel,
    advance,
    evaluate,
    model_forces,
    model_hessian,
)
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw, stop_at_memory
from adhesis.solver.sharp.field.cholesky import factor_rows, padded, solve_column
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.tolerances import (
    FAINT_SADDLE,
    FORCES_FELL,
    MODEL_SHORT_STEP,
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
    motion : array, shape (n,)
        Outward motion of the contact at every edge.
    opening : array, shape (n,)
        C of the model at the end.
    lengths : array, shape (steps,)
        Largest motion up to each step.
    residuals : array, shape (steps, n)
        C - C_c of the model after each step.
    is_at_limit : bool
        Whether an edge came to its limit.
    """

    motion: Array
    opening: Array
    lengths: Array
    residuals: Array
    is_at_limit: bool


@compiled
def no_flow() -> ModelFlow:
    """Make a flow without steps."""
    none, nothing = np.empty((0, 0)), np.empty(0)
    return ModelFlow(nothing, nothing, nothing, none, False)


@compiled
def flow_through(
    model: EdgeModel, limit: Array, equal_speeds: bool, is_long: bool, strongest: float,
    law: EdgeLaw, panels: Panels,
) -> ModelFlow:  # fmt: skip
    """Follow the flow until an edge is at its limit, or at rest; a long step, or near balance.

    ``model`` goes along with the edges. ``strongest`` is the largest norm of the forces on the way
    so far. A short step ends where the forces have fallen, too: how far a shallow minimum is from a
    saddle only the field shows.
    """
    edges = model.opening.shape[0]
    residuals = np.empty((MODEL_STEPS, edges))
    lengths = np.empty(MODEL_STEPS)
    matrix = np.empty((edges, edges))
    force, step = np.empty(edges), np.empty(edges)
    factor = np.empty((edges, padded(edges)))
    longest = (MODEL_STEP if is_long else MODEL_SHORT_STEP) * law.longest_step
    count, length, share, first = 0, 0.0, 1.0, 0.0
    shortest = RUNNING_ENDS * law.longest_step
    for e in range(edges):
        shortest = min(shortest, RUNNING_ENDS * limit[e])
    while count < MODEL_STEPS and share == 1:
        model_forces(model, force)
        total = norm(force)
        strongest, first = max(strongest, total), max(first, total)
        if near_balance(total, strongest, law) if is_long else FORCES_FELL * total < first:
            break
        model_hessian(model, matrix)
        size = implicit_step(matrix, force, longest, equal_speeds, factor, step)
        if law.pinning > 0:
            stop_at_memory(model.edges, model.theta, force, step, law)
            size = largest(step)
        if not size > shortest:
            distance = distance_to_minimum(matrix, force, factor)
            if distance <= shortest or total < FAINT_SADDLE * law.force_error:
                break
        share = share_within(model.motion, step, limit)
        if share < 1:
            step *= share
        advance(model, step)
        evaluate(model, law, panels)
        residuals[count] = model.opening - model.critical
        length = max(length, largest(model.motion))
        lengths[count] = length
        count += 1
    return ModelFlow(
        model.motion, model.opening, lengths[:count], residuals[:count],
        share < 1,
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
def distance_to_minimum(matrix: Array, force: Array, factor: Array) -> float:
    """Compute the largest motion to the minimum of a quadratic model; infinite without one."""
    edges = force.shape[0]
    for e in range(edges):
        for f in range(e + 1):
            factor[e, f] = matrix[e, f]
    if not factor_rows(factor, 0.0):
        return np.inf
    step = force.copy()
    solve_column(factor, step)
    return largest(step)


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
def norm(force: Array) -> float:
    """Compute the Euclidean norm."""
    square = 0.0
    for e in range(force.shape[0]):
        square += force[e] * force[e]
    return float(np.sqrt(square))
