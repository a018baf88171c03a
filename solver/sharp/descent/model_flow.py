"""Gradient flow through the model of the openings, compiled: a long step with one field.

The flow ṅ = C_c² - C² is integrated by linearly implicit Euler steps, (1/Δτ + H) Δn = force, each
at most a longest step long; with equal speeds, for comparison, by steps of the bounded quadratic
model. Fields are not solved on the way: how far the model leads is the step-size control's
(``step_size``), which compares its openings with those of the field at the end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.bound_constrained_step import bound_constrained_step
from adhesis.solver.sharp.descent.edge_model import (
    EdgeModel,
    ModelState,
    advance,
    evaluate,
    initial_state,
    model_forces,
    model_hessian,
    model_tangent,
)
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw
from adhesis.solver.sharp.field.cholesky import factor_rows, padded, solve_column
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.tolerances import (
    MODEL_STEPS,
    RUNNING_ENDS,
    TIME_REDUCTION,
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
    forces : array, shape (n,)
        Norm of dU/dn before each step.
    interaction : array, shape (2L, 2L)
        Force, as C², that the motion of each edge (columns) took from every edge (rows).
    """

    motion: Array
    opening: Array
    points: Array
    forces: Array
    interaction: Array


@compiled
def no_flow() -> ModelFlow:
    """Make a flow without points."""
    none = np.empty((0, 0))
    return ModelFlow(np.empty(0), np.empty(0), none, np.empty(0), none)


@compiled
def flow_through(
    gaps: Array, opening: Array, model: EdgeModel, limit: Array, equal_speeds: bool,
    law: EdgeLaw, panels: Panels,
) -> ModelFlow:  # fmt: skip
    """Follow the flow until an edge is at its limit, all are nearly at rest, or one closes."""
    state = initial_state(gaps, opening)
    evaluate(state, model, law, panels)
    edges = opening.shape[0]
    points, forces = np.empty((MODEL_STEPS, edges)), np.empty(MODEL_STEPS)
    interaction = np.zeros((edges, edges))
    count = 0
    while count < MODEL_STEPS:
        force, matrix = model_forces(state), model_hessian(state, model)
        if equal_speeds:
            step = step_with_equal_speeds(state, model, law)
        else:
            step = implicit_step(matrix, force, law.longest_step)
        if not np.abs(step).max() > RUNNING_ENDS * law.longest_step:
            break
        share = share_within(state.motion, step, limit)
        step *= share
        add_forces(matrix, step, interaction)
        advance(state, step, model, law, panels)
        forces[count] = np.sqrt(force @ force)
        points[count] = state.theta
        count += 1
        if share < 1:
            break
    return ModelFlow(state.motion, state.opening, points[:count], forces[:count], interaction)


@compiled
def implicit_step(matrix: Array, force: Array, longest: float) -> Array:
    """Take a linearly implicit Euler step of the flow, no edge moving further than ``longest``.

    The time Δτ is that in which the largest force alone would move its edge so far, or less: where
    1/Δτ + H is not positive definite the step would not be downhill.
    """
    edges = force.shape[0]
    time = longest / np.abs(force).max()
    factor = np.empty((edges, padded(edges)))
    step = np.zeros(edges)
    for _ in range(TIME_TRIES):
        for e in range(edges):
            for f in range(e + 1):
                factor[e, f] = matrix[e, f]
            factor[e, e] += 1 / time
        if not factor_rows(factor, 0.0):
            time *= TIME_REDUCTION
            continue
        step[:] = force
        solve_column(factor, step)
        size = np.abs(step).max()
        if size <= longest:
            break
        step *= longest / size
        time *= max(TIME_REDUCTION, 0.9 * longest / size)
    return step


@compiled
def step_with_equal_speeds(state: ModelState, model: EdgeModel, law: EdgeLaw) -> Array:
    """Take a step with equal speeds, at most a longest step."""
    scale, matrix, residual = model_tangent(state, model, law.overlap_limit)
    limit = np.full(scale.shape[0], law.longest_step)
    return bound_constrained_step(matrix, scale, -residual, limit)


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
